"""Gain and phase over frequency, and where the poles of a loop go as its gain grows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from servotwin.errors import InputError
from servotwin.look import COLOURS, LINES, axes_grid, context, finished, new_figure, on_page, plain_decades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.datasheet import Loop
    from servotwin.linear import SampledServo


# --- The torque of a digital servo over the error that stands ---------------------------------------------------------

LOOPS_A_PAGE = len(LINES) - 2
"""How many loops a picture shows at once: of the first one three curves, of the others one each, none alike."""
_BEYOND = 1.2  # times the error of the cap
_POINTS = 1201
_MOST = 1e3  # N m: what friction holds beyond is not drawn


def loop_curve(loops: Sequence[Loop], *, width: float = 8.4, height: float = 3.9, page: int = 1) -> Figure:
    """Return the torque of one servo over its error, both ways: the whole, and large around no error.

    Between what it lifts and what it holds friction keeps the shaft wherever it is.

    Parameters
    ----------
    loops : sequence of Loop
        Of one servo, at one voltage or several: the first one of a page is drawn in full, of the others what the motor
        gives.
    width, height : float
        [inch]
    page : int
        One of ``pages(len(loops), LOOPS_A_PAGE)``.

    Raises
    ------
    InputError
        If there are no loops, or no such page.

    Examples
    --------
    >>> import servotwin as st
    >>> sheet = st.curves(st.DigitalServo(st.load_servo("feetech-sts3215-12v")), bandwidth=False)
    >>> len(loop_curve([sheet.voltages[0].loop]).axes)
    2
    """
    loops, which = on_page("loops", loops, LOOPS_A_PAGE, page)
    first = loops[0]
    far = _BEYOND * max(each.cap_error for each in loops if not math.isnan(each.cap_error))
    near = min(far, 2.2 * (first.dead_zone + first.friction_error) + 3.0 * first.count)
    with context():
        figure = new_figure(width, height)
        axes = list(figure.subplots(1, 2))
        _torques(axes[0], loops, far)
        _torques(axes[1], loops, near)
        _cap(axes[0], first)
        _middle(axes[1], first, near)
        handles, labels = axes[0].get_legend_handles_labels()
        columns = len(labels) if len(labels) < 6 else 3  # six are wider than the figure
        figure.legend(handles, labels, loc="outside lower center", ncols=columns, handlelength=3.2)
        axes[0].set_ylabel("torque (N m)")
        title = first.model.servo.title or first.model.servo.name
        figure.suptitle(f"{title}: {first.stiffness:.3g} N m/rad" + (f", {which}" if which else ""), fontsize=9)
    return finished(figure)


def _torques(ax: Axes, loops: Sequence[Loop], reach: float) -> None:
    errors = np.linspace(-reach, reach, _POINTS)
    over = loops[0].over(np.abs(errors))
    motor = np.copysign(over[0], errors)
    up, down = np.where(errors < 0.0, -over[2], over[1]), np.where(errors < 0.0, -over[1], over[2])
    down, up = np.minimum(down, _MOST), np.maximum(up, -_MOST)
    ax.fill_between(np.degrees(errors), up, down, color=COLOURS["grey"], alpha=0.18, linewidth=0.0,
                    label="friction holds")
    drawn = (motor, _volts("motor", loops[0])), (up, "load below: turns to +"), (down, "load above: turns to −")
    for k, (values, label) in enumerate(drawn):
        ax.plot(np.degrees(errors), values, color=LINES[k][0], linestyle=LINES[k][1],
                linewidth=1.8 if k == 0 else 1.2, label=label)
    for k, loop in enumerate(loops[1:], start=3):
        values = np.copysign(loop.over(np.abs(errors))[0], errors)
        ax.plot(np.degrees(errors), values, color=LINES[k][0], linestyle=LINES[k][1], label=_volts("motor", loop))
    ax.axhline(0.0, color=COLOURS["grey"], linewidth=0.6)
    ax.axvline(0.0, color=COLOURS["grey"], linewidth=0.6)
    ax.set_xlabel("error, goal minus angle (°)")
    ax.set_xlim(-math.degrees(reach), math.degrees(reach))
    most = 1.25 * float(np.max(np.abs(motor))) + 1.5 * loops[0].friction_torque
    ax.set_ylim(-most, most)


def _volts(words: str, loop: Loop) -> str:
    return f"{words}, {loop.model.value('supply.open_circuit_voltage'):g} V"


def _cap(ax: Axes, loop: Loop) -> None:
    """Tell the cap, and mark where the overload starts and what it leaves."""
    said = [f"cap: {loop.cap_torque:.3g} N m from {math.degrees(loop.cap_error):.3g}° on"]
    overload = next((each for each in loop.protections if each.kind == "overload"), None)
    if overload is not None and not math.isnan(overload.error):
        for sign in (-1.0, 1.0):
            ax.plot([sign * math.degrees(overload.error)], [sign * overload.torque], marker="D", markersize=5.5,
                    markerfacecolor="white", markeredgecolor=COLOURS["black"], linestyle="none", zorder=5)
            ax.axhline(sign * overload.left_torque, color=COLOURS["black"], linewidth=0.9, linestyle=(0, (1, 1.6)))
        said += [f"◇ overload: trips after {overload.time:g} s",
                 f"⋯ left of it once tripped: {overload.left_torque:.3g} N m"]
    _tell(ax, said)


def _middle(ax: Axes, loop: Loop, reach: float) -> None:
    """Tell dead zone and startup force, and mark them around no error."""
    top = 1.9 * max(loop.friction_torque, loop.at(0.6 * reach).motor)
    ax.set_ylim(-top, top)
    said = []
    if not math.isnan(loop.start_error):
        start = math.degrees(loop.start_error)
        ax.plot([start], [0.0], marker="o", markersize=4.5, markerfacecolor="white",
                markeredgecolor=COLOURS["black"], zorder=5)
        said += ["○ free shaft moves", f"from {start:.2g}° on"]  # beside the dead zone
    if loop.minimum_duty > 0.0:
        said.append(f"startup force: {loop.motor_torque(loop.minimum_duty):.2g} N m")
    if loop.dead_zone > 0.0:
        zone = math.degrees(loop.dead_zone)
        ax.axvspan(-zone, zone, facecolor="none", edgecolor=COLOURS["black"], hatch="////", linewidth=0.6)
        said.append(f"hatched: dead zone ±{zone:.2g}°")
    _tell(ax, said)


def _tell(ax: Axes, said: Sequence[str]) -> None:
    """Write lines where no curve passes: at positive errors and negative torques."""
    ax.annotate("\n".join(said), (0.985, 0.03), xycoords="axes fraction", ha="right", va="bottom", fontsize=7.5,
                linespacing=1.5, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5})


# --- Gain and phase over frequency, and where the poles of a loop go as its gain grows --------------------------------

_MARKERS = ("o", "s", "^", "D", "v")
_FLOOR = 1e-3  # a smaller gain is not drawn
_TICK = 45.0  # ° between labels of the phase
_GAINS = np.geomspace(0.02, 30.0, 240)  # times the loop's own


class Response(NamedTuple):
    """A response over frequency: a line, or points.

    Parameters
    ----------
    label : str
    frequency : array_like, shape (n,)
        [rad/s]
    response : array_like of complex, shape (n,)
    points : bool
        Whether to draw points and no line.
    style : int
        Number of line style or marker.
    """

    label: str
    frequency: ArrayLike
    response: ArrayLike
    points: bool
    style: int


def bode(drawn: Sequence[Response], *, title: str = "", height: float = 4.2) -> Figure:
    """Return gain [dB] and phase [°] of responses over frequency [Hz].

    Parameters
    ----------
    drawn : sequence of Response
        Gains below 1e-3 are left out.
    title : str
    height : float
        [inch]

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> figure = bode([Response("a lag", [1.0, 10.0], [0.7 - 0.5j, 0.01 - 0.1j], False, 0)])
    >>> figure.axes[1].get_xlabel()
    'frequency (Hz)'
    """
    if not drawn:
        raise InputError("responses in a picture", got="none", allowed="at least one")
    from matplotlib.ticker import MultipleLocator

    figure, axes = axes_grid(2, height=height)
    with context():
        for place, each in enumerate(drawn):
            _draw(axes, each, place)
        axes[0].set_ylabel("gain (dB)")
        axes[1].set_ylabel("phase (°)")
        axes[0].axhline(-3.0, color=COLOURS["grey"], linestyle=(0, (2, 2)), linewidth=1.0)
        axes[1].set_xlabel("frequency (Hz)")
        axes[1].set_xscale("log")
        plain_decades(axes[1].xaxis)
        axes[1].yaxis.set_major_locator(MultipleLocator(_TICK))
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, handlelength=3.2)
        if title:
            axes[0].set_title(title)
        figure.align_ylabels(axes)
    return finished(figure)


def _draw(axes: Sequence[Axes], each: Response, place: int) -> None:
    values = np.asarray(each.response, np.complex128)
    keep = np.isfinite(values) & (np.abs(values) > _FLOOR)
    hertz = np.asarray(each.frequency, np.float64)[keep] / (2.0 * np.pi)
    colour, dash = LINES[each.style % len(LINES)]
    look = ({"linestyle": "none", "marker": _MARKERS[each.style % len(_MARKERS)], "markersize": 4.0,
             "markerfacecolor": "white"} if each.points else {"linestyle": dash})
    phase = np.degrees(np.unwrap(np.angle(values[keep])))
    for ax, shown in zip(axes, (20.0 * np.log10(np.abs(values[keep])), phase), strict=True):
        ax.plot(hertz, shown, color=colour, label=each.label, zorder=3 + place, **look)


def root_locus(loop: SampledServo, *, height: float = 3.4) -> Figure:
    """Return where the poles of a sampled loop go as its gain grows, with those at its own gain.

    Poles are drawn as s = ln z/T, in rad/s; to the right of the axis what disturbs the loop grows.

    Examples
    --------
    >>> import servotwin as st
    >>> loop = st.linear.sampled(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> root_locus(loop).axes[0].get_ylabel()
    'imaginary part (rad/s)'
    """
    figure, (ax,) = axes_grid(1, height=height)
    own = loop.poles
    reach = 2.5 * float(np.max(np.abs(own[: 2])))
    with context():
        roots = np.concatenate([loop.poles_at(gain) for gain in _GAINS.tolist()])
        colours = np.concatenate([np.full(len(loop.poles_at(gain)), np.log10(gain)) for gain in _GAINS.tolist()])
        near = np.abs(roots) < 1.5 * reach
        drawn = ax.scatter(roots.real[near], roots.imag[near], c=colours[near], s=4.0, cmap="viridis", linewidths=0.0)
        ax.plot(own.real, own.imag, linestyle="none", marker="x", markersize=7.0, color=COLOURS["vermilion"],
                label="poles at its own gain")
        ax.axvline(0.0, color=COLOURS["black"], linewidth=0.8)
        ax.set_xlim(-reach, 0.4 * reach)
        ax.set_ylim(-reach, reach)
        ax.set_xlabel("real part (1/s)")
        ax.set_ylabel("imaginary part (rad/s)")
        bar = figure.colorbar(drawn, ax=ax, ticks=[-1.0, 0.0, 1.0])
        bar.ax.set_yticklabels(["0.1", "1", "10"])
        bar.set_label("gain, times its own")
        ax.legend(loc="upper left")
    return finished(figure)
