"""The first stage: every joint a lane of its own, under the torque and inertia that the measured motion asks of it.

All joints, and copies of them with one number moved, run side by side, each as if it were alone on the supply; what the
others draw, and how long turns take that stamps only count, counts in the second stage. Time is that of the goals: a
joint at a stamp t is where its lane is at t less the latency.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.dynamics import Demand
from servotwin.identification.arms.rows import Copies, Episode, Numbers, model_columns
from servotwin.simulation import VectorSimulator

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
_PARTS = 2  # of a sample: over each of them the torque stays
_DIGITS = 12  # of torques [N m] and inertias [kg m²] that tell lanes apart


class JointLanes(Copies):
    """Lanes of the joints of a robot; parameters as of `Copies`, and what its motions ask of them."""

    def __init__(self, plant: Any, numbers: Numbers, links: Sequence[int], look: Callable[[], object],
                 demand: Demand) -> None:
        super().__init__(plant, numbers, links, look)
        self.demand = demand
        self.models = [mount.model for mount in numbers.mounts.values()]
        self._gain = np.array([mount.gain for mount in numbers.mounts.values()])
        self._zero = np.array([mount.zero for mount in numbers.mounts.values()])

    def angles(self, episode: Episode, points: Array, *, fine: bool = False) -> Array:
        """Return where the joints are, shape (copies, n, joints) [rad]; nan of a failed lane."""
        return self.run(episode, points, self.numbers.columns(points), fine=fine)

    def run(self, episode: Episode, points: Array, columns: Sequence[Mapping[str, Array]], *,
            fine: bool = False) -> Array:
        """Return where the joints are with servos whose numbers are columns (copies,), a mapping for each joint."""
        copies, joints = len(points), len(self.models)
        time = episode.time
        grid = np.interp(np.arange(_PARTS * (len(time) - 1) + 1) / _PARTS, np.arange(len(time)), time)
        torque, inertia = self._asked(episode, points, grid)
        numbers = model_columns(self.models, columns, copies, fine=fine)
        own, same = _alike(joints, torque, inertia, numbers)
        torque, inertia = (np.ascontiguousarray(some[:, own]) for some in (torque, inertia))
        sims = VectorSimulator(self.models[0], len(own), threads=1,
                               parameters={name: values[own] for name, values in numbers.items()})
        goals = np.ascontiguousarray(((episode.goals - self._zero) / self._gain)[:, own % joints])
        first = ((episode.measured[0] - self._zero) / self._gain)[own % joints]
        sims.reset(command_angle=goals[0], output_angle=first)
        angle, speed = np.zeros((2, len(grid), len(own)))
        angle[0] = first
        entry = sims.c_entry()  # one call of compiled code for each step
        tick, row = entry.tick(), angle.strides[0]
        command, outside, load, angles, speeds = (some.ctypes.data for some in (goals, torque, inertia, angle, speed))
        for k, step in enumerate(np.diff(grid).tolist()):
            begins = k % _PARTS == 0
            if begins:
                self.look()
            tick.duration = step
            tick.command_angle = command + k // _PARTS * row if begins else None
            tick.set_load_inertia = load + k * row if begins else None
            tick.external_torque = outside + k * row
            tick.output_angle, tick.output_speed = angles + (k + 1) * row, speeds + (k + 1) * row
            entry.advance(tick)
        late = np.array([self.numbers.latency(x) for x in points])
        angle, speed = (some[:, same].reshape(-1, copies, joints) for some in (angle, speed))
        found = _hermite(grid, angle, speed, time[:, None] - late)
        return np.asarray(np.moveaxis(found, 0, 1) * self._gain + self._zero)

    def _asked(self, episode: Episode, points: Array, grid: Array) -> tuple[Array, Array]:
        """Return external torques and inertias at the servos between the times of a grid, shape (parts, lanes)."""
        middles, found = 0.5 * (grid[1:] + grid[:-1]), []
        zeros, masses = (np.array([of(x) for x in points]) for of in (self.numbers.zeros, self.numbers.masses))
        for x, (torque, inertia) in zip(points, self.demand.torques(episode, zeros, masses), strict=True):
            late = middles + self.numbers.latency(x)
            found.append([np.stack([np.interp(late, episode.time, column) for column in some.T], axis=1)
                          for some in (torque * self._gain, inertia * self._gain**2)])
        torques, inertias = (np.concatenate([one[k] for one in found], axis=1) for k in range(2))
        return torques, inertias


def _alike(joints: int, torque: Array, inertia: Array, numbers: Mapping[str, Array]) -> tuple[Indices, Indices]:
    """Return lanes that differ, and which of these each lane is like: many a number moves few joints."""
    lanes = torque.shape[1]
    rows = np.column_stack([np.arange(lanes) % joints, *(some for some in numbers.values() if some.dtype.kind == "f"),
                            np.round(torque.T, _DIGITS), np.round(inertia.T, _DIGITS)])
    _, own, same = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return own, same.ravel()


def _hermite(grid: Array, angle: Array, speed: Array, at: Array) -> Array:
    """Return angles between the times of a grid by cubics, shape (n, copies, joints); before it the first one."""
    place = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
    step = grid[place + 1] - grid[place]
    s = np.clip((at - grid[place]) / step, 0.0, None)[..., None]
    copy = np.arange(angle.shape[1])[None, :]
    a, b = angle[place, copy], angle[place + 1, copy]
    va, vb = speed[place, copy] * step[..., None], speed[place + 1, copy] * step[..., None]
    return np.asarray(a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb))))
