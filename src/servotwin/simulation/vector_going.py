"""Lanes of a `VectorSimulator` that go on one by one, tick after tick: calls of kernels whose words stay."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.memory import Memories
from servotwin.models.engine.tiles import Lanes
from servotwin.simulation import lane_recipes
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.compile.calls import call_of
from servotwin.simulation.first_ticks import to_first_ticks
from servotwin.simulation.lanes import ALL_FIELDS

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class GoingOn:
    """How some lanes go on, all of them, in one thread.

    Parameters
    ----------
    recipe : Recipe
    columns : models.engine.tiles.Lanes
        Of all lanes.
    inputs : tuple
        Table of the potentiometers, rows of torque, where those of each lane begin, and how many there are.
    which : ndarray of int64
    memories : Memories
        Of those lanes; they are changed in place.
    """

    def __init__(self, recipe: Recipe, columns: Lanes, inputs: tuple[Any, ...], which: Indices,
                 memories: Memories) -> None:
        count = len(which)
        self._durations = np.empty(count)
        self._first, self._status, self._ended = np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros(count)
        self._shared = (columns, *inputs, which, self._durations, np.zeros(0), self._first,
                        np.zeros((count, len(ALL_FIELDS), 0)), memories, self._status)
        *ahead, self._last = lane_recipes.chain_of(recipe)
        self._calls = [*(call_of(one, "go_on", *self._shared, *lane_recipes.room_of(one)) for one in ahead),
                       call_of(self._last, "go_on", *self._shared, self._ended)]

    def __call__(self, duration: float) -> tuple[Indices, Array]:
        """Let them go on for a time [s]; return status and end of each, until the next call."""
        self._durations[:], self._first[:], self._status[:], self._ended[:] = duration, 0, 0, 0.0
        if len(self._calls) > 1:
            to_first_ticks(kernels(self._last), *self._shared)
        for call in self._calls:
            call()
        return self._status, self._ended
