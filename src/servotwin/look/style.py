"""One look for all pictures: readable at column width, for the colour-blind and in grey print."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from servotwin.errors import HIDDEN, InputError, OutputError
from servotwin.text import shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


# --- Pictures of more than one of them can show: pages, as even as possible -------------------------------------------

Item = TypeVar("Item")


def pages(count: int, most: int) -> range:
    """Return the numbers, from 1 on, of the pages on which a picture shows `count` things, at most `most` on each.

    Of nothing there is one page.

    Examples
    --------
    >>> [len(pages(count, 12)) for count in (0, 1, 12, 13, 47)], pages(47, 12)[-1]
    ([1, 1, 1, 2, 4], 4)
    """
    return range(1, max(-(-count // most), 1) + 1)


def on_page(what: str, items: Sequence[Item], most: int, page: int) -> tuple[Sequence[Item], str]:
    """Return what a page shows of some things, and the words that say which of several pages it is.

    Parameters
    ----------
    what : str
        For messages.
    items : sequence
        All of them; pages take them in their order, and none has two more than another.
    most : int
        That a page shows.
    page : int
        One of the `pages` of all of them.

    Raises
    ------
    InputError
        If there is nothing to show, or no such page.

    Examples
    --------
    >>> on_page("letters", "abcde", 2, 2), on_page("letters", "abcde", 5, 1)
    (('bc', 'page 2 of 3'), ('abcde', ''))
    """
    if not items:
        raise InputError(f"{what} in a picture", got="none", allowed="at least one")
    last = pages(len(items), most)[-1]
    if not (isinstance(page, int) and 1 <= page <= last):
        raise InputError(f"page of {len(items)} {what}", got=page, allowed=f"1 to {last}")
    return part(items, page, last), f"page {page} of {last}" if last > 1 else ""


def part(items: Sequence[Item], page: int, last: int) -> Sequence[Item]:
    """Return what a page shows where `last` is the last one.

    Examples
    --------
    >>> [part("abcde", page, 3) for page in (1, 2, 3)]
    ['a', 'bc', 'de']
    """
    return items[len(items) * (page - 1) // last:len(items) * page // last]


# --- One look for all pictures: readable at column width, for the colour-blind and in grey print ----------------------

COLOURS: Mapping[str, str] = MappingProxyType({
    "black": "#000000", "orange": "#E69F00", "sky": "#56B4E9", "green": "#009E73", "yellow": "#F0E442",
    "blue": "#0072B2", "vermilion": "#D55E00", "purple": "#CC79A7", "grey": "#666666",
})
"""The palette of Okabe and Ito (2008), distinguished with any colour vision, and a grey."""

LINES: tuple[tuple[str, Any], ...] = (
    (COLOURS["blue"], "-"), (COLOURS["vermilion"], (0, (5, 2))), (COLOURS["green"], (0, (1, 1.4))),
    (COLOURS["purple"], (0, (6, 2, 1.2, 2))), (COLOURS["black"], (0, (3, 1.5, 1, 1.5, 1, 1.5))),
)
"""Colour and dash of the first, second, … curve: the dash alone tells them apart in grey print."""

CURVES_A_PAGE = len(LINES)
"""How many curves a picture shows at once: as many as can be distinguished."""

_RC = {
    "font.size": 9.0, "axes.titlesize": 9.0, "axes.labelsize": 9.0, "legend.fontsize": 8.0, "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0, "font.family": "DejaVu Sans", "mathtext.fontset": "dejavusans", "lines.linewidth": 1.6,
    "axes.linewidth": 0.8, "axes.grid": True, "grid.color": "#D9D9D9", "grid.linewidth": 0.6,
    "axes.axisbelow": True, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    "figure.facecolor": "white", "savefig.facecolor": "white", "figure.dpi": 100.0, "path.simplify": True,
    "svg.hashsalt": "servotwin", "svg.fonttype": "path", "pdf.fonttype": 42, "axes.unicode_minus": True,
    "text.parse_math": False,  # a $ is a letter but where a label of our own has formulas: parse_math=True
}

WIDTH = 5.2  # inch: a column of text, or the width of a phone held upright


def context() -> AbstractContextManager[None]:
    """Return a context in which matplotlib draws in the style of this package."""
    import matplotlib as mpl

    settings: Any = _RC
    return mpl.rc_context(settings)


def axes_grid(rows: int = 1, *, width: float = WIDTH, height: float = 3.0,
              share: bool = True, ratios: tuple[float, ...] | None = None,
              margins: tuple[float, float, float, float, float] | None = None) -> tuple[Figure, list[Axes]]:
    """Return a figure with `rows` panels below each other.

    Parameters
    ----------
    rows : int
        Number of panels, at least 1.
    width, height : float
        Of the whole figure [inch].
    share : bool
        Whether all panels show the same stretch of the horizontal axis.
    ratios : tuple of float, length `rows`, optional
        Heights of the panels to each other; equal unless given.
    margins : tuple of float, optional
        Left, right, bottom, top and the gap between equal panels [inch]; found from the labels unless given, which
        takes several times as long as drawing.

    Examples
    --------
    >>> figure, axes = axes_grid(2)
    >>> len(axes)
    2
    """
    with context():
        figure = new_figure(width, height, "constrained" if margins is None else None)
        if margins is not None:
            left, right, bottom, top, gap = margins
            panel = (height - bottom - top - gap * (rows - 1)) / rows
            figure.subplots_adjust(left=left / width, right=1.0 - right / width, bottom=bottom / height,
                                   top=1.0 - top / height, hspace=gap / panel)
        grid = figure.subplots(rows, 1, sharex=share, squeeze=False, height_ratios=ratios)
        return figure, [grid[k, 0] for k in range(rows)]


def plain_decades(axis: Axis) -> None:
    """Put plain numbers at a logarithmic axis in place of formulas."""
    from matplotlib.ticker import LogFormatter

    class Plain(LogFormatter):
        def __call__(self, x: float, pos: int | None = None) -> str:
            return f"{x:g}" if super().__call__(x, pos) else ""

    axis.set_major_formatter(Plain())
    axis.set_minor_formatter(Plain())


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """Return an empty figure [inch] that is drawn without any window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def finished(figure: Figure, foot: str = "") -> Figure:
    """Return the figure with its layout found once and then kept, so that all files of it look the same.

    Words for its foot, such as which page of a picture it is, stand in its lower right corner.
    """
    with context():
        if foot:
            figure.supxlabel(foot, x=0.995, ha="right", fontsize=7.5, color=COLOURS["grey"])
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
    return figure


# --- From figures to bytes: PNG, SVG or PDF; the same figure gives the same bytes -------------------------------------

FORMATS = ("png", "svg", "pdf")
# No date and no program version in a file: two runs are comparable byte by byte.
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None}, "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
_DPI = 160


def to_bytes(figure: Figure, file_format: str, dpi: float = _DPI) -> bytes:
    """Return a figure as the contents of a file.

    Parameters
    ----------
    figure : Figure
    file_format : {"png", "svg", "pdf"}
    dpi : float
        Pixels an inch of a PNG.

    Raises
    ------
    OutputError
        If the format is none of these.

    Examples
    --------
    >>> from servotwin.look import axes_grid
    >>> to_bytes(axes_grid()[0], "png")[1:4]
    b'PNG'
    """
    if file_format not in FORMATS:
        raise OutputError("format of a picture", got=file_format, allowed=", ".join(FORMATS))
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        if HIDDEN.search(text.get_text()):
            text.set_text(shown(text.get_text()))
    with context(), io.BytesIO() as stream:
        figure.savefig(stream, format=file_format, dpi=dpi, metadata=_METADATA[file_format])
        return stream.getvalue()
