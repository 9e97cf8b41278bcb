"""Paths of a tool: where it went and how far it was off, and how a redundant arm uses its joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.look import COLOURS, CURVES_A_PAGE, LINES, context, finished, new_figure, on_page
from servotwin.plotting.panels import same_axes
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

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
    """What of the ranges of its joints an arm uses, and the torque that takes.

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
            _bars(left, np.asarray(at), width, use, LINES[k][0])
            right.bar(at, 1e3 * use.torque, 0.85 * width, color=LINES[k][0], alpha=0.85)
        for limit in (-1.0, 1.0):
            left.axhline(limit, color=COLOURS["grey"], linewidth=1.2, linestyle=(0, (4, 2)))
        left.set_ylim(-1.15, 1.15)
        left.set_yticks([-1.0, 0.0, 1.0], ["lower limit", "middle", "upper limit"])
        right.set_ylabel("torque, rms (mN m)")
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(uses))
    return finished(figure, foot)


def _bars(ax: Axes, at: Array, width: float, use: JointUse, colour: str) -> None:
    low, high = use.angles.min(axis=0), use.angles.max(axis=0)
    ax.bar(at, np.maximum(high - low, 0.01), 0.85 * width, bottom=low, color=colour, alpha=0.85, label=use.label)
