"""A servo with play in its gear, leg by leg: two bodies against a fine solution, and momentum."""

import math
from itertools import product

import pytest
from scipy.integrate import solve_ivp

from lane_cases import replaced
from models.test_arcs import NUMBERS, OPEN
from servotwin.models.engine.batch import backlash_batch
from servotwin.models.state.modes import INSIDE, Vector
from servotwin.models.terms.shaft import Shaft

HALF = 6e-3
LOOSE = replaced(NUMBERS, {"play.half": HALF, "shaft": Shaft(6e-3, 1.5e-3, 2e-3, 5e-4)})
SERVOS = {
    "braked": LOOSE, "open": replaced(LOOSE, OPEN), "drops": replaced(LOOSE, {"bridge.D_drive": 0.4}),
    "dry load": replaced(LOOSE, {"load.coulomb": 0.05}),
    "load friction": replaced(LOOSE, {"friction.varies": 1.0, "friction.K_m": 0.4, "friction.K_e": 0.2}),
    "load friction and drops": replaced(LOOSE, {"friction.varies": 1.0, "friction.K_m": 0.7, "bridge.D_drive": 0.4})}


def current(numbers, drive, w_m):
    path, V = numbers.bridge, drive * numbers.source.V
    D, R = (path.D_drive, path.R_drive) if drive else (path.off.D, path.off.R)
    x = V - numbers.motor.K_b * w_m
    return 0.0 if abs(x) <= D else (x - math.copysign(D, x)) / R


def rates(numbers, torque, drive):
    """Return what gives the rates of two bodies that slide, and what they do not: stop or meet."""
    own, dry = numbers.shaft, numbers.friction

    def of(_, y):
        _, w, _, w_m = y
        drives = numbers.motor.K * current(numbers, drive, w_m)
        f_m = math.copysign((dry.F_forward if w_m > 0.0 else dry.F_backward) + dry.K_m * abs(drives), w_m)
        f = math.copysign(numbers.load.coulomb, w)
        return [w, (-own.b_out * w - f - torque) / own.J_out,
                w_m, (drives - (own.b - own.b_out) * w_m - f_m) / (own.J - own.J_out)]

    def meets(_, y):
        return HALF - abs(y[2] - y[0])

    def stops(_, y):
        return min(abs(y[3]), abs(y[1]) if numbers.load.coulomb > 0.0 else 1.0) - 1e-3

    meets.terminal = stops.terminal = True
    return of, (meets, stops)


@pytest.mark.parametrize("name", SERVOS)
def test_two_bodies_against_a_fine_solution(name):
    """To where they meet or one is about to stop, and 20 ms at most; then, once they have met, momentum is kept."""
    numbers, met = SERVOS[name], 0
    own = numbers.shaft
    for drive, torque, (w, w_m) in product((-1.0, 0.0, 1.0), (0.0, -0.3, 0.2),
                                           ((0.1, 1.0), (-1.0, 0.5), (2.0, -1.5), (-2.0, -1.9))):
        of, events = rates(numbers, torque, drive)
        start = [0.3, w, 0.301, w_m]
        run = solve_ivp(of, (0.0, 0.02), start, method="DOP853", rtol=1e-12, atol=1e-14, events=events)
        end, y = run.t[-1], run.y[:, -1]
        if len(run.t_events[0]):
            met += 1
            after = go(numbers, torque, drive, start, end + 1e-9)
            assert own.J_out * after.y.w + (own.J - own.J_out) * after.y.w_m == pytest.approx(
                own.J_out * y[1] + (own.J - own.J_out) * y[3], abs=1e-8)
            assert abs(after.y.w - after.y.w_m) < 1e-6  # one speed
        before = go(numbers, torque, drive, start, end - 1e-9)
        assert before.mode.mesh == INSIDE
        at = [x - 1e-9 * rate for x, rate in zip(y, of(end, y), strict=True)]
        found = [before.y.q, before.y.w, before.y.q_m, before.y.w_m]
        assert found == pytest.approx(at, abs=3e-10), (drive, torque, w, w_m)
    assert met > 3


def go(numbers, torque, drive, start, time):
    q, w, q_m, w_m = start
    return backlash_batch.gone(numbers, torque, drive, Vector(q, w, 0.0, 0.0, 0.0, q_m, w_m), INSIDE, q, time,
                               1e-12)
