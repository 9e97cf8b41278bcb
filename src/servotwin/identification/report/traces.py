"""Measured over simulated, log by log, and what is left: over time, its distribution, how it follows itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.report.shown import sensor_shown
from servotwin.units.look import COLOURS, WIDTH, context, finished, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.identification.fitting.fit import Trace

Array = NDArray[np.float64]

_SMALL = (3.5, 2.25)  # inch
_GAP = 4.0  # times the usual step, beyond which a line is broken
_MOST_LAG = 100  # samples
_BINS = 40  # of time
_WORDS = {"output_angle": "angle", "feedback_voltage": "feedback"}


def chosen(traces: Sequence[Trace], most: int) -> list[Trace]:
    """Return traces of every kind of motion in turn, of each those that were held out and are furthest off first."""
    kinds: dict[str, list[Trace]] = {}
    for trace in traces:
        kinds.setdefault(trace.log.motion, []).append(trace)
    for members in kinds.values():
        members.sort(key=lambda trace: (not trace.held_out, -_rms(trace.residual)))
    picked: list[Trace] = []
    for turn in range(max((len(members) for members in kinds.values()), default=0)):
        picked += [members[turn] for members in kinds.values() if turn < len(members)]
    kept = {id(trace) for trace in picked[:most]}
    return [trace for members in kinds.values() for trace in members if id(trace) in kept]


def beside(trace: Trace) -> Figure:
    """Return what one log measured, the simulation over it, and below their difference."""
    factor, unit = sensor_shown(trace.signal)
    time, measured, simulated = _broken(trace.time, trace.measured * factor, trace.simulated * factor)
    from matplotlib.ticker import MaxNLocator

    with context():
        figure = new_figure(*_SMALL, layout=None)
        figure.subplots_adjust(left=0.19, right=0.965, top=0.97, bottom=0.185, hspace=0.12)
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
        above.plot(time, measured, color=COLOURS["black"], linewidth=2.4, alpha=0.45, label="measured")
        above.plot(time, simulated, color=COLOURS["blue"], linewidth=1.2, label="simulated")
        above.set_ylabel(f"{_WORDS.get(trace.signal, trace.signal)} ({unit})")
        above.margins(x=0.01)
        below.axhline(0.0, color=COLOURS["grey"], linewidth=0.8)
        below.plot(time, simulated - measured, color=COLOURS["vermilion"], linewidth=1.0)
        below.set_ylabel(f"diff. ({unit})")
        below.set_xlabel("time (s)")
        below.xaxis.set_major_locator(MaxNLocator(6))
        for ax in (above, below):
            ax.tick_params(labelsize=7.0)
            ax.yaxis.set_label_coords(-0.155, 0.5)
        return figure


def residuals(traces: Sequence[Trace], noise: Mapping[str, float]) -> Figure:
    """Return three panels: residuals over time, their distribution, and their autocorrelation.

    In units of each sensor's noise, so that all logs stand in one picture.
    """
    with context():
        figure = new_figure(WIDTH, 6.6)
        over_time, spread, follows = figure.subplots(3, 1)
        mixed = len({trace.held_out for trace in traces}) > 1
        groups = [(words if mixed else "all logs", [t for t in traces if t.held_out is held], style)
                  for words, held, style in (("fitted", False, (COLOURS["blue"], "-")),
                                             ("held out", True, (COLOURS["vermilion"], (0, (5, 2)))))]
        for words, members, (colour, dash) in groups:
            if members:
                _over_time(over_time, members, noise, words, colour, dash)
                _spread(spread, members, noise, words, colour, dash)
                _follows(follows, members, words, colour, dash)
        over_time.axhline(0.0, color=COLOURS["grey"], linewidth=0.8)
        over_time.set(xlabel="time since the start of a log (s)", ylabel="residual (σ)")
        x = np.linspace(-5.0, 5.0, 201)
        spread.plot(x, np.exp(-0.5 * x**2) / math.sqrt(2.0 * math.pi), color=COLOURS["grey"], linewidth=1.0,
                    label="normal law")
        spread.set(xlabel="residual (σ)", ylabel="density (1/σ)", xlim=(-5.0, 5.0))
        follows.axhline(0.0, color=COLOURS["grey"], linewidth=0.8)
        follows.set(xlabel="lag (samples)", ylabel="autocorrelation (1)", ylim=(-0.5, 1.05))
        for ax in (over_time, spread, follows):
            ax.legend(loc="upper right")
    return finished(figure)


def _over_time(ax: Axes, traces: Sequence[Trace], noise: Mapping[str, float], words: str, colour: str, dash: Any,
               ) -> None:
    """Draw the median of the residuals over time, and the band of nine tenths of them."""
    time = np.concatenate([t.time - t.log.start for t in traces])
    value = np.concatenate([t.residual / noise[t.signal] for t in traces])
    edges = np.linspace(0.0, max(float(time.max()), 1e-9), _BINS + 1)
    place = np.clip(np.digitize(time, edges) - 1, 0, _BINS - 1)
    filled = [k for k in range(_BINS) if (place == k).any()]
    at = 0.5 * (edges[:-1] + edges[1:])[filled]
    low, middle, high = np.array([np.quantile(value[place == k], [0.05, 0.5, 0.95]) for k in filled]).T
    ax.fill_between(at, low, high, color=colour, alpha=0.18, linewidth=0.0)
    ax.plot(at, middle, color=colour, linestyle=dash, label=f"{words}: median, 90 % band")


def _spread(ax: Axes, traces: Sequence[Trace], noise: Mapping[str, float], words: str, colour: str,
            dash: Any) -> None:
    value = np.concatenate([t.residual / noise[t.signal] for t in traces])
    far = float(np.mean(np.abs(value) > 5.0))
    label = f"{words}: {100.0 * far:.2g} % beyond 5 σ" if far else words
    counts, edges = np.histogram(value, bins=np.linspace(-5.0, 5.0, 61))
    density = counts / (len(value) * np.diff(edges))
    ax.stairs(density, edges, color=colour, linestyle=dash, linewidth=1.4, label=label)


def _follows(ax: Axes, traces: Sequence[Trace], words: str, colour: str, dash: Any) -> None:
    """Draw the mean autocorrelation of the logs, up to a third of the longest."""
    found = autocorrelation([t.residual for t in traces])
    ax.plot(np.arange(len(found)), found, color=colour, linestyle=dash, label=words)


def autocorrelation(residuals: Sequence[Array]) -> Array:
    """Return the autocorrelation of residuals, all logs together, by lag.

    Examples
    --------
    >>> autocorrelation([np.array([1.0, -1.0] * 6)]).round(3).tolist()
    [1.0, -0.917, 0.833, -0.75, 0.667]
    """
    most = min(_MOST_LAG, max(len(r) for r in residuals) // 3)
    power = sum(float(r @ r) for r in residuals)
    if power == 0.0:
        return np.ones(1)
    return np.array([sum(float(r[k:] @ r[:len(r) - k]) for r in residuals if len(r) > k) / power
                     for k in range(most + 1)])


def _broken(time: Array, *values: Array) -> tuple[Array, ...]:
    """Return times and values with nan where there is a gap, so that no line is drawn across it."""
    if len(time) < 3:
        return (time, *values)
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > _GAP * float(np.median(steps))) + 1
    return tuple(np.insert(x, gaps, math.nan) for x in (time, *values))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
