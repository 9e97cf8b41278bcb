"""A servo side by side, told as the general way remembers it, and back."""

import math

import numpy as np
import pytest

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.cosim import put_beside, remembered
from servotwin.models.engine.memory import time_of
from servotwin.models.state.modes import ON_BACKWARD, RIGID
from servotwin.models.state.records import room
from servotwin.models.terms.control import NOT_STARTED

PERIOD, PLACE = 0.02, 5
GROUPS = {"servo": tiles.Servo, "clock": tiles.Clock, "count": tiles.Count}
CHANGED = {"servo": set(tiles.Servo._fields) - {"width"}, "clock": {"period", "edge", "since", "length"},
           "count": {"number", "first_draw"}}


def empty(dtype="float64"):
    rows = room(1, tiles.tile_type(dtype, tiles.ONE_FORMULA))
    rows.view(np.uint8)[...] = 0
    rows["count"]["edges"] = -1
    return rows[0]


def random_tile(seed, slack=0.01, dtype="float64"):
    """Return a tile with what a lane may hold within a frame of 20 ms."""
    rng, tile = np.random.default_rng(seed), empty(dtype)
    drive = rng.choice([-1.0, 0.0, 1.0])
    waits = rng.random() < 0.5
    q, w, mesh = rng.uniform(0.0, 3.0), rng.uniform(-5.0, 5.0), float(rng.integers(RIGID, ON_BACKWARD + 1))
    own = {"q": q, "w": w, "drive": drive, "left": rng.uniform(0.0, 0.01) if drive else 0.0, "silence": math.inf,
           "error": rng.uniform(-1e-4, 1e-4), "due": rng.uniform(0.0, 2e-3) if waits else math.inf, "sign": 1.0,
           "duration": 3e-3, "decided": 2e-5, "later_due": math.inf, "wiper": rng.uniform(0.0, 3.0),
           "i": rng.uniform(-1.0, 1.0), "T_w": 300.0, "T_h": 310.0, "mesh": mesh, "step": 1e-3,
           "q_m": q + rng.uniform(-0.01, 0.01) if mesh else q, "w_m": rng.uniform(-5.0, 5.0) if mesh else w}
    number = int(rng.integers(1, 10_000))
    clock = {"period": PERIOD, "edge": (number - 1) * PERIOD, "since": rng.uniform(0.0, PERIOD), "length": PERIOD}
    for group, values in (("servo", own), ("clock", clock),
                          ("count", {"number": number, "first_draw": int(rng.integers(0, 100))})):
        for name, value in values.items():
            tile[group][name][PLACE] = value
    tile.hung.half_slack[PLACE] = slack
    return tile


def back(tile, period=PERIOD):
    there = empty(str(tile.servo.q.dtype))
    put_beside(remembered(tile, PLACE, NOT_STARTED), period, there, PLACE)
    return there


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("seed", range(5))
def test_there_and_back_changes_nothing(seed, dtype):
    tile = random_tile(seed, dtype=dtype)
    there = back(tile)
    clock, single = tile.clock, dtype == "float32"
    close = {"rel": 1e-6 if single else 1e-12, "abs": 1e-9 if single else 1e-15}
    time = clock.edge[PLACE] + clock.since[PLACE]
    assert time_of(remembered(tile, PLACE, NOT_STARTED)) == pytest.approx(time, abs=1e-12)
    for group, names in CHANGED.items():
        for name in GROUPS[group]._fields:
            before = tile[group][name][PLACE] if name in names else empty()[group][name][PLACE]
            assert float(there[group][name][PLACE]) == pytest.approx(float(before), **close), name


def test_another_period_goes_on_at_its_own_next_edge():
    tile = random_tile(9, slack=0.0)
    time, there = tile.clock.edge[PLACE] + tile.clock.since[PLACE], back(tile, 0.012)
    assert there.count.number[PLACE] == math.ceil(time / 0.012)
    assert there.clock.edge[PLACE] + there.clock.since[PLACE] == pytest.approx(time, abs=1e-12)
    assert (there.count.first_draw[PLACE] + there.count.number[PLACE]
            == tile.count.first_draw[PLACE] + tile.count.number[PLACE])


def test_without_slack_the_potentiometer_goes_with_the_shaft():
    stiff, loose = random_tile(3, slack=0.0), random_tile(3)
    assert remembered(stiff, PLACE, NOT_STARTED).point.wiper == stiff.servo.q[PLACE]
    assert remembered(loose, PLACE, NOT_STARTED).point.wiper == loose.servo.wiper[PLACE] != loose.servo.q[PLACE]
