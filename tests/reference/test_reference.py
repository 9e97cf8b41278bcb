"""Checks of the reference itself: closed forms, power balance, convergence, and independent integrations."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from .cases import COMMANDS, DURATION, LOADS, command_signal, random_case
from .hybrid import armature_voltage
from .reference import (
    Load,
    Plant,
    solve_averaged,
    solve_averaged_inductive,
    solve_bounded,
    solve_dc_motor,
    solve_geared_motor,
)

N = 250.0
SERVO = Plant(
    R=3.1, L=4e-4, k_a=1.03 / N, k_b=1.03 / N, J_m=6e-3 / N**2, B_m=2e-3 / N**2, N=N, F1=0.2 / N, F2=0.16 / N, k=0.5,
    A_ks=22.8, p=0.42, b_o=0.59, w_v=6e-3, V_max=5.6,
)
FREE = replace(SERVO, F1=0.0, F2=0.0)


def affine(A: np.ndarray, b: np.ndarray, y0: np.ndarray, t: float) -> np.ndarray:
    """Solution of y' = A y + b."""
    n = y0.size
    M = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n] = A, b
    return (expm(M * t) @ np.append(y0, 1.0))[:n]


def gauss(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of 12-point Gauss quadrature on each interval between edges."""
    x, weight = np.polynomial.legendre.leggauss(12)
    half = 0.5 * np.diff(edges)
    return (edges[:-1, None] + half[:, None] * (x + 1.0)).ravel(), (half[:, None] * weight).ravel()


# --- linear cases against the matrix exponential --------------------------------------------------------------------


def test_dc_motor_is_the_matrix_exponential() -> None:
    P, times = SERVO, np.linspace(0.0, 0.2, 21)
    A = np.array([[0, 1, 0], [0, -P.B_m / P.J_m, P.k_a / P.J_m], [0, -P.k_b / P.L, -P.R / P.L]])
    got = solve_dc_motor(P, lambda t: 5.0 if t < 0.1 else -2.0, 0.2, times, breaks=(0.1,))
    y = np.zeros(3)
    at_break = affine(A, np.array([0, 0, 5.0 / P.L]), y, 0.1)
    for n, t in enumerate(times):
        u, start, t0 = (5.0, y, 0.0) if t < 0.1 else (-2.0, at_break, 0.1)
        q, w, i = affine(A, np.array([0, 0, u / P.L]), start, t - t0)
        assert abs(got.q[n] - q) < 1e-11 * 60
        assert abs(got.w[n] - w) < 1e-11 * 1200
        assert abs(got.i[n] - i) < 1e-11


def test_geared_motor_is_the_matrix_exponential() -> None:
    load = Load(J_L=2e-3, B_L=1e-3, tau=lambda t: 0.03, stiffness=0.2, rest=0.4)
    P, times = replace(SERVO, load=load), np.linspace(0.0, 0.5, 11)
    J, B = N**2 * P.J_m + 2e-3, N**2 * P.B_m + 1e-3
    A = np.array([[0, 1, 0], [-0.2 / J, -B / J, N * P.k_a / J], [0, -P.k_b * N / P.L, -P.R / P.L]])
    b = np.array([0.0, (0.2 * 0.4 - 0.03) / J, 3.0 / P.L])
    got = solve_geared_motor(P, lambda t: 3.0, 0.5, times, y0=(0.1, -0.2, 0.05))
    want = np.array([affine(A, b, np.array([0.1, -0.2, 0.05]), t) for t in times])
    np.testing.assert_allclose(np.stack([got.q, got.w, got.i], axis=1), want, rtol=0, atol=3e-12)


def test_geared_motor_refuses_coulomb_load() -> None:
    with pytest.raises(ValueError, match="Coulomb"):
        solve_geared_motor(replace(SERVO, load=Load(coulomb=0.1)), lambda t: 1.0, 0.1, np.array([0.1]))


@pytest.mark.parametrize("solver", [solve_averaged, solve_bounded])
def test_frictionless_servo_is_the_matrix_exponential(solver) -> None:
    P, times = replace(FREE, w_v=0.0), np.linspace(0.0, 0.6, 25)
    drive = N * P.k_a / P.R
    A = np.array([[0, 1], [-drive * P.A_ks * P.p / P.J, -(drive * P.k_b * N + P.B) / P.J]])
    b = np.array([0.0, drive * P.A_ks * (1.0 - P.b_o) / P.J])
    y0 = np.array([(1.0 - P.b_o) / P.p - 0.3, 0.4])  # the error stays inside the linear zone
    got = solver(P, lambda t: 1.0, 0.6, times, y0)
    want = np.array([affine(A, b, y0, t) for t in times])
    np.testing.assert_allclose(np.stack([got.q, got.w], axis=1), want, rtol=0, atol=1e-12)


def test_frictionless_inductive_servo_is_the_matrix_exponential() -> None:
    P, times = FREE, np.linspace(0.0, 0.6, 25)
    A = np.array([
        [0, 1, 0], [0, -P.B / P.J, N * P.k_a / P.J], [-P.A_ks * P.p / P.L, -P.k_b * N / P.L, -P.R / P.L],
    ])
    b = np.array([0.0, 0.0, P.A_ks * (1.0 - P.b_o) / P.L])
    got = solve_averaged_inductive(P, lambda t: 1.0, 0.6, times, (0.2, 0.0, 0.0))
    want = np.array([affine(A, b, np.array([0.2, 0.0, 0.0]), t) for t in times])
    np.testing.assert_allclose(np.stack([got.q, got.w, got.i], axis=1), want, rtol=0, atol=1e-11)


# --- closed forms of the bounded servo --------------------------------------------------------------------------------


def test_saturated_rise_without_load() -> None:
    """w = w_inf (1 - exp(-t/T)) while the drive is saturated, Coulomb friction taken off the stall torque."""
    P, times = SERVO, np.linspace(0.0, 0.2, 41)
    K, J = N * P.k_a, P.J
    drag = K**2 / P.R + P.B
    w_inf, T = (K * P.V_max / P.R - N * P.F1) / drag, J / drag
    got = solve_bounded(P, lambda t: 10.0, 0.2, times, (0.0, 0.0))
    np.testing.assert_allclose(got.w, w_inf * -np.expm1(-times / T), rtol=0, atol=1e-11)
    np.testing.assert_allclose(got.q, w_inf * (times + T * np.expm1(-times / T)), rtol=0, atol=1e-12)
    assert [kind for _, kind in got.events] == ["release_forward"]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_release_time_under_a_rising_torque(sign: float) -> None:
    """Unpowered, breakaway 1.4: leaves where |τ|/N = r F + coulomb/N, in the direction of the push."""
    load = Load(tau=lambda t: sign * 0.5 * t, coulomb=0.03)
    P = replace(SERVO, r=1.4, load=load)
    v_c = P.b_o  # q = 0 is the centre of the deadband
    got = solve_bounded(P, lambda t: v_c, 1.0, np.linspace(0.0, 1.0, 11))
    F = P.F2 if sign > 0 else P.F1
    when, kind = got.events[0]
    assert kind == ("release_backward" if sign > 0 else "release_forward")
    assert abs(when - (1.4 * F * N + 0.03) / 0.5) < 1e-14
    assert np.all(got.q[np.linspace(0.0, 1.0, 11) < when] == 0.0)
    assert got.q[-1] * sign < 0.0


def test_sticks_within_the_band_for_ever() -> None:
    P = replace(SERVO, load=Load(tau=lambda t: 0.1999))  # holds: pushed towards -q, bound F1 does not matter
    held = solve_bounded(replace(P, F2=0.2 / N), lambda t: P.b_o, 1.0, np.array([1.0]))
    assert held.q[0] == 0.0
    assert held.events == ()
    slipped = solve_bounded(replace(P, F2=0.1998 / N), lambda t: P.b_o, 1.0, np.array([1.0]))
    assert slipped.events[0] == (0.0, "release_backward")


def test_ball_bouncing_on_a_stop() -> None:
    """No motor, no friction, constant torque: hits at t1 (1 + 2 e + 2 e² + ...) until a rebound is below 1e-6 rad/s.

    The stop is at 0: elsewhere the rounding of q, divided by the speed, is the error of the last times.
    """
    e, height, a = 0.5, 0.8, 40.0
    P = replace(FREE, B_m=0.0, k_b=0.0, A_ks=0.0, lower=0.0, restitution=e, V_max=0.0)
    P = replace(P, load=Load(tau=lambda t: a * P.J))
    t1 = math.sqrt(2.0 * height / a)
    got = solve_bounded(P, lambda t: 0.0, 1.5, np.array([0.5 * t1, t1 * (1.0 + e), 1.5]), (height, 0.0))
    hits = [t for t, kind in got.events if kind == "stop_hit"]
    speeds = a * t1 * e ** np.arange(1, 60)
    count = int(np.sum(speeds >= 1e-6)) + 1
    want = t1 * (1.0 + 2.0 * np.concatenate([[0.0], np.cumsum(e ** np.arange(1, count))]))
    assert len(hits) == count
    np.testing.assert_allclose(hits, want, rtol=0, atol=2e-14)
    assert got.events[-1] == (hits[-1], "stop_rest")
    np.testing.assert_allclose(got.q, [0.75 * height, height * e**2, 0.0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(got.w, [-0.5 * a * t1, 0.0, 0.0], rtol=0, atol=1e-12)


def test_leaves_a_stop_by_the_sticking_rule() -> None:
    """Driven into the upper stop, then the torque that pushes back grows past drive and friction."""
    P = replace(SERVO, upper=0.5, r=1.2, load=Load(tau=lambda t: 3.0 * t))
    got = solve_bounded(P, lambda t: 2.0, 1.5, np.array([0.4, 1.5]), (0.45, 0.0))
    kinds = [kind for _, kind in got.events]
    assert kinds[:4] == ["release_forward", "stop_hit", "stop_rest", "stop_release_backward"]
    v_a = armature_voltage(P, 2.0 - (P.p * 0.5 + P.b_o))
    assert v_a == P.V_max
    assert abs(got.events[3][0] - N * (P.k_a * v_a / P.R + 1.2 * P.F2) / 3.0) < 1e-14
    assert got.q[0] == 0.5
    assert got.q[1] < 0.5


def test_mean_voltage_servo_of_the_specification() -> None:
    """Set S of the specification: sag about 2.2° at 0.3 N·m; a 2° step does not move it."""
    s_r = 735.6
    P = Plant(
        R=3.1, k_a=1.03 / N, k_b=1.03 / N, J_m=6e-3 / N**2, N=N, F1=0.2 / N, F2=0.2 / N,
        A_ks=5.6 * 60.0 / (0.02 * s_r), p=573e-6 * s_r, b_o=0.5, w_v=8e-6 * s_r, V_max=5.6,
    )
    sag = solve_bounded(replace(P, load=Load(tau=lambda t: 0.3)), lambda t: 1.0, 2.0, np.array([0.0, 2.0])).q
    assert abs(math.degrees(sag[0] - sag[1]) - 2.2) < 0.1
    small = math.radians(2.0) * P.p
    still = solve_bounded(P, lambda t: 1.0 + (small if t >= 0 else 0.0), 1.0, np.array([1.0]), breaks=(0.0,))
    assert still.events == ()


# --- properties on random cases ---------------------------------------------------------------------------------------


@pytest.mark.long
def test_power_balance_of_the_bounded_servo() -> None:
    """Kinetic energy gained = work of motor, drag, friction and load, by quadrature from event to event."""
    for seed in range(4):
        c = random_case(np.random.default_rng(seed), stops=False)
        P = c.plant
        cuts = {t for t, _ in solve_bounded(P, c.v_c, DURATION, [], breaks=c.breaks).events}
        cuts |= {t for t in (*c.breaks, *P.load.tau_breaks) if 0 < t < DURATION} | set(np.linspace(0, DURATION, 151))
        t, weight = gauss(np.array(sorted(cuts)))
        run = solve_bounded(P, c.v_c, DURATION, np.append(t, DURATION), breaks=c.breaks)
        q, w = run.q[:-1], run.w[:-1]
        v_a = np.array([armature_voltage(P, c.v_c(x) - (P.p * y + P.b_o)) for x, y in zip(t, q, strict=True)])
        motor = P.N * P.k_a * (v_a - P.k_b * P.N * w) / P.R
        friction = P.B * w + np.sign(w) * (P.N * np.where(w > 0, P.F1, P.F2) + P.load.coulomb)
        ext = np.array([P.load.external(x, y) for x, y in zip(t, q, strict=True)])
        work = float(weight @ (w * (motor - friction - ext)))
        assert abs(work - 0.5 * P.J * run.w[-1] ** 2) < 1e-10 * float(weight @ np.abs(w * motor)) + 1e-13


def test_power_balance_of_the_averaged_servo() -> None:
    for seed in range(4):
        c = random_case(np.random.default_rng(seed))
        P = replace(c.plant, F2=c.plant.F1, k=0.02)  # smooth, so that quadrature needs no events
        cuts = {t for t in (*c.breaks, *P.load.tau_breaks) if 0 < t < DURATION} | set(np.linspace(0, DURATION, 601))
        t, weight = gauss(np.array(sorted(cuts)))
        run = solve_averaged(P, c.v_c, DURATION, np.append(t, DURATION), breaks=c.breaks)
        q, w = run.q[:-1], run.w[:-1]
        v_a = P.A_ks * (np.array([c.v_c(x) for x in t]) - P.p * q - P.b_o)
        motor = P.N * P.k_a * (v_a - P.k_b * P.N * w) / P.R
        friction = P.B * w + (P.N * P.F1 + P.load.coulomb) * np.tanh(P.k * P.N * w)
        ext = np.array([P.load.external(x, y) for x, y in zip(t, q, strict=True)])
        work = float(weight @ (w * (motor - friction - ext)))
        assert abs(work - 0.5 * P.J * run.w[-1] ** 2) < 1e-9 * float(weight @ np.abs(w * motor)) + 1e-13


@pytest.mark.long
def test_bounded_servo_does_not_depend_on_step_and_tolerance() -> None:
    times = np.linspace(0.0, DURATION, 51)
    for seed in range(100, 106):
        c = random_case(np.random.default_rng(seed))
        a = solve_bounded(c.plant, c.v_c, DURATION, times, breaks=c.breaks)
        b = solve_bounded(c.plant, c.v_c, DURATION, times, breaks=c.breaks, rtol=1e-11, max_step=7e-4)
        np.testing.assert_allclose(a.q, b.q, rtol=0, atol=1e-12)
        assert [k for _, k in a.events] == [k for _, k in b.events]
        np.testing.assert_allclose([t for t, _ in a.events], [t for t, _ in b.events], rtol=0, atol=1e-11)


@pytest.mark.long
@pytest.mark.parametrize("solver", [solve_averaged, solve_averaged_inductive])
def test_averaged_servos_do_not_depend_on_tolerance(solver) -> None:
    times = np.linspace(0.0, DURATION, 51)
    for seed in range(200, 204):
        c = random_case(np.random.default_rng(seed))
        a = solver(c.plant, c.v_c, DURATION, times, breaks=c.breaks)
        b = solver(c.plant, c.v_c, DURATION, times, breaks=c.breaks, tol=1e-10)
        np.testing.assert_allclose(a.q, b.q, rtol=0, atol=3e-11)


def test_inductive_tends_to_the_plain_averaged_servo() -> None:
    times = np.linspace(0.0, 0.6, 13)
    plain = solve_averaged(SERVO, lambda t: 1.2 if t >= 0 else 0.9, 0.6, times)
    gap = [
        np.max(np.abs(solve_averaged_inductive(
            replace(SERVO, L=L), lambda t: 1.2 if t >= 0 else 0.9, 0.6, times).q - plain.q))
        for L in (2e-5, 1e-5)
    ]
    assert gap[0] < 1e-3
    assert abs(math.log2(gap[0] / gap[1]) - 1.0) < 0.15


# --- independent integrations -----------------------------------------------------------------------------------------


@pytest.mark.long
def test_averaged_servo_against_scipy() -> None:
    """SciPy's Radau on the equation as printed, (41) with its two branches and sgn."""
    P, times = replace(SERVO, load=Load(J_L=1e-3, pendulum=0.1, hanging=0.3, coulomb=0.02)), np.linspace(0.0, 0.5, 11)

    def v_c(t: float) -> float:
        return 1.2 + 0.15 * math.sin(2.0 * math.pi * 3.0 * t)

    def f(t: float, y: np.ndarray) -> list[float]:
        q, w = float(y[0]), float(y[1])
        sgn = (w > 0) - (w < 0)
        fec = math.tanh(P.k * N * w) * (P.F1 * (1 + sgn) + P.F2 * (1 - sgn)) / 2
        i_a = (P.A_ks * (v_c(t) - P.p * q - P.b_o) - P.k_b * N * w) / P.R
        tau = 0.1 * math.sin(q - 0.3) + 0.02 * math.tanh(P.k * N * w)
        return [w, (N * P.k_a * i_a - N**2 * P.B_m * w - N * fec - tau) / (N**2 * P.J_m + 1e-3)]

    got = solve_averaged(P, v_c, 0.5, times, (1.0, 0.0))
    want = solve_ivp(f, (0.0, 0.5), [1.0, 0.0], method="Radau", t_eval=times, rtol=1e-9, atol=1e-11).y
    np.testing.assert_allclose(got.q, want[0], rtol=0, atol=2e-8)
    np.testing.assert_allclose(got.w, want[1], rtol=0, atol=5e-7)


@pytest.mark.slow
def test_averaged_servo_against_thirty_digits() -> None:
    mpmath = pytest.importorskip("mpmath")
    P = replace(SERVO, F2=SERVO.F1, k=0.02)
    with mpmath.workdps(30):
        m = mpmath.mpf

        def f(t, y):
            q, w = y
            v_c = m(1.25) + m(0.125) * mpmath.sin(20 * t)
            i_a = (m(P.A_ks) * (v_c - m(P.p) * q - m(P.b_o)) - m(P.k_b) * N * w) / m(P.R)
            fric = m(N) * m(P.F1) * mpmath.tanh(m(P.k) * N * w)
            return [w, (N * m(P.k_a) * i_a - N**2 * m(P.B_m) * w - fric) / (N**2 * m(P.J_m))]

        exact = mpmath.odefun(f, 0, [m(1), m(0)])(m(0.015625))
        exact = [float(x) for x in exact]
    got = solve_averaged(P, lambda t: 1.25 + 0.125 * math.sin(20 * t), 0.015625, np.array([0.015625]), (1.0, 0.0))
    assert abs(got.q[0] - exact[0]) < 1e-14
    assert abs(got.w[0] - exact[1]) < 1e-12


def plain_euler(c, h: float) -> float:
    """Angle at the end by the crudest method: fixed small steps, the sticking rule applied wherever w changes sign."""
    P, t = c.plant, 0.0
    q, w = (c.v_c(-1.0) - P.b_o) / P.p, 0.0
    for n in range(round(DURATION / h)):
        t = n * h
        v_a = armature_voltage(P, c.v_c(t) - P.p * q - P.b_o)
        ext, own = P.load.external(t, q), P.load.coulomb / P.N
        if w == 0.0:
            tau = P.k_a * v_a / P.R - ext / P.N
            if -P.r * P.F2 - own <= tau <= P.r * P.F1 + own:
                continue
            d = 1 if tau > 0 else -1
        else:
            d = 1 if w > 0 else -1
        i_a = (v_a - P.k_b * P.N * w) / P.R
        fric = d * (P.N * (P.F1 if d > 0 else P.F2) + P.load.coulomb)
        new = w + h * (P.N * P.k_a * i_a - P.B * w - fric - ext) / P.J
        if new * d <= 0.0:
            new = 0.0
        q, w = q + 0.5 * h * (w + new), new
        if not P.lower < q < P.upper:
            q = min(max(q, P.lower), P.upper)
            w = -P.restitution * w if abs(w) > 0.02 else 0.0
    return q


@pytest.mark.long
def test_bounded_servo_against_plain_steps() -> None:
    """Looks for a misreading, not for digits: both come from the same sentences by different code."""
    for n, kind in enumerate(LOADS):
        rng, command = np.random.default_rng(300 + n), COMMANDS[n % len(COMMANDS)]
        c = random_case(rng, load=kind, command=command, stops=n % 2 == 0)
        exact = solve_bounded(c.plant, c.v_c, DURATION, [DURATION], breaks=c.breaks).q[0]
        coarse, fine = (abs(plain_euler(c, h) - exact) for h in (8e-5, 2e-5))
        assert fine < 3e-3
        assert fine < coarse + 2e-4


# --- cases ------------------------------------------------------------------------------------------------------------


def test_cases_are_repeatable_and_complete() -> None:
    a, b = (random_case(np.random.default_rng(7)) for _ in range(2))
    assert (a.servo, a.load, a.command, a.breaks) == (b.servo, b.load, b.command, b.breaks)
    servo, _load, _command, plant, v_c, _breaks = a
    gains = servo["electronics"]
    k_p = gains["voltage_to_pulse_gain"] * gains["pulse_to_voltage_gain"]
    v_i, _ = command_signal(a.command)
    assert v_c(0.4) == k_p * v_i(0.4) + gains["command_offset"]
    assert plant.V_max == servo["supply"]["open_circuit_voltage"] - servo["supply"]["bridge_drop_voltage"]


@pytest.mark.long(but="inertia")
@pytest.mark.parametrize("kind", LOADS)
def test_every_load_and_command_runs(kind: str) -> None:
    for n, command in enumerate(COMMANDS):
        c = random_case(np.random.default_rng(n), load=kind, command=command)
        run = solve_bounded(c.plant, c.v_c, 0.3, np.linspace(0.0, 0.3, 7), breaks=c.breaks)
        assert run.q.shape == (7,)
        assert np.all(np.isfinite(run.q))
        assert np.all((run.q >= c.plant.lower) & (run.q <= c.plant.upper))
