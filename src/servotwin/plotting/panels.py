"""Curves and points in one panel, and trains of pulses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin import units
from servotwin.errors import InputError
from servotwin.look import (
    COLOURS,
    CURVES_A_PAGE,
    LINES,
    axes_grid,
    context,
    finished,
    new_figure,
    on_page,
    plain_decades,
)
from servotwin.look.style import pages, part
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.datasheet import DataSheet, Lift, SpeedCurve
    from servotwin.parameters import PrintedPoint
    Array = NDArray[np.float64]


# --- Curves and points in one panel, and trains of pulses -------------------------------------------------------------

_BELOW = 1.5  # levels between two trains of pulses


class Curve(NamedTuple):
    """A curve: a line, or points with the half length of their error bars where it is given.

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
        Curves of the second panel, about zero, and its label with the unit.
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


# --- Pictures of a computed sheet -------------------------------------------------------------------------------------

_PANELS = ("torque (N m)", "current (A)", "power to the load (W)", "efficiency (%)")
_MARKERS = ("D", "s", "o", "^", "v")


def speed_curves(sheet: DataSheet, *, width: float = 8.4, height: float = 5.6, page: int = 1) -> Figure:
    """Return torque, current, power and efficiency of a servo over its speed, cold and hot, at each voltage.

    Printed figures of a voltage stand beside its curves as open marks. All pages have the same axes.

    Parameters
    ----------
    sheet : DataSheet
    width, height : float
        [inch]
    page : int
        One of ``pages(len(sheet.voltages), CURVES_A_PAGE)``.

    Raises
    ------
    InputError
        If there is no such page.

    Examples
    --------
    >>> import servotwin as st
    >>> sheet = st.curves(st.PulseServo(st.load_servo("hitec-hs-755hb")), bandwidth=False)
    >>> len(speed_curves(sheet).axes)
    4
    """
    shown, foot = on_page("voltages", sheet.voltages, CURVES_A_PAGE, page)
    with context():
        figure = new_figure(width, height)
        axes = [ax for row in figure.subplots(2, 2, sharex=True, squeeze=False) for ax in row]
        for part in sheet.voltages:
            _reach(axes, (part.cold, part.hot), part.printed)
        for k, part in enumerate(shown):
            for curve, hot in ((part.cold, False), (part.hot, True)):
                _curve(axes, curve, k, f"{part.voltage:g} V{', hot' if hot else ''}", hot=hot)
            for point in part.printed:
                _printed(axes, point, k)
            _name(axes[0], part.cold, f"{part.voltage:g} V", k)
        _finish(axes, _PANELS, axes[2:])
        if any(part.printed for part in shown):
            axes[0].plot([], [], color="none", marker="D", markeredgecolor=COLOURS["black"], label="printed")
        axes[0].legend(loc="upper right", handlelength=3.2)
        figure.suptitle(f"{sheet.servo.title or sheet.servo.name}, {type(sheet.model).__name__}, at full drive",
                        fontsize=9)
    return finished(figure, foot)


def compared_curves(sheets: Sequence[DataSheet], *, page: int = 1) -> Figure:
    """Return torque and current over speed of several servos, cold, each at the first of its voltages.

    Printed figures of that voltage stand beside as open marks. All pages have the same axes.

    Parameters
    ----------
    sheets : sequence of DataSheet
    page : int
        One of ``pages(len(sheets), CURVES_A_PAGE)``.

    Raises
    ------
    InputError
        If there are no servos, or no such page.
    """
    shown, foot = on_page("servos", sheets, CURVES_A_PAGE, page)
    with context():
        figure = new_figure(8.4, 3.4)
        axes = list(figure.subplots(1, 2))
        for sheet in sheets:
            _reach(axes, (sheet.voltages[0].cold,), sheet.voltages[0].printed)
        for k, sheet in enumerate(shown):
            part, (colour, dash) = sheet.voltages[0], LINES[k]
            for ax, values in zip(axes, (part.cold.torque, part.cold.current), strict=True):
                ax.plot(_degrees(part.cold.speed), values, color=colour, linestyle=dash,
                        label=f"{sheet.servo.title or sheet.servo.name}, {part.voltage:g} V")
            for point in part.printed:
                _printed(axes, point, k)
        _finish(axes, _PANELS[:2], axes)
        axes[0].legend(loc="upper right", handlelength=3.2)
    return finished(figure, foot)


def holding_curves(sheet: DataSheet, *, page: int = 1) -> Figure:
    """Return how far loads pull a servo off, over the load, at each voltage; pages are those of `speed_curves`."""
    drawn = []
    for at in sheet.voltages:
        held = [each for each in at.holding if each.stands]
        drawn.append(Curve(f"{at.voltage:g} V", [0.0, *(each.torque for each in held)],
                           [0.0, *(math.degrees(each.error) for each in held)]))
    return curves(drawn, x_label="load (N m)", y_label="error of holding (°)", page=page)


def bandwidth_curves(sheet: DataSheet, *, page: int = 1) -> Figure:
    """Return up to which frequency sines are followed within 3 dB, over their amplitude, at each voltage.

    Pages are those of `speed_curves`.
    """
    drawn = []
    for at in sheet.voltages:
        seen = [each for each in at.bandwidth if 0.0 < each.frequency < math.inf]
        drawn.append(Curve(f"{at.voltage:g} V", [math.degrees(each.amplitude) for each in seen],
                           [each.frequency for each in seen]))
    figure = curves(drawn, x_label="amplitude of the command (°)", y_label="followed within 3 dB up to (Hz)",
                    page=page)
    for ax in figure.axes:
        ax.set_ylim(bottom=0.0)
        ax.set_xlim(left=0.0)
        for line in ax.lines:
            line.set_marker("o")
    return figure


def lift_curve(lifts: Sequence[tuple[float, Lift]]) -> Figure:
    """Return what a mass on an arm takes over the angle of the arm, and the most that the servo lifts.

    Parameters
    ----------
    lifts : sequence of tuple
        Supply voltage [V] and lift, all of one mass and arm.
    """
    first = lifts[0][1]
    angle = np.linspace(-90.0, 90.0, 181)
    limits = [Limit(f"the servo lifts, {voltage:g} V", lift.most_torque) for voltage, lift in lifts]
    figure = curves([Curve("the mass takes", angle, first.torque * np.cos(np.radians(angle)))],
                    x_label="arm below (−) or above (+) the horizontal (°)", y_label="torque (N m)", limits=limits)
    for ax in figure.axes:
        ax.set_ylim(0.0, 1.15 * max(first.torque, *(lift.most_torque for _, lift in lifts)))
        ax.set_xticks([-90, -60, -30, 0, 30, 60, 90])
    return figure


def _curve(axes: Sequence[Axes], curve: SpeedCurve, k: int, label: str, *, hot: bool) -> None:
    colour = LINES[k][0]
    style: dict[str, Any] = {"linestyle": (0, (4, 2)), "linewidth": 1.1} if hot else {"linewidth": 1.8}
    for ax, values in zip(axes, _values(curve), strict=True):
        ax.plot(_degrees(curve.speed), values, label=label, color=colour, **style)


def _values(curve: SpeedCurve) -> tuple[NDArray[np.float64], ...]:
    """Return what the panels show over the speed."""
    return curve.torque, curve.current, curve.power, 100.0 * curve.efficiency


def _reach(axes: Sequence[Axes], curves: Sequence[SpeedCurve], printed: Sequence[PrintedPoint]) -> None:
    """Let axes reach as far as some curves and what is printed, whatever page they stand on."""
    for curve in curves:
        for ax, values in zip(axes, _values(curve), strict=False):
            same_axes(ax, [(_degrees(curve.speed), values)])
    for point in printed:
        for panel, x, y in _spots(point):
            same_axes(axes[panel], [(x, y)])


def _name(ax: Axes, curve: SpeedCurve, words: str, k: int) -> None:
    """Write words at a curve: in grey print the colour does not tell it from the others."""
    at = len(curve.speed) // 3 + 6 * k
    ax.annotate(words, xy=(float(_degrees(curve.speed)[at]), float(curve.torque[at])), xytext=(4.0, 3.0),
                textcoords="offset points", fontsize=8.0, color=LINES[k][0])


def _finish(axes: Sequence[Axes], labels: Sequence[str], lowest: Sequence[Axes]) -> None:
    for ax, label in zip(axes, labels, strict=True):
        ax.set_ylabel(label)
        ax.set_ylim(bottom=0.0)
        ax.set_xlim(left=0.0)
    for ax in lowest:
        ax.set_xlabel("speed (°/s)")


def _printed(axes: Sequence[Axes], point: PrintedPoint, k: int) -> None:
    for panel, x, y in _spots(point):
        axes[panel].plot([x], [y], marker=_MARKERS[k], markersize=6.5, markerfacecolor="white", clip_on=False,
                         markeredgecolor=LINES[k][0], markeredgewidth=1.4, linestyle="none", zorder=5)


def _spots(point: PrintedPoint) -> list[tuple[int, float, float]]:
    """Return panel and place of what is printed: of the standing shaft at the left, of the free one where it ends."""
    free = 60.0 / point.time_60 if point.time_60 else None
    spots = ((0, 0.0, point.stall_torque), (0, free, 0.0), (1, 0.0, point.stall_current),
             (1, free, point.no_load_current))
    return [(panel, x, y) for panel, x, y in spots if x is not None and y is not None]


def _degrees(speed: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(units.from_si(speed, "deg/s", "speed"))


# --- Paths of a tool: where it went and how far it was off, and how a redundant arm uses its joints -------------------

_WIDTH, _HEIGHT = 8.4, 3.9  # inch
_POINTS = 3000
_MM = 1e3
_NAMES = "xyz"


class ToolTrace(NamedTuple):
    """Where a tool went.

    Parameters
    ----------
    label : str
    time : ndarray, shape (n,)
        [s]
    places : ndarray, shape (n, 3)
        [m]
    error : ndarray, shape (n,)
        Distance from the path [m]
    """

    label: str
    time: Array
    places: Array
    error: Array


def tool_paths(line: Array, traces: Sequence[ToolTrace], *, page: int = 1) -> Figure:
    """Return the path of a tool as it was asked for and as it was, and its distance from that path over time.

    All pages have the same axes.

    Parameters
    ----------
    line : ndarray, shape (m, 3)
        The path asked for [m]
    traces : sequence of ToolTrace
    page : int
        One of ``pages(len(traces), CURVES_A_PAGE)``.

    Raises
    ------
    InputError
        If there are no traces, or no such page.

    Examples
    --------
    >>> line = np.array([[0.0, 0.0, 0.0], [0.1, 0.1, 0.0]])
    >>> len(tool_paths(line, [ToolTrace("servo", np.array([0.0, 1.0]), line, np.zeros(2))]).axes)
    2
    """
    shown, foot = on_page("paths", traces, CURVES_A_PAGE, page)
    first, second = sorted(np.argsort(np.ptp(line, axis=0), kind="stable")[1:].tolist())
    with context():
        figure = new_figure(_WIDTH, _HEIGHT)
        left, right = figure.subplots(1, 2)
        left.plot(_MM * line[:, first], _MM * line[:, second], color=COLOURS["orange"], linewidth=4.0, alpha=0.55,
                  label="asked for")
        same_axes(left, ((_MM * trace.places[:, first], _MM * trace.places[:, second]) for trace in traces))
        same_axes(right, ((trace.time, _MM * trace.error) for trace in traces))
        for trace, (colour, dash) in zip(shown, LINES, strict=False):
            thin = slice(None, None, max(len(trace.time) // _POINTS, 1))
            left.plot(_MM * trace.places[thin, first], _MM * trace.places[thin, second], color=colour, linestyle=dash,
                      linewidth=1.3, label=trace.label)
            right.plot(trace.time[thin], _MM * trace.error[thin], color=colour, linestyle=dash, linewidth=1.2,
                       label=trace.label)
        left.set_aspect("equal", adjustable="datalim")
        left.set_xlabel(f"{_NAMES[first]} (mm)")
        left.set_ylabel(f"{_NAMES[second]} (mm)")
        right.set_xlabel("time (s)")
        right.set_ylabel("distance from the path (mm)")
        right.set_ylim(bottom=0.0)
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 4), handlelength=2.8)
    return finished(figure, foot)


class JointUse(NamedTuple):
    """The parts of its joints' ranges that an arm uses, and the torque that takes.

    Parameters
    ----------
    label : str
    angles : ndarray, shape (n, joints)
        From −1 to 1, the limits of each joint.
    torque : ndarray, shape (joints,)
        Root mean square of each joint [N m]
    """

    label: str
    angles: Array
    torque: Array


def joint_use(joints: Sequence[str], uses: Sequence[JointUse], *, page: int = 1) -> Figure:
    """Return how far the joints of a redundant arm go in their ranges, and their torques, by criterion.

    Pages are ``pages(len(uses), CURVES_A_PAGE)``.

    Raises
    ------
    InputError
        If there are no criteria, or no such page.

    Examples
    --------
    >>> len(joint_use(["elbow"], [JointUse("none", np.zeros((3, 1)), np.ones(1))]).axes)
    2
    """
    uses, foot = on_page("criteria", uses, CURVES_A_PAGE, page)
    with context():
        figure = new_figure(_WIDTH, 0.8 * _HEIGHT)
        left, right = figure.subplots(1, 2)
        for ax in (left, right):
            ax.set_xticks(range(len(joints)), [shortened(joint.replace("_", " ")) for joint in joints])
        width = 0.8 / len(uses)
        for k, use in enumerate(uses):
            at = np.arange(len(joints)) + (k - 0.5 * (len(uses) - 1)) * width
            low, high = use.angles.min(axis=0), use.angles.max(axis=0)
            left.bar(np.asarray(at), np.maximum(high - low, 0.01), 0.85 * width, bottom=low, color=LINES[k][0],
                     alpha=0.85, label=use.label)
            right.bar(at, 1e3 * use.torque, 0.85 * width, color=LINES[k][0], alpha=0.85)
        for limit in (-1.0, 1.0):
            left.axhline(limit, color=COLOURS["grey"], linewidth=1.2, linestyle=(0, (4, 2)))
        left.set_ylim(-1.15, 1.15)
        left.set_yticks([-1.0, 0.0, 1.0], ["lower limit", "middle", "upper limit"])
        right.set_ylabel("torque, rms (mN m)")
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(uses))
    return finished(figure, foot)


# --- Values of several things in several conditions: a line for each thing, a mark for each condition -----------------

_RANK_MARKERS = ("o", "s", "^", "D", "v")
_ROW = 0.2  # inch: a name below another


def ranking(names: Sequence[str], values: Mapping[str, Sequence[float]], *, x_label: str, width: float = 7.0,
            height: float = 4.0, page: int = 1) -> Figure:
    """Return a figure with a line for each name, and on it a mark for each condition, on a logarithmic axis.

    All pages have the same axes.

    Parameters
    ----------
    names : sequence of str, length n
        From top to bottom.
    values : mapping of str to sequence of float, length n
        By condition; positive, or nan where there is none.
    x_label : str
        With the unit in brackets.
    width, height : float
        [inch]; it is higher where names need more.
    page : int
        One of ``pages(len(values), CURVES_A_PAGE)``.

    Raises
    ------
    InputError
        If there are no conditions, or no such page.

    Examples
    --------
    >>> figure = ranking(["plain", "PID"], {"nominal": [12.0, 3.0], "worn": [13.0, 4.0]}, x_label="error (mm)")
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ['plain', 'PID']
    """
    shown, foot = on_page("conditions", list(values), CURVES_A_PAGE, page)
    figure, (ax,) = axes_grid(1, width=width, height=max(height, 1.0 + _ROW * len(names)))
    with context():
        same_axes(ax, ((found, range(len(names))) for found in values.values()))
        for condition, (colour, _), marker in zip(shown, LINES, _RANK_MARKERS, strict=False):
            found = values[condition]
            ax.plot(found, range(len(names)), linestyle="none", marker=marker, markersize=6.0, color=colour,
                    markerfacecolor="white" if marker != "o" else colour, label=condition)
        ax.set_xscale("log")
        plain_decades(ax.xaxis)
        ax.set_yticks(range(len(names)), [shortened(name) for name in names])
        ax.set_ylim(len(names) - 0.5, -0.5)
        ax.set_xlabel(x_label)
        figure.legend(loc="outside upper center", ncols=len(shown), handletextpad=0.3)
    return finished(figure, foot)
