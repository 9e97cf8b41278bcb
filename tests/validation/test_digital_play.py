"""Bus servos with play, load friction and bridge drop, tick by tick, against a reference written from the equations.

`python -m validation.test_digital_play 0 50`, in tests/, prints the largest deviations of these runs, and what grazes.
"""

import itertools
import sys
from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import pytest

import plain_run
import servotwin as st
from leg_cases import GOALS, INERTIAS, SERVOS, TORQUES, goals_of, values_of, written
from reference import digital
from validation.test_drivetrain_stops import around

pytestmark = pytest.mark.long

DURATION = 1.0  # s
TIMES = np.arange(1000) * 1e-3 + 3.7e-4  # s, none at a tick
RUNS, QUICK = 48, (2, 12)
GRAZING, TIE = 1e-6, 1e-9  # rad/s: teeth that meet so slowly may miss; counts: so near to its edge a count is another
AFTER = 1e-6  # rad, what grazes changes
BOUNCE = 1e-5  # s; the engine ends bounces lower than 1e-12 rad, the reference those slower than 1e-6 rad/s
KINDS = ("stick", "reversal", "gear meets", "gear parts", "motor speed zero", "upper stop", "lower stop")
PARTS = ("supply", "winding", "bridge", "brush", "friction", "stops", "load")


class Run(NamedTuple):
    """Numbers that differ from the servo's, goals and load of one run."""

    name: str
    changes: dict[str, Any]
    goals: str
    inertia: float
    torque: float


def case(number: int) -> Run:
    """Every servo with every kind of goals, inertia and torque, in turns; from `RUNS` on with more terms."""
    name, goals = list(SERVOS)[number % 4], list(GOALS)[number // 4 % 4]
    inertia, torque = INERTIAS[number // 16 % 2], TORQUES[number % 5]
    return Run(name, more(number) if number >= RUNS else {}, goals, inertia, torque)


def more(seed: int) -> dict[str, Any]:
    """Return some of what the catalog's servos lack."""
    rng, servo = np.random.default_rng(seed), SERVOS["12 V"]
    coulomb = servo.friction.coulomb_torque_forward
    terms: list[dict[str, Any]] = [
        {"supply.internal_resistance": float(rng.uniform(0.05, 0.6))}, {"supply.bridge_drop_resistance": 0.2},
        {"motor.brush_drop_voltage": rng.uniform(0.1, 0.3)}, {"motor.motor_viscous_friction": 1e-7},
        {"friction.coulomb_torque_backward": coulomb * rng.uniform(0.7, 1.4), "friction.breakaway_ratio": 1.4},
        {"friction.load_friction": None, "friction.load_friction_motor": 0.1,
         "friction.load_friction_external": rng.uniform(0.1, 0.5)},
        {"stops.lower_angle": -0.25, "stops.upper_angle": 0.3, "stops.restitution": float(rng.choice([0.0, 0.4]))},
        {"firmware.off_state": str(rng.choice(["diode", "coast"]))}, {"firmware.compute_delay": 4e-4},
        {"gear.backlash": rng.uniform(1e-3, 0.06)}, {"friction.bearing_coulomb_torque": 0.0}]
    chosen = rng.permutation(len(terms))[:4]
    return {name: value for k in chosen for name, value in terms[k].items()}


def both(run: Run, number: int, plain: bool = False) -> tuple[st.Result, digital.Trace, st.Batch]:
    """Return a run by `simulate`, compiled and if asked plain too, by the reference, and as lanes."""
    servo = SERVOS[run.name].replace(run.changes)
    model, (at, goals) = st.DigitalServo(servo), goals_of(run.goals, number)
    if run.changes.get("stops.upper_angle"):
        goals = np.clip(goals, servo.stops.lower_angle, servo.stops.upper_angle)
    load = st.loads.Inertia(run.inertia) + st.loads.Constant(run.torque)
    asked = {"duration": DURATION, "load": load, "output_times": TIMES, "initial": {"output_angle": 0.1},
             "accuracy": 1e-12}
    result = st.simulate(model, written(at, goals), **asked).raise_if_failed()
    if plain:
        plain_run.is_the_same(result, plain_run.simulate(model, written(at, goals), **asked).raise_if_failed())
    pieces = [(float(t), float(goal), 0.0) for t, goal in zip(at, goals, strict=True)]
    trace = digital.run(values_of(servo), {"kind": "goal", "pieces": pieces},
                        {"inertia": run.inertia, "torque": run.torque}, DURATION, TIMES, initial_angle=0.1)
    lanes = st.simulate_many(model, written(at, goals), outputs=("output_angle", "output_speed"), **asked)
    return result, trace, lanes


def kinds(result: st.Result, trace: digital.Trace) -> tuple[Counter[str], Counter[str]]:
    """Return how many events of each kind there are here and there; currents count only where there is a drop."""
    drops = result.model.servo.supply.bridge_drop_voltage or result.model.servo.motor.brush_drop_voltage
    counted = (*KINDS, "current starts", "current stops") if drops else KINDS
    here = [(e.time, e.kind.replace("lower stop", "upper stop")) for e in result.events if e.kind in counted]
    there = [(t, {"stop": "upper stop"}.get(kind, kind)) for t, kind in trace.events]
    return _counted(here, counted), _counted(there, counted)


def _counted(events: list[tuple[float, str]], counted: tuple[str, ...]) -> Counter[str]:
    """Return how many there are of each kind, without bounces of which the last are too low for one of both."""
    found, stop = Counter[str](), -1.0
    for t, kind in events:
        if kind in counted and not (kind in ("upper stop", "reversal") and t - stop < BOUNCE):
            found[kind] += 1
        stop = t if kind == "upper stop" else stop
    return found


def grazing(trace: digital.Trace) -> list[tuple[float, float]]:
    """Return when rounding decides whether teeth meet, and how slowly they do [rad/s]; 0: at a stop, to and fro."""
    slow = [(m.time, m.motor - m.output) for m in trace.meetings if abs(m.motor - m.output) < GRAZING]
    pairs = itertools.pairwise((t, kind) for t, kind in trace.events if kind in ("gear meets", "stop"))
    return sorted([*slow, *((t, 0.0) for (t, one), (u, other) in pairs if one != other and u - t < 1e-9)])


def check(number: int, plain: bool = False) -> None:
    run = case(number)
    result, trace, lanes = both(run, number, plain)
    if trace.least_tie < TIE:
        pytest.skip("a count at its edge")
    sure = min((t for t, _ in grazing(trace)), default=DURATION) > TIMES
    off = np.abs(result["output_angle"] - trace.output_angle)
    assert off[sure].max() <= 1e-9
    assert off.max() <= AFTER
    assert np.abs(result["output_speed"] - trace.output_speed)[sure].max() <= 1e-7
    assert np.abs(result["armature_current"] - trace.current)[sure].max() <= 1e-7
    for name in ("output_angle", "output_speed"):
        np.testing.assert_allclose(lanes[name][0], result[name], rtol=0.0, atol=1e-9 if name.endswith("e") else 1e-7)
    if not grazing(trace):
        here, there = kinds(result, trace)
        assert here == there
        meets = [t for t, kind in trace.events if kind == "gear meets"]
        times = [event.time for event in result.events if event.kind == "gear meets"]
        np.testing.assert_allclose(times, meets, rtol=0.0, atol=1e-8)
        check_meetings(result, trace)
    check_energy(result, trace)


def check_energy(result: st.Result, trace: digital.Trace) -> None:
    """It is kept, and goes where it does in the reference."""
    supplied, near = abs(result.energy.supply), 1e-6 if grazing(trace) else 1e-9
    assert abs(result.energy.residual) <= 1e-9 * supplied
    for part in PARTS:
        assert getattr(result.energy, part) == pytest.approx(trace.energy[part], rel=1e-8, abs=near * supplied)


def check_meetings(result: st.Result, trace: digital.Trace) -> None:
    """Momentum is kept where the teeth meet, and what is lost is that of a plastic impact."""
    J_m = result.model.servo.gear.gear_reduction ** 2 * result.model.servo.motor.rotor_inertia
    J = result.model.servo.gear.output_inertia + result.load.total_inertia
    lost = 0.0
    for before, after in around(result, "gear meets"):
        assert abs(before[5] - before[0]) == pytest.approx(0.5 * result.model.servo.gear.backlash, abs=1e-10)
        closing = (before[6] - before[1]) * np.sign(before[5] - before[0])
        assert closing >= -1e-9
        if after[1] == after[6] and after[1] * before[1] >= 0.0 and after[1] != 0.0:
            together = J * before[1] + J_m * before[6]
            assert (J + J_m) * after[1] == pytest.approx(together, rel=1e-9, abs=1e-13)
        lost += 0.5 * J * (before[1]**2 - after[1]**2) + 0.5 * J_m * (before[6]**2 - after[6]**2)
    expected = sum(m.lost for m in trace.meetings)
    if not any(kind == "stop" for _, kind in trace.events):
        assert lost == pytest.approx(expected, rel=1e-6, abs=1e-12)
        assert result.energy.stops == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("number", QUICK)
def test_a_few_runs_are_those_of_the_reference(number):
    check(number, plain=True)


@pytest.mark.slow
@pytest.mark.parametrize("number", [n for n in range(RUNS + 24) if n not in QUICK])
def test_runs_are_those_of_the_reference(number):
    check(number)


if __name__ == "__main__":
    worst = np.zeros(3)
    for number in range(*map(int, sys.argv[1:])):
        result, trace, lanes = both(case(number), number)
        off = [np.abs(result[name] - getattr(trace, name)).max() for name in ("output_angle", "output_speed")]
        off.append(np.abs(lanes["output_angle"][0] - result["output_angle"]).max())
        here, there = kinds(result, trace)
        worst = np.maximum(worst, off)
        sys.stdout.write(f"{number} {case(number)}: angle {off[0]:.1e}, speed {off[1]:.1e}, lanes {off[2]:.1e}; "
                         f"tie {trace.least_tie:.1e}; residual {result.energy.residual:.1e}; "
                         f"{sum(there.values())} events{'' if here == there else f', {dict(here)} != {dict(there)}'}; "
                         f"grazing: {grazing(trace)}\n")
    sys.stdout.write(f"largest: {worst}\n")
