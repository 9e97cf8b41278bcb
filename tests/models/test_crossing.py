"""A servo side by side, told as the general way remembers it, and back."""

import math

import numpy as np
import pytest

from servotwin.models.engine.crossing import Counted, Held, Hour, Side, remembered, side_of
from servotwin.models.engine.memory import time_of
from servotwin.models.engine.modes import ON_BACKWARD, RIGID
from servotwin.models.engine.records import mapped
from servotwin.models.terms.control import ABSENT, NOT_STARTED
from servotwin.physics.laws import array_form

PERIOD = 0.02


def random_side(rng):
    """Return what a tile may hold within a frame of 20 ms."""
    drive = rng.choice([-1.0, 0.0, 1.0])
    waits = rng.random() < 0.5
    q, w, mesh = rng.uniform(0.0, 3.0), rng.uniform(-5.0, 5.0), float(rng.integers(RIGID, ON_BACKWARD + 1))
    held = Held(
        q, w, drive, rng.uniform(0.0, 0.01) if drive else 0.0, math.inf,
        rng.uniform(-1e-4, 1e-4), rng.uniform(0.0, 2e-3) if waits else math.inf, 1.0, 3e-3, 2e-5, math.inf, 0.0, 0.0,
        0.0, rng.uniform(0.0, 3.0), rng.uniform(-1.0, 1.0), 300.0, 310.0, q + rng.uniform(-0.01, 0.01) if mesh else q,
        rng.uniform(-5.0, 5.0) if mesh else w, mesh, 1e-3)
    number = int(rng.integers(1, 10_000))
    return Side(held, Hour(PERIOD, (number - 1) * PERIOD, rng.uniform(0.0, PERIOD), PERIOD),
                Counted(number, int(rng.integers(0, 100))))


@pytest.mark.parametrize("seed", range(5))
def test_there_and_back_changes_nothing(seed):
    side = random_side(np.random.default_rng(seed))
    memory = remembered(side, True, 0.01, NOT_STARTED)
    assert time_of(memory) == pytest.approx(side.hour.edge + side.hour.since, abs=1e-12)
    back = side_of(memory, PERIOD)
    for there, here in zip(side, back, strict=True):
        assert here == pytest.approx(there, rel=1e-12, abs=1e-15)


def test_another_period_goes_on_at_its_own_next_edge():
    side = random_side(np.random.default_rng(9))
    time = side.hour.edge + side.hour.since
    back = side_of(remembered(side, True, 0.0, NOT_STARTED), 0.012)
    assert back.counted.number == math.ceil(time / 0.012)
    assert back.hour.edge + back.hour.since == pytest.approx(time, abs=1e-12)
    assert back.counted.first_draw + back.counted.number == side.counted.first_draw + side.counted.number


def test_without_slack_the_potentiometer_goes_with_the_shaft():
    side = random_side(np.random.default_rng(3))
    assert remembered(side, True, 0.0, NOT_STARTED).point.wiper == side.held.q
    assert remembered(side, True, 0.01, NOT_STARTED).point.wiper == side.held.wiper != side.held.q


def test_many_at_once_are_each_alone():
    sides = [random_side(np.random.default_rng(seed)) for seed in range(20)]
    columns = Side(*(type(parts[0])(*map(np.array, zip(*parts, strict=True))) for parts in zip(*sides, strict=True)))
    memory = array_form(remembered)(columns, np.ones(20, bool), np.zeros(20), ABSENT)
    back = array_form(side_of)(memory, np.where(np.arange(20) % 2 == 0, PERIOD, 0.012))
    for k, side in enumerate(sides):
        alone = side_of(remembered(side, True, 0.0, NOT_STARTED), PERIOD if k % 2 == 0 else 0.012)
        assert mapped(lambda column, k=k: float(column[k]), back) == mapped(float, alone)
