"""The mark that is printed, cut out and put on the horn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.look import COLOURS, new_figure, to_bytes
from servotwin.look.opencv import load_opencv

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DICTIONARY = "DICT_4X4_50"
"""Of ArUco marks: the one with the largest cells, which stand blur best; ids 0 to 49."""
HORN, CASE = 0, 1  # ids
CELLS = 6  # along a side: four of the code, and the black border
SIDES = (5e-3, 0.2)
_ZONE = 1.5  # cells of white around the mark: one to find it by, the rest for the arrow
_BAR = 50e-3  # m, the printed ruler
_MARGIN = 5e-3
_INCH = 25.4e-3
_MOST_DPI = 2400.0


def dictionary(cv2: Any) -> Any:
    """Return OpenCV's table of marks."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))


def mark_cells(mark: int) -> NDArray[np.bool_]:
    """Return which cells of a mark are white, shape (6, 6), the upper row first.

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    InputError
        If there is no such mark.
    """
    cv2 = load_opencv()
    known = dictionary(cv2)
    count = int(known.bytesList.shape[0])
    if not 0 <= mark < count:
        raise InputError("id of a mark", got=mark, allowed=f"0 to {count - 1}; {HORN}: horn, {CASE}: case")
    return np.asarray(cv2.aruco.generateImageMarker(known, mark, CELLS) > 0)


def mark_bytes(file_format: str, *, side: float, mark: int = HORN, dpi: float = 600.0) -> bytes:
    """Return a page with a mark at its true size, its direction of 0°, and a ruler that checks the printer.

    Parameters
    ----------
    file_format : {"png", "svg", "pdf"}
    side : float
        Of the black square, 5 mm to 200 mm [m]
    mark : int
        Id: 0 for the horn, 1 for the case.
    dpi : float
        Pixels an inch of a PNG, 72 to 2400.

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    InputError
        If side, id or dpi cannot be.
    OutputError
        If the format is none of these.
    """
    if not SIDES[0] <= side <= SIDES[1]:
        raise InputError("side of a mark", got=f"{1e3 * side:g} mm",
                         allowed=f"{1e3 * SIDES[0]:g} mm to {1e3 * SIDES[1]:g} mm")
    if not 72.0 <= dpi <= _MOST_DPI:
        raise InputError("dpi", got=dpi, allowed=f"72 to {_MOST_DPI:g}")
    cells = mark_cells(mark)
    piece = side * (1.0 + 2.0 * _ZONE / CELLS)
    width = max(piece, _BAR) + 2.0 * _MARGIN
    height = piece + 2.0 * _MARGIN + 14e-3  # ruler and words below
    figure = new_figure(width / _INCH, height / _INCH, None)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(-0.5 * width, 0.5 * width)
    axes.set_ylim(_MARGIN + 0.5 * piece - height, _MARGIN + 0.5 * piece)
    _piece(axes, cells, side, piece)
    _ruler(axes, -0.5 * piece - 7e-3,
           f"mark {mark}, black side {1e3 * side:g} mm, {DICTIONARY}: print at 100 %, this bar is {1e3 * _BAR:g} mm")
    return to_bytes(figure, file_format, dpi)


def _piece(axes: Axes, cells: NDArray[np.bool_], side: float, piece: float) -> None:
    """Draw what is cut out: mark, arrow at 0°, and the line to cut along."""
    from matplotlib.patches import Polygon, Rectangle

    cell = side / CELLS
    axes.add_patch(Rectangle((-0.5 * side, -0.5 * side), side, side, color="black", linewidth=0.0, snap=False))
    for row, column, rows, columns in _runs(cells):
        axes.add_patch(Rectangle((-0.5 * side + column * cell, 0.5 * side - (row + rows) * cell), columns * cell,
                                 rows * cell, color="white", linewidth=0.0, snap=False))
    tip = 0.5 * piece
    axes.add_patch(Polygon([(tip, 0.0), (tip - 0.4 * cell, 0.3 * cell), (tip - 0.4 * cell, -0.3 * cell)],
                           color=COLOURS["black"], linewidth=0.0))
    axes.add_patch(Rectangle((-tip, -tip), piece, piece, fill=False, edgecolor=COLOURS["grey"], linewidth=0.25))


def _runs(cells: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Return white bars: first row and column, rows and columns.

    Along rows and along columns, so that a viewer shows no dark hairline between two white cells.
    """
    found = []
    for turned in (False, True):
        for k, line in enumerate(cells.T if turned else cells):
            ends = np.flatnonzero(np.diff(np.concatenate(([False], line, [False])).astype(int)))
            for a, b in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True):
                found.append((a, k, b - a, 1) if turned else (k, a, 1, b - a))
    return found


def _ruler(axes: Axes, height: float, words: str) -> None:
    black: dict[str, Any] = {"color": COLOURS["black"], "linewidth": 0.5}
    axes.plot([-0.5 * _BAR, 0.5 * _BAR], [height, height], **black)
    for k in range(6):
        x = (k / 5 - 0.5) * _BAR
        axes.plot([x, x], [height, height + (2e-3 if k in (0, 5) else 1e-3)], **black)
    axes.text(0.0, height - 1.5e-3, words.replace(": ", ":\n"), ha="center", va="top", fontsize=5.0)
    axes.text(0.5 * _BAR, height + 2.5e-3, "0° is where the arrow points", ha="right", va="bottom", fontsize=4.0)
