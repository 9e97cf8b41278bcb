"""Inductance and heat beside what else a servo has: accuracy, one result by every way, lanes that know no others."""

import numpy as np
import pytest

import servotwin as st

HEAT = {"thermal.winding_capacity": 2.0, "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 10.0, "thermal.magnet_coefficient": -1.5e-3}
M5 = {"friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1}
GAP = {"gear.backlash": 0.01}
COIL = {"motor.armature_inductance": 6e-4}
KINDS = {"heat": (st.PulseServo, HEAT), "heat, M5": (st.PulseServo, HEAT | M5),
         "inductance, M5": (st.PulseServoInductive, COIL | M5),
         "inductance, heat": (st.PulseServoInductive, COIL | HEAT),
         "play, heat": (st.PulseServo, GAP | HEAT), "play, heat, M5": (st.PulseServo, GAP | HEAT | M5)}
LOAD = st.loads.Inertia(0.0) + st.loads.Constant(0.0)
LANES, DURATION = 12, 0.4  # s


def fleet(servo, name, lanes=LANES, seed=3):
    rng = np.random.default_rng(seed)
    kind, changes = KINDS[name]
    model = kind(servo.replace(changes | {"gear.output_inertia": 1e-3, "supply.internal_resistance": 0.2}))
    parameters = {"load.inertia": rng.uniform(0.0, 5e-3, lanes), "load.torque": rng.uniform(-0.2, 0.2, lanes),
                  "friction.coulomb_torque_forward": 1e-3 * rng.uniform(0.6, 1.4, lanes)}
    told = [st.signals.samples(np.concatenate(([0.0], np.sort(rng.uniform(0.0, DURATION, 3)))),
                               rng.uniform(0.9e-3, 2.1e-3, 4), unit="s") for _ in range(lanes)]
    return model, told, parameters


def many(servo, name, lanes=LANES, which=slice(None), **options):
    model, told, parameters = fleet(servo, name, lanes)
    options = {"output_times": np.linspace(0.02, DURATION, 20)} | options
    return st.simulate_many(model, told[which], duration=DURATION, load=LOAD,
                            parameters={key: x[which] for key, x in parameters.items()}, **options).raise_if_failed()


@pytest.mark.long(but="heat")
@pytest.mark.parametrize("name", KINDS)
def test_the_error_is_below_the_accuracy_and_falls_with_it(servo, name):
    """The finest run is one of many small steps: that of the general engine in other tests."""
    finest = many(servo, name, accuracy=1e-13)["output_angle"]
    for accuracy in (1e-7, 1e-9, 1e-11):
        errors = np.max(np.abs(many(servo, name, accuracy=accuracy)["output_angle"] - finest), axis=1)
        assert np.max(errors) < max(accuracy, 2e-12)


@pytest.mark.long(but="heat")
@pytest.mark.parametrize("name", KINDS)
def test_one_many_and_those_that_go_on_are_the_same(servo, name):
    model, told, parameters = fleet(servo, name)
    batch = many(servo, name)
    for lane in (0, 5):
        own = {key: float(x[lane]) for key, x in parameters.items() if not key.startswith("load.")}
        load = st.loads.Inertia(parameters["load.inertia"][lane]) + st.loads.Constant(parameters["load.torque"][lane])
        alone = st.simulate(type(model)(model.servo.replace(own)), told[lane], duration=DURATION, load=load,
                            output_times=np.linspace(0.02, DURATION, 20))
        np.testing.assert_allclose(batch["output_angle"][lane], alone["output_angle"], rtol=0.0, atol=1e-9)
    constant = [st.signals.constant(1.8e-3, unit="s") for _ in range(LANES)]
    ticked = st.VectorSimulator(model, LANES, load=LOAD, parameters=parameters, threads=1)
    ticked.reset(pulse_width=1.2e-3)
    for _ in range(40):
        ticked.advance(5e-3, pulse_width=1.8e-3)
    start = model.start_angle(1.2e-3)
    whole = st.simulate_many(model, constant, duration=0.2, load=LOAD, parameters=parameters, output_times=[0.2],
                             initial={"output_angle": np.full(LANES, start)})
    np.testing.assert_allclose(ticked["output_angle"], whole["output_angle"][:, 0], rtol=0.0, atol=1e-9)


@pytest.mark.long(but="heat")
@pytest.mark.parametrize("name", KINDS)
def test_lanes_know_nothing_of_each_other(servo, name):
    whole = many(servo, name)["output_angle"]
    for which in (slice(0, 1), slice(4, 7), slice(2, 12)):
        np.testing.assert_array_equal(many(servo, name, which=which)["output_angle"], whole[which])


@pytest.mark.parametrize("name", ["heat", "inductance, heat", "play, heat"])
def test_energy_is_kept(servo, name):
    kind, changes = KINDS[name]
    model = kind(servo.replace(changes | {"gear.output_inertia": 1e-3}))
    result = st.simulate(model, st.signals.step(1.2e-3, 1.9e-3, at=0.02, unit="s"), duration=0.3,
                         load=st.loads.Inertia(2e-3) + st.loads.Constant(0.1))
    assert abs(result.energy.residual) < 1e-8 * abs(result.energy.supply)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["heat", "inductance, heat"])
def test_ten_minutes_of_heating_do_not_drift(servo, name):
    """A servo that is driven to and fro, beside itself by finer steps."""
    kind, changes = KINDS[name]
    model = kind(servo.replace(changes | {"gear.output_inertia": 1e-3}))
    told = st.signals.samples(np.arange(0.0, 600.0, 0.25), np.tile([1.1e-3, 1.9e-3], 1200), unit="s", hold="previous")
    ends = [st.simulate_many(model, [told], duration=600.0, load=LOAD, parameters={"load.torque": np.array([0.1])},
                             output_times=[150.0, 300.0, 600.0], outputs=("winding_temperature",), accuracy=accuracy)
            ["winding_temperature"][0] for accuracy in (1e-9, 1e-12)]
    assert ends[1][-1] > 305.0
    np.testing.assert_allclose(ends[0], ends[1], rtol=0.0, atol=1e-6)
