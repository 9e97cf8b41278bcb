"""Checks of the pulse-level reference itself: right side by SciPy, frame by its formula, power balance, convergence."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .cases import LOADS
from .pulse import Chip, PulseRun, Shaft, solve_pulse
from .pulse_cases import PulseCase, random_pulse_case

SHAFT = Shaft(J=6e-3, B=1e-3, K=1.03, K_b=1.0, forward=0.2, backward=0.15, R_a=3.1, R_b=0.2, r_c=0.1, V_oc=6.0,
              V_ce0=0.4, V_br=0.3)
CHIP = Chip(slope=1.3e-3, p=0.44, b_o=0.6, deadband=8e-6, gain=60.0)


def slope_of(S: Shaft, drive: int, direction: int, t: float, q: float, w: float) -> float:
    """Acceleration of the moving shaft, written straight from the specification."""
    dry = direction * ((S.forward if direction > 0 else S.backward) + S.coulomb)
    return (S.K * S.current(drive, w) - S.B * w - dry - S.external(t, q)) / S.J


# --- bridge -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("coasts", [False, True])
@pytest.mark.parametrize("drive", [-1, 0, 1])
def test_voltages_and_currents_are_consistent(drive: int, coasts: bool) -> None:
    """Kirchhoff's law with the terminal voltage as the specification writes it, at speeds of every sign and size."""
    S, flowed = replace(SHAFT, coasts=coasts), set()
    for w in np.linspace(-16.0, 16.0, 401).tolist():
        i, V_bus, v_m = S.current(drive, w), S.bus(drive, w), S.terminal(drive, w)
        sign = (i > 0) - (i < 0)
        flowed.add(sign)
        if drive:
            v_a = drive * V_bus - S.V_ce0 * sign - S.r_c * i
        else:
            v_a = -sign * (V_bus + S.V_ce0) if coasts else 0.0
        if sign:
            assert abs(v_m - v_a) < 1e-14
            assert abs(v_a - S.V_br * sign - S.R_a * i - S.K_b * w) < 1e-13
        else:
            assert v_m == (0.0 if not drive and not coasts else S.K_b * w)
            limit = S.V_ce0 + S.V_br if drive else S.V_oc + S.V_ce0 + S.V_br if coasts else S.V_br
            assert abs(drive * S.V_oc - S.K_b * w) <= limit
            assert V_bus == S.V_oc
    assert flowed == {-1, 0, 1}


def test_stretchers() -> None:
    assert CHIP.drive_time(0.0) == CHIP.drive_time(-1e-6) == 0.0
    assert replace(CHIP, t_min=1e-4).drive_time(1e-5) == pytest.approx(7e-4, rel=1e-14)
    curved = replace(CHIP, t_min=1e-4, tau_s=0.02)
    full = 0.02 / 60.0 * (math.exp((0.02 - 1e-4) / 0.02) - 1.0)  # the error that drives for a whole frame
    assert curved.drive_time(full) == pytest.approx(0.02, rel=1e-14)


# --- certificate of whole runs ----------------------------------------------------------------------------------------


def check_pieces(S: Shaft, run: PulseRun) -> None:
    """Each piece starts where the last one ended, obeys the equation of motion, or rests within its bounds."""
    for a, b in pairwise(run.pieces):
        assert (a.t_end, a.q_end) == (b.t, pytest.approx(b.q, abs=1e-15))
    for p in run.pieces:
        if p.direction == 0:
            for t in (p.t, p.t_end):
                torque = S.K * S.current(p.drive, 0.0) - S.external(t, p.q)
                assert p.q == S.lower or torque >= -S.breakaway * S.backward - S.coulomb - 1e-14
                assert p.q == S.upper or torque <= S.breakaway * S.forward + S.coulomb + 1e-14
        elif p.t_end - p.t > 1e-9:
            y = solve_ivp(lambda t, y, p=p: (y[1], slope_of(S, p.drive, p.direction, t, y[0], y[1])),
                          (p.t, p.t_end), (p.q, p.w), method="DOP853", rtol=1e-12, atol=1e-15,
                          max_step=0.05 * (p.t_end - p.t), dense_output=True)  # its estimate is blind to a kink
            assert abs(y.y[0, -1] - p.q_end) < 1e-14
            assert abs(y.y[1, -1] - p.w_end) < 1e-13 * (1.0 + abs(p.w))
            inside = y.sol(np.linspace(p.t, p.t_end, 9)[1:-1])
            assert np.all(p.direction * inside[1] > -1e-11)
            assert np.all((inside[0] >= S.lower - 1e-13) & (inside[0] <= S.upper + 1e-13))


def drive_by_formula(chip: Chip, run: PulseRun, t: float) -> int:
    """Sign of the drive at t: frame k drives during [d_k, min(d_k + t_on, d_k+1)), unless the timeout came between."""
    edges = np.array([edge for edge, _, _ in run.frames])
    starts = [edge + max(t_in, T_os) for edge, t_in, T_os in run.frames]
    for k, (_, t_in, T_os) in enumerate(run.frames):
        e = t_in - T_os
        until = starts[k] + chip.drive_time(abs(e) - 0.5 * chip.deadband)
        if starts[k] <= t < min(until, starts[k + 1] if k + 1 < len(starts) else math.inf):
            seen = edges[edges <= t]
            lapses = [a + chip.timeout for a, b in pairwise([*seen, math.inf]) if a + chip.timeout <= min(b, t)]
            return 0 if any(starts[k] <= lapse for lapse in lapses) or seen[-1] + chip.timeout <= starts[k] else (
                1 if e > 0 else -1)
    return 0


def check_frames(case: PulseCase, run: PulseRun, times: np.ndarray) -> None:
    """The one-shots follow from the state at their edges, and the drive from the one-shots."""
    S, chip = case.shaft, case.chip
    at_edges = case.solve([edge for edge, _, _ in run.frames])
    for n, (edge, t_in, T_os) in enumerate(run.frames):
        q, w, s = at_edges.q[n], at_edges.w[n], int(at_edges.drive[n])
        v = chip.p * q + chip.b_o + chip.beta * S.terminal(s, w) + chip.c_s * (S.bus(s, w) - S.V_oc)
        assert T_os == max(0.0, chip.T_0 + chip.slope * v)
        assert t_in == case.width(edge)
    if case.edges is None:
        assert set(edge for edge, _, _ in run.frames) <= {k * chip.period for k in range(1000)}
    want = [drive_by_formula(chip, run, t) for t in times]
    clear = ~run.near_event(times)
    np.testing.assert_array_equal(run.drive[clear], np.array(want)[clear])


@pytest.mark.long(but="0")
@pytest.mark.parametrize("seed", range(6))
def test_runs_satisfy_the_specification(seed: int) -> None:
    case = random_pulse_case(5000 + seed)
    times = np.linspace(0.0, case.duration, 401)
    run = case.solve(times)
    check_pieces(case.shaft, run)
    check_frames(case, run, times)


@pytest.mark.long(but="1")
@pytest.mark.parametrize("seed", range(20))
def test_power_balance(seed: int) -> None:
    """Kinetic energy gained = work of motor, drag, friction and load, by quadrature over the pieces; without stops."""
    case = random_pulse_case(6000 + seed)
    if "stops" in case.servo:
        case = replace(case, shaft=replace(case.shaft, lower=-math.inf, upper=math.inf))
    S, run = case.shaft, case.solve([])
    x, weight = np.polynomial.legendre.leggauss(16)
    moving = [p for p in run.pieces if p.direction and p.t_end > p.t]
    cuts = [t for p in moving for t in np.linspace(p.t, p.t_end, 5)[:-1]]
    nodes = np.array([p.t + 0.25 * (p.t_end - p.t) * (n + 0.5 * (1.0 + x)) for p in moving for n in range(4)])
    weights = np.array([0.125 * (p.t_end - p.t) * weight for p in moving for _ in range(4)])
    assert len(cuts) == nodes.shape[0]
    state = case.solve(nodes.ravel())
    direction = np.repeat([p.direction for p in moving], 64)
    rate = [slope_of(S, int(s), int(d), t, q, w) * S.J * w for s, d, t, q, w in zip(
        state.drive, direction, nodes.ravel(), state.q, state.w, strict=True)]
    first, last = run.pieces[0], case.solve([case.duration])
    gained = 0.5 * S.J * (last.w[0] ** 2 - first.w**2)
    scale = float(weights.ravel() @ np.abs(rate))
    assert abs(float(weights.ravel() @ np.array(rate)) - gained) < 1e-11 * scale + 1e-15


@pytest.mark.parametrize("seed", range(20))
def test_order_and_step_do_not_matter(seed: int) -> None:
    case = random_pulse_case(7000 + seed)
    times = np.linspace(0.0, case.duration, 101)
    a, b = case.solve(times), case.solve(times, order=18, max_step=3e-4)
    np.testing.assert_allclose(a.q, b.q, rtol=0.0, atol=2e-12)
    assert [kind for _, kind in a.events] == [kind for _, kind in b.events]
    np.testing.assert_allclose([t for t, _ in a.events], [t for t, _ in b.events], rtol=0.0, atol=1e-11)


# --- situations with known answers ------------------------------------------------------------------------------------


def test_no_pulse_creeps_under_brake_and_falls_under_coast() -> None:
    S = replace(SHAFT, torques=(0.6,), V_br=0.0, B=0.0)
    held = solve_pulse(S, CHIP, lambda t: 1.5e-3, 1.0, [1.0], edges=[])
    assert held.w[0] == pytest.approx(-(0.6 - S.backward) * S.R_a / (S.K * S.K_b), rel=1e-12)
    free = solve_pulse(replace(S, coasts=True), CHIP, lambda t: 1.5e-3, 0.05, [0.05], edges=[])
    assert free.w[0] == pytest.approx(-(0.6 - S.backward) / S.J * 0.05, rel=1e-12)
    assert [kind for _, kind in free.events] == ["release"]


def test_saturated_rise_is_an_exponential() -> None:
    """A drive that outlasts the run: w = w_inf (1 − exp(−t/T)), braked again where the timeout ends it."""
    S, chip = replace(SHAFT, V_br=0.0), replace(CHIP, gain=1e4, timeout=0.08)
    run = solve_pulse(S, chip, lambda t: 2.4e-3, 0.2, [0.05, 0.2], edges=[0.0], y0=(0.0, 0.0))
    start, R = 2.4e-3, S.R_a + S.R_b + S.r_c
    drag = S.K * S.K_b / R + S.B
    w_inf, T = (S.K * (S.V_oc - S.V_ce0) / R - S.forward) / drag, S.J / drag
    assert run.w[0] == pytest.approx(w_inf * -math.expm1(-(0.05 - start) / T), rel=1e-13)
    assert (0.08, "drive_end") in run.events
    top, drag = w_inf * -math.expm1(-(0.08 - start) / T), S.K * S.K_b / S.R_a + S.B
    stop = -S.J / drag * math.log((S.forward / drag) / (top + S.forward / drag))
    assert next(t for t, k in run.events if k == "stick") == pytest.approx(0.08 + stop, rel=1e-13)


def test_a_later_decision_that_comes_first_replaces_the_earlier_one() -> None:
    """Edge 1 decides before edge 0 does: by the formula, frame 0 never drives."""
    chip = replace(CHIP, beta=0.0)
    run = solve_pulse(SHAFT, chip, lambda t: 2.4e-3 if t < 5e-4 else 1.2e-3, 0.02, np.linspace(0, 0.02, 201),
                      edges=[0.0, 1e-3], y0=(-0.2, 0.0))
    assert [k for _, k in run.events].count("decision") == 1
    early = solve_pulse(SHAFT, chip, lambda t: 1.2e-3, 0.02, np.linspace(0, 0.02, 201), edges=[1e-3], y0=(-0.2, 0.0))
    np.testing.assert_array_equal(run.q, early.q)


def test_two_decisions_pending_drive_one_after_the_other() -> None:
    chip = replace(CHIP, period=1.0e-3)
    run = solve_pulse(SHAFT, chip, lambda t: 1.9e-3, 0.01, [0.0019, 0.0021, 0.0095], y0=(1.0, 0.0))
    decisions = [t for t, k in run.events if k == "decision"]
    np.testing.assert_allclose(decisions, 1e-3 * np.arange(len(decisions)) + 1.9e-3, rtol=0.0, atol=1e-15)
    assert len(decisions) == 9
    assert run.drive.tolist() == [1, 1, 1]


# --- cases ------------------------------------------------------------------------------------------------------------

OPTIONS = ("minimum_drive_time", "stretcher_time_constant", "back_emf_injection", "supply_coupling", "pulse_timeout",
           "pulse_width_min", "pulse_width_max")


def features(case: PulseCase) -> set[str]:
    found = {name for name in OPTIONS if name in case.servo["electronics"]} | set(case.load) | set(case.initial)
    found |= {case.command["kind"], case.command["unit"], case.servo["electronics"]["off_state"]}
    found |= {"R_b"} if case.shaft.R_b else set()
    found |= {"r_c"} if case.shaft.r_c else set()
    found |= {"V_br"} if case.shaft.V_br else set()
    found |= {"V_ce0"} if case.shaft.V_ce0 else set()
    found |= {"stops"} if "stops" in case.servo else set()
    found |= {"no deadband"} if not case.chip.deadband else set()
    found |= {"breakaway"} if case.shaft.breakaway > 1.0 else set()
    found |= {"frame_period"} if "frame_period" in case.command else set()
    return found


def test_every_option_meets_every_other() -> None:
    met: set[frozenset[str]] = set()
    for seed in range(600):
        names = sorted(features(random_pulse_case(seed)))
        met |= {frozenset((a, b)) for a in names for b in names}
    always = {name for pair in met for name in pair} - {"us", "deg", "V"}
    options = sorted(always & {*OPTIONS, "R_b", "r_c", "V_br", "V_ce0", "stops", "breakaway", "brake", "coast",
                               "pulse_train", "output_angle", "output_speed", "pendulum", "recorded", "spring"})
    missing = [(a, b) for a in options for b in options if frozenset((a, b)) not in met and {a, b} != {"brake", "coast"}
               and not {a, b} & {"recorded"}]
    assert missing == []
    assert {"constant", "coulomb", "inertia", "viscous", "recorded", "frame_period", "no deadband"} <= always


def test_cases_are_repeatable() -> None:
    a, b = random_pulse_case(3), random_pulse_case(3)
    assert (a.servo, a.load, a.command, a.initial, a.shaft) == (b.servo, b.load, b.command, b.initial, b.shaft)


@pytest.mark.parametrize("kind", LOADS)
def test_every_load_runs(kind: str) -> None:
    for seed in range(4):
        case = random_pulse_case(900 + seed, load=kind)
        run = case.solve(np.linspace(0.0, case.duration, 11))
        assert run.q.shape == (11,)
        assert np.all((run.q >= case.shaft.lower) & (run.q <= case.shaft.upper))
