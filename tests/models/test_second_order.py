"""The closed form of one second-order motion, against 50-digit arithmetic."""

import math

import mpmath as mp
import pytest
from hypothesis import given, settings
from hypothesis import strategies as s

from servotwin.models.engine.motions import second_order


def exact(coefficients, time):
    """The same motion as the exponential of an augmented matrix."""
    with mp.workdps(50):
        a, c, f0, f1, fs, omega, phase, q0, w0 = (mp.mpf(x) for x in coefficients)
        M = mp.matrix(7, 7)
        M[0, 1] = M[3, 2] = 1
        M[1, 0], M[1, 1], M[1, 2], M[1, 3], M[1, 4] = -c, -2 * a, f0, f1, fs
        M[4, 5], M[5, 4] = omega, -omega
        M[6, 0] = 1
        y = mp.expm(M * mp.mpf(time), method="taylor") * mp.matrix([q0, w0, 1, 0, mp.sin(phase), mp.cos(phase), 0])
        return float(y[0]), float(y[1]), float(y[6])


rates = s.floats(-6, 3).map(lambda x: 10**x)


@pytest.mark.long
@settings(max_examples=100, deadline=None)
@given(a=rates, kind=s.sampled_from(["none", "weak", "near critical", "critical", "stiff"]), size=s.floats(0.0, 1.0),
       time=s.floats(-6, 0).map(lambda x: 10**x), f0=s.floats(-300, 300), f1=s.floats(-300, 300),
       fs=s.sampled_from([0.0, 50.0]), omega=s.floats(1.0, 60.0), q0=s.floats(-3, 3), w0=s.floats(-6, 6))
def test_no_digits_are_lost_at_any_damping(a, kind, size, time, f0, f1, fs, omega, q0, w0):
    c = {"none": 0.0, "weak": 1e-6 * size, "near critical": a * a * (1 + 0.03 * (size - 0.5)), "critical": a * a,
         "stiff": 1e4 * size}[kind]
    coefficients = (a, c, f0, f1, fs, omega, 0.3, q0, w0)
    q, w, way = second_order.propagate_with_integral(coefficients, time)
    q_exact, w_exact, way_exact = exact(coefficients, time)
    # a sinusoid is the difference of two motions of its steady size
    steady = fs / max(omega, 2 * a) / omega
    scale = steady + abs(q0) + abs(w0) * time + (abs(f0) + abs(f1) * time + fs) * time**2
    speed = steady * omega + abs(w0) + (abs(f0) + abs(f1) * time + fs + c * abs(q0)) * time
    assert abs(q - q_exact) <= 2e-13 * max(scale, 1e-3)
    assert abs(w - w_exact) <= 2e-13 * max(speed, 1e-3)
    assert abs(way - way_exact) <= 2e-13 * max(scale * time, steady / omega, 1e-4)


def test_negative_stiffness_is_exact_too():
    coefficients = (0.5, -4.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.2)
    assert second_order.propagate(coefficients, 0.7) == pytest.approx(exact(coefficients, 0.7)[:2], rel=1e-14)


@pytest.mark.parametrize(("a", "c"), [(1.0, 0.0), (3.0, 2.0), (2.0, 4.0), (0.5, 100.0), (20.0, 1.0)])
@pytest.mark.parametrize(("h0", "h1"), [(1.0, -30.0), (-1.0, 200.0), (1.0, 5.0), (2.0, -0.1)])
def test_zero_of_the_acceleration(a, c, h0, h1):
    first, spacing = second_order.first_zero(a, c, h0, h1)

    def h(t):
        dg, g, *_ = second_order.response(a, c, t)
        return h0 * (dg + 2 * a * g) + h1 * g

    if math.isfinite(first):
        assert h(first) == pytest.approx(0.0, abs=1e-12 * (abs(h0) + abs(h1)))
        assert all(h(first * k / 50) * h0 > 0 for k in range(1, 50))
        if math.isfinite(spacing):
            assert h(first + spacing) == pytest.approx(0.0, abs=1e-12 * (abs(h0) + abs(h1)))
    else:
        assert all(h(t) * h0 > 0 for t in (0.01, 0.1, 1.0, 5.0))
