"""Gain and phase over frequency, and where the poles of a loop go as its gain grows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from servotwin.errors import InputError
from servotwin.look import COLOURS, LINES, axes_grid, context, finished, plain_decades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from servotwin.linear import SampledServo

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
