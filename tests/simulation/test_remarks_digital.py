"""What is said of a run of a digital or bus servo: judged by its goal, by its cap, and by what tripped it."""

import math

import pytest

import servotwin as st
from models.digital_servos import COUNT, LOCKED, digital, feetech
from servotwin.simulation.remarks import CANNOT_HOLD, ON_STOP, REFUSED, STAYS_TRIPPED, words

END = 3.0
STEP = st.signals.step(0.0, 0.5, at=0.1, unit="rad")
LIMIT = {"proportional_gain": 8.0, "duty_limit": 0.5}
TORQUE = 345.0 * 3e-3 * 0.5 * 12.0 / 3.0  # of the plant at half the duty [N m]
FRICTION = 345.0 * 2e-4
STOPS = {"stops": {"lower_angle": -1.0, "upper_angle": 1.0}}
HEAT = {"thermal": {"winding_capacity": 1.0, "housing_capacity": 2.0, "winding_to_housing": 2.0,
                    "housing_to_ambient": 20.0}}
OVERLOAD = {"overload_duty": 0.4, "overload_time": 0.5, "overload_output": 0.2, "stall_travel": 0.1}
RC = st.DigitalServo(st.load_servo("towerpro-mg996r"))
JUST, TOO_MUCH = 0.98 * (TORQUE - FRICTION), 1.02 * (TORQUE - FRICTION)
CASES = {
    "free": (digital(LIMIT), STEP, None, {}),
    "just lifted": (digital(LIMIT), STEP, st.loads.Constant(JUST), {}),
    "just not lifted": (digital(LIMIT), STEP, st.loads.Constant(TOO_MUCH), {CANNOT_HOLD: END}),
    "by the limit of the loop": (digital({"proportional_gain": 8.0, "torque_limit": 0.5}), STEP,
                                 st.loads.Constant(TOO_MUCH), {CANNOT_HOLD: END}),
    "by a limit of the motor's current": (
        digital({"proportional_gain": 8.0, "current_limit": 2.0}), STEP, st.loads.Constant(TOO_MUCH),
        {CANNOT_HOLD: END}),
    "by a limit of the supply's current": (
        digital({"proportional_gain": 8.0, "current_limit": 1.0, "current_sense": "bus"}), STEP,
        st.loads.Constant(TOO_MUCH), {CANNOT_HOLD: END}),
    "just lifted by the supply's current": (
        digital({"proportional_gain": 8.0, "current_limit": 1.0, "current_sense": "bus"}), STEP,
        st.loads.Constant(JUST), {}),
    "stiff spring": (digital(LIMIT), STEP, st.loads.Spring(6.0), {CANNOT_HOLD: END}),
    "pushed to the stop": (digital(LIMIT, **STOPS), STEP, st.loads.Constant(2.0 * TORQUE),
                           {ON_STOP: END, CANNOT_HOLD: END}),
    "within the dead zone": (digital({"proportional_gain": 8.0, "deadband_angle": 0.6}), STEP, None, {}),
    "overload": (digital(LIMIT | OVERLOAD), STEP, st.loads.Constant(0.8 * TORQUE),
                 {CANNOT_HOLD: END, "tripped by overload": None, STAYS_TRIPPED: END}),
    "overload, and let go": (
        digital(LIMIT | OVERLOAD), STEP,
        st.loads.Recorded(time=[0.0, 1.1, 1.11, END], torque=[0.8 * TORQUE, 0.8 * TORQUE, 0.0, 0.0]),
        {"tripped by overload": None}),
    "current": (digital(LIMIT | {"trip_current": 1.5, "trip_time": 0.2}, friction=LOCKED), STEP, None,
                {"tripped by current": 0.3, STAYS_TRIPPED: END}),
    "heat": (digital(LIMIT | {"trip_temperature": 299.0}, friction=LOCKED, **HEAT), STEP, None,
             {"tripped by heat": None, STAYS_TRIPPED: END}),
    "undervoltage": (
        digital(LIMIT | {"undervoltage": 11.0}, friction=LOCKED, supply={"internal_resistance": 3.0}), STEP, None,
        {"tripped by undervoltage": None}),
    "refused from a step on": (RC, st.signals.step(1500.0, 2950.0, at=0.5, unit="us"), None, {REFUSED: 0.5}),
    "refused for a while": (
        RC, st.signals.samples([0.0, 0.5, 0.8], [1500.0, 2950.0, 1500.0], unit="us"), None, {}),
    "own edges": (RC, st.signals.pulse_train([0.0, 0.4, 0.9, 1.2], [1500.0, 1510.0, 2950.0, 100.0]), None,
                  {REFUSED: 0.9}),
}


@pytest.mark.long(but="refused from a step on")
@pytest.mark.parametrize("case", CASES)
def test_what_is_said_of_a_run(case):
    model, command, load, expected = CASES[case]
    if load is not None:
        load = load + st.loads.Inertia(1e-3)
    result = st.simulate(model, command, load=load, duration=END, output_times=[END], initial=(
        {"output_angle": 0.0} if model is not RC else None))
    assert result.status.ok
    found = dict(result.remarks)
    if case == "undervoltage":  # it goes on and off
        found.pop(STAYS_TRIPPED, None)
    assert set(found) == set(expected)
    for kind, time in expected.items():
        if time is not None:
            assert found[kind] == pytest.approx(time, abs=0.12 if kind.startswith("tripped") else 1e-9)
    for remark in result.remarks:
        assert remark.words == words(remark.kind, f"{remark.time:g} s")
        assert f"{remark.time:g} s" in remark.words


def test_the_first_of_many_trips_is_named_with_its_tick():
    # the table of the Feetech: from the 2000th tick on, and a tick until the bridge has it
    result = st.simulate(feetech(32, 1, 16), st.signals.constant(100 * COUNT, unit="rad"), duration=END,
                         initial={"output_angle": 0.0})
    first = next(event.time for event in result.events if event.kind == "trips by overload")
    assert ("tripped by overload", first) in result.remarks
    assert first == pytest.approx(2.0, abs=2e-3)


@pytest.mark.long
def test_a_lane_alone_has_the_remarks_that_its_batch_leaves_out():
    model, command, load, expected = CASES["just not lifted"]
    batch = st.simulate_many(model, [command, command], load=load, duration=END, output_times=[END],
                             initial={"output_angle": 0.0})
    assert batch.remarks == ()
    assert dict(batch[1].remarks) == pytest.approx(expected)
    assert not math.isnan(batch["output_angle"][1, 0])
