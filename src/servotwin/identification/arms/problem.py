"""What is fitted in the fit of a robot, and how far simulated joints are off it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.dynamics import Demand, WholeArm
from servotwin.identification.arms.lanes import JointLanes
from servotwin.identification.arms.rows import Copies, Episode, Mask, Noise, Numbers, residuals, used_rows
from servotwin.identification.arms.search import ArmSearch
from servotwin.identification.fitting.arrow import Loss, Prior
from servotwin.identification.fitting.task import HUBER

Array = NDArray[np.float64]


class Problem(NamedTuple):
    """What is fitted: robot, numbers, links, episodes and their samples, what is called, and what motions ask for."""

    plant: Any
    numbers: Numbers
    links: list[int]
    episodes: list[Episode]
    used: list[Mask]
    look: Callable[[], object]
    demand: Demand

    @property
    def prior(self) -> Prior:
        """The beliefs."""
        return Prior(self.numbers.start, self.numbers.weight)

    def shorter(self, seconds: float) -> Problem:
        """Return the problem of the parts of so many seconds in which goals go furthest."""
        parts = [(one, used) if rows.all() else (part := one.part(rows), used[rows] & used_rows(part))
                 for one, used in zip(self.episodes, self.used, strict=True) for rows in (one.busiest(seconds),)]
        return self._replace(episodes=[one for one, _ in parts], used=[used for _, used in parts])

    def lanes(self) -> JointLanes:
        """Return the joints one by one."""
        return JointLanes(self.plant, self.numbers, self.links, self.look, self.demand)

    def whole(self) -> WholeArm:
        """Return the whole robot."""
        return WholeArm(self.plant, self.numbers, self.links, self.look)

    def search(self, simulated: Copies, noise: Noise, prior: Prior | None = None,
               steps: Array | None = None) -> ArmSearch:
        """Return the least-squares problem of a stage; `steps` are those of derivatives."""
        return ArmSearch(simulated, self.episodes, self.used, noise, Loss(HUBER), prior or self.prior,
                         np.zeros(len(self.numbers), np.bool_), steps)

    def left(self, simulated: Copies, x: Array) -> list[Array]:
        """Return simulated less measured angles of all episodes at a point, shape (n, joints) each."""
        return [residuals(simulated, episode, x[None])[0] for episode in self.episodes]

    def at_bound(self, x: Array) -> Mask:
        """Return which numbers are at a bound."""
        return np.asarray((x <= self.numbers.lower + 1e-9) | (x >= self.numbers.upper - 1e-9))
