"""Curves and points in one panel, and trains of pulses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError
from servotwin.look import COLOURS, CURVES_A_PAGE, LINES, axes_grid, context, finished, on_page
from servotwin.look.pages import pages, part

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BELOW = 1.5  # levels between two trains of pulses
_MARKERS = ("o", "s", "^", "D", "v")


class Curve(NamedTuple):
    """What is drawn: a line, or points with the half length of their error bars where it is given.

    Parameters
    ----------
    label : str
        For the legend.
    x, y : array_like, shape (n,)
        In the units of the axes.
    points : bool
        Whether to draw points and no line.
    error : array_like, shape (n,), optional
        Half the length of a bar along y.
    style : int, optional
        Number of the line style or marker; that of its place in the list unless given.
    """

    label: str
    x: ArrayLike
    y: ArrayLike
    points: bool = False
    error: ArrayLike | None = None
    style: int | None = None


class Limit(NamedTuple):
    """A horizontal line with words on it."""

    label: str
    y: float


def curves(drawn: Sequence[Curve], *, x_label: str, y_label: str, limits: Sequence[Limit] = (),
           below: Sequence[Curve] = (), below_label: str = "", height: float = 3.0, page: int = 1) -> Figure:
    """Return a figure with several curves in one panel, and differences in a second one below if there are any.

    All pages have the same axes.

    Parameters
    ----------
    drawn : sequence of Curve
        At least one; points that come later lie in front.
    x_label, y_label : str
        With the unit in brackets; formulas stand between $.
    limits : sequence of Limit
        Bounds to mark.
    below, below_label : sequence of Curve, str
        What the second panel shows, about zero, and its label with the unit.
    height : float
        [inch]
    page : int
        One of ``pages(len(drawn), CURVES_A_PAGE)``.

    Raises
    ------
    InputError
        If there is nothing to draw, or no such page.

    Examples
    --------
    >>> figure = curves([Curve("speed", [0.0, 1.0], [0.0, 2.0])], x_label="time (s)", y_label="speed (°/s)")
    >>> figure.axes[0].get_xlabel()
    'time (s)'
    """
    shown, foot = on_page("curves", drawn, CURVES_A_PAGE, page)
    shown_below = part(below, page, pages(len(drawn), CURVES_A_PAGE)[-1])
    figure, axes = axes_grid(2, height=height, ratios=(2.0, 1.0)) if below else axes_grid(1, height=height)
    with context():
        ax = axes[0]
        for limit in limits:
            ax.axhline(limit.y, color=COLOURS["grey"], linestyle=(0, (2, 2)), linewidth=1.0)
            ax.annotate(limit.label, xy=(1.0, limit.y), xycoords=("axes fraction", "data"), xytext=(-2.0, 2.5),
                        textcoords="offset points", ha="right", va="bottom", fontsize=7.5, color=COLOURS["grey"])
        _panel(ax, shown, y_label)
        same_axes(ax, ((curve.x, curve.y) for curve in drawn))
        if len(shown) > 1:
            ax.legend(loc="upper left" if below else "best", handlelength=3.2)
        if below:
            axes[1].axhline(0.0, color=COLOURS["grey"], linewidth=1.0)
            _panel(axes[1], shown_below, below_label)
            same_axes(axes[1], ((curve.x, curve.y) for curve in below))
        axes[-1].set_xlabel(x_label, parse_math=True)
        figure.align_ylabels(axes)
    return finished(figure, foot)


def same_axes(ax: Axes, drawn: Iterable[tuple[ArrayLike, ArrayLike]]) -> None:
    """Let the axes of a page reach as far as all that any page of its picture shows."""
    for x, y in drawn:
        ax.update_datalim(np.column_stack([x, y]))


def _panel(ax: Axes, drawn: Sequence[Curve], label: str) -> None:
    for place, curve in enumerate(drawn):
        _draw(ax, curve, place if curve.style is None else curve.style, place)
    ax.margins(y=0.09)
    ax.set_ylabel(label, parse_math=True)


def _draw(ax: Axes, curve: Curve, style: int, place: int) -> None:
    colour, dash = LINES[style % len(LINES)]
    if not curve.points:
        ax.plot(np.asarray(curve.x), np.asarray(curve.y), color=colour, linestyle=dash, label=curve.label)
        return
    marker = _MARKERS[style % len(_MARKERS)]
    ax.errorbar(np.asarray(curve.x), np.asarray(curve.y), yerr=curve.error, color=colour, linestyle="none",
                marker=marker, markersize=6.5 if style else 4.5, markerfacecolor="white" if style else colour,
                capsize=3.0, elinewidth=1.0, label=curve.label, zorder=3 + place)  # the last one in front


class Train(NamedTuple):
    """Another train of pulses.

    Parameters
    ----------
    label : str
    edges, widths : sequence of float, length n
        Rising edges and widths, at least two [s].
    """

    label: str
    edges: Sequence[float]
    widths: Sequence[float]


def pulses(edges: Sequence[float], widths: Sequence[float], *, frame_period: float, beside: Train | None = None,
           label: str = "") -> Figure:
    """Return a figure of a train of pulses: some frames above, the first pulse large below.

    Parameters
    ----------
    edges, widths : sequence of float, length n
        Rising edges and widths, at least two [s].
    frame_period : float
        Shown between the first two edges [s].
    beside : Train, optional
        Another one, drawn dashed below it.
    label : str
        Of the first one, where there are two.

    Raises
    ------
    InputError
        If there are fewer than two pulses.

    Examples
    --------
    >>> len(pulses([0.0, 0.02], [0.0015, 0.0015], frame_period=0.02).axes)
    2
    """
    if len(edges) < 2 or len(edges) != len(widths):
        raise InputError("pulses", got=f"{len(edges)} edges, {len(widths)} widths", allowed="as many, at least 2")
    figure, axes = axes_grid(2, height=3.6, share=False)
    with context():
        from matplotlib.ticker import FixedFormatter, FixedLocator

        time, level = pulse_corners(edges, widths)
        for ax in axes:
            ax.plot(1e3 * time, level, color=LINES[0][0], linewidth=1.5, solid_joinstyle="miter")
            low = -0.15 if beside is None else _beside(ax, beside)
            ax.set_ylim(low, 1.6)
            levels = [0.0, 1.0] if beside is None else [0.0, 1.0, -_BELOW, 1.0 - _BELOW]
            ax.yaxis.set_major_locator(FixedLocator(levels))
            ax.yaxis.set_major_formatter(FixedFormatter(["low", "high"] * (len(levels) // 2)))
            ax.set_ylabel("logic level")
            ax.set_xlabel("time (ms)")
        above, below = axes
        for y, text in () if beside is None else ((0.5, label), (0.5 - _BELOW, beside.label)):
            below.annotate(text, xy=(0.99, y), xycoords=("axes fraction", "data"), ha="right", va="center", fontsize=8,
                           bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5})
        above.set_xlim(1e3 * float(time[0]), 1e3 * float(time[-1]))
        below.set_xlim(-0.4, max(3.0, 1.2e3 * max(widths)) if beside is None else 1e3 * max(widths) + 2.2)
        _span(above, 1e3 * edges[0], 1e3 * edges[1], 1.22,
              f"$T_f$ = {1e3 * frame_period:.3f} ms,  $f$ = {1.0 / frame_period:.3f} Hz")
        _span(below, 0.0, 1e3 * widths[0], 1.22, f"$t_a$ = {1e6 * widths[0]:.0f} µs")
        below.annotate("first pulse, enlarged", xy=(1.0, 0.88), xycoords="axes fraction", ha="right", fontsize=8,
                       color=COLOURS["grey"])
    return finished(figure)


def _beside(ax: Axes, other: Train) -> float:
    """Draw another train below the first one; return the lower end of the panel."""
    time, level = pulse_corners(other.edges, other.widths)
    ax.plot(1e3 * time, level - _BELOW, color=LINES[1][0], linestyle=LINES[1][1], linewidth=1.5,
            solid_joinstyle="miter")
    return -_BELOW - 0.2


def pulse_corners(edges: Sequence[float], widths: Sequence[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time [s] and level (0 or 1) of the corners of a train of pulses.

    Examples
    --------
    >>> time, level = pulse_corners([0.0, 1.0], [0.2, 0.4])
    >>> level.tolist()
    [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    """
    rest = 0.06 * (edges[-1] - edges[0])
    time, level = [edges[0] - rest], [0.0]
    for start, width in zip(edges, widths, strict=True):
        time += [start, start, start + width, start + width]
        level += [0.0, 1.0, 1.0, 0.0]
    return np.array([*time, edges[-1] + widths[-1] + rest]), np.array([*level, 0.0])


def _span(ax: Axes, left: float, right: float, y: float, text: str) -> None:
    """Draw a measure between two times with its words above."""
    ax.annotate("", xy=(left, y), xytext=(right, y), arrowprops={
        "arrowstyle": "<|-|>,head_width=0.15,head_length=0.3", "color": COLOURS["black"], "linewidth": 0.9,
        "shrinkA": 0.0, "shrinkB": 0.0})
    ax.text(0.5 * (left + right), y + 0.07, text, ha="center", va="bottom", fontsize=8.5, parse_math=True)
