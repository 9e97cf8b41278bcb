"""Bus servos with play, load friction and bridge drop on one supply, against a reference written from the equations.

`python -m validation.test_digital_bus 0 50`, in tests/, prints the largest deviations of these runs, and what grazes or
ties.
"""

import math
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest

import servotwin as st
from leg_cases import SERVOS
from reference import digital_bus
from validation import digital_fleets as fleets
from validation.digital_fleets import FREE, Fleet, Seen, fleet
from validation.test_digital_play import AFTER, GRAZING, PARTS, TIE, more

SLOW = 1e-5  # rad/s: where teeth meet so slowly, rounding decides when, and whether they part and meet once more
ANGLE, SPEED, CURRENT, VOLTAGE = 1e-9, 1e-7, 1e-7, 1e-7  # rad, rad/s, A, V
BROWN_OUT = {**FREE, "firmware.undervoltage": 6.0, "firmware.undervoltage_action": "stop"}
RESET = {**BROWN_OUT, "firmware.undervoltage": 8.0, "firmware.undervoltage_action": "reset",
         "firmware.restart_time": 0.03}
QUICK = {
    "two, calls of 1 ms": (fleet(1, 2, 0.5, changes=FREE, unlike=False, duration=0.08), 1e-3),
    "six, ticks of their own": (fleet(2, 6, 0.3, changes=FREE, duration=0.04), 2e-3),
    "fourteen, calls of 20 ms": (fleet(3, 14, 0.05, unlike=False, duration=0.04), 2e-2),
    "a sag below half": (fleet(4, 3, 4.0, changes=FREE, unlike=False, duration=0.06), 2e-3),
    "a brown-out": (fleet(4, 3, 4.0, changes=BROWN_OUT, unlike=False, duration=0.06), 1e-3),
    "a regulator": (fleet(5, 2, 0.3, limit=2.0, changes=FREE, duration=0.04), 2e-3),
    "one unplugged": (fleet(6, 2, 0.5, changes=FREE, unlike=False, duration=0.1, off=((), ((0.04, 0.08),))), 2e-2),
    "warm": (fleet(7, 2, 0.5, changes=FREE, duration=0.04, hot=True), 2e-3),
}
LONG = {
    **{f"{n} of {kind}, {R_b} Ohm{', warm' * hot}": (
        fleet(10 * n + k, n, R_b, names=(kind,), changes=changes, unlike=bool(k % 2), duration=duration, hot=hot), call)
       for n, duration in ((2, 0.3), (6, 0.12), (14, 0.06))
       for k, (kind, R_b, changes, call, hot) in enumerate([
           ("12 V", 0.05, {}, 2e-2, False), ("12 V", 0.5, FREE, 2e-3, False), ("12 V, LeRobot", 0.2, {}, 1e-3, False),
           ("12 V, LeRobot", 0.5, FREE, 2e-2, False), ("12 V", 0.3, FREE, 2e-2, True), ("12 V", 0.5, {}, 2e-3, True)])},
    "constant goals": (fleet(61, 6, 0.5, changes=FREE, still=True, duration=0.3), 2e-2),
    "fourteen in a brown-out": (fleet(62, 14, 1.5, changes=BROWN_OUT, duration=0.1), 2e-2),
    "a reset": (fleet(63, 3, 2.0, changes=RESET, unlike=False, duration=0.3), 2e-3),
    "six on a regulator": (fleet(64, 6, 0.1, limit=3.0, changes=FREE, unlike=False, duration=0.2), 2e-2),
    "a regulator that is warm": (fleet(65, 3, 0.3, limit=1.5, changes=FREE, duration=0.2, hot=True), 2e-3),
    "two of six unplugged": (fleet(66, 6, 0.5, changes=FREE, duration=0.2, off=(
        ((0.04, 0.1),), (), ((0.0, 0.06), (0.12, 1.0)), (), (), ())), 2e-2),
    "one that falls back": (fleet(67, 2, 0.5, changes=FREE, unlike=False, still=True, duration=0.5, off=(
        ((0.1, 1.0),), ())), 2e-2),
    **{f"two that fall and feed {what}": (
        fleet(68, 3, 0.8, limit=limit, changes=FREE, still=True, duration=0.24, hot=hot, off=(
            ((0.0, 1.0),), (), ((0.04, 0.2),)))._replace(torques=np.array([[3.0, 0.3, -3.5]])), 2e-2)
       for what, limit, hot in (("a battery", None, False), ("a regulator", 2.0, True))},
}
RANDOM = 24


class Found(NamedTuple):
    """A run here and there."""

    fleet: Fleet
    traces: digital_bus.Traces
    there: Seen
    here: Seen


def case(number: int) -> tuple[Fleet, float]:
    """Draw servos, supply, goals and calls, with some of what the catalog's servos lack."""
    rng = np.random.default_rng(5000 + number)
    n, R_b = int(rng.choice([2, 3, 6])), float(rng.choice([0.05, 0.1, 0.3, 0.5, 1.5, 4.0]))
    changes: dict[str, Any] = dict(FREE) if rng.random() < 0.7 else {}
    if rng.random() < 0.6:
        given = more(number)
        given.pop("supply.internal_resistance", None)
        changes |= {key: value for key, value in given.items() if value != "coast"}
    if rng.random() < 0.2:
        changes |= {"firmware.undervoltage": float(rng.choice([5.0, 8.0, 10.5])), "firmware.restart_time": 0.03,
                    "firmware.undervoltage_action": str(rng.choice(["stop", "reset"]))}
    found = fleet(number, n, R_b, limit=rng.choice([None, None, 1.0, 2.5]), names=(str(rng.choice(list(SERVOS))),),
                  changes=changes, unlike=bool(rng.random() < 0.5), still=bool(rng.random() < 0.15), duration=0.2,
                  hot=bool(rng.random() < 0.25))
    if "stops.upper_angle" in changes:
        found = found._replace(goals=np.clip(found.goals, -0.25, 0.3), angles=np.clip(found.angles, -0.25, 0.3))
    if rng.random() < 0.25:
        found = found._replace(off=(((0.08, 0.16),), *(() for _ in range(n - 1))))
    return found, float(rng.choice([1e-3, 2e-3, 2e-2]))


def sure_until(traces: digital_bus.Traces, slow: float = GRAZING) -> tuple[float, float]:
    """Return when rounding decides first whether teeth meet, and which count an angle is."""
    grazes = [m.time for s in traces.servos for m in s.meetings if abs(m.motor - m.output) < slow]
    ties = [t for s in traces.servos for t, distance in s.edges if distance < TIE]
    return min(grazes, default=math.inf), min(ties, default=math.inf)


def between_ticks(one: Fleet, times: np.ndarray) -> np.ndarray:
    """Return which times are not when a duty begins: there a current is that before or after it."""
    late = [model.servo.firmware.compute_delay or 0.0 for model in fleets.models(one)]
    since = (times[:, None] - one.phases - np.array(late) + 1e-9) % 1e-3
    return np.asarray((since > 2e-9).all(axis=1))


def agree(found: Found) -> None:
    """Angles, speeds, currents and voltage, until rounding decides."""
    graze, tie = sure_until(found.traces)
    time = found.here.time
    sure = time < min(graze, tie)
    smooth = sure & between_ticks(found.fleet, time)
    angle, motor, speed, current, voltage = deviations(found)
    assert angle[sure].max(initial=0.0) <= ANGLE
    assert motor[sure].max(initial=0.0) <= ANGLE
    assert speed[sure].max(initial=0.0) <= SPEED
    assert current[smooth].max(initial=0.0) <= CURRENT
    assert voltage[smooth].max(initial=0.0) <= VOLTAGE
    assert angle[time < tie].max(initial=0.0) <= AFTER


def deviations(found: Found) -> list[np.ndarray]:
    """Return those of all signals, the motor's angle as at the output."""
    scales = (1.0, 1.0 / fleets.reductions(found.fleet), 1.0, 1.0, 1.0)
    return [np.abs(a - b) * scale for a, b, scale in zip(found.here[1:], found.there[1:], scales, strict=True)]


def by_lanes(one: Fleet, call: float, lead: float = fleets.LEAD) -> Found:
    here = fleets.lanes(one, call, lead=lead)
    return Found(one, *fleets.reference(one, here.time), here)


def by_bus(one: Fleet) -> tuple[st.Fleet, Found]:
    one = fleets.holding(one)
    times = np.arange(round(one.duration / 1e-3)) * 1e-3 + fleets.LEAD
    result, here = fleets.together(one, times)
    return result, Found(one, *fleets.reference(one, times), here)


def check_lanes(one: Fleet, call: float) -> Found:
    """Hold lanes against the reference; calls that end at ticks change nothing."""
    found = by_lanes(one, call)
    agree(found)
    even = fleets.lanes(one, call, lead=0.0)
    shared = np.flatnonzero(np.isclose(found.here.time[:, None], even.time[None], rtol=0.0, atol=1e-12).any(axis=1))
    sure = even.time < min(sure_until(found.traces))
    assert len(shared) == len(even.time)
    for name, scale in (("output_angle", 1.0), ("motor_angle", fleets.reductions(one))):
        off = np.abs(getattr(even, name) - getattr(found.here, name)[shared]) / scale
        assert off[sure].max(initial=0.0) <= ANGLE
    return found


def check_bus(one: Fleet) -> None:
    """Hold `simulate_bus` against the reference: with its trips, meetings of teeth, and where energy goes."""
    result, found = by_bus(one)
    agree(found)
    assert abs(result.energy.residual) <= 1e-9 * abs(result.energy.supply)
    if min(sure_until(found.traces, SLOW)) < one.duration:
        return
    for own, trace in zip(result.values(), found.traces.servos, strict=True):
        ticks = np.array([tick.time for tick in trace.ticks])
        trips = np.array([tick.trip for tick in trace.ticks])
        last = np.searchsorted(ticks, found.here.time, side="right") - 1
        np.testing.assert_array_equal(own["trip"][last >= 0], trips[last[last >= 0]])
        here = [event.time for event in own.events if event.kind == "gear meets"]
        there = [t for t, kind in trace.events if kind == "gear meets"]
        np.testing.assert_allclose(here, there, rtol=0.0, atol=1e-8)
        for part in PARTS:
            near = 1e-9 * (1.0 + abs(result.energy.supply))
            assert getattr(own.energy, part) == pytest.approx(trace.energy[part], rel=1e-8, abs=near)


@pytest.mark.long(but="two, calls of 1 ms")
@pytest.mark.parametrize("name", QUICK)
def test_few_servos_on_one_supply_are_those_of_the_reference(name):
    one, call = QUICK[name]
    found = check_lanes(one, call)
    assert min(sure_until(found.traces)) > one.duration
    if "brown" in name or "half" in name:
        assert found.traces.bus_voltage.min() < 0.5 * 12.0
    if "brown" in name:
        assert any(tick.trip == 4 for servo in found.traces.servos for tick in servo.ticks)
    if one.supply.current_limit:
        assert "limit" in dict(zone[::-1] for zone in found.traces.zones)


@pytest.mark.long(but="a regulator")
@pytest.mark.parametrize("name", ["a brown-out", "a regulator"])
def test_a_fleet_goes_and_spends_as_the_reference(name):
    check_bus(QUICK[name][0])


def test_teeth_that_press_at_the_limit_of_a_supply_keep_pressing():
    """Under the voltage that the supply would have without its limit they part: 1e-10 rad in these 60 ms."""
    one, call = case(3)
    found = check_lanes(one._replace(duration=0.06), call)
    assert deviations(found)[0].max() <= 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_long_runs_are_those_of_the_reference(name):
    one, call = LONG[name]
    check_lanes(one, call)
    if not one.off:
        check_bus(one)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(RANDOM))
def test_random_servos_are_those_of_the_reference(number):
    one, call = case(number)
    check_lanes(one, call)
    if not one.off:
        check_bus(one)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(6))
def test_unlike_servos_on_one_supply_are_those_of_the_reference(number):
    changes = ({}, FREE, {"gear.backlash": 0.03}, {**FREE, "firmware.compute_delay": 4e-4},
               {"firmware.control_period": 8e-4}, {**FREE, "friction.bearing_coulomb_torque": 0.0})
    n = 2 + 2 * (number % 3)
    one = fleet(90 + number, n, 0.4, names=tuple(SERVOS), unlike=bool(number % 2), duration=0.2,
                limit=2.0 if number == 4 else None)
    check_bus(one._replace(changes=tuple(changes[(number + k) % len(changes)] for k in range(n))))


@pytest.mark.parametrize("lead", [0.0, fleets.LEAD])
@pytest.mark.parametrize(("n", "goal", "torque", "R_b", "call"), [
    (2, 0.002, 0.3, 0.5, 1e-3), (2, 0.002, 0.3, 4.0, 2e-2), (4, 0.01, 0.3, 0.5, 2e-2), (14, 1.0, 0.0, 0.5, 2e-2)])
def test_servos_that_are_told_the_same_do_the_same(n, goal, torque, R_b, call, lead):
    twins = fleets.twins(n, goal, torque, R_b, 0.06)
    here = fleets.lanes(twins, call, lead=lead)
    alone = fleets.reference(fleets.slower(fleets.order(twins, [0]), n * R_b), here.time)[1]
    for name, scale in (("output_angle", 1.0), ("motor_angle", fleets.reductions(twins)[0])):
        assert np.ptp(getattr(here, name), axis=1).max() / scale <= 1e-12
        assert np.abs(getattr(here, name) - getattr(alone, name)).max() / scale <= ANGLE


@pytest.mark.long
def test_one_servo_on_a_bus_is_the_servo_alone():
    one = fleet(31, 1, 0.5, changes=FREE, unlike=False, duration=0.1)
    on, alone = fleets.lanes(one, 2e-3), fleets.lanes(one, 2e-3, alone=(0,))
    own = one._replace(changes=({**FREE, "supply.internal_resistance": 0.5},))
    itself = fleets.lanes(own, 2e-3, alone=(0,))
    assert np.abs(on.output_angle - itself.output_angle).max() <= 1e-12
    assert np.abs(on.output_angle - alone.output_angle).max() > 1e-4
    result, seen = fleets.together(fleets.holding(one), on.time)
    model = fleets.models(own)[0]
    load = st.loads.Inertia(float(one.inertias[0])) + st.loads.Constant(float(one.torques[0, 0]))
    by_itself = st.simulate(model, result["0"].command, duration=0.1, load=load, output_times=on.time,
                            initial={"output_angle": float(one.angles[0])}, accuracy=1e-12)
    assert np.abs(seen.output_angle[:, 0] - by_itself["output_angle"]).max() <= 1e-12


@pytest.mark.parametrize("unlike", [False, True])
def test_the_order_of_servos_changes_nothing(unlike):
    one, turned = fleet(32, 4, 0.5, changes=FREE, unlike=unlike, duration=0.06), [2, 0, 3, 1]
    here, other = fleets.lanes(one, 2e-3), fleets.lanes(fleets.order(one, turned), 2e-3)
    assert np.abs(here.output_angle[:, turned] - other.output_angle).max() <= 1e-12
    times = here.time[::2]
    here, other = (fleets.together(fleets.holding(which), times)[1] for which in (one, fleets.order(one, turned)))
    assert np.abs(here.output_angle[:, turned] - other.output_angle).max() <= 1e-12


@pytest.mark.long
def test_one_that_is_taken_off_the_bus_leaves_the_others_alone():
    one = fleet(33, 3, 0.5, changes=FREE, duration=0.06)
    here = fleets.lanes(one, 2e-3, alone=(1,))
    for which, R_b in (([0, 2], 0.5), ([1], 0.0)):
        rest = fleets.slower(fleets.order(one, which), R_b)
        agree(Found(rest, *fleets.reference(rest, here.time), Seen(here.time, *(x[:, which] for x in here[1:]))))


def largest(found: Found) -> np.ndarray:
    """Return the largest deviation of each signal, ties and grazing or not."""
    smooth = between_ticks(found.fleet, found.here.time)
    return np.array([x[smooth if k > 2 else slice(None)].max() for k, x in enumerate(deviations(found))])


if __name__ == "__main__":
    worst = np.zeros(5)
    for number in range(*map(int, sys.argv[1:])):
        one, call = case(number)
        found = by_lanes(one, call)
        off = largest(found) if one.off else np.maximum(largest(found), largest(by_bus(one)[1]))
        worst = np.maximum(worst, off)
        sys.stdout.write(f"{number} {one.count} of {one.names[0]}, {one.supply.internal_resistance} Ohm, "
                         f"limit {one.supply.current_limit}, warm {one.hot}, {one.changes[0]}: {off}; graze, tie "
                         f"{sure_until(found.traces)}; down to {found.traces.bus_voltage.min():.2f} V\n")
    sys.stdout.write(f"largest: {worst}\n")
