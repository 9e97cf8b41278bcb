"""The legs of a servo with armature inductance: what they are, and where they end."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from lane_cases import replaced
from servotwin.models.engine.batch.segments import inductive_segments
from servotwin.models.state.modes import CONDUCTING, CURRENT_BACKWARD, CURRENT_FORWARD, NO_CURRENT
from servotwin.models.terms.bridge import Bridge, Off
from servotwin.models.terms.friction import NO_FRICTION
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.source import Source

SERVO = Numbers(
    shaft=Shaft(J=6e-3, b=5e-3, J_out=0.0, b_out=0.0), motor=Motor(K=0.8, K_b=0.82, R=3.0, L=5e-4),
    friction=NO_FRICTION._replace(F_forward=0.12, F_backward=0.15, breakaway=1.3), source=Source(6.0, 0.05, math.inf),
    bridge=Bridge(D_drive=0.3, R_drive=3.1, off=Off(0.2, 3.0, 0.0), silence=Off(0.2, 3.0, 0.0), V_br=0.2))
K, K_b, J, b, R = 0.8, 0.82, 6e-3, 5e-3, 3.1
TORQUE = 0.05  # N m


def equal_inductance():
    """Return the inductance at which both rates of a driven servo are equal: (R/L − b/J)² = 4 K K_b/(L J)."""
    x = np.roots([R * R, -2.0 * R * b / J - 4.0 * K * K_b / J, (b / J) ** 2])
    return 1.0 / float(np.max(x.real))


def reference(L, voltage, R_loop, dry, state, time):
    """Return angle, speed and current by the matrix exponential."""
    rates = np.zeros((4, 4))
    rates[0, 1] = 1.0
    rates[1] = 0.0, -b / J, K / J, -(dry + TORQUE) / J
    rates[2] = 0.0, -K_b / L, -R_loop / L, voltage / L
    return (expm(rates * time) @ np.array([*state, 1.0]))[:3]


@pytest.mark.parametrize("L", [1e-6, 5e-4, 0.9 * equal_inductance(), equal_inductance(), 0.05, 0.4])
@pytest.mark.parametrize("time", [1e-7, 3e-4, 0.015])
def test_a_leg_is_the_matrix_exponential(L, time):
    numbers = replaced(SERVO, {"motor.L": L})
    circuit = inductive_segments.winding(numbers).drive
    q, w, i, left, _, way = inductive_segments.leg(numbers, circuit, TORQUE, 6.0, CURRENT_FORWARD, 1.0, 1.0, 2.0, 0.9,
                                                   time)
    assert (left, way) == (0.0, 1.0)
    expected = reference(L, 6.0 - 0.3, 3.1, 0.12, (1.0, 2.0, 0.9), time)
    np.testing.assert_allclose((q, w, i), expected, rtol=1e-11, atol=1e-13)  # as far as SciPy's expm agrees on all CPUs


@pytest.mark.parametrize("L", [5e-4, equal_inductance(), 0.05])
@pytest.mark.parametrize(("u", "zone", "way", "w", "i", "ends"), [
    (0.0, CURRENT_FORWARD, 1.0, 0.4, 0.05, "current"), (0.0, CURRENT_BACKWARD, 1.0, 0.02, -1.5, "speed"),
    (-6.0, CURRENT_BACKWARD, 1.0, 3.0, -0.2, "speed"), (6.0, CURRENT_BACKWARD, -1.0, -2.0, -1.5, "current")])
def test_a_leg_ends_where_speed_or_current_is_zero(L, u, zone, way, w, i, ends):
    numbers = replaced(SERVO, {"motor.L": L})
    own = inductive_segments.winding(numbers)
    circuit, side = own.drive if u else own.off, 1.0 if zone == CURRENT_FORWARD else -1.0
    after = inductive_segments.leg(numbers, circuit, TORQUE, u, zone, way, 1.0, w, i, 0.5)
    assert 0.0 < after.left < 0.5
    expected = reference(L, u - side * (0.3 if u else 0.2), circuit.R, 0.12 if way > 0.0 else -0.15, (1.0, w, i),
                         0.5 - after.left)
    np.testing.assert_allclose((after.q, after.w, after.i), expected, rtol=1e-11, atol=1e-12)
    assert (after.w if ends == "speed" else after.i) == 0.0
    assert abs(after.i if ends == "speed" else after.w) > 1e-3


@pytest.mark.parametrize(("u", "way", "hold"), [(6.0, 1.0, 1.3 * 0.12), (-6.0, -1.0, -1.3 * 0.15)])
def test_a_shaft_at_rest_is_released_where_friction_holds_no_more(u, way, hold):
    circuit = inductive_segments.winding(SERVO).drive
    zone = CURRENT_FORWARD if u > 0.0 else CURRENT_BACKWARD
    after = inductive_segments.leg(SERVO, circuit, TORQUE, u, zone, 0.0, 1.0, 0.0, 0.0, 0.01)
    i = (hold + TORQUE) / K
    final = (u - math.copysign(0.3, u)) / 3.1
    assert after[:3] == pytest.approx((1.0, 0.0, i), rel=1e-14)
    assert after.way == way
    assert 0.01 - after.left == pytest.approx(-5e-4 / 3.1 * math.log1p(-i / final), rel=1e-12)


@pytest.mark.parametrize(("D", "zone"), [(0.0, CONDUCTING), (0.2, CURRENT_FORWARD)])
def test_nothing_is_left_of_a_current_at_rest_after_a_while(D, zone):
    """A drop lets it end at once, in a finite time; without one it fades until it is less than rounding."""
    numbers = replaced(SERVO, {"bridge.off.D": D})
    for time, gone in ((1e-4, False), (0.01, True)):
        went = inductive_segments.through(numbers, inductive_segments.winding(numbers), TORQUE, 0.0, 1.0, 0.0, 0.15,
                                          1.0, time)
        assert (went.q, went.w, went.done) == (1.0, 0.0, 1.0)
        assert (went.i == 0.0) == gone
    assert inductive_segments.entered(numbers, TORQUE, 0.0, 0.0, 0.15)[0] == zone


@pytest.mark.parametrize("L", [5e-4, 0.05])
@pytest.mark.parametrize(("drive", "w", "i"), [(1.0, 0.0, 0.0), (0.0, 3.0, 0.4), (-1.0, 3.0, 0.4), (1.0, -0.3, -0.5)])
def test_a_way_may_be_gone_in_parts(L, drive, w, i):
    numbers = replaced(SERVO, {"motor.L": L})
    own = inductive_segments.winding(numbers)
    whole = inductive_segments.through(numbers, own, TORQUE, drive, 1.0, w, i, 1.0, 0.02)
    parts = inductive_segments.Went(1.0, w, i, 1.0, 1.0)
    for time in (1e-5, 2e-4, 3e-3, 0.02 - 3.21e-3):
        parts = inductive_segments.through(numbers, own, TORQUE, drive, parts.q, parts.w, parts.i, parts.wiper, time)
        assert parts.done == 1.0
    assert parts == pytest.approx(whole, rel=1e-11, abs=1e-12)


def test_a_shaft_slides_on_without_current_until_it_is_fast_or_at_rest():
    """Below the drop of an open bridge no current flows; pushed above it, the motor brakes through the diodes."""
    numbers = replaced(SERVO, {"bridge.off.D": 0.5, "shaft.b": 0.0})
    circuit = inductive_segments.winding(numbers).off
    slows = inductive_segments.leg(numbers, circuit, TORQUE, 0.0, NO_CURRENT, 1.0, 0.0, 0.5, 0.0, 1.0)
    assert slows[1:3] == (0.0, 0.0)
    assert 1.0 - slows.left == pytest.approx(0.5 * J / (0.12 + TORQUE), rel=1e-12)
    pushed = inductive_segments.leg(numbers, circuit, -1.0, 0.0, NO_CURRENT, 1.0, 0.0, 0.5, 0.0, 1.0)
    assert pushed.w == pytest.approx(0.5 / K_b, rel=1e-14)
    assert (pushed.zone, pushed.way) == (CURRENT_BACKWARD, 1.0)


def test_a_servo_at_a_stop_is_given_up():
    numbers = replaced(SERVO, {"stops.upper": 1.0})
    went = inductive_segments.through(numbers, inductive_segments.winding(numbers), TORQUE, 1.0, 0.999, 0.0, 0.0,
                                      0.999, 0.02)
    assert went.done == 0.0
