"""Pictures of robots whose recorded goals were replayed: measured beside simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.look import COLOURS, LINES, context, finished, new_figure, on_page
from servotwin.plotting.robots import JOINTS_A_PAGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
_WIDTH, _COLUMNS = 8.6, 2


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
        figure = new_figure(_WIDTH if columns > 1 else 5.6, 0.6 + 2.3 * rows)
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
