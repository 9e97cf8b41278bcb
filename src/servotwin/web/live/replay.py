"""A scene once more, from t = 0 to its end: the numbers of a page, without the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servotwin.errors import InputError
from servotwin.models.outputs import SIGNALS
from servotwin.units import is_finite
from servotwin.web.live.live_bench import LiveBench
from servotwin.web.live.scene import Scene, read_scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_MOST_POINTS = 2e6
_STRETCH = 0.5  # s between two calls of `progress`


@dataclass(frozen=True, eq=False)
class Replayed:
    """What a bench did.

    Parameters
    ----------
    scene : Scene
    names : tuple of str
        Of the servos.
    signals : tuple of mapping of str to ndarray, shape (n,)
        Of each servo, by name, `time` first (SI).
    pulses : tuple of ndarray, shape (m, 2)
        Edges and widths of the pulses of each servo [s], width 0 of a lost one.
    """

    scene: Scene
    names: tuple[str, ...]
    signals: tuple[Mapping[str, Array], ...]
    pulses: tuple[Array, ...]

    def __getitem__(self, servo: int) -> Mapping[str, Array]:
        """Return the signals of a servo."""
        return self.signals[servo]

    def __len__(self) -> int:
        """Return the number of servos."""
        return len(self.signals)

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each signal."""
        return {name: "s" if name == "time" else SIGNALS[name].unit for one in self.signals for name in one}


def replay(scene: Scene | str, *, output_step: float = 1e-3, switches: bool = True,
           progress: Callable[[float], object] | None = None) -> Replayed:
    r"""Repeat what was done at a bench, and return what its servos did.

    Parameters
    ----------
    scene : Scene or str
        A bench, or the text of one.
    output_step : float
        Distance of the output times [s].
    switches : bool
        Whether the times at which a bridge switches come beside, each twice: just before and just after.
    progress : callable, optional
        Is told the share that is done.

    Raises
    ------
    InputError
        Or one of its kinds, if the scene is not possible.
    SimulationError
        If a servo cannot go on.

    Examples
    --------
    >>> run = replay('format = 1\nend = 0.5\nservo = [{id = "hitec-hs-755hb"}]')
    >>> run.names, float(run[0]["time"][-1])
    (('hitec-hs-755hb',), 0.5)
    """
    read = read_scene(scene) if isinstance(scene, str) else scene
    if not (is_finite(output_step) and output_step > 0.0 and read.end / output_step <= _MOST_POINTS):
        raise InputError("output_step", got=output_step,
                         allowed=f"a positive number [s], {_MOST_POINTS:.0e} points at most")
    bench = LiveBench(read)
    rows: list[list[tuple[float, ...]]] = [[row] for row in bench.rows]
    pulses: list[list[tuple[float, float]]] = [[] for _ in bench.models]
    while not bench.reached(read.end):
        push = bench.advance(min(read.end, bench.time + _STRETCH), 1.0 / output_step, switches=switches)
        for k, one in enumerate(push.servos):
            rows[k] += one.points
            pulses[k] += one.pulses
        if progress is not None:
            progress(bench.time / read.end)
    tables = [dict(zip(names, np.array(own, dtype=np.float64).T, strict=True))
              for names, own in zip(bench.columns, rows, strict=True)]
    return Replayed(read, tuple(model.servo.name for model in bench.models), tuple(tables),
                    tuple(np.array(own, dtype=np.float64).reshape(-1, 2) for own in pulses))
