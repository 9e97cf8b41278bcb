"""Values of several things in several conditions: a line for each thing, a mark for each condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin.errors import InputError
from servotwin.look import LINES, axes_grid, context, finished, plain_decades
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKERS = ("o", "s", "^", "D", "v")


def ranking(names: Sequence[str], values: Mapping[str, Sequence[float]], *, x_label: str, width: float = 7.0,
            height: float = 4.0) -> Figure:
    """Return a figure with a line for each name, and on it a mark for each condition, on a logarithmic axis.

    Parameters
    ----------
    names : sequence of str, length n
        From top to bottom.
    values : mapping of str to sequence of float, length n
        By condition, at most five; positive, or nan where there is none.
    x_label : str
        With the unit in brackets.
    width, height : float
        [inch]

    Raises
    ------
    InputError
        If there is no condition, or too many to tell apart.

    Examples
    --------
    >>> figure = ranking(["plain", "PID"], {"nominal": [12.0, 3.0], "worn": [13.0, 4.0]}, x_label="error (mm)")
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ['plain', 'PID']
    """
    if not 1 <= len(values) <= len(_MARKERS):
        raise InputError("conditions in one picture", got=len(values), allowed=f"1 to {len(_MARKERS)}")
    figure, (ax,) = axes_grid(1, width=width, height=height)
    with context():
        for (condition, found), (colour, _), marker in zip(values.items(), LINES, _MARKERS, strict=False):
            ax.plot(found, range(len(names)), linestyle="none", marker=marker, markersize=6.0, color=colour,
                    markerfacecolor="white" if marker != "o" else colour, label=condition)
        ax.set_xscale("log")
        plain_decades(ax.xaxis)
        ax.set_yticks(range(len(names)), [shortened(name) for name in names])
        ax.set_ylim(len(names) - 0.5, -0.5)
        ax.set_xlabel(x_label)
        figure.legend(loc="outside upper center", ncols=len(values), handletextpad=0.3)
    return finished(figure)
