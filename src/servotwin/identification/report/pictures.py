"""The pictures of a fit's numbers: intervals, correlation, and errors beside those of simpler models."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.identification.fitting.residual_noise import SensorSeries, cross_correlation
from servotwin.identification.fitting.search.free import LUMPED, nominal
from servotwin.identification.fitting.traces import fit_percent
from servotwin.identification.fitting.verdict import FALSE_ALARM
from servotwin.look import (
    COLOURS,
    WIDTH,
    context,
    figure_in,
    finished,
    label_of,
    new_figure,
    on_page,
    readable,
    unit_for,
)
from servotwin.studies import dimension_of
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.identification.fitting.fit import Fit
    from servotwin.identification.fitting.residual_noise import CrossCorrelation
    from servotwin.identification.fitting.traces import ErrorTable, Interval, Trace


# --- The numbers of a fit as people read them -------------------------------------------------------------------------

_LUMPED = {"output_torque_constant": "torque per current", "output_inertia": "inertia",
           "output_coulomb_torque": "torque"}
_NUISANCE = {"delay": "time", "angle_offset": "angle", "angle_sag": "angle", "frame_period": "time"}
_PER = {"angle_sag": "/V"}  # after the unit of the dimension
_SENSOR = {"output_angle": "angle", "feedback_voltage": "voltage", "armature_current": "current",
           "supply_current": "current"}
MODELS = {"BoundedServo": "bounded servo", "PulseServo": "pulse servo", "PulseServoInductive": "inductive pulse servo",
          "M1": "M1: Coulomb, viscous"}
"""Names of the columns of an error table, in words; others are words already."""


@dataclass(frozen=True)
class Line:
    """One estimate in words.

    Parameters
    ----------
    name : str
    value, lower, upper, sheet : str
        Numbers in the unit, "–" where there is none; `sheet` is what the servo said before.
    unit : str
        As it is printed.
    method : str
        How the interval was found: "normal", "profile", "linearised", "at bound", "undetermined"
        or "not sought".
    nuisance : bool
        Whether it belongs to the rig and not to the servo.
    prior : str
        How much of the interval is prior: a share, "–" where there is no interval, or "dropped".
    """

    name: str
    value: str
    lower: str
    upper: str
    sheet: str
    unit: str
    method: str
    nuisance: bool
    prior: str = "–"

    @property
    def interval(self) -> str:
        """Both ends, or why there are none.

        Examples
        --------
        >>> Line("delay", "20.1", "19.8", "20.4", "–", "ms", "normal", True).interval
        '19.8 to 20.4'
        """
        return self.method if self.lower == "–" or self.upper == "–" else f"{self.lower} to {self.upper}"


def dimension_of_free(name: str) -> str:
    """Return the dimension (of `servotwin.units`) of a searched name or a nuisance.

    Examples
    --------
    >>> dimension_of_free("output_inertia"), dimension_of_free("delay"), dimension_of_free("motor.armature_resistance")
    ('inertia', 'time', 'resistance')
    """
    if name in LUMPED:
        return _LUMPED[name]
    return _NUISANCE[name] if name in _NUISANCE else dimension_of(name)


def estimate_lines(fit: Fit) -> tuple[Line, ...]:
    """Return all estimates in words, in the order of the fit."""
    found = fit.intervals()
    return tuple(_line(fit, name, found[name]) for name in fit.names)


def _line(fit: Fit, name: str, interval: Interval) -> Line:
    dimension, value = dimension_of_free(name), fit.estimates[name]
    sheet = nominal_of(fit, name)
    unit = unit_for(value or sheet or 0.0, dimension)
    method = "not sought" if fit.doubt is None and interval.method == "undetermined" else interval.method
    within = 0.5 * (interval.upper - interval.lower)
    shown, lower, upper = (figure_in(float(x), unit, dimension, within=float(within))
                           for x in (value, interval.lower, interval.upper))
    said = "–" if sheet is None else figure_in(sheet, unit, dimension)
    return Line(name, shown, lower, upper, said, label_of(unit) + _PER.get(name, ""), method, name in _NUISANCE,
                _prior(fit, name))


def _prior(fit: Fit, name: str) -> str:
    """Return in words how much of what is known of a number is prior."""
    if any(one.name == name for one in fit.yielded):
        return "dropped"
    share = fit.prior_share.get(name, math.nan)
    return f"{100.0 * share:.0f} %" if math.isfinite(share) else "–"


def nominal_of(fit: Fit, name: str) -> float | None:
    """Return what the servo said of a searched parameter before the fit (SI); None where it said nothing."""
    if name in _NUISANCE:
        return None
    if name.startswith("load."):
        return next((p.start for p in fit.space.parameters if p.name == name), None)
    return nominal(fit.space.servo, name)


def rig_text(name: str, value: float) -> str:
    """Return a nuisance that all logs share, in words.

    Examples
    --------
    >>> rig_text("angle_offset", 0.0174532925), rig_text("delay", 0.02)
    ('angle offset 1°', 'delay 20 ms')
    """
    return f"{name.replace('_', ' ')} {readable(value, _NUISANCE[name])}{_PER.get(name, '')}"


def sensor_shown(name: str) -> tuple[float, str]:
    """Return by what a sensor's values (SI) are multiplied to be shown, and the unit.

    Examples
    --------
    >>> sensor_shown("feedback_voltage"), sensor_shown("output_angle")[1]
    ((1.0, 'V'), '°')
    """
    dimension = sensor_dimension(name)
    unit = "deg" if dimension == "angle" else units.si_unit(dimension)
    return 1.0 / units.factor(unit, dimension), label_of(unit)


def sensor_dimension(name: str) -> str:
    """Return the dimension (of `servotwin.units`) of a measured signal."""
    return _SENSOR[name]


def error_unit(name: str) -> tuple[float, str]:
    """Return by what errors of a sensor (SI) are multiplied to be shown, and the unit.

    Examples
    --------
    >>> error_unit("feedback_voltage")
    (1000.0, 'mV')
    """
    factor, unit = sensor_shown(name)
    return (factor, unit) if unit == "°" else (1e3 * factor, f"m{unit}")


def error_shown(traces: Iterable[Trace]) -> tuple[float, str]:
    """Return by what errors of these logs are multiplied to be shown, and the unit."""
    names = {trace.signal for trace in traces}
    return error_unit(names.pop()) if len(names) == 1 else (1.0, "rad or V")


class ErrorRow(NamedTuple):
    """Rms errors (SI) and fits [%] of the logs with one value of a label, by model; `which` logs, as "held out"."""

    value: str
    which: str
    errors: Mapping[str, float]
    fits: Mapping[str, float]


def tables_of(fit: Fit) -> dict[str, ErrorTable]:
    """Return the error tables of a fit that hold any log, with what to call their logs."""
    both = {"held out": fit.holdout, "fitted": fit.training}
    return {which: table for which, table in both.items() if table}


def error_rows(tables: Mapping[str, ErrorTable], label: str) -> list[ErrorRow]:
    """Return the rms errors by the values of a label, those of one value next to each other."""
    rows = []
    found = {which: (table.by(label), table.by(label, fit_percent)) for which, table in tables.items()}
    for value in dict.fromkeys(key for by, _ in found.values() for key in by):
        rows += [ErrorRow(value, which, by[value], fits[value]) for which, (by, fits) in found.items() if value in by]
    return rows


def percent(value: float) -> str:
    """Return a fit in per cent, to where it differs from 100; "–" where it is not known.

    Examples
    --------
    >>> percent(98.123), percent(99.9912), percent(-310.2), percent(float("nan"))
    ('98.1', '99.991', '-310', '–')
    """
    if not math.isfinite(value):
        return "–"
    digits = 1 if value < 99.0 else min(2 - math.floor(math.log10(max(100.0 - value, 1e-6))), 6)
    return f"{value:.{digits}f}" if value > -100.0 else f"{value:.0f}"


def share_text(value: float) -> str:
    """Return a share in per cent.

    Examples
    --------
    >>> share_text(0.0312), share_text(float("nan")), share_text(12.0)
    ('3.1 %', '–', '1200 %')
    """
    if not math.isfinite(value):
        return "–"
    return f"{100.0 * value:.2g} %" if abs(value) < 1.0 else f"{100.0 * value:.0f} %"


# --- The pictures of a fit's numbers: intervals, correlation, and errors beside those of simpler models ---------------
VALUES_A_PAGE = 12  # of a label, whose errors a picture shows at once; assumed
_ROW, _BAR = 0.34, 0.15
_TICKS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0,
          20.0)
_FAR = 20.0  # of the sheet's value: what lies further is cut off
_BARS = ((COLOURS["blue"], ""), (COLOURS["orange"], "////"), (COLOURS["sky"], "...."), (COLOURS["purple"], "xx"))


class _Row(NamedTuple):
    """One line of the forest, all relative to the servo's value before the fit."""

    name: str
    value: float
    ends: tuple[float, float] | None
    prior: tuple[float, float] | None
    method: str


def forest(fit: Fit) -> Figure | None:
    """Return the estimates with their intervals, relative to what the servo said before; None where it said nothing."""
    rows = [row for row in (_row(fit, name) for name in fit.space.names) if row is not None]
    if not rows:
        return None
    with context():
        figure = new_figure(WIDTH, 1.05 + _ROW * len(rows))
        ax = figure.subplots()
        _scale(ax, [x for row in rows for x in (row.value, *(row.ends or ()), *(row.prior or ()))])
        ax.axvline(1.0, color=COLOURS["grey"], linewidth=1.0, linestyle=(0, (4, 2)))
        for place, row in enumerate(rows):
            _draw_row(ax, place, row)
        ax.set_yticks(range(len(rows)), [row.name for row in rows])
        ax.set_ylim(len(rows) - 0.5, -0.5)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("value, relative to that of the servo file before the fit (1)")
        _forest_legend(figure, fit.level)
    return finished(figure)


def _row(fit: Fit, name: str) -> _Row | None:
    before = nominal_of(fit, name)
    if not before:
        return None
    interval = fit.intervals()[name]
    ends = None if math.isnan(interval.lower) else (interval.lower / before, interval.upper / before)
    p = next(p for p in fit.space.parameters if p.name == name)
    reach = None
    if p.scaled_prior is not None:
        mean, std = p.scaled_prior
        low, high = (float(p.value(mean + side * 1.96 * std)) / before for side in (-1.0, 1.0))
        reach = (min(low, high), max(low, high))
    return _Row(name, fit.estimates[name] / before, ends, reach, interval.method)


def _scale(ax: Axes, values: Sequence[float]) -> None:
    """Set a horizontal axis of factors, logarithmic where nothing is negative."""
    finite = [x for x in values if math.isfinite(x)]
    low, high = min(finite), max(finite)
    if low <= 0.0:
        low, high = max(low, -_FAR), min(high, _FAR)
        room = 0.08 * (high - low)
        ax.set_xlim(min(low, 1.0) - room, max(high, 1.0) + room)
        return
    low, high = max(min(low, 0.97), 1.0 / _FAR), min(max(high, 1.03), _FAR)
    room = (high / low) ** 0.06
    ax.set_xscale("log")
    ax.set_xlim(low / room, high * room)
    ticks = _ticks(low / room, high * room)
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()


def _ticks(low: float, high: float) -> list[float]:
    """Return ticks of a logarithmic axis about 1, none too near the next."""
    least = 0.09 * math.log(high / low)
    ticks = [1.0]
    for tick in sorted(_TICKS, key=lambda tick: abs(math.log(tick))):
        if low <= tick <= high and min(abs(math.log(tick / other)) for other in ticks) >= least:
            ticks.append(tick)
    return sorted(ticks)


def _draw_row(ax: Axes, place: int, row: _Row) -> None:
    left, right = ax.get_xlim()
    if row.prior is not None:
        begin, end = (min(max(x, left), right) for x in row.prior)
        ax.barh(place, end - begin, left=begin, height=0.62, color="#DDDDDD", zorder=1)
    if row.ends is not None:
        begin, end = (min(max(x, left), right) for x in row.ends)
        ax.plot([begin, end], [place, place], color=COLOURS["blue"], linewidth=2.2, zorder=3,
                solid_capstyle="butt", marker="|", markersize=8.0)
    known = row.ends is not None
    at = min(max(row.value, left), right)
    ax.plot([at], [place], linestyle="none", marker="o" if known else "D", markersize=6.0, zorder=4,
            color=COLOURS["blue"] if known else COLOURS["vermilion"], clip_on=False,
            markerfacecolor=COLOURS["blue"] if known else "white", markeredgewidth=1.4)
    if not known:
        to_right = ax.transData.transform((at, 0.0))[0] < ax.transAxes.transform((0.6, 0.0))[0]
        ax.annotate(row.method, xy=(at, place), xytext=(8.0 if to_right else -8.0, 0.0), textcoords="offset points",
                    ha="left" if to_right else "right", va="center", fontsize=7.5, color=COLOURS["vermilion"])


def _forest_legend(figure: Figure, level: float) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    figure.legend(handles=[
        Line2D([], [], color=COLOURS["blue"], marker="o", linewidth=2.2, label=f"estimate, {100 * level:g} % interval"),
        Line2D([], [], color=COLOURS["vermilion"], marker="D", markerfacecolor="white", linestyle="none",
               label="without interval"),
        Patch(color="#DDDDDD", label="what the servo file allows")], loc="outside upper center", ncols=2)


def correlation(fit: Fit) -> Figure | None:
    """Return the matrix of correlations; None where fewer than two numbers have one."""
    matrix = fit.correlation
    known = [k for k in range(len(fit.names)) if math.isfinite(matrix[k, k])]
    if len(known) < 2:
        return None
    shown = matrix[np.ix_(known, known)]
    size = len(known)
    with context():
        from matplotlib.colors import LinearSegmentedColormap

        colours = LinearSegmentedColormap.from_list("", [COLOURS["vermilion"], "#FFFFFF", COLOURS["blue"]])
        figure = new_figure(WIDTH, 1.5 + 0.42 * size)
        ax = figure.subplots()
        places = np.arange(size)
        ax.pcolormesh(places, places, shown, cmap=colours, vmin=-1.0, vmax=1.0, shading="nearest")
        ax.set_ylim(size - 0.5, -0.5)
        for i in range(size):
            for j in range(size):
                value = shown[i, j]
                ax.text(j, i, f"{value:.2f}".replace("-", "−"), ha="center", va="center", fontsize=7.5,
                        color="white" if abs(value) > 0.75 else "black")
        names = [fit.names[k] for k in known]
        ax.set_yticks(range(size), names)
        ax.set_xticks(range(size), [name.rpartition(".")[2].replace("_", " ") for name in names], rotation=40.0,
                      ha="right", rotation_mode="anchor")
        ax.grid(visible=False)
        ax.set_title("correlation (1)")
    return finished(figure)


def errors(tables: Mapping[str, ErrorTable], label: str, factor: float, unit: str, page: int = 1) -> Figure:
    """Return bars of the rms error by the values of a label, one for each model; the servo itself first.

    All pages have the same axis.
    """
    models = next(iter(tables.values())).models
    every = error_rows(tables, label)
    shown, foot = on_page("values", list(dict.fromkeys(row.value for row in every)), VALUES_A_PAGE, page)
    rows = [row for row in every if row.value in shown]
    with context():
        height = 1.15 + len(rows) * (0.16 + _BAR * len(models))
        figure = new_figure(WIDTH, height)
        ax = figure.subplots()
        most = max((x for row in every for x in row.errors.values() if math.isfinite(x)), default=1.0) * factor
        for place, row in enumerate(rows):
            _draw_errors(ax, place, row.errors, models, factor, most, faint=row.which == "fitted" and len(tables) > 1)
        ax.set_yticks(range(len(rows)), [f"{shortened(row.value)}\n{row.which}".rstrip() for row in rows])
        ax.set_ylim(len(rows) - 0.45, -0.55)
        ax.set_xlim(0.0, 1.16 * most)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel(f"rms error ({unit})")
        if len(models) > 1:
            _error_legend(figure, models)
    return finished(figure, foot)


def _draw_errors(ax: Axes, place: int, by: Mapping[str, float], models: Sequence[str], factor: float, most: float, *,
                 faint: bool) -> None:
    height = 0.8 / max(len(models), 1)
    for k, model in enumerate(models):
        value = by.get(model, math.nan) * factor
        y = place + height * (k - 0.5 * (len(models) - 1))
        colour, hatch = _BARS[k % len(_BARS)]
        if not math.isfinite(value):
            ax.annotate("none", xy=(0.0, y), xytext=(3.0, 0.0), textcoords="offset points", va="center", fontsize=7.0)
            continue
        ax.barh(y, value, height=0.9 * height, color=colour, hatch=hatch, edgecolor="white", linewidth=0.0,
                alpha=0.55 if faint else 1.0)
        ax.annotate(f"{value:.3g}", xy=(min(value, most), y), xytext=(3.0, 0.0), textcoords="offset points",
                    va="center", fontsize=7.0)


def _error_legend(figure: Figure, models: Sequence[str]) -> None:
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=_BARS[k % len(_BARS)][0], hatch=_BARS[k % len(_BARS)][1], edgecolor="white",
                     linewidth=0.0, label=MODELS.get(model, model)) for k, model in enumerate(models)]
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 3))


# --- Measured over simulated, log by log, and what is left ------------------------------------------------------------
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
    return sorted(traces, key=lambda trace: -float(np.sqrt(np.mean(trace.residual**2))))


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
                found = autocorrelation([t.residual for t in members])
                follows.plot(np.arange(len(found)), found, color=colour, linestyle=dash, label=words)
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
