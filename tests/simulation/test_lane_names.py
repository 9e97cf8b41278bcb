"""Which lane is named: the first that is meant, however loads and commands repeat, lanes differ or chunks fall."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin import loads, signals
from servotwin.errors import CommandError, InputError, LoadError

SERVO = st.load_servo("hitec-hs-755hb")
STEP = signals.step(10.0, 50.0, at=0.05, unit="deg")
LIGHT, HEAVY = loads.Inertia(1e-3), loads.Pendulum(mass=0.1, length=0.1)
SHORT = loads.Recorded([0.0, 0.05], [0.0, 0.0])
FAST = signals.constant(1500.0, unit="us", frame_period=2e-3)


@pytest.mark.parametrize(("options", "error", "words"), [
    ({"load": [None, LIGHT, LIGHT, 3.0, LIGHT, 3.0]}, LoadError, "load of lane 3: "),
    ({"load": [LIGHT, LIGHT, None, SHORT, LIGHT, SHORT]}, LoadError, "recorded torque of lane 3"),
    ({"load": [HEAVY, HEAVY, LIGHT, HEAVY, LIGHT], "parameters": {"load.pendulum.mass": 0.2}}, LoadError,
     "load.pendulum of lane 2"),
    ({"load": [HEAVY, HEAVY, LIGHT, HEAVY], "parameters": {"load.pendulum.mass": [0.1, 0.1, 0.2, 0.2]}}, LoadError,
     "load.pendulum of lane 2"),
    ({"command": [STEP, FAST, STEP, "up", STEP, "up"]}, CommandError, "command of lane 3: "),
    ({"command": [STEP, STEP, FAST, STEP, FAST], "duration": 1e8, "parameters": {"electronics.frame_period": 1.0}},
     InputError, "frame period of lane 2: got '5e+10 frames'"),
    ({"initial": {"output_angle": [0.1, 0.2, 9.0, 9.0]}}, InputError, "initial output_angle of lane 2: got 9.0"),
    ({"initial": {"output_speed": [0.1, 0.2, 0.1, math.inf]}}, InputError, "initial output_speed of lane 3"),
])
def test_the_first_lane_that_is_wrong_is_named(options, error, words):
    options = {"duration": 0.1, "output_times": [0.1], "command": STEP, **options}
    if "initial" in options:
        options["parameters"] = {"stops.upper_angle": 3.0, "stops.lower_angle": -1.0}
    with pytest.raises(error) as caught:
        st.simulate_many(st.PulseServo(SERVO), **options)
    assert words in str(caught.value)


def test_failures_keep_their_lanes_and_times_in_every_chunk():
    resistance = np.full(9, SERVO.motor.armature_resistance)
    resistance[[3, 7]] = 1e-300
    steps = [signals.step(10.0, 50.0, at=0.05 + 0.01 * lane, unit="deg") for lane in range(9)]
    runs = [st.simulate_many(st.BoundedServo(SERVO), steps, duration=0.2, output_step=0.02, chunk=chunk,
                             parameters={"motor.armature_resistance": resistance}) for chunk in (2, 4, 9)]
    for batch in runs:
        for lane, time, _ in batch.failures:  # some time after its own step, and nothing is known from then on
            assert 0.05 + 0.01 * lane < time < 0.05 + 0.01 * lane + 0.1
            np.testing.assert_array_equal(np.isnan(batch["output_angle"][lane]), batch.time > time)
        assert [failure.lane for failure in batch.failures] == [3, 7]
        assert np.flatnonzero(batch.status).tolist() == [3, 7]
        assert np.flatnonzero(np.isnan(batch["output_angle"][:, -1])).tolist() == [3, 7]
        assert [failure.time for failure in batch.failures] == [failure.time for failure in runs[0].failures]
        with pytest.raises(st.errors.SimulationError, match=r"lane 3: .* \(and 1 more of 9 lanes\)$"):
            batch.raise_if_failed()


def test_a_lane_alone_is_that_lane():
    """`batch[k]` has the parameters, command, load, start and seed of lane k."""
    servo = SERVO.replace({"potentiometer.noise": 2e-3})
    commands = [STEP, signals.step(10.0, 30.0, unit="deg"), STEP, STEP]
    batch = st.simulate_many(st.PulseServo(servo), commands, load=[LIGHT, None, HEAVY, LIGHT], duration=0.3,
                             parameters={"motor.armature_resistance": [3.0, 3.2, 3.4, 3.6]}, output_step=0.01,
                             initial={"output_angle": [0.1, 0.2, 0.3, 0.4]}, seeds=[7, 5, 3, 1],
                             outputs=("output_angle", "error_time"))
    for lane, result in enumerate(batch):
        assert result.command is commands[lane]
        run = result.at("output_angle", result.time)  # simulated again, alone
        np.testing.assert_allclose(run, batch["output_angle"][lane], rtol=0.0, atol=1e-9)
    assert len({float(x) for x in batch["error_time"][:, -1]}) == 4


def test_pendulums_with_and_without_an_inertia_of_their_own_stand_side_by_side():
    """A point mass has the inertia m l²; beside one that says its own, each keeps what it has."""
    hung = [loads.Pendulum(mass=0.1, length=0.1), loads.Pendulum(mass=0.1, length=0.1, inertia=2e-2),
            loads.Pendulum(mass=0.1, length=0.1, inertia=5e-3), loads.Pendulum(mass=0.2, length=0.1)]
    batch = st.simulate_many(st.PulseServo(SERVO), STEP, load=hung, duration=0.2, output_step=0.02)
    for lane, load in enumerate(hung):
        alone = st.simulate(st.PulseServo(SERVO), STEP, load=load, duration=0.2, output_step=0.02)
        np.testing.assert_allclose(batch["output_angle"][lane], alone["output_angle"], rtol=0.0, atol=1e-9)
