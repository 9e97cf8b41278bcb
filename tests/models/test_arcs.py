"""Arcs against a fine numerical solution, and lanes side by side against one by one, plain and compiled."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lane_cases import case, replaced, with_lanes
from servotwin.models.engine.batch import side_by_side, tiles
from servotwin.models.engine.batch.segments import linear_segments
from servotwin.models.engine.dynamics import contacts
from servotwin.models.state.records import room
from servotwin.models.terms.bridge import NO_BRIDGE, Off
from servotwin.models.terms.friction import NO_FRICTION
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source
from servotwin.simulation.lanes import whole_runs
from servotwin.simulation.lanes.forms import RUNS
from servotwin.simulation.lanes.packed import FIELDS, empty_raw
from servotwin.simulation.lanes.whole_runs import run as run_lanes

NUMBERS = Numbers(
    motor=Motor(1.03, 1.0, 3.0, 0.0), shaft=Shaft(6e-3, 1e-3, 0.0, 0.0), source=Source(6.0, 0.0, math.inf),
    bridge=NO_BRIDGE._replace(R_drive=3.1, off=Off(0.0, 3.0, 0.0)),
    friction=NO_FRICTION._replace(F_forward=0.2, F_backward=0.25))
DEAD_ZONES = ((0.0, 0.0), (0.5, 0.1), (0.4, 7.0))
LOADS = (0.0, -0.3, 0.6, 1.5, -3.0)


def fine(numbers, torque, drive, q, w, end):
    """Solve the arc's differential equation, stopping wherever the speed is zero."""
    D, R = (numbers.bridge.D_drive, numbers.bridge.R_drive) if drive else numbers.bridge.off[:2]

    def current(w):
        x = drive * numbers.source.V - numbers.motor.K_b * w
        return 0.0 if abs(x) <= D else (x - math.copysign(D, x)) / R

    t = 0.0
    while t < end:
        way = np.sign(w)
        if w == 0.0:
            backward, forward = contacts.holding_bounds(numbers, 0.0, 0.0)
            pull = numbers.motor.K * current(0.0) - torque
            way = 1.0 if pull > forward else -1.0 if pull < -backward else 0.0
        if way == 0.0:
            break
        friction = numbers.friction.F_forward if way > 0.0 else -numbers.friction.F_backward

        def rates(_, y, friction=friction):
            pull = numbers.motor.K * current(y[1]) - torque
            return [y[1], (pull - numbers.shaft.b * y[1] - friction) / numbers.shaft.J]

        def stands(t, y, way=way, begin=t):
            return y[1] if t > begin else way

        stands.terminal, stands.direction = True, -way
        run = solve_ivp(rates, (t, end), [q, w], method="DOP853", rtol=1e-11, atol=1e-13, events=stands,
                        max_step=(end - t) / 50)
        (q, w), t = run.y[:, -1], run.t[-1]
        w = 0.0 if run.status == 1 else w
    return q, w


@pytest.mark.parametrize("zones", DEAD_ZONES)
@pytest.mark.parametrize("torque", LOADS)
def test_arcs_against_a_fine_solution(zones, torque):
    numbers = replaced(NUMBERS, {"bridge.D_drive": zones[0], "bridge.off.D": zones[1]})
    for drive, w in product((-1.0, 0.0, 1.0), (0.0, 4.0, -9.0)):
        q, speed, _, done = linear_segments.slide(linear_segments.arc_numbers(numbers, torque), drive, 0.3, w, 0.06)
        assert done == 1.0
        expected = fine(numbers, torque, drive, 0.3, w, 0.06)  # not much finer than this itself
        assert (q, speed) == pytest.approx(expected, abs=5e-8), (drive, w)


@pytest.mark.parametrize("time", [1e-12, 1e-6, 1e-3, 1.0, 100.0])
def test_a_free_shaft_has_no_cancellation(time):
    numbers = replaced(NUMBERS, {"shaft.b": 0.0, "friction.F_forward": 0.0, "friction.F_backward": 0.0,
                               "bridge.off.R": 1e15})
    q, w, _, _ = linear_segments.slide(linear_segments.arc_numbers(numbers, -0.006), 0.0, 0.0, 0.0, time)
    assert q == pytest.approx(0.5 * time * time, rel=1e-9)  # a winding of 1e15 ohm hardly brakes
    assert w == pytest.approx(time, rel=1e-9)


OPEN = {"bridge.off.coast": 1.0, "bridge.silence.coast": 1.0, "bridge.off.D": 6.7, "bridge.off.R": 3.2}
COIL = {"motor.L": 5e-4}
LOOSE = {"play.half": 6e-3, "shaft.J_out": 1e-3, "shaft.b_out": 1e-3}
STRIBECK = {"friction.varies": 1.0, "friction.w_s": 0.05, "friction.alpha": 1.5, "friction.breakaway": 1.4}
FEATURES = {
    "plain": {}, "coast": OPEN, "RC stretcher": {"chip.tau_s": 0.02},
    "couplings": {"chip.beta": 0.01, "chip.c_s": 0.02}, "noise": {"chip.noise": 1e-3},
    "timeout": {"chip.timeout": 0.013},
    "limits": {"chip.shortest": 1e-3, "chip.longest": 2e-3, "chip.timeout": 0.05},
    "stops": {"stops.lower": 0.2, "stops.upper": 1.6}, "no drops": {"bridge.D_drive": 0.0, "bridge.off.D": 0.0},
    "brush drop": {"bridge.off.D": 0.15}, "no friction": {"friction.F_forward": 0.0, "friction.F_backward": 0.0},
    "short frames": {"chip.frame_period": 0.004}, "play": {"sensor.half_slack": 2e-3},
    "play, open": OPEN | {"sensor.half_slack": 2e-3}, "regulator": {"source.I_max": 0.9},
    "weak regulator": {"source.I_max": 0.5, "chip.c_s": 0.02, "chip.beta": 0.01, "chip.noise": 1e-3},
    "M3": {"friction.varies": 1.0, "friction.K_m": 0.1, "friction.K_e": 0.1},
    "M5": {"friction.varies": 1.0, "friction.K_m": 0.3, "friction.K_e": 0.8, "friction.K_ms": 0.1, "shaft.b_out": 2e-3},
    "M5 of the load alone": {"friction.varies": 1.0, "friction.K_e": 0.8, "shaft.b_out": 2e-3},
    "Stribeck": STRIBECK, "Stribeck, steep": STRIBECK | {"friction.alpha": 0.6, "chip.frame_period": 0.008},
    "M4": STRIBECK | {"friction.K_m": 0.1, "friction.K_e": 0.1, "friction.K_ms": 0.05, "friction.K_es": 0.05},
    "M6": STRIBECK | {"friction.K_m": 0.1, "friction.K_e": 0.2, "friction.K_ms": 0.05, "friction.K_es": 0.1,
                      "friction.K_mq": 0.2, "friction.K_eq": 0.1, "shaft.b_out": 2e-3, "source.I_max": 0.9},
    "all bands": OPEN | {"friction.varies": 1.0, "friction.K_m": 0.1, "friction.K_e": 0.2, "source.I_max": 0.9,
                         "sensor.half_slack": 2e-3, "stops.lower": 0.1, "stops.upper": 2.0, "friction.F_forward": 0.0,
                         "friction.F_backward": 0.0},
    "inductance": COIL, "inductance, open": COIL | OPEN, "inductance, swinging": {"motor.L": 5e-2},
    "inductance, brush drop, play": COIL | {"bridge.off.D": 0.15, "bridge.V_br": 0.15, "sensor.half_slack": 2e-3},
    "inductance, no friction": COIL | {"friction.F_forward": 0.0, "friction.F_backward": 0.0, "load.coulomb": 0.0},
    "inductance, short frames": COIL | OPEN | {"chip.frame_period": 0.004, "chip.timeout": 0.007},
    "inductance, everything": {"motor.L": 2e-3} | OPEN | {
        "chip.tau_s": 0.02, "chip.beta": 0.01, "chip.c_s": 0.02, "chip.noise": 1e-3, "chip.shortest": 0.9e-3,
        "sensor.half_slack": 2e-3, "stops.lower": 0.1, "stops.upper": 2.0},
    "backlash": LOOSE, "backlash, dry load": LOOSE | {"load.coulomb": 0.05},
    "backlash, free load": LOOSE | {"load.coulomb": 0.0, "shaft.b_out": 0.0},
    "backlash, stops": LOOSE | {"stops.lower": 0.2, "stops.upper": 1.6},
    "backlash, no friction": LOOSE | {"friction.F_forward": 0.0, "friction.F_backward": 0.0, "load.coulomb": 0.0},
    "backlash, two decisions wait": LOOSE | {"chip.frame_period": 1.9e-3, "chip.K": 1.0},
    "backlash, all": LOOSE | OPEN | {"chip.tau_s": 0.02, "chip.beta": 0.01, "chip.c_s": 0.02, "chip.noise": 1e-3,
                                     "chip.timeout": 0.025, "sensor.half_slack": 2e-3, "source.I_max": 0.9},
    "everything": OPEN | {"chip.tau_s": 0.02, "chip.beta": 0.01, "chip.c_s": 0.02, "chip.noise": 1e-3,
                          "chip.timeout": 0.025, "chip.shortest": 0.9e-3, "stops.lower": 0.1, "stops.upper": 2.0}}

GIVING_UP = ("stops", "everything", "all bands", "backlash, two decisions wait")  # a lane of them at least


def one_by_one(work):
    raw = empty_raw(work)
    whole_runs.run_one_by_one(work, work.packed.columns(), np.arange(work.packed.size), raw, RUNS)
    return raw


@pytest.mark.long
@pytest.mark.parametrize("name", FEATURES)
def test_side_by_side_against_one_by_one(name):
    """Where the final speed lies within the creep the integrator takes over, with steps of its own."""
    loose = name in ("Stribeck, steep", "backlash, two decisions wait")
    work = case(40, duration=0.7, times=np.linspace(0.0, 0.7, 39), fields=FIELDS, changes=FEATURES[name])
    assert_same(run_lanes(work), one_by_one(work), 1e-10 if loose else 1e-11)


def assert_same(raw, other, tolerance):
    np.testing.assert_array_equal(raw.status, other.status)
    for name in ("angle", "error", "speed", "wiper", "current"):
        np.testing.assert_allclose(raw.fields[name], other.fields[name], rtol=0,
                                   atol=tolerance * (100.0 if name in ("speed", "current") else 1.0))
    for name in ("contact", "drive"):
        assert np.mean(raw.fields[name] != other.fields[name]) < 1e-3  # at the very instant of an event either holds


def plain(work):
    raw = empty_raw(work)
    lanes, times = work.packed.columns(), work.asked.times
    (kind,) = whole_runs.kinds_of(work.packed, "float64")
    with np.errstate(all="ignore"):
        rows = room(1, tiles.tile_type("float64", kind.form))
        side_by_side.start(lanes, kind.form, times[0], rows)
        lost = side_by_side.go_on(
            lanes.pieces, lanes.edges, kind.form, kind.slack, kind.which, work.asked.duration,
            times, whole_runs.outputs_of(work, raw, "float64"), rows, tiles.plan_room("float64", kind.form))
    assert lost == 0
    return raw


@pytest.mark.long(but="plain")
@pytest.mark.parametrize("name", [name for name in FEATURES if name not in GIVING_UP and not name.endswith(
    "everything")])
def test_plain_source_against_compiled(name):
    work = case(18, duration=0.12, times=np.linspace(0.0, 0.12, 7), fields=FIELDS, changes=FEATURES[name])
    assert_same(plain(work), run_lanes(work), 1e-12)


@pytest.mark.long
def test_edges_of_the_command():
    """Late, jittered, missing, and none at all."""
    edges = [[0.0, 0.021, 0.0385, 0.1, 0.12], [0.03, 0.05], [], [0.0]]
    first = np.cumsum([0, *map(len, edges[:-1])])
    work = with_lanes(case(4, duration=0.3, times=np.linspace(0.0, 0.3, 61), fields=FIELDS), edge_first=first,
                      edge_count=np.array([len(e) for e in edges]),
                      edges=np.concatenate([np.asarray(e, float) for e in edges]))
    assert_same(run_lanes(work), one_by_one(work), 1e-11)


@pytest.mark.long
def test_commands_that_are_not_constant():
    work = case(3, duration=0.5, times=np.linspace(0.0, 0.5, 11), fields=FIELDS)
    rows = np.array([[0.0, 1.2e-3, 1e-3, 0, 0, 0, 0], [0.2, 1.4e-3, 0, 3e-4, 9.0, 0.5, 0],
                     [0.0, 1.5e-3, 0, 2e-4, 5.0, 0, 40.0]])
    work = with_lanes(work, piece_first=np.array([0, 1, 2]), piece_count=np.array([2, 1, 1]), pieces=rows)
    assert_same(run_lanes(work), one_by_one(work), 1e-11)


@pytest.mark.long(but="plain")
@pytest.mark.parametrize("name", ["plain", "inductance"])
def test_lanes_know_nothing_of_each_other(name):
    work = case(300, duration=0.5, times=np.linspace(0.0, 0.5, 5), fields=FIELDS, changes=FEATURES[name])
    whole = run_lanes(work)
    for start, stop in ((0, 1), (7, 30), (100, 237)):
        part = run_lanes(work.part(start, stop))
        for name in FIELDS:
            np.testing.assert_array_equal(part.fields[name], whole.fields[name][start:stop])


@pytest.mark.long
def test_float32_follows_float64():
    work = case(100, duration=0.5, times=np.array([0.5]), fields=FIELDS)
    exact, single = run_lanes(work), run_lanes(replace(work, asked=replace(work.asked, dtype="float32")))
    assert single.fields["angle"].dtype == np.float32
    assert np.median(np.abs(single.fields["angle"] - exact.fields["angle"])) < 2e-6


@pytest.mark.long
def test_lanes_that_need_the_general_way_are_mixed_with_others():
    lane = np.arange(12)
    work = case(12, duration=0.3, times=np.array([0.1, 0.3]), fields=FIELDS, changes={
        "load.stiffness": np.where(lane % 3 == 0, 0.1, 0.0), "motor.L": np.where(lane % 2 == 0, 5e-4, 0.0),
        "source.I_max": np.where(lane > 8, 0.9, math.inf)})
    assert_same(run_lanes(work), one_by_one(work), 1e-11)


def test_numbers_beyond_all_bounds_end_with_a_status():
    work = case(3, duration=0.2, times=np.array([0.0, 0.2]), fields=FIELDS)
    start = work.packed.lanes.start.copy()
    start[1, 1] = math.nan
    broken = with_lanes(work, start=start)
    raw = run_lanes(broken)
    assert raw.status.tolist()[::2] == [0, 0]
    assert raw.status[1] != 0
    assert np.isnan(raw.fields["angle"][1, -1])
    np.testing.assert_array_equal(raw.fields["angle"][::2], run_lanes(work).fields["angle"][::2])


@pytest.mark.long
def test_a_current_at_the_start_flows_on():
    work = case(20, duration=0.05, times=np.array([0.0, 2e-4, 0.05]), fields=FIELDS, changes=COIL)
    start = work.packed.lanes.start.copy()
    start[1], start[2] = np.linspace(-2.0, 2.0, 20), np.linspace(1.5, -1.5, 20)
    raw = run_lanes(with_lanes(work, start=start))
    assert_same(raw, one_by_one(with_lanes(work, start=start)), 1e-11)
    np.testing.assert_array_equal(raw.fields["current"][:, 0], start[2])
    assert np.abs(raw.fields["angle"] - run_lanes(work).fields["angle"])[:, -1].min() > 1e-6
