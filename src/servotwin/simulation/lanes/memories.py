"""What lanes remember, as records: made, picked out and put back, and brought from tiles and there again."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.memory import Memories, Memory
from servotwin.models.state.records import record_of
from servotwin.models.terms.control import Firm
from servotwin.simulation.compile import kernels
from servotwin.simulation.lanes.form_recipes import TICKS

Indices = NDArray[np.int64]

_RECORD, _FIRM = record_of(Memory), record_of(Firm)


def nothing_yet(count: int) -> Memories:
    """Return room for what so many lanes remember."""
    return Memories(np.zeros(count, _RECORD), np.zeros(count, _FIRM))


def taken(memories: Memories, which: Any) -> Memories:
    """Return what some lanes remember, by their numbers or as a slice."""
    return Memories(*(array[which] for array in memories))


def put_back(memories: Memories, which: Any, some: Memories) -> None:
    """Let some lanes remember something else."""
    for array, values in zip(memories, some, strict=True):
        array[which] = values


def copied(memories: Memories) -> Memories:
    """Return the same, to be kept."""
    return Memories(*(array.copy() for array in memories))


def flat(tiles: NDArray[Any], group: str, name: str) -> Any:
    """Return a copy of a number of all lanes in tiles, one after the other."""
    return tiles[group][name].ravel()


def memories_of(tiles: NDArray[Any], places: Indices) -> Memories:
    """Return what the lanes at these places of tiles remember."""
    found = nothing_yet(len(places))
    kernels(TICKS).to_records(places, tiles, found)
    return found
