"""Digital servos up to their first tick, from which on they go side by side."""

from __future__ import annotations

from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.memory import Memories
from servotwin.models.engine.tiles import Lanes
from servotwin.simulation.lane_memory import put_back, taken
from servotwin.simulation.lanes import Floats

Indices = NDArray[np.int64]


def to_first_ticks(module: ModuleType, lanes: Lanes, curve: Floats, torques: Floats, first: Indices, count: Indices,
                   which: Indices, durations: Floats, times: Floats, first_output: Indices, outputs: Floats,
                   memories: Memories, status: Indices) -> None:
    """Let lanes that begin before their first tick go on to it, one by one; who cannot stays where it is.

    `module` has the kernels that do, the other arguments are those of `runs.go_on`. What is left to do is noted for it.
    """
    phases = lanes.firmware["t_phi"][which]
    some = np.flatnonzero((phases > 0.0) & (phases < durations) & (memories.rows["point"]["time"] == 0.0)
                          & (memories.rows["frames"] == 0) & (first_output == 0))
    if not len(some):
        return
    early = times[times < phases[some].max()]
    own, there = taken(memories, some), np.zeros((len(some), outputs.shape[1], len(early)))
    states, ended = np.zeros(len(some), np.int64), np.zeros(len(some))
    module.go_on(lanes, curve, torques, first, count, which[some], phases[some], early,
                 np.zeros(len(some), np.int64), there, own, states, ended)
    for k in np.flatnonzero(states == 0):
        lane, seen = some[k], int(np.searchsorted(early, phases[some[k]]))
        put_back(memories, lane, taken(own, k))
        outputs[lane, :, :seen], first_output[lane] = there[k, :, :seen], seen
        durations[lane] -= phases[lane]
