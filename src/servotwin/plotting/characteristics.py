"""What a servo's computed sheet shows: curves at full drive, errors of holding, bandwidth, and the torque of a lift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import units
from servotwin.look import COLOURS, CURVES_A_PAGE, LINES, context, finished, new_figure, on_page
from servotwin.plotting.panels import Curve, Limit, curves, same_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from servotwin.datasheet import DataSheet, Lift, SpeedCurve
    from servotwin.parameters import PrintedPoint

_PANELS = ("torque (N m)", "current (A)", "power to the load (W)", "efficiency (%)")
_MARKERS = ("D", "s", "o", "^", "v")


def speed_curves(sheet: DataSheet, *, width: float = 8.4, height: float = 5.6, page: int = 1) -> Figure:
    """Return torque, current, power and efficiency of a servo over its speed, cold and hot, at each voltage.

    What the sheet prints for a voltage stands beside its curves as open marks. All pages have the same axes.

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

    What a sheet prints for that voltage stands beside as open marks. All pages have the same axes.

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
    for part in sheet.voltages:
        held = [each for each in part.holding if each.stands]
        drawn.append(Curve(f"{part.voltage:g} V", [0.0, *(each.torque for each in held)],
                           [0.0, *(math.degrees(each.error) for each in held)]))
    return curves(drawn, x_label="load (N m)", y_label="error of holding (°)", page=page)


def bandwidth_curves(sheet: DataSheet, *, page: int = 1) -> Figure:
    """Return up to which frequency sines are followed within 3 dB, over their amplitude, at each voltage.

    Pages are those of `speed_curves`.
    """
    drawn = []
    for part in sheet.voltages:
        seen = [each for each in part.bandwidth if 0.0 < each.frequency < math.inf]
        drawn.append(Curve(f"{part.voltage:g} V", [math.degrees(each.amplitude) for each in seen],
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
