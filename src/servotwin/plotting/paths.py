"""Where a robot on wheels has driven, and where it believed that it did: paths in the plane of the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.look import COLOURS, LINES, context, finished, new_figure, on_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

PATHS_A_PAGE = 4
"""How many drives a picture shows at once; assumed: two rows of two panels."""
_WIDTH, _LOWEST, _HIGHEST = 3.6, 2.2, 6.0  # of a panel [inch]


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
    panel = 1.6 * _WIDTH if len(shown) == 1 else _WIDTH
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
