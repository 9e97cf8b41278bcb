"""The two stages of the fit of a robot, of which each keeps the best that it has found wherever it is stopped."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.arm_fit import ArmCause
from servotwin.identification.arms.causes import causes_of, confirmed
from servotwin.identification.arms.doubts import Doubts, doubts_of
from servotwin.identification.arms.numbers import LATENCY, Numbers
from servotwin.identification.arms.problem import Problem
from servotwin.identification.arms.registers import arm_registers
from servotwin.identification.arms.rows import (
    Linear,
    Noise,
    beyond_scatter,
    noise_of,
    parts_of,
    spread_of,
    used_rows,
    usual_steps,
)
from servotwin.identification.arms.whole import WholeArm
from servotwin.identification.arms.windows import LeftOut, strange_windows, without
from servotwin.identification.fitting.registers import RegisterSearch
from servotwin.identification.fitting.stopping import Stops
from servotwin.robots import Mount

Array = NDArray[np.float64]
Show = Callable[[float, str], None]
_ROUNDS, _STEPS = 2, 8  # of the first stage
_SECONDS = 20.0  # of each episode, that the search for causes looks at
_WHOLE_TURNS, _WHOLE_STEPS = 2, 6  # of the second: derivatives, and steps by them
_FAR = 1.0  # widths of a belief, over which derivatives change
_TRIED = 1.5  # widths of a belief, that make causes be tried
_NOISY = 2e-3  # rad at rest: more than counts and a clock leave
JOINTS_ALONE, CAUSES, WHOLE, INTERVALS = (
    "where the search of single joints ends", "what may be the matter", "what the whole robot does", "intervals")


@dataclass
class Way:
    """How far a fit has come.

    Parameters
    ----------
    what : Problem
    x : ndarray
        The best so far.
    noise : Noise
    steps : ndarray, optional
        For derivatives.
    found : bool
        Whether that is more than the start.
    left_out : tuple of LeftOut
    causes : tuple of ArmCause
    doubts : Doubts, optional
    missing : list of str
        What is not known yet.
    seconds : dict of str to float
        CPU time that each stage took.
    registers : RegisterSearch, optional
        What stands in registers that nobody recorded.
    """

    what: Problem
    x: Array
    noise: Noise
    steps: Array | None = None
    found: bool = False
    left_out: tuple[LeftOut, ...] = ()
    causes: tuple[ArmCause, ...] = ()
    doubts: Doubts | None = None
    missing: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    registers: RegisterSearch | None = None

    def keep(self, other: Way, best: Array) -> None:
        """Take over what another one fits, with the best so far."""
        self.what, self.x, self.noise, self.steps, self.found = other.what, best, other.noise, other.steps, True
        self.left_out = other.left_out

    def know(self, what: str) -> None:
        """Note that something is no longer missing."""
        self.missing = [one for one in self.missing if one != what]

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Note the CPU time of a stage."""
        began = clock.process_time()
        try:
            yield
        finally:
            self.seconds[stage] = clock.process_time() - began


def searched(what: Problem, make: Callable[[Sequence[str], Mapping[str, Mount]], Numbers], course: Stops, *,
             intervals: bool, diagnose: bool) -> Way:
    """Return where a fit ends; a stop ends the stage that it meets, and those that come after it are left out."""
    way = Way(what, what.numbers.start.copy(), Noise(np.zeros(0), 0.0))
    way.missing = [JOINTS_ALONE, *([CAUSES] if diagnose else []), *([WHOLE, INTERVALS] if intervals else [])]
    try:
        with way.timed("registers"):
            course(0.0, "registers")
            way.registers, mounts = arm_registers(what, lambda having: make((), having))
            what = what._replace(numbers=make((), mounts))
        with way.timed("first"):
            _first_stage(way, what, course)
        if diagnose:
            with way.timed("causes"):
                _look_for_causes(way, lambda gains: make(gains, mounts), course)
        with way.timed("second"):
            _second_stage(way, course, intervals=intervals)
    except KeyboardInterrupt:
        pass
    return way


def _first_stage(way: Way, what: Problem, show: Show) -> None:
    """Search with lanes of single joints, and leave out what no numbers explain."""
    lanes, x, steps = what.lanes(), what.numbers.start.copy(), usual_steps(what.numbers)
    windows: tuple[LeftOut, ...] = ()
    for turn in range(_ROUNDS):
        noise = noise_of(what.episodes, what.left(lanes, x), what.used)
        now = Way(what, x, noise, left_out=windows)

        def tell(step: int, best: Array, now: Way = now, turn: int = turn) -> None:
            if turn or step:
                way.keep(now, best)
            show(0.4 * (turn + step / _STEPS) / _ROUNDS, "joints one by one")

        search = what.search(lanes, noise, steps=steps)
        x, steps = search.run(x, most=_STEPS, tell=tell), search.steps
        if turn == 0:
            left = what.left(lanes, x)
            noise = noise_of(what.episodes, left, what.used)
            windows = strange_windows(what.episodes, left, what.used, noise, what.numbers.joints)
            what = what._replace(used=without(what.used, what.episodes, windows, what.numbers.joints))
    way.keep(Way(what, x, noise_of(what.episodes, what.left(lanes, x), what.used), steps, left_out=windows), x)
    way.know(JOINTS_ALONE)


def _look_for_causes(way: Way, make: Callable[[Sequence[str]], Numbers], show: Show) -> None:
    """Seek causes where a belief is pushed far, or what is left is no noise; a wrong gain is searched from then on."""
    what, noise = way.what, way.noise
    off = np.abs(way.x - what.numbers.start) * what.numbers.weight
    if off.max() >= _TRIED or noise.positions.max() >= _NOISY:
        show(0.4, "causes")
        way.causes = causes_of(what.shorter(_SECONDS), noise, way.x, make)
    if way.causes and way.causes[0].joints:  # what the wrong gain has bent is found anew with that gain searched
        _first_stage(way, what._replace(numbers=make(way.causes[0].joints),
                                        used=[used_rows(one) for one in what.episodes]), show)


def _second_stage(way: Way, show: Show, *, intervals: bool) -> None:
    """Search with the whole robot, and see what its derivatives say of the numbers."""
    what = way.what
    arm = what.whole()
    way.x, way.noise = _nearest(what, arm, way.x)
    noise = way.noise
    if not intervals:
        way.know(CAUSES)
        return

    for turn in range(_WHOLE_TURNS):
        def tell(step: int, best: Array, turn: int = turn) -> None:
            way.x = best
            show(0.6 + 0.2 * turn + 0.05 * step / _WHOLE_STEPS, "the whole robot")

        show(0.45 + 0.2 * turn, "the whole robot")
        search, x = what.search(arm, noise, steps=way.steps), way.x
        steps, linear = search.steps, search.linear(x, central=True)
        slopes, shakes = _clean(what, linear, noise), [one.scatter * steps for one in linear]
        way.steps = search.steps
        way.x = search.along(x, slopes, most=_WHOLE_STEPS, tell=tell)
        far = float(np.abs((way.x - x) * np.where(what.numbers.weight > 0.0, what.numbers.weight, 1.0)).max())
        if far < _FAR:
            break
    way.know(WHOLE)
    way.causes = confirmed(way.causes, what, arm, noise, way.x, slopes)
    way.know(CAUSES)
    show(0.85, "intervals")
    found = what.left(arm, way.x)
    way.noise = noise_of(what.episodes, found, what.used)
    way.doubts = doubts_of(what, way.x, way.noise, found, slopes, shakes)
    way.know(INTERVALS)


def _nearest(what: Problem, arm: WholeArm, x: Array) -> tuple[Array, Noise]:
    """Return which of some points the whole robot moves nearest by, and the noise that it leaves.

    Joints that hang on others without servos, or that stick, do otherwise alone: what the search of single joints has
    found may then be worse than what the files say.
    """
    late = np.where(np.array(what.numbers.names) == LATENCY, x, what.numbers.start)
    points = (x, late, what.numbers.start)
    found = [what.left(arm, point) for point in points]
    best = int(np.argmin([spread_of(left, what.used) for left in found]))
    return points[best], noise_of(what.episodes, found[best], what.used)


def _clean(what: Problem, linear: Sequence[Linear], noise: Noise) -> list[Array]:
    """Return derivatives without directions in which they are no more than their noise."""
    tables = [[np.concatenate([part.shared for part in parts_of(episode, one.residual, some, noise, used)])
               for episode, one, used, some in zip(what.episodes, linear, what.used, chosen, strict=True)]
              for chosen in ([one.slopes for one in linear], [one.scatter for one in linear])]
    kept = beyond_scatter(*(np.concatenate(one) for one in tables))
    return [one.slopes @ kept for one in linear]
