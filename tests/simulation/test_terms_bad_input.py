"""What the effects of the drive train refuse: one clear line that names it, and the lane in a batch."""

import numpy as np
import pytest

import servotwin as st
from servotwin import loads
from servotwin.errors import InputError, ParameterError, UnknownNameError

SERVO = st.load_servo("hitec-hs-755hb")
STEP = st.signals.step(10.0, 50.0, unit="deg")
PLAY = {"gear.backlash": 0.02, "gear.output_inertia": 1e-3}
MASSES = {"thermal.winding_capacity": 0.5, "thermal.housing_capacity": 5.0, "thermal.winding_to_housing": 10.0,
          "thermal.housing_to_ambient": 20.0}
MODELS = (st.PulseServo, st.PulseServoInductive)


def refused(error, words, call):
    with pytest.raises(error) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def run(changes, model=st.PulseServo, **options):
    return st.simulate(model(SERVO.replace(changes)), STEP, duration=0.05, **options)


def many(parameters, changes=None, model=st.PulseServo, **options):
    return st.simulate_many(model(SERVO.replace(changes or {})), STEP, duration=0.05, parameters=parameters, **options)


# --- servos -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_play_needs_inertia_behind_it(model):
    words = ["gear.backlash", "got 0.02", "gear.output_inertia", "a load that has some"]
    refused(ParameterError, words, lambda: run({"gear.backlash": 0.02, "gear.output_inertia": None}, model))
    run(PLAY, model).raise_if_failed()
    run({"gear.backlash": 0.02}, model, load=loads.Inertia(1e-3)).raise_if_failed()
    run({"gear.backlash": 0.02}, model, load=loads.Pendulum(mass=0.1, length=0.1)).raise_if_failed()


def test_play_needs_inertia_in_every_lane():
    words = ["gear.backlash of lane 1", "got 0.02", "gear.output_inertia"]
    refused(ParameterError, words, lambda: many({"gear.output_inertia": [1e-3, 0.0]}, {"gear.backlash": 0.02}))
    refused(ParameterError, words, lambda: many({"load.inertia": [1e-3, 0.0]}, {"gear.backlash": 0.02}))


def test_friction_behind_the_play_is_a_part_of_all_friction():
    most = SERVO.gear.gear_reduction * SERVO.friction.coulomb_torque_forward
    name = "friction.bearing_coulomb_torque"
    words = [name, "at most the Coulomb friction either way"]
    refused(ParameterError, words, lambda: run(PLAY | {name: 1.01 * most}))
    refused(ParameterError, [f"{name} of lane 1", *words[1:]], lambda: many({name: [0.0, 1.01 * most]}, PLAY))
    elastic = PLAY | {name: 0.0, "gear.stiffness": 90.0}
    refused(ParameterError, [name, "none beside gear.stiffness"], lambda: run(elastic))
    refused(ParameterError, [name, "at least 0"], lambda: SERVO.replace({name: -0.01}))
    run(PLAY | {name: most}).raise_if_failed()
    run({name: 2.0 * most}).raise_if_failed()  # without play it acts in nothing


@pytest.mark.parametrize("name", MASSES)
def test_heat_is_all_of_its_numbers_or_none(name):
    some = {other: value for other, value in MASSES.items() if other != name}
    refused(ParameterError, ["thermal.", name.partition(".")[2]], lambda: SERVO.replace(some))
    refused(ParameterError, ["thermal."], lambda: SERVO.replace({name: MASSES[name]}))


def test_magnets_follow_a_temperature_that_there_is():
    refused(ParameterError, ["thermal.magnet_coefficient", "thermal.winding_capacity"],
            lambda: SERVO.replace({"thermal.magnet_coefficient": -1e-3}))
    SERVO.replace(MASSES | {"thermal.magnet_coefficient": -1e-3})


def test_an_exponent_needs_its_speed():
    refused(ParameterError, ["friction.stribeck_exponent", "friction.stribeck_speed"],
            lambda: SERVO.replace({"friction.stribeck_exponent": 2.0}))
    SERVO.replace({"friction.stribeck_exponent": 2.0, "friction.stribeck_speed": 10.0})


@pytest.mark.parametrize("one", ["load_friction", "load_friction_stribeck"])
@pytest.mark.parametrize("two", ["load_friction_motor", "load_friction_external_stribeck", "load_friction_motor_quad"])
def test_shares_of_two_laws_do_not_mix(one, two):
    refused(ParameterError, [f"friction.{two}", f"friction.{one}", "another friction law"],
            lambda: SERVO.replace({f"friction.{one}": 0.1, f"friction.{two}": 0.1}))


@pytest.mark.parametrize(("angle", "error", "words"), [
    ([0.0, 1.0], [0.01], ["potentiometer.linearity_error", "as many values"]),
    ([0.0, 1.0], None, ["potentiometer.linearity_error", "as many values"]),
    ([1.0, 0.0], [0.01, 0.02], ["potentiometer.linearity_angle", "increasing"]),
    ([0.0, 0.0], [0.01, 0.02], ["potentiometer.linearity_angle", "increasing"]),
    ([0.0, float("nan")], [0.01, 0.02], ["potentiometer.linearity_angle"]),
])
def test_tables_that_are_none(angle, error, words):
    refused(ParameterError, words, lambda: SERVO.replace(
        {"potentiometer.linearity_angle": angle, "potentiometer.linearity_error": error}))


@pytest.mark.parametrize(("name", "value"), [
    ("gear.backlash", -0.01), ("supply.current_limit", 0.0), ("friction.stribeck_speed", 0.0),
    ("friction.load_friction", -0.1), ("thermal.ambient", -3.0), ("potentiometer.quantisation", 0.0),
    ("potentiometer.backlash", -1e-3), ("motor.armature_inductance", 0.0), ("stops.restitution", 1.5)])
def test_ranges(name, value):
    refused(ParameterError, [name, f"got {value}"], lambda: SERVO.replace({name: value}))
    if name in st.PulseServoInductive.optional or name in st.PulseServoInductive.requires:
        good = {"thermal.ambient": 298.15}.get(name, 0.1)
        changes = MASSES if name.startswith("thermal") else PLAY
        refused(ParameterError, [f"{name} of lane 1"],
                lambda: many({name: [good, value]}, changes, st.PulseServoInductive))


# --- starts -----------------------------------------------------------------------------------------------------------


def test_a_motor_outside_its_play():
    N = SERVO.gear.gear_reduction
    at = {"output_angle": 0.5, "motor_angle": N * 0.52}
    words = ["initial motor_angle", f"got {N * 0.52}", f"{N * 0.49:.6g} to {N * 0.51:.6g} rad", "within the play"]
    refused(InputError, words, lambda: run(PLAY, initial=at))
    run(PLAY, initial=at | {"motor_angle": N * 0.509}).raise_if_failed()
    refused(InputError, ["initial motor_angle of lane 1", "within the play"],
            lambda: many(None, PLAY, initial={"output_angle": 0.5, "motor_angle": [N * 0.5, N * 0.52]}))


@pytest.mark.parametrize(("name", "model", "changes"), [
    ("armature_current", st.PulseServo, {}), ("motor_angle", st.PulseServo, {}), ("motor_speed", st.PulseServo, MASSES),
    ("winding_temperature", st.PulseServo, PLAY), ("housing_temperature", st.PulseServoInductive, {})])
def test_a_state_that_the_servo_lacks(name, model, changes):
    words = [f"state of {model.__name__}", name, "output_angle, output_speed"]
    refused(UnknownNameError, words, lambda: run(changes, model, initial={name: 0.1}))
    refused(UnknownNameError, words[1:], lambda: many(None, changes, model, initial={name: [0.1, 0.2]}))


@pytest.mark.parametrize("name", ["armature_current", "winding_temperature", "motor_speed"])
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), "1", None])
def test_a_state_that_is_no_number(name, bad):
    refused(InputError, [f"initial {name}"],
            lambda: run(PLAY | MASSES, st.PulseServoInductive, initial={name: bad}))


def test_a_bad_state_names_its_lane():
    refused(InputError, ["initial winding_temperature of lane 1"],
            lambda: many(None, MASSES, initial={"winding_temperature": [300.0, float("nan")]}))


@pytest.mark.long
def test_every_state_can_be_a_start():
    """By signal name, and the first sample of that signal gives it back."""
    N = SERVO.gear.gear_reduction
    start = {"output_angle": 0.5, "output_speed": 0.3, "armature_current": -0.2, "winding_temperature": 320.0,
             "housing_temperature": 310.0, "motor_angle": N * 0.505, "motor_speed": N * 0.1}
    result = run(PLAY | MASSES, st.PulseServoInductive, initial=start)
    for name, value in start.items():
        assert result[name][0] == pytest.approx(value, rel=1e-14)
    batch = many(None, PLAY | MASSES, st.PulseServoInductive, outputs=tuple(start), output_times=np.array([0.0]),
                 initial={name: [value] for name, value in start.items()})
    for name, value in start.items():
        assert batch[name][0, 0] == pytest.approx(value, rel=1e-14)
