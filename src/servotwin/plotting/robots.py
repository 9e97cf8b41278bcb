"""Signals of a robot's servos: following a motion, currents and temperatures, and torque in their curves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.look import COLOURS, LINES, context, finished, new_figure, on_page
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from servotwin.datasheet import SpeedCurve


# --- Where a robot on wheels has driven, and where it believed that it did --------------------------------------------

PATHS_A_PAGE = 4
"""How many drives a picture shows at once; assumed: two rows of two panels."""
_MAP_WIDTH, _LOWEST, _HIGHEST = 3.6, 2.2, 6.0  # of a panel [inch]


class PathTrace(NamedTuple):
    """A drive over the floor: places x, y [m] in the first two columns.

    Parameters
    ----------
    label : str
    path, believed : ndarray, shape (n, 2 or more)
        Where the robot was, and where it believed to be.
    """

    label: str
    path: Array
    believed: Array


def robot_paths(runs: Sequence[PathTrace], waypoints: ArrayLike, *, page: int = 1) -> Figure:
    """Return where robots have driven between waypoints, and where they believed to be; a panel each, equally scaled.

    All pages have the same axes.

    Parameters
    ----------
    runs : sequence of PathTrace
    waypoints : array_like, shape (m, 2)
        [m]
    page : int
        One of ``pages(len(runs), PATHS_A_PAGE)``.

    Raises
    ------
    InputError
        If there are no runs, or no such page.

    Examples
    --------
    >>> drive = np.array([[0.0, 0.0], [0.5, 0.02], [1.0, 0.1]])
    >>> len(robot_paths([PathTrace("equal", drive, drive), PathTrace("unequal", drive, -drive)], drive).axes)
    2
    """
    shown, foot = on_page("paths", runs, PATHS_A_PAGE, page)
    points = np.asarray(waypoints, np.float64)
    every = np.concatenate([points, *(side[:, :2] for run in runs for side in (run.path, run.believed))])
    low, high = every.min(axis=0), every.max(axis=0)
    margin = 0.06 * max(*(high - low), 0.1)
    wide, tall = high - low + 2.0 * margin
    panel = 1.6 * _MAP_WIDTH if len(shown) == 1 else _MAP_WIDTH
    with context():
        height = min(max(panel * tall / wide, _LOWEST), _HIGHEST)
        rows = math.ceil(len(shown) / 2)
        figure = new_figure(panel * min(len(shown), 2) + 0.6, 0.9 + height * rows)
        grid = figure.subplots(rows, min(len(shown), 2), sharex=True, sharey=True, squeeze=False)
        panels = grid.ravel().tolist()
        for ax, run in zip(panels, shown, strict=False):
            ax.plot(*points.T, color=COLOURS["grey"], linewidth=0.9, linestyle=(0, (2, 2)), marker="o", markersize=4.0,
                    label="waypoints")
            for side, line, word in zip((run.path, run.believed), LINES, ("driven", "believed"), strict=False):
                colour, dash = line
                ax.plot(side[:, 0], side[:, 1], color=colour, linestyle=dash, label=word)
                ax.plot(*side[-1, :2], color=colour, marker="s", markersize=4.5)
            ax.set_title(run.label)
            ax.set_aspect("equal")
            ax.set_xlim(low[0] - margin, high[0] + margin)
            ax.set_ylim(low[1] - margin, high[1] + margin)
        for ax in panels[len(shown):]:
            ax.set_axis_off()
        for ax in grid[-1]:
            ax.set_xlabel("x (m)")
        for row in grid:
            row[0].set_ylabel("y (m)")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, handlelength=3.2)
    return finished(figure, foot)


# --- Signals of a robot's servos --------------------------------------------------------------------------------------

JOINTS_A_PAGE = 12
"""How many joints or servos a picture of a robot shows at once; assumed: whole rows of two and of three panels."""
_WIDTH = 8.4  # inch
_LINE_POINTS, _CLOUD_POINTS, _BINS = 1500, 500, 400
_STRETCH = 0.04  # s
_MOST_DELIVERED = 1.5  # times the stall torque: what is delivered beyond lies outside the picture
_ZERO_CELSIUS = 273.15
_DRIVING, _HOLDING, _RMS, _WORST, _DELIVERED, _LASTING = (
    "needed, driving", "needed, holding back", "needed, rms", "least to spare", "delivered", "lifted without end")
_ORDER = (_LASTING, _DRIVING, _HOLDING, _RMS, _WORST, _DELIVERED)  # of a legend, behind the curves


class JointTrace(NamedTuple):
    """How a joint has followed its goal: angles of a hinge [rad], places of a slide [m], over time [s].

    Parameters
    ----------
    label : str
    time, goal, real, ideal : ndarray, shape (n,)
        Places or angles that were asked for, those of the servo, and those of an ideal actuator.
    slides : bool
    measured : ndarray, shape (n,), optional
        Where the real joint was; nan where it was not measured.
    """

    label: str
    time: Array
    goal: Array
    real: Array
    ideal: Array
    slides: bool = False
    measured: Array | None = None


class ServoTrace(NamedTuple):
    """Current and temperatures of a servo, over time [s]; what it does not have is None.

    Parameters
    ----------
    label : str
    time, current : ndarray, shape (n,)
        Of the motor [A]
    voltage : ndarray, shape (n,), optional
        Of its supply [V]
    winding, housing : ndarray, shape (n,), optional
        [K]
    """

    label: str
    time: Array
    current: Array
    voltage: Array | None = None
    winding: Array | None = None
    housing: Array | None = None


class Cloud(NamedTuple):
    """Speeds [rad/s] and torques [N m] of a shaft; torques that hold a motion back are negative."""

    speed: Array
    torque: Array


class ShaftTrace(NamedTuple):
    """The demands of a motion on a servo, beside its curves.

    Parameters
    ----------
    label, words : str
        Of the joint, and a line about it.
    curves : sequence of tuple (str, SpeedCurve)
        With the words of the legend, the first one that of the full supply.
    needed, delivered : Cloud
    worst : tuple (float, float), optional
        Speed [rad/s] and torque [N m] where there is least to spare.
    rms_torque, lasting_torque : float
        Mean of what is needed, and what the servo can give without end; nan where it is not known [N m]
    """

    label: str
    words: str
    curves: Sequence[tuple[str, SpeedCurve]]
    needed: Cloud
    delivered: Cloud
    worst: tuple[float, float] | None
    rms_torque: float
    lasting_torque: float


def joint_tracking(joints: Sequence[JointTrace], *, events: Sequence[float] = (), page: int = 1) -> Figure:
    """Return goal, real and ideal joint over time, with the error of the real one below, joint by joint.

    Parameters
    ----------
    joints : sequence of JointTrace
    events : sequence of float
        Times to mark, such as beginning and end of the motion [s]
    page : int
        One of ``pages(len(joints), JOINTS_A_PAGE)``.

    Raises
    ------
    InputError
        If there are no joints, or no such page.

    Examples
    --------
    >>> time = np.linspace(0.0, 1.0, 11)
    >>> len(joint_tracking([JointTrace("elbow", time, time, 0.9 * time, time)]).axes)
    2
    """
    joints, foot = on_page("joints", joints, JOINTS_A_PAGE, page)
    columns = 1 if len(joints) < 3 else 2
    rows = -(-len(joints) // columns)
    with context():
        figure = new_figure(_WIDTH if columns > 1 else 6.2, 0.5 + 2.35 * rows)
        grid = figure.add_gridspec(2 * rows, columns, height_ratios=(2.0, 1.0) * rows)
        above: Axes | None = None
        for k, joint in enumerate(joints):
            row, column = divmod(k, columns)
            above = figure.add_subplot(grid[2 * row, column])
            below = figure.add_subplot(grid[2 * row + 1, column], sharex=above)
            _followed(above, joint)
            _error(below, joint)
            for ax in (above, below):
                for event in events:
                    ax.axvline(event, color=COLOURS["grey"], linewidth=0.8, linestyle=(0, (2, 2)))
                ax.set_xlim(float(joint.time[0]), float(joint.time[-1]))
            above.tick_params(labelbottom=False)
            if k >= len(joints) - columns:
                below.set_xlabel("time (s)")
        if above is not None:
            handles, labels = above.get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper center", ncols=3, handlelength=3.2)
    return finished(figure, foot)


def servo_electrics(servos: Sequence[ServoTrace], *, page: int = 1) -> Figure:
    """Return motor current, supply voltage and temperatures of servos over time, a row each.

    Currents are shown as their mean and, pale, all between the smallest and the largest. Pages are those of
    `joint_tracking`.

    Raises
    ------
    InputError
        If there are no servos, or no such page.

    Examples
    --------
    >>> time = np.linspace(0.0, 1.0, 11)
    >>> len(servo_electrics([ServoTrace("elbow", time, time, 6.0 - time)]).axes)
    2
    """
    servos, foot = on_page("servos", servos, JOINTS_A_PAGE, page)
    kinds = [kind for kind, has in (("current", True), ("voltage", any(s.voltage is not None for s in servos)),
                                    ("heat", any(s.winding is not None for s in servos))) if has]
    with context():
        figure = new_figure(_WIDTH, 0.75 + 1.1 * len(servos))
        grid = figure.subplots(len(servos), len(kinds), sharex=True, sharey="col", squeeze=False)
        for row, servo in zip(grid, servos, strict=True):
            for ax, kind in zip(row, kinds, strict=True):
                _DRAWN[kind](ax, servo)
            row[0].set_ylabel(shortened(servo.label.replace("_", " "), 24), fontsize=8.5, fontweight="bold")
            row[0].set_xlim(float(servo.time[0]), float(servo.time[-1]))
        for ax, kind in zip(grid[0], kinds, strict=True):
            ax.set_title(_TITLES[kind])
        for ax in grid[-1]:
            ax.set_xlabel("time (s)")
        if "heat" in kinds:
            warm = next(row[-1] for row, servo in zip(grid, servos, strict=True) if servo.winding is not None)
            warm.legend(loc="upper left", handlelength=2.6, fontsize=7.5)
    return finished(figure, foot)


def shaft_torques(joints: Sequence[ShaftTrace], *, page: int = 1) -> Figure:
    """Return torque over speed of servos: what a motion takes, and what they gave, in their curves at full drive.

    Pages are those of `joint_tracking`.

    Raises
    ------
    InputError
        If there are no joints, or no such page.
    """
    joints, foot = on_page("joints", joints, JOINTS_A_PAGE, page)
    columns = min(len(joints), 3 if len(joints) > 2 else 2)
    rows = -(-len(joints) // columns)
    with context():
        figure = new_figure(_WIDTH if columns > 1 else 5.6, 0.75 + 2.6 * rows)
        grid = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
        for ax, joint in zip(grid, joints, strict=False):
            _torques(ax, joint)
        for ax in grid[len(joints):]:
            ax.set_axis_off()
        for k, ax in enumerate(grid[:len(joints)]):
            if k % columns == 0:
                ax.set_ylabel("torque (N m)")
            if k >= len(joints) - columns:
                ax.set_xlabel("speed of the servo (°/s)")
        labelled: dict[str, Any] = {}
        for ax in grid:
            labelled = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True)) | labelled
        order = sorted(labelled, key=lambda label: _ORDER.index(label) if label in _ORDER else -1)
        figure.legend([labelled[label] for label in order], order, loc="outside upper center", ncols=3,
                      handlelength=2.6)
    return finished(figure, foot)


def _shown(values: Array, slides: bool) -> Array:
    return np.asarray(units.from_si(values, *(("mm", "length") if slides else ("deg", "angle"))))


def _thin(values: Array, most: int) -> Array:
    return values[::max(len(values) // most, 1)]


def _followed(ax: Axes, joint: JointTrace) -> None:
    time = _thin(joint.time, _LINE_POINTS)
    lines = (("ideal actuator", joint.ideal, {"color": COLOURS["orange"], "linewidth": 3.4, "alpha": 0.55}),
             ("goal", joint.goal, {"color": COLOURS["black"], "linestyle": (0, (1, 1.6)), "linewidth": 1.2}),
             ("servo", joint.real, {"color": COLOURS["blue"], "linewidth": 1.5}))
    for label, values, style in lines:
        ax.plot(time, _shown(_thin(values, _LINE_POINTS), joint.slides), label=label, **style)  # type: ignore[arg-type]
    if joint.measured is not None:
        ax.plot(time, _shown(_thin(joint.measured, _LINE_POINTS), joint.slides), label="measured",
                color=COLOURS["vermilion"], linewidth=1.1, linestyle=(0, (5, 1.5)))
    ax.set_title(shortened(joint.label.replace("_", " ")), fontweight="bold")
    ax.set_ylabel("place (mm)" if joint.slides else "angle (°)")


def _error(ax: Axes, joint: JointTrace) -> None:
    ax.axhline(0.0, color=COLOURS["grey"], linewidth=1.0)
    ax.plot(_thin(joint.time, _LINE_POINTS), _thin(_shown(joint.goal - joint.real, joint.slides), _LINE_POINTS),
            color=COLOURS["blue"], linewidth=1.2)
    if joint.measured is not None:
        ax.plot(_thin(joint.time, _LINE_POINTS), _thin(_shown(joint.goal - joint.measured, joint.slides),
                _LINE_POINTS), color=COLOURS["vermilion"], linewidth=1.0, linestyle=(0, (5, 1.5)))
    ax.set_ylabel("error (mm)" if joint.slides else "error (°)")


def _current(ax: Axes, servo: ServoTrace) -> None:
    edges = _edges(servo.time)
    counts = np.diff(np.append(edges, len(servo.time)))
    mean = np.add.reduceat(servo.current, edges) / counts
    low, high = np.minimum.reduceat(servo.current, edges), np.maximum.reduceat(servo.current, edges)
    ax.fill_between(servo.time[edges], low, high, color=COLOURS["sky"], alpha=0.55, linewidth=0.0)
    ax.plot(servo.time[edges], mean, color=COLOURS["blue"], linewidth=1.1)


def _edges(time: Array) -> NDArray[np.int64]:
    """Return where stretches begin over which a signal is summed up: no shorter than two frames of pulses."""
    count = int(np.clip((time[-1] - time[0]) / _STRETCH, 1.0, min(_BINS, len(time))))
    return np.linspace(0, len(time), count + 1).astype(np.int64)[:-1]


def _voltage(ax: Axes, servo: ServoTrace) -> None:
    if servo.voltage is not None:
        edges = _edges(servo.time)
        ax.plot(servo.time[edges], np.minimum.reduceat(servo.voltage, edges), color=COLOURS["green"], linewidth=1.1)


def _heat(ax: Axes, servo: ServoTrace) -> None:
    for label, values, (colour, dash) in (("winding", servo.winding, LINES[1]), ("housing", servo.housing, LINES[4])):
        if values is not None:
            ax.plot(_thin(servo.time, _LINE_POINTS), _thin(values, _LINE_POINTS) - _ZERO_CELSIUS, color=colour,
                    linestyle="-" if label == "winding" else dash, linewidth=1.3, label=label)


_DRAWN = {"current": _current, "voltage": _voltage, "heat": _heat}
_TITLES = {"current": "motor current (A)", "voltage": "supply (V)", "heat": "temperature (°C)"}


def _torques(ax: Axes, joint: ShaftTrace) -> None:
    for k, (label, curve) in enumerate(joint.curves):
        ax.plot(_degrees(curve.speed), curve.torque, color=COLOURS["black"], linewidth=1.7 if k == 0 else 1.1,
                linestyle="-" if k == 0 else (0, (5, 2)), label=label)
    stall = float(joint.curves[0][1].torque.max())
    speed, torque = _thin(joint.delivered.speed, _CLOUD_POINTS), np.abs(_thin(joint.delivered.torque, _CLOUD_POINTS))
    ax.plot(_degrees(speed), torque, linestyle="none", marker="x", markersize=2.8, markeredgewidth=0.6,
            color=COLOURS["orange"], label=_DELIVERED)
    speed, torque = _thin(joint.needed.speed, _CLOUD_POINTS), _thin(joint.needed.torque, _CLOUD_POINTS)
    for label, chosen, face in ((_HOLDING, torque < 0.0, "white"),
                                (_DRIVING, torque >= 0.0, COLOURS["blue"])):
        ax.plot(_degrees(speed[chosen]), np.abs(torque[chosen]), linestyle="none", marker="o", markersize=3.0,
                markerfacecolor=face, markeredgecolor=COLOURS["blue"], markeredgewidth=0.7, label=label)
    if joint.worst is not None:
        ax.plot([math.degrees(joint.worst[0])], [joint.worst[1]], marker="*", markersize=12.0, linestyle="none",
                color=COLOURS["vermilion"], markeredgecolor="white", markeredgewidth=0.7, zorder=5,
                label=_WORST)
    if not math.isnan(joint.lasting_torque):
        ax.axhline(joint.lasting_torque, color=COLOURS["grey"], linewidth=1.1, linestyle=(0, (2, 2)),
                   label=_LASTING)
    ax.plot([0.0], [joint.rms_torque], marker=">", markersize=7.0, color=COLOURS["blue"], linestyle="none",
            clip_on=False, zorder=6, label=_RMS)
    highest = max(stall, float(np.abs(joint.needed.torque).max()),
                  min(float(np.abs(joint.delivered.torque).max()), _MOST_DELIVERED * stall))
    fastest = max(float(joint.curves[0][1].speed[-1]), float(joint.needed.speed.max()))
    ax.set_ylim(0.0, 1.08 * highest)
    ax.set_xlim(0.0, 1.05 * math.degrees(fastest))
    ax.set_title(shortened(joint.label.replace("_", " ")), fontweight="bold", loc="left")
    ax.set_title(joint.words, loc="right", fontsize=8.0)


def _degrees(speed: Array) -> Array:
    return np.asarray(units.from_si(speed, "deg/s", "speed"))


# --- Pictures of robots whose recorded goals were replayed: measured beside simulated ---------------------------------

Array = NDArray[np.float64]
_REPLAY_WIDTH, _COLUMNS = 8.6, 2


class ReplayTrace(NamedTuple):
    """A stretch of an episode of one joint.

    Parameters
    ----------
    title : str
    time, goal, measured : ndarray, shape (n,)
        [s], [rad]
    simulated : mapping of str to ndarray
        By what simulated it, the servos first [rad]
    """

    title: str
    time: Array
    goal: Array
    measured: Array
    simulated: Mapping[str, Array]


def replay_windows(traces: Sequence[ReplayTrace], *, page: int = 1) -> Figure:
    """Return goal, measured and simulated angle over time, a panel for each stretch.

    Pages are those of `joint_tracking`.

    Raises
    ------
    InputError
        If there are no stretches, or no such page.

    Examples
    --------
    >>> time = np.linspace(0.0, 1.0, 11)
    >>> len(replay_windows([ReplayTrace("elbow", time, time, 0.9 * time, {"servos": 0.8 * time})]).axes)
    1
    """
    traces, foot = on_page("stretches", traces, JOINTS_A_PAGE, page)
    columns = min(len(traces), _COLUMNS)
    rows = -(-len(traces) // columns)
    with context():
        figure = new_figure(_REPLAY_WIDTH if columns > 1 else 5.6, 0.6 + 2.3 * rows)
        grid = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
        for ax, one in zip(grid, traces, strict=False):
            ax.plot(one.time, np.degrees(one.measured), color=COLOURS["black"], linewidth=2.6, alpha=0.45,
                    label="measured")
            ax.plot(one.time, np.degrees(one.goal), color=COLOURS["black"], linestyle=(0, (1, 1.6)), linewidth=1.1,
                    label="goal", drawstyle="steps-post")
            for k, (label, angle) in enumerate(one.simulated.items()):
                colour, dash = LINES[(k + 1) % len(LINES)]
                ax.plot(one.time, np.degrees(angle), color=COLOURS["blue"] if k == 0 else colour,
                        linestyle="-" if k == 0 else dash, linewidth=1.6 if k == 0 else 1.0, label=label)
            ax.set_title(one.title, fontweight="bold")
            ax.set_ylabel("angle (°)")
            ax.set_xlabel("time (s)")
        for ax in grid[len(traces):]:
            ax.set_axis_off()
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4, handlelength=2.8)
    return finished(figure, foot)
