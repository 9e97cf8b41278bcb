"""What warming does to a motion that is a straight line otherwise: legs of lanes and steps of the general engine."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import servotwin as st
from servotwin.models.engine.batch import backlash_batch
from servotwin.models.engine.batch.rk_steps import State
from servotwin.models.engine.batch.segments import warm_segments
from servotwin.models.engine.dynamics import coefficients, guards
from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.engine.legs import legs
from servotwin.models.engine.motions import warm_exponential, warm_linear
from servotwin.models.state.modes import (
    BACKWARD,
    CONDUCTING,
    CURRENT_FORWARD,
    FORWARD,
    FREE,
    INSIDE,
    NO_CURRENT,
    ON_BACKWARD,
    ON_FORWARD,
    RIGID,
    STUCK,
    Mode,
    Vector,
)
from servotwin.models.terms.numbers import warm

HEAT = {"thermal.winding_capacity": 2.0, "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 10.0, "thermal.magnet_coefficient": -1.5e-3}
GAP = {"gear.backlash": 0.01, "gear.output_inertia": 1e-3}
LOAD = st.loads.Inertia(2e-3) + st.loads.Constant(0.1)
TORQUE = 0.1
WARM = Vector(0.5, 1.0, 0.3, 310.0, 300.0, 0.5, 1.0)


def numbers_of(servo, kind=st.PulseServo, **changes):
    return kind(servo.replace(HEAT | changes)).pack(LOAD)


def followed(numbers, mode, u, y, time):
    """Return the state after a time by SciPy, with the laws as they are."""
    found = solve_ivp(lambda _, x: list(rates_of(numbers, mode, u, TORQUE, Vector(*x))), (0.0, time), list(y),
                      method="DOP853", rtol=1e-13, atol=1e-14, max_step=1e-4)
    return Vector(*found.y[:, -1])


def gone(numbers, y, h):
    """Return where a shaft that is driven has gone, and its error as estimated."""
    mode, now = Mode(CURRENT_FORWARD, FORWARD, RIGID, FREE, 0), warm(numbers, y)
    a, _, f, *_ = coefficients.linear_coefficients(now, mode, (6.0, 0.0, 0.0, 0.0, 0.0), (TORQUE, 0.0), 0.0, y.w)
    law = warm_exponential.law_of(numbers, now, CURRENT_FORWARD, 6.0, y.T_w, y.T_h, 2.0 * a, f - 2.0 * a * y.w, y.w,
                                  coefficients.per_ampere(now, mode))
    to = warm_exponential.going(law, numbers.heat, h)
    return mode, Vector(y.q + to.way, to.w, 0.0, y.T_w + to.warmer, y.T_h + to.housing, 0.0, to.w), to


@pytest.mark.parametrize("h", [1e-3, 5e-3, 0.02])
@pytest.mark.parametrize("w", [-3.0, 0.0, 2.0])
def test_a_leg_is_off_by_no_more_than_estimated(servo, h, w):
    numbers = numbers_of(servo)
    y = WARM._replace(w=w, w_m=w, i=0.0)
    mode, after, to = gone(numbers, y, h)
    want = followed(numbers, mode, 6.0, y, h)
    off = max(abs(after.q - want.q), abs(after.w - want.w) / (1.0 + abs(w)))
    assert off <= warm_segments.MARGIN * to.error + 1e-13
    assert abs(after.T_w - want.T_w) < 1e-9
    assert to.dw == pytest.approx(rates_of(numbers, mode, 6.0, TORQUE, want).w, rel=1e-9)


def test_a_leg_of_a_servo_of_large_capacity_is_a_straight_law(servo):
    numbers = numbers_of(servo, **{"thermal.winding_capacity": 1e9, "thermal.housing_capacity": 1e9})
    y = WARM._replace(i=0.0)
    mode, after, _ = gone(numbers, y, 0.01)
    want = followed(numbers._replace(heat=numbers.heat._replace(C_w=0.0)), mode, 6.0, y, 0.01)
    cold = followed(warm(numbers, y)._replace(heat=numbers.heat._replace(C_w=0.0)), mode, 6.0, y, 0.01)
    assert after.w == pytest.approx(cold.w, rel=1e-12)
    assert abs(after.w - want.w) > 1e-3  # at other temperatures it is another law


def test_the_error_falls_as_the_cube_of_the_warming(servo):
    sizes = []
    for capacity in (1.0, 4.0):
        numbers = numbers_of(servo, **{"thermal.winding_capacity": capacity, "thermal.magnet_coefficient": 0.0})
        sizes.append(gone(numbers, WARM._replace(w=-3.0, w_m=-3.0, i=0.0), 0.004)[2].error)
    assert math.log(sizes[0] / sizes[1], 4.0) == pytest.approx(3.0, abs=0.15)


MODES = {"drive": (Mode(CURRENT_FORWARD, FORWARD, RIGID, FREE, 0), 6.0, WARM),
         "brake": (Mode(CONDUCTING, FORWARD, RIGID, FREE, 0), 0.0, WARM._replace(w=3.0, w_m=3.0, i=0.8)),
         "held": (Mode(CONDUCTING, STUCK, RIGID, FREE, 0), 0.0, WARM._replace(w=0.0, w_m=0.0, i=0.8)),
         "stalled": (Mode(CURRENT_FORWARD, STUCK, RIGID, FREE, 0), 6.0, WARM._replace(w=0.0, w_m=0.0, i=0.1)),
         "coasting": (Mode(NO_CURRENT, FORWARD, RIGID, FREE, 0), 0.0, WARM._replace(i=0.0))}


@pytest.mark.parametrize("name", MODES)
@pytest.mark.parametrize(("tolerance", "off"), [(1e-9, 1e-10), (1e-11, 3e-12)])
def test_a_step_of_shaft_and_current_follows_the_law(servo, name, tolerance, off):
    numbers = numbers_of(servo, st.PulseServoInductive, **{"motor.armature_inductance": 6e-4})
    mode, u, y = MODES[name]
    want = followed(numbers, mode, u, y, 0.012)
    left = 0.012
    for _ in range(60):
        law = warm_linear.law_of(numbers, mode, u, TORQUE, y)
        h, found = warm_linear.follow(law, numbers.heat, y, left, tolerance)
        assert 0.0 < h <= left
        assert found.error <= tolerance * (1.0 + abs(y.w_m))
        y, left = warm_linear.state(numbers, mode, y, (0.0, 0.0), found.dense, h, h), left - h
        if left <= 0.0:
            break
    assert left <= 0.0
    np.testing.assert_allclose((y.q, y.w * 0.02), (want.q, want.w * 0.02), rtol=0.0, atol=off)
    np.testing.assert_allclose((y.T_w, y.T_h), (want.T_w, want.T_h), rtol=0.0, atol=1e-9)


def test_a_step_without_inductance_is_the_limit_of_a_small_one(servo):
    mode, y = Mode(CURRENT_FORWARD, FORWARD, RIGID, FREE, 0), WARM._replace(i=0.0)
    ends = []
    for kind, L in ((st.PulseServo, 1e-9), (st.PulseServoInductive, 1e-9), (st.PulseServoInductive, 1e-7)):
        numbers = numbers_of(servo, kind, **{"motor.armature_inductance": L})
        law = warm_linear.law_of(numbers, mode, 6.0, TORQUE, y)
        ends.append(warm_linear.state(numbers, mode, y, (0.0, 0.0), warm_linear.step(law, numbers.heat, y, 5e-3).dense,
                                      5e-3,
                                      5e-3).w)
    assert abs(ends[1] - ends[0]) < 1e-6
    assert abs(ends[2] - ends[0]) == pytest.approx(100.0 * abs(ends[1] - ends[0]), rel=0.05)


@pytest.mark.parametrize("u", [6.0, 0.0, -6.0])
@pytest.mark.parametrize("w", [0.0, 1.5, -2.5])
def test_a_phase_in_two_parts_is_the_phase(servo, u, w):
    numbers, start = numbers_of(servo), State(0.5, w, 310.0, 300.0)
    whole = warm_segments.go(numbers, TORQUE, u, warm_segments.UNKNOWN, 0, start, 0.5, 0.016, 1e-11)
    half = warm_segments.go(numbers, TORQUE, u, warm_segments.UNKNOWN, 0, start, 0.5, 0.009, 1e-11)
    both = warm_segments.go(numbers, TORQUE, u, warm_segments.UNKNOWN, 0, half.state, 0.5, 0.007, 1e-11)
    assert whole.done == both.done == 1.0
    np.testing.assert_allclose(both.state, whole.state, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("u", [6.0, 0.0, -6.0])
def test_legs_with_play_end_where_those_of_a_cold_servo_do(servo, u):
    """With so much capacity that nothing warms."""
    large = {"thermal.winding_capacity": 1e12, "thermal.housing_capacity": 1e12, "thermal.magnet_coefficient": 0.0}
    numbers = numbers_of(servo, **GAP, **large)
    y = Vector(0.5, -0.4, 0.0, 298.15, 298.15, 0.498, 1.2)
    hot = backlash_batch.go(numbers, TORQUE, u, y, INSIDE, 0.5, 0.015, 1e-11)
    cold = numbers._replace(heat=numbers.heat._replace(C_w=0.0))
    want = legs.go(cold, TORQUE, u, y, legs.mode_from(cold, TORQUE, u, y, INSIDE), 0.5, 0.015)
    assert hot.done == want.done == 1.0
    assert hot.mode == want.mode
    np.testing.assert_allclose(hot.y, want.y, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("mesh", [ON_FORWARD, ON_BACKWARD])
@pytest.mark.parametrize("w", [-0.4, 0.6])
@pytest.mark.parametrize("i", [-0.3, 0.2])
def test_how_fast_teeth_in_contact_cease_to_press(servo, mesh, w, i):
    """They may part and meet again within a step: seen by the rates at its ends."""
    shares = {"friction.load_friction_motor": 0.08, "friction.load_friction_external": 0.1}
    numbers = numbers_of(servo, st.PulseServoInductive, **GAP, **shares, **{"motor.armature_inductance": 6e-4})
    large = numbers._replace(heat=numbers.heat._replace(C_w=1e12, C_h=1e12))
    contact = FORWARD if w > 0.0 else BACKWARD
    y = Vector(0.5, w, i, 310.0, 300.0, 0.5, w)
    share = guards.contacts.share_sign(warm(large, y), CONDUCTING, contact, mesh, 0.0, TORQUE, y)
    mode = Mode(CONDUCTING, contact, mesh, FREE, share)

    def pressing(t):
        dy = rates_of(large, mode, 0.0, TORQUE, y)
        at = Vector(*(x + t * dx for x, dx in zip(y, dy, strict=True)))
        return guards.guard(large, mode, guards.PART, 0.0, 0.0, TORQUE, 0.0, at, rates_of(large, mode, 0.0, TORQUE, at))

    value, rate = pressing(0.0)
    assert abs(value) > 1e-3
    assert rate == pytest.approx((pressing(1e-6)[0] - pressing(-1e-6)[0]) / 2e-6, rel=1e-6)
