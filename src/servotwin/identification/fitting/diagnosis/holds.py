"""Do the intervals of a fit hold although its model lacks something? What may be missing is simulated, and fitted away.

If a candidate were true, a fit without it would be off by the part of its effect that the numbers of the fit imitate.
How large it is follows from the part that they do not, which is what is left.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.assumptions import assumptions
from servotwin.identification.fitting.diagnosis.bench import Setting, TrialBench
from servotwin.identification.fitting.diagnosis.candidates import TABLE, possible
from servotwin.identification.fitting.point import joined

Array = NDArray[np.float64]

_IMITATED = 0.05  # of an effect: with less of it left nothing says how large it is
_LIKELY = 0.2  # of what is left: what a candidate explains that is asked alone


_SIZES = ("minimum drive time", "coast", "viscous friction", "breakaway", "play at the potentiometer", "load friction",
          "play", "bent potentiometer")  # what the shape of an effect is known of


def moved(bench: TrialBench, half: Mapping[str, float], named: str = "") -> dict[str, tuple[float, str]]:
    """Return by how many half widths of its interval each number would be off, and by what, if that were missing.

    Every candidate is as large as what is left lets it be; one that is named, or explains what is left, counts alone.

    Parameters
    ----------
    bench : TrialBench
    half : mapping of str to float
        Half widths of the intervals, on the scale of the search.
    named : str
        The cause that a trial found.
    """
    known = {one.name for one in assumptions(bench.task.forecast, bench.whole)}  # intervals allow for these already
    settings = [(one.name, several[0]) for one in TABLE if one.name in _SIZES and (several := possible(one, bench))
                and (one.name == named or not set(several[0].values) <= known)]
    r, J = _slopes(bench)
    names = (*bench.old.space.names, *bench.old.extra)
    asked = {k: name for k, name in enumerate(names) if half.get(name, 0.0) > 0.0}
    effects = [one for name, setting in settings if (one := _effect(bench, name, setting, r, J)) is not None]
    likely = ([one for one in effects if one.candidate == named]
              or [one for one in effects if one.share >= _LIKELY] or effects)
    found = {}
    for k, name in asked.items() if likely else ():
        worst = max(likely, key=lambda one: abs(one.shift[k]))
        found[name] = float(abs(worst.shift[k])) / half[name], worst.candidate
    return found


class _Effect(NamedTuple):
    """By how much a candidate would move the numbers of a fit (scaled), and which share of what is left it explains."""

    candidate: str
    shift: Array
    share: float


def _effect(bench: TrialBench, name: str, setting: Setting, r: Array, J: Array) -> _Effect | None:
    """Return what a candidate would do; None if that cannot be told."""
    try:
        d = _residuals(bench, setting) - r
    except ServotwinError:
        return None
    if len(d) != len(r) or not np.isfinite(d).all() or not float(r @ r) > 0.0:
        return None
    x: Array = np.asarray(np.linalg.lstsq(J, d, rcond=1e-10)[0])
    e = d - J @ x
    power = float(e @ e)
    if power <= _IMITATED**2 * float(d @ d):
        return None
    size = -float(e @ r) / power
    share = size**2 * power / float(r @ r) if size > 0.0 else 0.0
    times = size if share >= _LIKELY else math.sqrt(float(r @ r) / power)
    return _Effect(name, np.asarray(x * times), share)


def _slopes(bench: TrialBench) -> tuple[Array, Array]:
    """Return residuals and derivatives of all logs at the base, also where nothing teaches."""
    forecast = bench.base.forecast
    seen, forecast.seen = forecast.seen, None
    parts = forecast.at(bench.base.point)
    forecast.seen = seen
    return np.concatenate([part.residual for part in parts]), joined(parts)


def _residuals(bench: TrialBench, setting: Setting) -> Array:
    """Return the residuals of all logs with a setting at its start, in the noise of the base.

    Raises
    ------
    InputError
        If the model cannot follow the logs so.
    """
    forecast = bench.forecast(setting)
    forecast.noise, forecast.seen = dict(bench.base.forecast.noise), None
    parts = forecast.at(bench.start(forecast, setting, bench.base.point), derivatives=False)
    return np.concatenate([part.residual for part in parts])
