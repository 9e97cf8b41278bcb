"""The simulations of a fit: lanes of several logs in as few calls as pay, wherever a crew does them.

Lanes are simulated together though their logs were sampled at other times and last as long as others: all are looked at
whenever one of them is, and run as long as the longest. No lane feels that, to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.models import Model
from servotwin.signals import Signal
from servotwin.simulation.lanes.inputs import lanes_of
from servotwin.simulation.lanes.many import simulate_lanes
from servotwin.simulation.progress import HERE, Crew

Array = NDArray[np.float64]

FIT_ACCURACY = 1e-7  # rad
_LOOK = 1e-3  # s of simulation: about what it costs to look at a lane once
_CALL = 6e-3  # s: what a call costs besides its lanes
_WORTH = 4.0  # calls: less is not handed to another worker
_WORTH_AWAY = 20.0  # the same, where what goes to a worker and comes back is copied


@dataclass(frozen=True)
class Running:
    """Who simulates, and how closely.

    Parameters
    ----------
    crew : Crew
    accuracy : float
        Of motions that are integrated [rad].
    look : callable
        Called before each simulation; may raise KeyboardInterrupt.
    """

    crew: Crew = field(default_factory=Crew)
    accuracy: float = FIT_ACCURACY
    look: Callable[[], None] = lambda: None


@dataclass(frozen=True, eq=False)
class Bundle:
    """Lanes that are looked at together; picklable.

    Parameters
    ----------
    times : ndarray, shape (T,)
        When they are looked at, in any order [s].
    duration : float
        [s]
    load : Load
        Of all of them.
    signals : sequence of Signal, length n
    columns : mapping of str to ndarray, shape (n,)
        Numbers of servo and load by dotted name (SI).
    initial : mapping of str to ndarray, shape (n,)
    """

    times: Array
    duration: float
    load: Load
    signals: Sequence[Signal]
    columns: dict[str, Array]
    initial: dict[str, Array]

    @property
    def lanes(self) -> int:
        """How many there are."""
        return len(self.signals)

    @cached_property
    def key(self) -> bytes:
        """What is the same where bundles are looked at at the same times."""
        return self.times.tobytes()

    @property
    def cost(self) -> float:
        """What it takes, in seconds of one lane of which nothing is looked at."""
        return self.lanes * (self.duration + _LOOK * len(self.times))


@dataclass(frozen=True, eq=False)
class Batch:
    """Bundles of one call, and what they share; picklable.

    Parameters
    ----------
    model : Model
    outputs : tuple of str
    accuracy : float
        [rad]
    strict : bool
        Whether bad input is raised; otherwise the bundle that has it fails.
    bundles : tuple of Bundle
        All with the same names of columns and of initial values.
    nearly : bool
        As of `simulate_lanes`.
    """

    model: Model
    outputs: tuple[str, ...]
    accuracy: float
    strict: bool
    bundles: tuple[Bundle, ...]
    nearly: bool = False


Done = list[dict[str, Array] | None]
"""What comes of a batch: signals of each bundle, (n, T) each, None where it failed."""


def simulated(batch: Batch) -> Done:
    """Simulate a batch.

    Raises
    ------
    InputError
        If a lane is nothing that can be simulated, and the batch is strict.
    """
    try:
        return [*_simulated(batch)]
    except InputError:
        if batch.strict:
            raise
        alone = [replace(batch, bundles=(bundle,)) for bundle in batch.bundles]
        return [None] if len(alone) == 1 else [one for some in alone for one in simulated(some)]


def _simulated(batch: Batch) -> list[dict[str, Array]]:
    bundles = batch.bundles
    several = {bundle.key: bundle.times for bundle in bundles}
    times, where = np.unique(np.concatenate([*several.values()]), return_inverse=True)
    ends = np.cumsum([len(some) for some in several.values()])
    places = dict(zip(several, np.split(where, ends[:-1]), strict=True))
    counts = [bundle.lanes for bundle in bundles]
    columns, initial = ({name: np.concatenate([getattr(bundle, which)[name] for bundle in bundles])
                         for name in getattr(bundles[0], which)} for which in ("columns", "initial"))
    lanes = lanes_of(batch.model, [signal for bundle in bundles for signal in bundle.signals],
                     [bundle.load for bundle, count in zip(bundles, counts, strict=True) for _ in range(count)],
                     columns, initial or None, np.zeros(sum(counts), np.int64))
    made = simulate_lanes(lanes, duration=max(bundle.duration for bundle in bundles), output_times=times,
                          outputs=batch.outputs, executor=HERE, accuracy=batch.accuracy, nearly=batch.nearly)
    found, lane = [], 0
    for bundle, count in zip(bundles, counts, strict=True):
        rows, at = slice(lane, lane + count), places[bundle.key]
        found.append({name: np.asarray(made[name][rows, at], np.float64) for name in batch.outputs})
        lane += count
    return found


def batches(bundles: Sequence[Bundle], pace: float, crew: Crew) -> list[list[int]]:
    """Return which bundles go into which call: as few calls as keep all workers busy, the longest first.

    Parameters
    ----------
    bundles : sequence of Bundle
        That may be simulated together.
    pace : float
        How long a second of one lane takes, about [s].
    crew : Crew
    """
    seconds = [bundle.cost * pace for bundle in bundles]
    share = max(sum(seconds) / (2 * crew.workers), _CALL * (_WORTH if crew.is_here else _WORTH_AWAY))
    calls: list[_Call] = []
    for k in sorted(range(len(bundles)), key=lambda k: (-bundles[k].duration, bundles[k].key)):
        alone = not calls or calls[-1].seconds + 0.5 * seconds[k] > share
        vain = 0.0 if alone else calls[-1].in_vain(bundles[k]) * pace
        if alone or vain > (_CALL + calls[-1].vain) / len(calls[-1].which):  # more than each of these costs beside
            calls.append(_Call(bundles[k].duration))
            vain = 0.0
        calls[-1].add(k, bundles[k], seconds[k], vain)
    return [call.which for call in sorted(calls, key=lambda call: -call.seconds)]


class _Call:
    """Bundles that go into one call, the longest first."""

    def __init__(self, duration: float) -> None:
        self.which: list[int] = []
        self.seconds = self.vain = 0.0
        self._duration, self._lanes, self._looks = duration, 0, dict[bytes, int]()
        self._all_looks = 0

    def in_vain(self, bundle: Bundle) -> float:
        """Return what one more bundle, and the others for its sake, would do that nobody asks for [s of one lane]."""
        own = self._looks.get(bundle.key, 0)
        idle = self._duration - bundle.duration + _LOOK * (self._all_looks - own)
        return bundle.lanes * idle + (0.0 if own else self._lanes * _LOOK * len(bundle.times))

    def add(self, k: int, bundle: Bundle, seconds: float, vain: float) -> None:
        """Take one more, which does so much in vain [s]."""
        self.which.append(k)
        self.seconds += seconds
        self.vain += vain
        self._lanes += bundle.lanes
        if bundle.key not in self._looks:
            self._looks[bundle.key] = len(bundle.times)
            self._all_looks += len(bundle.times)
