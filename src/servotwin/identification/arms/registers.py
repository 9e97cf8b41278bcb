"""Registers of a robot's servos that nobody recorded, tried as whole lanes of its joints before its fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.episodes import Episode
from servotwin.identification.arms.numbers import LATENCY, LATENCY_SCALE, Numbers
from servotwin.identification.arms.problem import Problem
from servotwin.identification.arms.rows import used_rows
from servotwin.identification.fitting.point import DELAY_SCALE
from servotwin.identification.fitting.registers import (
    PROMISING,
    TAKEN,
    Bench,
    Lanes,
    RegisterSearch,
    State,
    Tried,
    has_registers,
    numbers_apart,
    searched,
)
from servotwin.parameters import Servo
from servotwin.robots import Mount

Array = NDArray[np.float64]
Make = Callable[[Mapping[str, Mount]], Numbers]
_EPISODES, _SECONDS = 2, 12.0  # that are looked at, those in which goals go furthest, and of each [s]
_MOVES = 0.05  # rad: a joint that moves less tells nothing


class _ArmBench(Bench):
    """Joints of a robot one by one, under the torque and inertia that their measured motion asks for.

    Masses, zeros and numbers of servos are those of files. Registers make up for some of what is wrong with these, so
    that no finer values are tried, and another register counts only where it leaves less than half.
    """

    rounds = 0

    def __init__(self, what: Problem, make: Make, episodes: Sequence[Episode]) -> None:
        super().__init__([mount.model.servo for mount in what.numbers.mounts.values()],
                         np.any([np.ptp(one.measured, axis=0) > _MOVES for one in episodes], axis=0))
        self.what, self.make, self.episodes = what, make, [*episodes]
        self.used = [used_rows(one)[:, 0] for one in self.episodes]

    def simplest(self, seen: Mapping[State, Tried]) -> list[State]:
        """Return the states with as few choices as do not leave twice what others do, of fewest registers first."""
        least = min(one.error for one in seen.values())
        few = min(state.choices for state, one in seen.items() if TAKEN * one.error <= least)
        some = {state: one for state, one in seen.items() if state.choices == few}
        least = min(one.error for one in some.values())
        near = [state for state, one in some.items() if one.error <= PROMISING * least]
        return sorted(near, key=lambda state: (len(seen[state].registers), seen[state].error))

    def lanes(self, some: Sequence[Tried]) -> Lanes:
        """Return what simulates servos of one form, in all episodes."""
        numbers = self.make(with_servos(self.what.numbers.mounts, some[0].servos))
        lanes, late = self.what._replace(numbers=numbers).lanes(), numbers.names.index(LATENCY)
        apart = [numbers_apart([one.servos[j] for one in some]) for j in range(len(self.servos))]

        def run(which: Sequence[int], delays: Array) -> list[tuple[Array, Array]]:
            points = np.repeat(numbers.start[None], len(which), axis=0)
            points[:, late] = delays / LATENCY_SCALE
            columns = numbers.columns(points)
            for j, (own, names) in enumerate(zip(columns, apart, strict=True)):
                own |= {name: np.array([some[k].servos[j].get(name) for k in which], np.float64) for name in names}
            residual, later = [], []
            for episode, used in zip(self.episodes, self.used, strict=True):
                angles = lanes.run(episode, points, columns)
                residual.append((angles - episode.measured)[:, used])
                later.append(-DELAY_SCALE * np.gradient(angles, episode.time, axis=1)[:, used])
            return [*zip(np.concatenate(residual, axis=1), np.concatenate(later, axis=1), strict=True)]

        return run


def with_servos(mounts: Mapping[str, Mount], servos: Sequence[Servo]) -> dict[str, Mount]:
    """Return mounts with other servos, in the order of the joints."""
    return {joint: Mount(type(mount.model)(servo), mount.zero, mount.direction, mount.ratio)
            for (joint, mount), servo in zip(mounts.items(), servos, strict=True)}


def arm_registers(what: Problem, make: Make) -> tuple[RegisterSearch | None, dict[str, Mount]]:
    """Return what stands in the registers of a robot's servos, and the mounts with those that are taken.

    All servos get the same registers, and single ones others where that clearly leaves less of their own error.

    Parameters
    ----------
    what : Problem
    make : callable
        Returns the numbers of a fit with other mounts.
    """
    mounts = dict(what.numbers.mounts)
    if not has_registers([mount.model for mount in mounts.values()]):
        return None, mounts
    episodes = sorted(what.episodes, key=lambda one: -float(np.abs(np.diff(one.goals, axis=0)).sum()))[:_EPISODES]
    some = what._replace(episodes=episodes).shorter(_SECONDS).episodes
    bench = _ArmBench(what, make, some)
    search = searched(bench, bench, names=[*mounts])
    if search is None:
        return None, mounts
    servos = search.taken.servos if search.taken is not None else [mount.model.servo for mount in mounts.values()]
    servos = [search.joints[joint].servo if joint in search.joints else servo
              for joint, servo in zip(mounts, servos, strict=True)]
    return search, with_servos(mounts, servos)
