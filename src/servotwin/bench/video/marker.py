"""The mark that is printed, cut out and put on the horn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.look import COLOURS, new_figure, to_bytes
from servotwin.look.opencv import load_opencv

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# --- The instant that a clip and a log have in common: a light that turns on, or the first motion ---------------------

LED, JUMP, NONE = "led", "jump", "none"
_ACROSS = 160  # blocks, in which a light is looked for
_STAY = 0.2  # s for which a light stays on, and was off
_LEAST = 25.0  # grey levels (assumed) by which a light that is not pointed at brightens a block
_LEAST_POINTED = 8.0
_RIVAL = 0.5  # of its step: another thing that may be the light
_OFF, _ON = 0.15, 0.85  # shares of its brightness
_STEP, _SIGMAS = np.radians(0.5), 6.0  # what counts as a motion (assumed), and in standard errors
_RECTANGLE = 1.0 / np.sqrt(12.0)  # standard deviation of what is anywhere within 1

Region = tuple[int, int, int, int]
"""Left, top, width and height in a picture [pixels]."""


@dataclass(frozen=True)
class Instant:
    """When it was.

    Parameters
    ----------
    kind : str
        "led", "jump", "none" or "given".
    time : float
        In the clip [s]
    error : float
        Standard error [s]
    """

    kind: str
    time: float
    error: float


class Lights:
    """How bright each picture of a clip is, block by block or in one region.

    Parameters
    ----------
    region : tuple of int, optional
        Where the light is: left, top, width, height [pixels].
    """

    def __init__(self, region: Region | None) -> None:
        self._cv2 = load_opencv()
        self._region = region
        self.block = 1.0  # pixels
        self._seen: list[NDArray[np.uint8]] = []

    def add(self, colours: NDArray[np.uint8]) -> None:
        """Look at one more picture: the brightest of the three colours counts.

        Raises
        ------
        InputError
            If the region is not in it.
        """
        height, width = colours.shape[:2]
        part = colours
        if self._region is not None:
            left, top, wide, high = self._region
            if left < 0 or top < 0 or wide < 1 or high < 1 or left + wide > width or top + high > height:
                raise InputError("region of the LED", got=",".join(map(str, self._region)),
                                 allowed=f"x,y,w,h within the picture's {width} x {height}")
            part = colours[top:top + high, left:left + wide]
            shape = (1, 1)
        else:
            self.block = max(1.0, width / _ACROSS)
            shape = (round(width / self.block), round(height / self.block))
        brightest = self._cv2.max(self._cv2.max(part[..., 0], part[..., 1]), part[..., 2])
        self._seen.append(self._cv2.resize(brightest, shape, interpolation=self._cv2.INTER_AREA))

    def instant(self, time: NDArray[np.float64], axis: NDArray[np.float64], reach: float) -> Instant:
        """Return when the light turned on.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Of the pictures [s]
        axis : ndarray, shape (2,)
            Of the horn [pixels]
        reach : float
            How far around it nothing counts as a light [pixels]

        Raises
        ------
        InputError
            If none turns on, or one of two things may be it.
        """
        seen = np.array(self._seen)
        stay = max(2, min(round(_STAY / float(np.median(np.diff(time)))), (len(time) - 2) // 2))
        # By how much blocks are brighter after a picture than before it, shape (n - 2 stay, rows, columns): picture
        # k + stay itself is in neither, for the light may turn on while it is taken
        sums = np.concatenate([np.zeros((1, *seen.shape[1:]), np.float32), np.cumsum(seen, axis=0, dtype=np.float32)])
        mean = (sums[stay:] - sums[:-stay]) / stay  # of pictures k to k + stay - 1
        steps = np.asarray(mean[stay + 1:] - mean[:-stay - 1])
        if self._region is None:
            rows, columns = np.indices(seen.shape[1:]) + 0.5
            near = np.hypot(columns * self.block - axis[0], rows * self.block - axis[1]) < reach
            steps[:, near] = 0.0
        k, row, column = (int(i) for i in np.unravel_index(np.argmax(steps), steps.shape))
        best = float(steps[k, row, column])
        if best < (_LEAST if self._region is None else _LEAST_POINTED):
            raise InputError("LED: no light goes on and stays on", got=f"brighter by {best:.0f} of 255 at most",
                             allowed="--led x,y,w,h around it, or --instant jump")
        if self._region is None:
            others = steps.copy()
            others[max(k - stay - 1, 0):k + stay + 2] = 0.0  # what becomes brighter then is lit by it
            if others.max() > _RIVAL * best:
                raise InputError("LED: more than one thing in the picture becomes brighter",
                                 allowed="--led x,y,w,h around it, or --instant jump")
        return _switched(time, seen[:, row, column].astype(float), k + stay, stay)


def _switched(time: NDArray[np.float64], level: NDArray[np.float64], k: int, stay: int) -> Instant:
    """Return the middle between the last picture without light and the first one with all of it."""
    dark, light = np.median(level[max(k - stay, 0):k]), np.median(level[k + 1:k + 1 + stay])
    share = (level - dark) / (light - dark)
    on = next((j for j in range(max(k - 2, 1), len(level)) if share[j] >= _ON), k + 1)
    off = next((j for j in range(on - 1, -1, -1) if share[j] <= _OFF), on - 1)
    # no wider than a picture: where one was taken while the light turned on, that is the one
    return Instant(LED, float(0.5 * (time[off] + time[on])), float(_RECTANGLE * (time[on] - time[off]) / (on - off)))


def jump(time: NDArray[np.float64], angle: NDArray[np.float64], error: float) -> Instant:
    """Return when an angle begins to change: between the last picture at rest and the first one that is off it.

    Parameters
    ----------
    time, angle : ndarray, shape (n,)
        nan where it was not seen [s], [rad]
    error : float
        Standard error of the angle [rad]

    Raises
    ------
    InputError
        If it never changes, or changes from the first pictures on.

    Examples
    --------
    >>> jump(np.arange(6.0), np.array([0.0, 0.0, 0.0, 0.0, 0.5, 1.0]), 1e-3).time
    3.5
    """
    seen = np.flatnonzero(np.isfinite(angle))
    rest = float(np.median(angle[seen[:3]]))
    off = np.abs(angle[seen] - rest) > max(_STEP, _SIGMAS * error)
    both = np.flatnonzero(off[:-1] & off[1:])
    if not both.size:
        raise InputError("first jump of the angle", got="a mark that stands still", allowed="a horn that turns by more "
                         "than half a degree")
    if both[0] < 3:
        raise InputError("first jump of the angle", got="a horn that turns from the beginning",
                         allowed="three pictures or more before it moves")
    before, after = (float(time[seen[both[0] + k]]) for k in (-1, 0))
    return Instant(JUMP, 0.5 * (before + after), float(_RECTANGLE * (after - before)))


# --- The mark that is printed, cut out and put on the horn ------------------------------------------------------------

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
