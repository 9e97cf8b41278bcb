"""The bus voltage against a bracketed root of the balance, and against what can be worked out by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from servotwin import physics

bridges = st.lists(st.tuples(st.sampled_from([-1.0, 0.0, 1.0]), st.floats(-9.0, 9.0), st.floats(0.0, 1.0),
                             st.floats(0.5, 10.0)), min_size=1, max_size=5)


def columns(drawn):
    """What a bus asks of its bridges, by sign of the drive, back-EMF, drop and resistance of each."""
    s, v_b, D, R = (np.array(column) for column in zip(*drawn, strict=True))
    return (*physics.conduction(s, v_b, D), R)


def total(V, above, below, R):
    return float(np.sum(physics.bridge_supply_current(V, above, below, R)))


def test_a_bridge_that_drives_draws_what_its_motor_takes():
    for s, v_b, V in ((1.0, 2.0, 6.0), (-1.0, 2.0, 6.0), (1.0, 8.0, 6.0), (1.0, 6.2, 6.0), (-1.0, -9.0, 5.0)):
        above, below = physics.conduction(s, v_b, 0.4)
        i = physics.bridge_current(s * V, v_b, 0.4, 3.0)
        assert physics.bridge_supply_current(V, above, below, 3.0) == pytest.approx(s * i, abs=1e-15)


def test_a_bridge_that_coasts_returns_what_its_diodes_let_through():
    for v_b in (-9.0, -6.0, 0.0, 6.3, 9.0):
        above, below = physics.conduction(0.0, v_b, 0.4)
        i = physics.bridge_current(0.0, v_b, 6.0 + 0.4, 3.0)
        assert physics.bridge_supply_current(6.0, above, below, 3.0) == pytest.approx(-abs(i), abs=1e-15)


def test_one_bridge_at_a_battery_is_one_circuit():
    above, below = physics.conduction(-1.0, 2.0, 0.4)
    i = physics.bridge_current(-6.0, 2.0, 0.4, 3.0 + 0.5)
    assert physics.bus_voltage([above], [below], [3.0], 6.0, 0.5) == pytest.approx(6.0 - 0.5 * abs(i), rel=1e-15)


@settings(deadline=None)
@given(drawn=bridges, R_b=st.floats(0.0, 3.0))
def test_a_battery_and_its_bridges_agree(drawn, R_b):
    bus = columns(drawn)
    V = physics.bus_voltage(*bus, 6.0, R_b)
    assert 6.0 - R_b * total(V, *bus) == pytest.approx(V, abs=1e-12)
    root = brentq(lambda U: U + R_b * total(U, *bus) - 6.0, -1e3, 1e3, xtol=1e-13)
    assert pytest.approx(root, abs=1e-9) == V


@settings(deadline=None)
@given(drawn=bridges, R_b=st.floats(0.0, 3.0), limit=st.floats(0.05, 5.0))
def test_a_regulator_gives_its_limit_at_most_and_takes_nothing_back(drawn, R_b, limit):
    bus = columns(drawn)
    V, free = physics.bus_voltage(*bus, 6.0, R_b, limit), physics.bus_voltage(*bus, 6.0, R_b)
    current = total(V, *bus)
    assert V <= 6.0
    if total(6.0, *bus) < 0.0:
        assert V == 6.0
    elif total(free, *bus) <= limit:
        assert V == free
    else:
        assert V < free or (V == 0.0 and free <= 0.0)
        assert current == pytest.approx(limit, rel=1e-12) or (V == 0.0 and current > limit)


def test_a_plugged_servo_takes_more_than_the_limit_when_nothing_is_left_of_the_voltage():
    above, below = physics.conduction(1.0, -5.0, 0.4)  # 5 V against it, 4.6 V of them at 3 ohm
    assert physics.bus_voltage([above], [below], [3.0], 6.0, 0.1, 1.0) == 0.0
    assert physics.bridge_supply_current(0.0, above, below, 3.0) == pytest.approx(4.6 / 3.0)


def test_current_of_one_servo_feeds_another_before_it_feeds_the_battery():
    fast = physics.conduction(1.0, 8.0, 0.0)
    stalled = physics.conduction(1.0, 0.0, 0.0)
    bus = [fast.draws_above, stalled.draws_above], [fast.returns_below, stalled.returns_below], [3.0, 3.0]
    alone = physics.bus_voltage([stalled.draws_above], [stalled.returns_below], [3.0], 6.0, 0.5)
    together = physics.bus_voltage(*bus, 6.0, 0.5)
    assert alone < together < 6.0
    assert together == pytest.approx((6.0 / 0.5 + 8.0 / 3.0) / (1.0 / 0.5 + 2.0 / 3.0))


def test_what_brakes_is_not_on_the_bus_and_an_empty_bus_has_all_its_voltage():
    assert physics.bus_voltage([np.inf], [-np.inf], [3.0], 6.0, 0.5) == 6.0
    assert physics.bus_voltage([], [], [], 6.0, 0.5) == 6.0
    assert physics.bus_voltage([], [], [], 6.0, 0.5, 1.0) == 6.0


def test_columns_of_sources_and_bridges():
    rng = np.random.default_rng(5)
    above = rng.uniform(-2.0, 8.0, (7, 3))
    below = above - rng.uniform(0.0, 1.0, (7, 3))
    R, R_b, limit = rng.uniform(1.0, 4.0, 3), rng.uniform(0.0, 1.0, 7), rng.uniform(0.1, 3.0, 7)
    V = physics.bus_voltage(above, below, R, 6.0, R_b, limit)
    assert V.shape == (7,)
    assert V.tolist() == [physics.bus_voltage(above[k], below[k], R, 6.0, R_b[k], limit[k]) for k in range(7)]
    assert isinstance(physics.bus_voltage(above[0], below[0], R, 6.0), float)


def test_a_source_below_its_limit():
    current = np.array([-2.0, 0.0, 2.0])
    np.testing.assert_array_equal(physics.source_voltage(current, 6.0, 0.5), [7.0, 6.0, 5.0])
    np.testing.assert_array_equal(physics.source_voltage(current, 6.0, 0.5, regulated=True), [6.0, 6.0, 5.0])
