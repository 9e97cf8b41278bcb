import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

angle = st.floats(-5.0, 5.0, allow_subnormal=False)
inertia = st.floats(1e-6, 1e-1)
speed = st.floats(-20.0, 20.0, allow_subnormal=False)


@given(y=angle, x=angle, b=st.floats(0.0, 2.0))
def test_what_follows_is_never_further_off_than_half_the_play_and_moves_only_if_it_must(y, x, b):
    after = physics.play(y, x, b)
    assert abs(after - x) <= 0.5 * b + 1e-15 * max(abs(x), 1.0)
    if abs(y - x) < 0.5 * b:
        assert after == y
    assert physics.play(after, x, b) == after


def test_without_play_it_is_rigid():
    assert physics.play(0.3, -0.7, 0.0) == -0.7


def test_there_and_back_leaves_the_whole_play():
    path = np.concatenate([np.linspace(0.0, 1.0, 11), np.linspace(1.0, 0.0, 11)])
    y, seen = 0.0, []
    for x in path:
        y = physics.play(y, x, 0.3)
        seen.append(y)
    assert seen[5] == pytest.approx(0.35)  # on the way up at 0.5
    assert seen[16] == pytest.approx(0.65)  # on the way down at 0.5
    assert max(seen) == pytest.approx(0.85)


@given(J_1=inertia, w_1=speed, J_2=inertia, w_2=speed)
def test_an_impact_keeps_momentum_and_loses_the_energy_it_says(J_1, w_1, J_2, w_2):
    w = physics.impact_speed(J_1, w_1, J_2, w_2)
    scale = J_1 * abs(w_1) + J_2 * abs(w_2)
    assert (J_1 + J_2) * w == pytest.approx(J_1 * w_1 + J_2 * w_2, abs=1e-14 * scale)
    before, after = 0.5 * J_1 * w_1**2 + 0.5 * J_2 * w_2**2, 0.5 * (J_1 + J_2) * w**2
    assert physics.impact_energy(J_1, w_1, J_2, w_2) == pytest.approx(before - after, abs=1e-13 * max(before, 1e-300))


def test_a_wall_stops_and_a_feather_is_swept_along():
    assert physics.impact_speed(1e-3, 5.0, 1e12, 0.0) == pytest.approx(0.0, abs=1e-13)
    assert physics.impact_speed(1e-3, 5.0, 0.0, -3.0) == 5.0
    assert physics.impact_energy(1e-3, 5.0, 0.0, -3.0) == 0.0
    assert physics.impact_energy(1e-3, 5.0, 1e12, 0.0) == pytest.approx(0.5 * 1e-3 * 25.0)
