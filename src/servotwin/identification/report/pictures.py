"""The pictures of a fit's numbers: intervals, correlation, and errors beside those of simpler models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.identification.report.shown import MODELS, error_rows, nominal_of
from servotwin.look import COLOURS, WIDTH, context, finished, new_figure, on_page
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.identification.fitting.fit import Fit
    from servotwin.identification.fitting.holdout import ErrorTable

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
