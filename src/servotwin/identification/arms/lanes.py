"""The first stage: every joint a lane of its own, under the torque and inertia that the measured motion asks of it.

All joints, and copies of them with one number moved, run side by side, each as if it were alone on the supply; what the
others draw, and how long turns take that stamps only count, counts in the second stage. Time is that of the goals: a
joint at a stamp t is where its lane is at t less the latency.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.copies import Copies
from servotwin.identification.arms.dynamics import Asked, asked_of
from servotwin.identification.arms.episodes import Episode
from servotwin.identification.arms.numbers import Numbers, model_columns
from servotwin.simulation import VectorSimulator

Array = NDArray[np.float64]
_PARTS = 2  # of a sample: over each of them the torque stays
_NUDGE, _NEAR = 0.01, 0.05  # rad


class JointLanes(Copies):
    """Lanes of the joints of a robot; parameters as of `Copies`."""

    def __init__(self, plant: Any, numbers: Numbers, links: Sequence[int],
                 look: Callable[[], object] = lambda: None) -> None:
        super().__init__(plant, numbers, links, look)
        self.models = [mount.model for mount in numbers.mounts.values()]
        self._gain = np.array([mount.gain for mount in numbers.mounts.values()])
        self._zero = np.array([mount.zero for mount in numbers.mounts.values()])
        self._known: dict[tuple[int, ...], tuple[Array, Asked, list[Array]]] = {}

    def angles(self, episode: Episode, points: Array, *, fine: bool = False) -> Array:
        """Return where the joints are, shape (copies, n, joints) [rad]; nan of a failed lane."""
        copies, joints = len(points), len(self.models)
        time = episode.time
        grid = np.interp(np.arange(_PARTS * (len(time) - 1) + 1) / _PARTS, np.arange(len(time)), time)
        torque, inertia = self._asked(episode, points, grid)
        sims = VectorSimulator(self.models[0], copies * joints, threads=1, parameters=model_columns(
            self.models, self.numbers.columns(points), copies, fine=fine))
        goals = np.tile((episode.goals - self._zero) / self._gain, (1, copies))
        first = np.tile((episode.measured[0] - self._zero) / self._gain, copies)
        sims.reset(command_angle=goals[0], output_angle=first)
        angle, speed = np.zeros((2, len(grid), copies * joints))
        angle[0] = first
        for k, step in enumerate(np.diff(grid).tolist()):
            if k % _PARTS == 0:
                self.look()
                sims.set(load_inertia=inertia[k])
            sims.advance(step, command_angle=goals[k // _PARTS], external_torque=torque[k])
            angle[k + 1], speed[k + 1] = sims["output_angle"], sims["output_speed"]
        late = np.array([self.numbers.latency(x) for x in points])
        found = _hermite(grid, angle.reshape(-1, copies, joints), speed.reshape(-1, copies, joints),
                         time[:, None] - late)
        return np.asarray(np.moveaxis(found, 0, 1) * self._gain + self._zero)

    def _asked(self, episode: Episode, points: Array, grid: Array) -> tuple[Array, Array]:
        """Return external torques and inertias at the servos between the times of a grid, shape (parts, lanes)."""
        middles, found = 0.5 * (grid[1:] + grid[:-1]), []
        zeros = np.array([self.numbers.zeros(x) for x in points])
        about, base, slopes = self._about(episode, zeros[0])
        for x, zero in zip(points, zeros, strict=True):
            factors = self.numbers.masses(x)
            torque, inertia = base.of(factors)
            for j in np.flatnonzero(zero != about).tolist():
                torque = torque + (zero[j] - about[j]) / _NUDGE * (slopes[j] @ factors)
            late = middles + self.numbers.latency(x)
            found.append([np.stack([np.interp(late, episode.time, column) for column in some.T], axis=1)
                          for some in (torque * self._gain, inertia * self._gain**2)])
        torques, inertias = (np.concatenate([one[k] for one in found], axis=1) for k in range(2))
        return torques, inertias

    def _about(self, episode: Episode, zeros: Array) -> tuple[Array, Asked, list[Array]]:
        """Return zeros near some others, what a motion asks for there, and how that torque changes with each zero."""
        key = (id(episode), *np.round(zeros / _NEAR).astype(int).tolist())
        if key not in self._known:
            def asked(at: Array) -> Asked:
                return asked_of(self.plant, list(self.numbers.mounts), self.links, episode.angle + at, episode.speed,
                                episode.acceleration)

            base = asked(zeros)
            self._known[key] = zeros, base, [asked(zeros + _NUDGE * one).torque - base.torque
                                             for one in np.eye(len(zeros))]
        return self._known[key]


def _hermite(grid: Array, angle: Array, speed: Array, at: Array) -> Array:
    """Return angles between the times of a grid by cubics, shape (n, copies, joints); before it the first one."""
    place = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
    step = grid[place + 1] - grid[place]
    s = np.clip((at - grid[place]) / step, 0.0, None)[..., None]
    copy = np.arange(angle.shape[1])[None, :]
    a, b = angle[place, copy], angle[place + 1, copy]
    va, vb = speed[place, copy] * step[..., None], speed[place + 1, copy] * step[..., None]
    return np.asarray(a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb))))
