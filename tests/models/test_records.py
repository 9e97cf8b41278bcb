"""Named tuples in tiles: what goes in comes out, by name and by lane."""

import numpy as np

from lane_cases import replaced
from servotwin.models.engine.batch.tiles import numbers_at
from servotwin.models.state.records import TILE, columns_of, put_columns, tiles_with
from servotwin.models.terms.numbers import NEUTRAL, Numbers

COUNT = 2 * TILE + 5
SPEEDS = np.linspace(1.0, 2.0, COUNT)
LANES = replaced(NEUTRAL, {"motor.K_b": SPEEDS, "play.half": 0.3})


def test_tiles_hold_columns_and_numbers():
    tiles = tiles_with(Numbers, LANES, COUNT)
    assert tiles["play"]["half"].shape == (3, TILE)
    np.testing.assert_array_equal(columns_of(Numbers, tiles, slice(COUNT)).motor.K_b, SPEEDS)
    one = numbers_at(tiles[1], 7)
    assert one == replaced(NEUTRAL, {"motor.K_b": SPEEDS[TILE + 7], "play.half": 0.3})


def test_some_lanes_are_read_and_put():
    tiles, which = tiles_with(Numbers, LANES, COUNT), np.array([3, COUNT - 1])
    some = columns_of(Numbers, tiles, which)
    np.testing.assert_array_equal(some.motor.K_b, SPEEDS[which])
    put_columns(tiles, which, replaced(some, {"heat.C_w": np.array([5.0, 6.0])}))
    warmed = columns_of(Numbers, tiles, slice(COUNT)).heat.C_w
    assert warmed[which].tolist() == [5.0, 6.0]
    assert warmed.sum() == 11.0
