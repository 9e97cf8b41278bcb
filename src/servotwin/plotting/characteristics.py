"""What a servo's computed sheet shows: curves at full drive, errors of holding, bandwidth, and the torque of a lift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import units
from servotwin.errors import InputError
from servotwin.look import COLOURS, LINES, context, finished, new_figure
from servotwin.plotting.panels import Curve, Limit, curves

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from servotwin.datasheet import DataSheet, Lift, SpeedCurve
    from servotwin.parameters import PrintedPoint

_PANELS = ("torque (N m)", "current (A)", "power to the load (W)", "efficiency (%)")
_MOST = 5  # curves that can be told apart
_MARKERS = ("D", "s", "o", "^", "v")


def speed_curves(sheet: DataSheet, *, width: float = 8.4, height: float = 5.6) -> Figure:
    """Return torque, current, power and efficiency of a servo over its speed, cold and hot, at each voltage.

    What the sheet prints for a voltage stands beside its curves as open marks.

    Parameters
    ----------
    sheet : DataSheet
        Of at most five voltages.
    width, height : float
        [inch]

    Raises
    ------
    InputError
        If there are more voltages than can be told apart.

    Examples
    --------
    >>> import servotwin as st
    >>> sheet = st.curves(st.PulseServo(st.load_servo("hitec-hs-755hb")), bandwidth=False)
    >>> len(speed_curves(sheet).axes)
    4
    """
    if len(sheet.voltages) > _MOST:
        raise InputError("voltages in one picture", got=len(sheet.voltages), allowed=f"at most {_MOST}")
    with context():
        figure = new_figure(width, height)
        axes = [ax for row in figure.subplots(2, 2, sharex=True, squeeze=False) for ax in row]
        for k, part in enumerate(sheet.voltages):
            for curve, hot in ((part.cold, False), (part.hot, True)):
                _curve(axes, curve, k, f"{part.voltage:g} V{', hot' if hot else ''}", hot=hot)
            for point in part.printed:
                _printed(axes, point, k)
            _name(axes[0], part.cold, f"{part.voltage:g} V", k)
        _finish(axes, _PANELS, axes[2:])
        if any(part.printed for part in sheet.voltages):
            axes[0].plot([], [], color="none", marker="D", markeredgecolor=COLOURS["black"], label="printed")
        axes[0].legend(loc="upper right", handlelength=3.2)
        figure.suptitle(f"{sheet.servo.title or sheet.servo.name}, {type(sheet.model).__name__}, at full drive",
                        fontsize=9)
    return finished(figure)


def compared_curves(sheets: Sequence[DataSheet]) -> Figure:
    """Return torque and current over speed of several servos, cold, each at the first of its voltages.

    What a sheet prints for that voltage stands beside as open marks.

    Raises
    ------
    InputError
        If there are none, or more than can be told apart.
    """
    if not 1 <= len(sheets) <= _MOST:
        raise InputError("servos in one picture", got=len(sheets), allowed=f"1 to {_MOST}")
    with context():
        figure = new_figure(8.4, 3.4)
        axes = list(figure.subplots(1, 2))
        for k, sheet in enumerate(sheets):
            part, (colour, dash) = sheet.voltages[0], LINES[k]
            for ax, values in zip(axes, (part.cold.torque, part.cold.current), strict=True):
                ax.plot(_degrees(part.cold.speed), values, color=colour, linestyle=dash,
                        label=f"{sheet.servo.title or sheet.servo.name}, {part.voltage:g} V")
            for point in part.printed:
                _printed(axes, point, k)
        _finish(axes, _PANELS[:2], axes)
        axes[0].legend(loc="upper right", handlelength=3.2)
    return finished(figure)


def holding_curves(sheet: DataSheet) -> Figure:
    """Return how far loads pull a servo off, over the load, at each voltage."""
    drawn = []
    for part in sheet.voltages[:_MOST]:
        held = [each for each in part.holding if each.stands]
        drawn.append(Curve(f"{part.voltage:g} V", [0.0, *(each.torque for each in held)],
                           [0.0, *(math.degrees(each.error) for each in held)]))
    return curves(drawn, x_label="load (N m)", y_label="error of holding (°)")


def bandwidth_curves(sheet: DataSheet) -> Figure:
    """Return up to which frequency sines are followed within 3 dB, over their amplitude, at each voltage."""
    drawn = []
    for part in sheet.voltages[:_MOST]:
        seen = [each for each in part.bandwidth if 0.0 < each.frequency < math.inf]
        drawn.append(Curve(f"{part.voltage:g} V", [math.degrees(each.amplitude) for each in seen],
                           [each.frequency for each in seen]))
    figure = curves(drawn, x_label="amplitude of the command (°)", y_label="followed within 3 dB up to (Hz)")
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
    for ax, values in zip(axes, (curve.torque, curve.current, curve.power, 100.0 * curve.efficiency), strict=True):
        ax.plot(_degrees(curve.speed), values, label=label, color=colour, **style)


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
    """Draw what is printed: torque and current of the standing shaft at the left, of the free one where it ends."""
    free = 60.0 / point.time_60 if point.time_60 else None
    spots = ((0, 0.0, point.stall_torque), (0, free, 0.0), (1, 0.0, point.stall_current),
             (1, free, point.no_load_current))
    for panel, x, y in spots:
        if x is not None and y is not None:
            axes[panel].plot([x], [y], marker=_MARKERS[k], markersize=6.5, markerfacecolor="white", clip_on=False,
                             markeredgecolor=LINES[k][0], markeredgewidth=1.4, linestyle="none", zorder=5)


def _degrees(speed: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(units.from_si(speed, "deg/s", "speed"))
