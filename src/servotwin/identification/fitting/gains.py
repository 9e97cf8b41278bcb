"""Why one fit of a ladder is chosen over a simpler one, in words: by how much, and in what motion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.fit import Fit, Trace

Array = NDArray[np.float64]

_STANDS = 0.02  # of a log's largest speed: below, it stands
_WINDOW = 0.05  # s, over which that is told: counts of an encoder are no speed
_LEAST = 0.02  # share of an error that is worth a word


def gained(simpler: Fit, chosen: Fit, name: str) -> str:
    """Return what a fit gains over a simpler one of the same logs, as half a sentence; empty where it gains nothing.

    Judged are the logs that were held out; all of them where there are none.

    Parameters
    ----------
    simpler, chosen : Fit
    name : str
        Of the simpler one.
    """
    before, after = (_squares(fit) for fit in (simpler, chosen))
    if not before or set(before) != set(after):
        return ""
    whole = _change(before.values(), after.values())
    if not whole < -_LEAST:
        return ""
    held = any(trace.held_out for trace in chosen.traces)
    told = f"{_percent(whole)} less off than {name} on logs that were {'held out' if held else 'fitted'}"
    states = {word: _change([x[k] for x in before.values()], [x[k] for x in after.values()])
              for k, word in enumerate(("where the shaft stands", "where it moves"))}
    parts = [f"{word} {_percent(x)} {'less' if x < 0.0 else 'more'}" for word, x in states.items() if abs(x) > _LEAST]
    motions: dict[str, list[str]] = {}
    for log, motion in {t.log.name: t.log.motion for t in chosen.traces if t.log.name in after}.items():
        motions.setdefault(motion, []).append(log)
    if len(motions) > 1:
        each = {motion: _change([before[x] for x in some], [after[x] for x in some])
                for motion, some in motions.items()}
        best = min(each, key=lambda motion: each[motion])
        if each[best] < -_LEAST:
            parts.append(f"most in {best}, {_percent(each[best])}")
    return told + (f" ({'; '.join(parts)})" if parts else "")


def _percent(change: float) -> str:
    return f"{100.0 * abs(change):.0f} %"


def _change(before: Iterable[Array], after: Iterable[Array]) -> float:
    """Return by which share the root mean square changes; of rows of sums of squares and counts."""
    roots = []
    for rows in (before, after):
        total = np.sum([np.atleast_2d(row).sum(axis=0) for row in rows], axis=0)
        roots.append(math.sqrt(total[0] / total[1]) if total[1] else math.nan)
    return roots[1] / roots[0] - 1.0 if roots[0] > 0.0 else 0.0


def _squares(fit: Fit) -> dict[str, Array]:
    """Return sum of squares and number of the judged samples that stand and that move, by log."""
    held = [trace for trace in fit.traces if trace.held_out] or list(fit.traces)
    return {trace.log.name: _of(trace) for trace in held if trace.signal == "output_angle" and len(trace.time) > 2}


def _of(trace: Trace) -> Array:
    ahead, behind = (np.interp(trace.time + side * _WINDOW, trace.time, trace.measured) for side in (0.5, -0.5))
    speed = np.abs(ahead - behind)
    stands = speed <= _STANDS * float(np.max(speed))
    squares: list[Sequence[float]] = []
    for some in (stands & trace.judged, ~stands & trace.judged):
        squares.append((float(np.sum(trace.residual[some] ** 2)), float(np.sum(some))))
    return np.array(squares)
