"""Angles whose span does not fit the commanded one: another unit, scale or travel."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from servotwin.errors import InputError
from servotwin.identification.fitting.suspicions.look import Array, Finding, Look, aligned

_FACTOR = math.sqrt(2.0)  # half way to 2 on a scale of ratios; pulse gains of makers differ by 12 %
_REST = 0.3  # s, in which the command hardly changes
_SLOW = 0.1  # of the speed without load: what counts as hardly
_LEAST = math.radians(20.0)  # of commands, so that friction and deadband count for little
_FEWEST = 10  # samples at rest
_MOST = 200  # of them in pairs
_ARRIVED = 0.5  # s, after which a shaft is where commands send it, wherever it began
_EDGE = 0.01  # of the samples: what is left of outliers
_BEYOND = 1.1  # of the travel from stop to stop
_KNOWN = (2.0, 3.0, 4.0, 1.5, 4.0 / 3.0, 180.0 / math.pi, 2.0 * math.pi)  # and their inverses
_NEAR = 0.07


def spans(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs whose angle moves much more or less than the command asks."""
    ratios = [ratio if not math.isnan(ratio := _ratio(one)) else _too_far(one) for one in looks]
    good = [one for one, ratio in zip(looks, ratios, strict=True)
            if not math.isnan(ratio) and 1.0 / _FACTOR < ratio < _FACTOR]
    found = [_scaled(one, ratio, good) for one, ratio in zip(looks, ratios, strict=True)
             if ratio > _FACTOR or (0.0 < ratio < 1.0 / _FACTOR and _free(one))]
    named = {finding.log for finding in found}
    return [*found, *(finding for one in looks if one.log.name not in named for finding in _beyond(one))]


def _ratio(one: Look) -> float:
    """Return how far the shaft goes where the command asks for one radian; nan where the log does not say."""
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    if len(time) < _FEWEST:
        return math.nan
    first = np.searchsorted(time, time - _REST)
    least = _SLOW * one.top_speed * _REST
    still = np.array([k > 0 and np.ptp(asked[a:k + 1]) < least and abs(angle[k] - angle[a]) < least + 6.0 * one.noise
                      and time[k] - time[0] >= _REST for k, a in enumerate(first)])
    x, y = asked[still], angle[still]
    if len(x) < _FEWEST:
        return math.nan
    some = np.linspace(0, len(x) - 1, min(len(x), _MOST)).astype(int)
    dx, dy = (np.subtract.outer(v[some], v[some]) for v in (x, y))
    far = dx > _LEAST
    return float(np.median(dy[far] / dx[far])) if far.sum() >= _FEWEST else math.nan


def _too_far(one: Look) -> float:
    """Return how much wider the measured span is than the commanded one; nan where it is not clearly wider."""
    later = one.smooth & (one.time >= _ARRIVED)
    if later.sum() < _FEWEST or np.ptp(one.asked) < _LEAST:
        return math.nan
    low, high = np.quantile(one.angle[later], (_EDGE, 1.0 - _EDGE))
    ratio = float((high - low) / np.ptp(one.asked))
    return ratio if ratio > _FACTOR else math.nan


def _free(one: Look) -> bool:
    """Tell whether no load pushes more on one side than on the other, so that a soft servo moves less."""
    return not (one.log.load.pendulums or one.log.load.springs or one.log.load.recorded)


def _scaled(one: Look, ratio: float, good: Sequence[Look]) -> Finding:
    known = min((*_KNOWN, *(1.0 / k for k in _KNOWN)), key=lambda k: abs(math.log(abs(ratio) / k)))
    factor = known if abs(math.log(abs(ratio) / known)) < _NEAR else ratio
    try:
        mended = one.with_angle(aligned(one, one.angle / factor, good))
    except InputError:  # an angle that hardly moves would be of any size
        mended = None
    return Finding("span", one.log.name, (
        f"log {one.log.name!r}: the shaft moves {ratio:.3g} times as far as it is asked to; check unit and scale of "
        "the angle, and travel and pulse range in the servo file (potentiometer.feedback_gain); mending \"span\" "
        f"divides the angle by {factor:.4g}"), mended)


def _beyond(one: Look) -> list[Finding]:
    """Return a finding where the angle goes through more than lies between the stops."""
    travel = one.model.value_or("stops.upper_angle", math.inf) - one.model.value_or("stops.lower_angle", -math.inf)
    angle: Array = one.angle[one.smooth]
    if len(angle) < _FEWEST or not math.isfinite(travel):
        return []
    span = float(np.quantile(angle, 1.0 - _EDGE) - np.quantile(angle, _EDGE))
    if span < _BEYOND * travel:
        return []
    return [Finding("span", one.log.name, (
        f"log {one.log.name!r}: the shaft goes through {span:.3g} rad, and the servo file's stops are {travel:.3g} rad "
        "apart; check the unit of the angle, and stops.lower_angle and stops.upper_angle"), None)]
