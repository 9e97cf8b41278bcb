"""Commands with samples without a value: the same as pulses given one by one, and refused where there are none."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import CommandError
from servotwin.studies.lane_metrics import decision_times, step_time

NAN = math.nan
SERVO = st.load_servo("hitec-hs-755hb").replace({
    "electronics.pulse_timeout": 0.03, "electronics.silence_state": "coast", "stops.lower_angle": -3.0})
MODEL = st.PulseServo(SERVO)
LOAD = st.loads.Constant(0.4)
TIME = np.array([0.0, 0.05, 0.1, 0.2, 0.3])
WIDTH = np.array([NAN, 1500.0, 1600.0, NAN, 1550.0])
EDGES = np.arange(16) * 0.02
SENT = EDGES[(EDGES >= 0.05) & ~((EDGES >= 0.2 - 1e-9) & (EDGES < 0.3 - 1e-9))]
AT = np.linspace(0.0, 0.31, 63)


def silent(unit="us", **more):
    values = WIDTH if unit == "us" else np.degrees([
        MODEL.start_angle(1e-6 * width) if width == width else NAN for width in WIDTH])
    return st.signals.samples(TIME, values, unit=unit, **more)


def trained(edges=SENT):
    known = np.where(np.isnan(WIDTH), [1500.0, 0.0, 0.0, 1600.0, 0.0], WIDTH)
    return st.signals.pulse_train(edges, known[np.searchsorted(TIME, edges + 1e-12, side="right") - 1])


@pytest.mark.parametrize("unit", ["us", "deg"])
@pytest.mark.parametrize("silence", ["brake", "coast"])
def test_they_are_pulses_given_one_by_one(unit, silence):
    model = st.PulseServo(SERVO.replace({"electronics.silence_state": silence}))
    one, other = (st.simulate(model, command, duration=0.31, load=LOAD, output_times=AT)
                  for command in (silent(unit), trained()))
    for name in ("output_angle", "output_speed", "drive", "armature_current"):
        np.testing.assert_allclose(one[name], other[name], rtol=1e-9, atol=1e-9)
    kinds = {(event.kind, round(event.time, 9)) for event in one.events if "silence" in event.kind}
    assert kinds == {(event.kind, round(event.time, 9)) for event in other.events if "silence" in event.kind}
    # the servo that brakes here brakes between drives too
    assert {time for _, time in kinds} == ({0.06, 0.21, 0.3} if silence == "coast" else set())
    assert not one["drive"][(AT > 0.18 + 0.03) & (AT < 0.3)].any()
    fell = float(one.at("output_angle", [0.3])[0] - one.at("output_angle", [0.21])[0])
    assert fell < -0.1 if silence == "coast" else -0.04 < fell < -0.02


def test_the_period_is_that_of_the_command_else_of_the_servo():
    short = silent(frame_period=0.008)
    edges = np.arange(40) * 0.008
    due = edges[(edges >= 0.05) & ~((edges >= 0.2 - 1e-9) & (edges < 0.3))]
    want = st.simulate(MODEL, trained(due), duration=0.31, load=LOAD)["output_angle"]
    servo = st.PulseServo(SERVO.replace({"electronics.frame_period": 0.008}))
    for model, command in ((MODEL, short), (servo, silent())):
        found = st.simulate(model, command, duration=0.31, load=LOAD)["output_angle"]
        np.testing.assert_allclose(found, want, rtol=0.0, atol=1e-9)
    with pytest.raises(CommandError, match="less than a frame"):
        st.simulate(MODEL, silent(frame_period=1.55e-3), duration=0.31)


def test_a_silence_between_two_frames_is_none():
    values = [1500.0, 1600.0, NAN, 1600.0, 1550.0]
    command = st.signals.samples([0.0, 0.1, 0.125, 0.135, 0.2], values, unit="us")
    plain = st.signals.samples([0.0, 0.1, 0.2], [1500.0, 1600.0, 1550.0], unit="us")
    one, other = (st.simulate(MODEL, each, duration=0.5, load=LOAD) for each in (command, plain))
    np.testing.assert_allclose(one["output_angle"], other["output_angle"], rtol=0.0, atol=1e-12)


def test_lanes_servos_on_a_supply_and_steps_do_the_same():
    want = st.simulate(MODEL, silent(), duration=0.31, load=LOAD, output_times=AT)["output_angle"]
    batch = st.simulate_many(MODEL, [silent(), st.signals.constant(1500.0, unit="us"), silent("deg")], duration=0.31,
                             load=LOAD, output_times=AT)
    np.testing.assert_allclose(batch["output_angle"][[0, 2]], [want, want], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(batch[0]["output_angle"], want, rtol=0.0, atol=1e-9)
    supply = st.Supply(open_circuit_voltage=SERVO.supply.open_circuit_voltage)
    fleet = st.simulate_bus({"a": (MODEL, silent(), LOAD)}, supply=supply, duration=0.31, output_times=AT)
    own = SERVO.replace({"supply.internal_resistance": 0.0, "supply.current_limit": None})
    alone = st.simulate(st.PulseServo(own), silent(), duration=0.31, load=LOAD, output_times=AT)
    np.testing.assert_allclose(fleet["a"]["output_angle"], alone["output_angle"], rtol=0.0, atol=1e-9)
    sim, command = st.Simulator(MODEL, load=LOAD), silent()
    state, found = sim.initial(command), []
    for time in AT.tolist():
        state = sim.advance(state, time, command)
        found.append(sim.observe(state, "output_angle", command))
    np.testing.assert_allclose(found, want, rtol=0.0, atol=1e-9)


def test_each_lane_has_frames_of_its_own():
    periods = np.array([0.02, 0.008, 0.0125])
    batch = st.simulate_many(MODEL, silent(), duration=0.31, load=LOAD, output_times=AT,
                             parameters={"electronics.frame_period": periods})
    for period, lane in zip(periods.tolist(), batch["output_angle"], strict=True):
        model = st.PulseServo(SERVO.replace({"electronics.frame_period": period}))
        one = st.simulate(model, silent(), duration=0.31, load=LOAD, output_times=AT)
        np.testing.assert_allclose(lane, one["output_angle"], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("unit", ["us", "deg"])
@pytest.mark.parametrize("kind", [st.BoundedServo, st.AveragedServo])
def test_models_of_the_mean_refuse_them_in_one_line(kind, unit):
    command = st.signals.samples([0.0, 0.1], [1500.0 if unit == "us" else 90.0, NAN], unit=unit)
    calls = [lambda model: st.simulate(model, command, duration=0.2)]
    if kind is st.BoundedServo:
        calls.append(lambda model: st.simulate_many(model, command, duration=0.2))
    for call in calls:
        with pytest.raises(CommandError) as caught:
            call(kind(st.load_servo("hitec-hs-755hb")))
        text = str(caught.value)
        assert all(word in text for word in (kind.__name__, "no pulses from 0.1 s on", "PulseServo")), text


def test_metrics_see_the_pulses_that_are_sent():
    decided = decision_times(MODEL, silent(), 0.3)
    np.testing.assert_allclose(decided[decided < 0.31], SENT + trained()(SENT), rtol=1e-12)
    assert math.isnan(step_time(st.signals.samples([0.0, 0.1, 0.2], [1500.0, NAN, 1600.0], unit="us")))
