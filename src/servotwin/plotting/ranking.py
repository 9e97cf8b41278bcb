"""Values of several things in several conditions: a line for each thing, a mark for each condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin.look import CURVES_A_PAGE, LINES, axes_grid, context, finished, on_page, plain_decades
from servotwin.plotting.panels import same_axes
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKERS = ("o", "s", "^", "D", "v")
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
        for condition, (colour, _), marker in zip(shown, LINES, _MARKERS, strict=False):
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
