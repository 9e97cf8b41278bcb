"""Measured over simulated, log by log, and what is left: over time, its distribution, how it follows itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.independence import cross_correlation
from servotwin.identification.fitting.noise import SensorSeries
from servotwin.identification.fitting.verdict import FALSE_ALARM
from servotwin.identification.report.shown import sensor_shown
from servotwin.look import COLOURS, WIDTH, context, finished, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.identification.fitting.fit import Trace
    from servotwin.identification.fitting.independence import CrossCorrelation

Array = NDArray[np.float64]

_TALL = 4.6  # inch
_FEW = 3  # logs, up to which all are shown open
_ZOOM = 16  # samples
_GAP = 4.0  # times the usual step, beyond which a line is broken
_MOST_LAG = 100  # samples
_BINS = 40  # of time
_WORDS = {"output_angle": "angle", "feedback_voltage": "feedback"}


def by_error(traces: Sequence[Trace]) -> list[Trace]:
    """Return traces, those furthest off first."""
    return sorted(traces, key=lambda trace: -_rms(trace.residual))


def shown_first(traces: Sequence[Trace]) -> list[Trace]:
    """Return of many logs the one that is furthest off, the middle one and the nearest; up to three all of them."""
    ordered = by_error(traces)
    if len(ordered) <= _FEW:
        return ordered
    return [ordered[0], ordered[len(ordered) // 2], ordered[-1]]


def worst_window(trace: Trace) -> tuple[float, float]:
    """Return from when to when the residuals are largest: a window of a tenth of the log, of some samples at least."""
    n = len(trace.time)
    width = min(n, max(_ZOOM, n // 10))
    power = np.convolve(trace.residual**2, np.ones(width), "valid")
    first = int(np.argmax(power))
    return float(trace.time[first]), float(trace.time[first + width - 1])


def beside(trace: Trace) -> Figure:
    """Return what one log measured, the simulation over it, their difference below, and where that is largest."""
    factor, unit = sensor_shown(trace.signal)
    time, measured, simulated = _broken(trace.time, trace.measured * factor, trace.simulated * factor)
    low, high = worst_window(trace)
    with context():
        figure = new_figure(WIDTH, _TALL)
        grid = figure.add_gridspec(3, 2, height_ratios=(2.2, 1.0, 1.6))
        above = figure.add_subplot(grid[0, :])
        below = figure.add_subplot(grid[1, :], sharex=above)
        near, left = figure.add_subplot(grid[2, 0]), figure.add_subplot(grid[2, 1])
        for ax, marker in ((above, ""), (near, ".")):
            ax.plot(time, measured, color=COLOURS["black"], linewidth=2.4, alpha=0.45, marker=marker, markersize=3.0,
                    label="measured")
            ax.plot(time, simulated, color=COLOURS["blue"], linewidth=1.2, label="simulated")
        for ax in (below, left):
            ax.axhline(0.0, color=COLOURS["grey"], linewidth=0.8)
            ax.plot(time, simulated - measured, color=COLOURS["vermilion"], linewidth=1.0)
        for ax in (above, below):
            ax.axvspan(low, high, color=COLOURS["yellow"], alpha=0.25, linewidth=0.0)
        above.legend(loc="upper right")
        above.margins(x=0.01)
        above.tick_params(labelbottom=False)
        above.set_ylabel(f"{_WORDS.get(trace.signal, trace.signal)} ({unit})")
        below.set(xlabel="time (s)", ylabel=f"difference ({unit})")
        _zoom(near, time, low, high, measured, simulated)
        _zoom(left, time, low, high, simulated - measured)
        near.set(xlabel="time (s)", ylabel=f"{_WORDS.get(trace.signal, trace.signal)} ({unit})")
        left.set(xlabel="time (s)", ylabel=f"difference ({unit})")
    return finished(figure)


def _zoom(ax: Axes, time: Array, low: float, high: float, *curves: Array) -> None:
    """Show a window, with the range that the curves have in it."""
    from matplotlib.ticker import MaxNLocator

    inside = (time >= low) & (time <= high)
    values = np.concatenate([curve[inside] for curve in curves])
    values = values[np.isfinite(values)]
    bottom, top = float(values.min(initial=0.0 if not len(values) else math.inf)), float(values.max(
        initial=0.0 if not len(values) else -math.inf))
    margin = 0.08 * max(top - bottom, 1e-9)
    ax.set_xlim(low, high if high > low else low + 1e-9)
    ax.set_ylim(bottom - margin, top + margin)
    ax.xaxis.set_major_locator(MaxNLocator(5))


def residuals(traces: Sequence[Trace], noise: Mapping[str, float], command: CrossCorrelation | None = None) -> Figure:
    """Return panels: residuals over time, their distribution, autocorrelation, and correlation with the command before.

    In units of each sensor's noise, so that all logs stand in one picture. The last is that of logs that were fitted,
    as the verdict says it where there is one; without a verdict that of all logs.
    """
    with context():
        if command is None and len({trace.signal for trace in traces}) == 1:
            command = cross_correlation([SensorSeries(t.log, t.time, t.measured, t.simulated) for t in traces
                                         if not t.held_out or all(one.held_out for one in traces)])
        figure = new_figure(WIDTH, 6.6 if command is None else 8.6)
        over_time, spread, follows, *last = figure.subplots(3 if command is None else 4, 1)
        if command is not None:
            _command(last[0], command)
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


def _command(ax: Axes, found: CrossCorrelation) -> None:
    """Draw how residuals follow the command of before, over the band in which noise does."""
    ax.fill_between(found.lag, -found.band, found.band, color=COLOURS["grey"], alpha=0.25, linewidth=0.0,
                    label="99 % of noise")
    ax.axhline(0.0, color=COLOURS["grey"], linewidth=0.8)
    ax.vlines(found.lag, 0.0, found.value, color=COLOURS["blue"], linewidth=1.2)
    ax.plot(found.lag, found.value, color=COLOURS["blue"], linestyle="none", marker="o", markersize=3.0,
            label=f"all lags together: noise does so in {100.0 * found.odds:.2g} % of logs" if found.odds > FALSE_ALARM
            else "all lags together: noise does not do so")
    most = 1.1 * float(max(np.abs(found.value).max(), found.band.max()))
    ax.set(xlabel="command so long before (s)", ylabel="cross-correlation (1)", ylim=(-most, 2.0 * most))
    ax.legend(loc="upper right")


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
