"""The compiled form against the plain one in every combination of features, and against itself at other outputs."""

import itertools
from dataclasses import fields

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import CommandError, ParameterError
from servotwin.parameters import GROUPS

# What a feature sets where it is on; where it is off, a number that leaves it out.
FEATURES = {
    "minimum drive": {"electronics.minimum_drive_time": (4e-4, 0.0)},
    "coast": {"electronics.off_state": ("coast", "brake")},
    "brush drop": {"motor.brush_drop_voltage": (0.3, 0.0)},
    "bridge drop": {"supply.bridge_drop_voltage": (0.4, 0.0), "supply.bridge_drop_resistance": (0.1, 0.0)},
    "source": {"supply.internal_resistance": (0.4, 0.0), "electronics.supply_coupling": (2e-3, 0.0)},
    "injection": {"electronics.back_emf_injection": (1e-3, 0.0)},
    "noise": {"potentiometer.noise": (2e-3, 0.0)},
    "timeout": {"electronics.pulse_timeout": (0.013, 10.0)},
    "silence": {"electronics.silence_state": ("coast", "brake")},
    "limits": {"electronics.pulse_width_max": (1.9e-3, 3e-3)},
    "sided friction": {"friction.coulomb_torque_backward": (1.6e-3, 0.9e-3), "friction.breakaway_ratio": (1.3, 1.0)},
    "stops": {"stops.upper_angle": (1.5, 4.0)},
}
TIMES = np.linspace(0.0, 0.2, 9)
COMMAND = st.signals.samples([0.0, 0.05, 0.11, 0.15], [1000.0, 1700.0, 2100.0, 1500.0], unit="us")
LOAD = st.loads.Constant(0.1) + st.loads.Coulomb(0.02) + st.loads.Inertia(1e-3)

PROGRAM = {"firmware.control_period": 2e-3, "firmware.proportional_gain": 9.0}
DECLARED = {f"{group}.{field.name}": field.metadata for group, kind in GROUPS.items() for field in fields(kind)}
TABLE = {"potentiometer.linearity_angle": [0.0, 1.0, 2.0], "potentiometer.linearity_error": [0.0, 0.01, -0.01]}
ENDLESS = "potentiometer.fixed_angle"


def lanes():
    """Return the parameters of all combinations."""
    on = np.array(list(itertools.product((True, False), repeat=len(FEATURES)))).T
    return {name: np.where(mask, *values) for mask, numbers in zip(on, FEATURES.values(), strict=True)
            for name, values in numbers.items()}


@pytest.mark.long(but="rc")
@pytest.mark.parametrize(("kind", "changes", "every"), [  # any three features meet in all eight ways
    (st.PulseServo, {}, 13), (st.PulseServo, {"electronics.stretcher_time_constant": 0.02}, 33),
    (st.PulseServoInductive, {"motor.armature_inductance": 6e-4}, 33)], ids=["linear", "rc", "inductance"])
def test_every_combination_of_features(servo, kind, changes, every):
    model = kind(servo.replace(changes))
    parameters = lanes()
    batch = st.simulate_many(model, COMMAND, duration=0.2, load=LOAD, parameters=parameters, output_times=TIMES,
                             seeds=7, outputs=("output_angle", "drive"))
    assert batch.ok
    for lane in range(0, len(batch), every):
        own = {name: values[lane].item() for name, values in parameters.items()}
        plain = st.simulate(kind(model.servo.replace(own)), COMMAND, duration=0.2, load=LOAD,
                            output_times=TIMES, seed=7)
        np.testing.assert_allclose(batch["output_angle"][lane], plain["output_angle"], rtol=0.0, atol=1e-12,
                                   err_msg=str(own))
        np.testing.assert_array_equal(batch["drive"][lane], plain["drive"])


def drawn(name, rng):
    """Return a value of a parameter by its name, as it is declared: a word, or a number well inside its range."""
    rule = DECLARED[name]["rule"]
    if rule == "table":
        return TABLE
    if isinstance(rule, tuple):
        return {name: str(rng.choice(rule))}
    low, high, _ = DECLARED[name]["plausible"]
    if low > 0.0:
        value = low * (high / low) ** rng.uniform(0.3, 0.6)
        return {name: float(round(value)) if low >= 1.0 and rng.integers(2) else value}  # it may be a count
    return {name: high * 10.0 ** -rng.uniform(1.0, 2.0) * (rng.choice([-1.0, 1.0]) if low < 0.0 else 1.0)}


def drawn_together(kind, name, rng):
    """Return parameters: one that terms read, some of its group, and two of any."""
    group = name.partition(".")[0]
    near = [other for other in kind.optional if other.startswith(f"{group}.")]
    some = len(near) if rng.integers(4) == 0 else min(rng.integers(4), len(near))  # some numbers go with all of a group
    others = (*rng.choice(near, some, replace=False), *rng.choice(kind.optional, 2))
    found = {}
    for one in (name, *map(str, others)):
        found |= drawn(one, rng)
    if ENDLESS in found:  # a servo that turns without end has no stops
        found = {one: value for one, value in found.items() if not one.startswith("stops.")}
        found |= {f"stops.{one}": None for one in ("lower_angle", "upper_angle", "restitution")}
    return found


@pytest.mark.long
@pytest.mark.parametrize(("kind", "changes"), [(st.PulseServo, {}), (st.DigitalServo, PROGRAM)],
                         ids=["pulse", "digital"])
def test_whatever_terms_read(servo, kind, changes):
    """Every parameter that the terms of a model name in `READS`, one of tomorrow too, meets some others."""
    rng, moved = np.random.default_rng(2), 0
    for name in kind.optional:
        for _ in range(500):  # not all go together
            try:
                model = kind(servo.replace({**changes, "gear.output_inertia": 1e-3, **drawn_together(kind, name, rng)}))
                R = model.value("motor.armature_resistance") * np.array([1.0, 1.05])
                batch = st.simulate_many(model, COMMAND, duration=0.2, load=LOAD, output_times=TIMES, seeds=7,
                                         parameters={"motor.armature_resistance": R})
                break
            except (ParameterError, CommandError):
                continue
        else:
            pytest.fail(f"no servo has {name}")
        plain = st.simulate(kind(model.servo.replace({"motor.armature_resistance": R[1].item()})), COMMAND,
                            duration=0.2, load=LOAD, output_times=TIMES, seed=7)
        assert batch.ok == plain.status.ok
        np.testing.assert_allclose(batch["output_angle"][1], plain["output_angle"], rtol=0.0, atol=1e-9,
                                   err_msg=name)
        moved += bool(np.ptp(plain["output_angle"]) > 1e-2)
    assert moved > 0.3 * len(kind.optional)


def test_a_timeout_of_one_frame_is_renewed_by_every_edge(servo):
    """Whatever the rounding of k T_f; found where a clock of 20 ms cut a full drive now and then."""
    for timeout in (0.02, 0.0205):
        model = st.PulseServo(servo.replace({"electronics.pulse_timeout": timeout}))
        command = st.signals.step(0.0, 150.0, unit="deg")
        times = np.linspace(0.03, 0.3, 500)
        batch = st.simulate_many(model, command, duration=0.3, output_times=times, outputs=("output_angle", "drive"))
        plain = st.simulate(model, command, duration=0.3, output_times=times)
        assert (plain["drive"] == 1.0).all()
        np.testing.assert_array_equal(batch["drive"][0], plain["drive"])
        np.testing.assert_allclose(batch["output_angle"][0], plain["output_angle"], rtol=0.0, atol=1e-12)


@pytest.mark.long(but="BoundedServo-float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("model", [st.BoundedServo, st.PulseServo, st.PulseServoInductive])
def test_results_do_not_depend_on_the_output_step(servo, model, dtype):
    """To the last bit: outputs are read from the motions, which do not know of them."""
    count = 150
    numbers = np.random.default_rng(8)
    parameters = {"load.torque": numbers.uniform(-0.6, 0.6, count), "load.inertia": numbers.uniform(0.0, 5e-3, count),
                  "motor.armature_resistance": numbers.uniform(2.5, 4.0, count)}
    if model is not st.BoundedServo:
        parameters |= {"electronics.frame_period": numbers.uniform(0.012, 0.02, count),
                       "motor.brush_drop_voltage": np.where(np.arange(count) % 3 == 0, 0.3, 0.0)}
    command = st.signals.samples([0.0, 0.1, 0.3, 0.45], [10.0, 80.0, 60.0, 61.0], unit="deg")

    own = servo.replace({"motor.armature_inductance": 5e-4}) if model is st.PulseServoInductive else servo

    def angles(**outputs):
        return st.simulate_many(model(own), command, duration=0.6, parameters=parameters, dtype=dtype,
                                **outputs)["output_angle"]

    fine, coarse, end = angles(output_step=0.002), angles(output_step=0.004), angles(output_times=[0.6])
    assert np.array_equal(fine[:, ::2], coarse)
    assert np.array_equal(fine[:, -1], end[:, 0])
