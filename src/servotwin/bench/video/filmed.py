"""From a clip to the angle of the horn in it.

A camera that stands still maps the plane onto its picture by one homography, whatever its tilt, focal length and
distance. In the plane the mark turns rigidly about one axis. So all corners of all pictures have eight numbers of the
homography and the two of the axis in common, and each picture adds one angle to them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.video.marker import (
    CASE,
    CELLS,
    DICTIONARY,
    HORN,
    JUMP,
    LED,
    NONE,
    Instant,
    Lights,
    Region,
    dictionary,
    jump,
)
from servotwin.errors import InputError
from servotwin.look.opencv import load_opencv, quiet
from servotwin.units import is_finite

# --- A clip: its pictures, and the times that its file gives them -----------------------------------------------------

_HEAD = 64  # bytes
_SLACK = 0.1  # s that a clip may end before what its file says, beside three pictures
_TRIMMED = 2.5  # s more for mp4: phones keep, unseen, what stood before a trimmed clip up to a whole picture (assumed)


@dataclass(frozen=True)
class Picture:
    """One picture of a clip.

    Parameters
    ----------
    time : float
        That its file gives it, from the first picture on [s]
    colours : ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    """

    time: float
    colours: NDArray[np.uint8]


class Clip:
    """A video file, read once from its beginning to its end.

    Times are those of the file (presentation times): phones take pictures at uneven intervals, and their files say so.

    Parameters
    ----------
    path : str or Path
    slow : float
        By how much the file is slower than what was filmed: 8 for 240 pictures a second that play at 30.

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    InputError
        If there is no such file, it is no video, or its end is missing.
    """

    def __init__(self, path: str | Path, slow: float = 1.0) -> None:
        cv2 = load_opencv()
        self.path = Path(path)
        if not (is_finite(slow) and slow > 0.0):
            raise InputError("slow", got=slow, allowed="a positive number")
        head = _head(self.path)
        self._boxed = head[4:8] == b"ftyp"  # mp4 and mov
        if self._boxed and _ends_early(self.path):
            raise InputError(f"{self.path}: the clip is cut, the end of its file is missing; copy it from the phone "
                             "again")
        with quiet():
            # one thread, or what others complain of would be printed between two pictures
            self._film = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
        if not self._film.isOpened():
            raise InputError(f"{self.path}", got="no video that OpenCV reads", allowed="a video, such as .mp4 or .mov")
        self._position = cv2.CAP_PROP_POS_MSEC
        rate, count = (self._film.get(name) for name in (cv2.CAP_PROP_FPS, cv2.CAP_PROP_FRAME_COUNT))
        self._said = count / rate * slow if rate > 0.0 and count > 0.0 else 0.0
        self._slow = slow
        self.codec = _word(int(self._film.get(cv2.CAP_PROP_FOURCC)))

    def pictures(self) -> Iterator[Picture]:
        """Yield the pictures; one whose time is not after that of the one before is passed over.

        Raises
        ------
        InputError
            If the file ends before it should: part of it is missing.
        """
        first, last, steps = None, -np.inf, []
        try:
            while True:
                with quiet():
                    there, colours = self._film.read()
                if not there:
                    break
                now = 1e-3 * float(self._film.get(self._position)) * self._slow
                first = now if first is None else first
                if now - first > last:
                    steps.append(now - first - last)
                    last = now - first
                    yield Picture(last, colours)
        finally:
            self._film.release()
        self._check_end(last, steps[1:])

    def _check_end(self, last: float, steps: list[float]) -> None:
        end = max(last, 0.0)
        usual = float(np.median(steps)) if steps else 0.0
        if self._said - end > 3.0 * usual + (_SLACK + _TRIMMED * self._boxed) * self._slow:
            raise InputError(f"{self.path}: its pictures end after {end:.2f} s of {self._said:.2f} s: the clip is cut "
                             "or damaged; copy it from the phone again")
        if not steps:
            raise InputError(f"{self.path}", got="fewer than two pictures", allowed="a clip of a turning horn")


def _head(path: Path) -> bytes:
    """Return the first bytes of a file."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if not head:
        raise InputError(f"{path}", got="an empty file", allowed="a video, such as .mp4 or .mov")
    return head


def _ends_early(path: Path) -> bool:
    """Return whether an mp4 is shorter than its boxes say, or the one with the table of pictures is missing."""
    at, size, kinds = 0, path.stat().st_size, set()
    with path.open("rb") as file:
        while at + 8 <= size:
            file.seek(at)
            head = file.read(16)
            length = int.from_bytes(head[:4], "big")
            length = int.from_bytes(head[8:16], "big") if length == 1 else length or size - at
            if length < 8:
                return True
            kinds.add(head[4:8])
            at += length
    return at > size or b"moov" not in kinds


def _word(code: int) -> str:
    """Return the four letters of a codec.

    Examples
    --------
    >>> _word(0x34363248)
    'H264'
    """
    letters = "".join(chr(code >> 8 * k & 0xFF) for k in range(4))
    return letters if letters.isprintable() and letters.strip() else "unknown"

# --- Corners of a square to a few hundredths of a pixel ---------------------------------------------------------------

_POINTS = 32  # across each edge
_ENDS = 0.1  # of an edge at each end, where the next one blurs it
_ROUNDS = 2
_FAR = 3.0  # standard deviations: a point off its line


def sharpened(cv2: Any, grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the corners of a dark square on white, to better than a pixel.

    Along the normal of an edge the grey goes from dark to white. The place of a sharp step with the same area between
    is that of the edge, however far lens or motion blur it. A motion blurs opposite edges to opposite sides, so that
    the angle is that in the middle of the exposure.

    Parameters
    ----------
    cv2 : module
    grey : ndarray of uint8, shape (height, width)
    corners : ndarray, shape (4, 2)
        To a pixel or two, one after the other around the square [pixels]

    Returns
    -------
    ndarray, shape (4, 2), or None
        None where an edge is not dark on one side and light on the other.
    """
    for _ in range(_ROUNDS):
        lines = _lines(cv2, grey, corners)
        if lines is None:
            return None
        meet = np.cross(np.roll(lines, 1, axis=0), lines)
        corners = meet[:, :2] / meet[:, 2:]
        if not np.isfinite(corners).all():
            return None
    return corners


def _lines(cv2: Any, grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the line through each edge, shape (4, 3), in homogeneous coordinates."""
    start, along = corners, np.roll(corners, -1, axis=0) - corners
    length = np.hypot(along[:, 0], along[:, 1])
    if length.min() < CELLS:  # less than a pixel a cell
        return None
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
    middle = start + 0.5 * along
    normal *= np.sign(np.sum((middle - corners.mean(axis=0)) * normal, axis=1))[:, None]  # out of the square
    reach = max(2.0, 0.5 * float(length.mean()) / CELLS)
    across = np.linspace(-reach, reach, max(9, 2 * int(2.0 * reach) + 1))
    shares = np.linspace(_ENDS, 1.0 - _ENDS, _POINTS)
    places = (start[:, None, None] + along[:, None, None] * shares[None, :, None, None]
              + normal[:, None, None] * across[None, None, :, None])
    flat = places.reshape(4 * _POINTS, across.size, 2).astype(np.float32)
    seen = cv2.remap(grey, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    seen = seen.astype(float).reshape(4, _POINTS, across.size)
    end = max(1, across.size // 8)
    dark = np.median(seen[..., :end], axis=(1, 2))[:, None, None]
    light = np.median(seen[..., -end:], axis=(1, 2))[:, None, None]
    if (light - dark).min() < 8.0:  # grey levels: no edge there
        return None
    step = across[1] - across[0]
    share = (light - seen) / (light - dark)
    offset = (share.sum(axis=2) - 0.5 * (share[..., 0] + share[..., -1])) * step - reach
    return np.array([_line(start[k], along[k], normal[k], shares, offset[k]) for k in range(4)])


def _line(start: NDArray[np.float64], along: NDArray[np.float64], normal: NDArray[np.float64],
          shares: NDArray[np.float64], offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the line through points at an edge, without those far off it."""
    x = shares - 0.5
    weight = np.ones_like(x)
    mean = slope = 0.0
    for _ in range(3):
        total, first = weight.sum(), weight @ x / weight.sum()
        slope = (weight * (x - first)) @ offset / ((weight * (x - first)) @ x)
        mean = weight @ offset / total - slope * first
        residual = np.abs(offset - mean - slope * x)
        # 1.48: from the median of a normal distribution's residuals to its standard deviation
        weight = (residual <= _FAR * 1.48 * np.median(residual) + 1e-9).astype(float)
    ends = (start + (mean - 0.5 * slope) * normal, start + along + (mean + 0.5 * slope) * normal)
    return np.asarray(np.cross(np.append(ends[0], 1.0), np.append(ends[1], 1.0)))

# --- The corners of the marks in each picture of a clip ---------------------------------------------------------------

_WHOLE = 15  # pictures: how often the whole picture is searched, for a second mark with the same id
_MARGIN = 0.8  # of a mark's size, around the place where it was last
_ALIKE = 0.5  # of the larger one's side: a second mark rather than a speck
_BLURS = (0.0, 1.0, 2.0)  # pixels: small marks want none, large ones in noise are found only so (measured)
_SMALLEST = 8  # pixels: a picture in which there may be a mark
_CONTRAST = 12.0  # grey levels (measured: 7, which is usual, loses half the marks in noise)


class Finder:
    """A finder of marks, picture after picture; it looks first where they were last.

    Parameters
    ----------
    wanted : sequence of int
        Ids.
    what : str
        How errors call the clip.

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    """

    def __init__(self, wanted: tuple[int, ...], what: str) -> None:
        self._cv2: Any = load_opencv()
        options = self._cv2.aruco.DetectorParameters()
        options.cornerRefinementMethod = self._cv2.aruco.CORNER_REFINE_NONE
        options.adaptiveThreshConstant = _CONTRAST
        self._detector = self._cv2.aruco.ArucoDetector(dictionary(self._cv2), options)
        self._wanted, self._what = wanted, what
        self._last: dict[int, NDArray[np.float64]] = {}
        self._count = 0
        self.seen: Counter[int] = Counter()

    def corners(self, grey: NDArray[np.uint8]) -> dict[int, NDArray[np.float64]]:
        """Return the corners of each mark that is seen, shape (4, 2): upper left, and on to the right [pixels].

        Raises
        ------
        InputError
            If two marks have the same id.
        """
        found: dict[int, NDArray[np.float64]] = {}
        if self._count % _WHOLE:
            for mark, last in self._last.items():
                found |= self._near(grey, mark, last)
        if len(found) < len(self._last) or not found:
            found = self._search(grey, self._wanted)
        self._count += 1
        self._last |= found
        sharp = {mark: sharpened(self._cv2, grey, at) for mark, at in found.items()}
        return {mark: at for mark, at in sharp.items() if at is not None}

    def _near(self, grey: NDArray[np.uint8], mark: int, last: NDArray[np.float64]) -> dict[int, NDArray[np.float64]]:
        margin = _MARGIN * float(np.ptp(last, axis=0).max())
        low = np.maximum(np.floor(last.min(axis=0) - margin), 0).astype(int)
        high = np.ceil(last.max(axis=0) + margin).astype(int)
        found = self._search(grey[low[1]:high[1], low[0]:high[0]], (mark,))
        return {one: at + low for one, at in found.items()}

    def _search(self, grey: NDArray[np.uint8], wanted: tuple[int, ...]) -> dict[int, NDArray[np.float64]]:
        """Return the marks that are wanted, as far as they are found; the blurs are tried until all are."""
        found: dict[int, NDArray[np.float64]] = {}
        for blur in _BLURS if min(grey.shape) >= _SMALLEST else ():
            smooth = self._cv2.GaussianBlur(grey, (0, 0), blur) if blur else np.ascontiguousarray(grey)
            found = self._marks(smooth, wanted) | found
            if len(found) == len(wanted):
                break
        return found

    def _marks(self, grey: NDArray[np.uint8], wanted: tuple[int, ...]) -> dict[int, NDArray[np.float64]]:
        places, ids, _ = self._detector.detectMarkers(grey)
        found: dict[int, NDArray[np.float64]] = {}
        for place, mark in zip(places, [] if ids is None else ids.ravel().tolist(), strict=True):
            at = place.reshape(4, 2).astype(float)
            self.seen[mark] += 1
            if mark not in wanted:
                continue
            if mark in found:
                sizes = sorted(float(np.ptp(one, axis=0).max()) for one in (at, found[mark]))
                if sizes[0] > _ALIKE * sizes[1]:
                    raise InputError(f"{self._what}: marks with id {mark}", got="two in one picture", allowed="one")
                if np.ptp(at, axis=0).max() < sizes[1]:
                    continue
            found[mark] = at
        return found

# --- The plane in which a mark turns, as the camera sees it, and the angles in it -------------------------------------

SQUARE = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
"""Corners of a mark with side 1 as it is printed, x to the right and y upwards: upper left, and on to the right."""
_SHARED = 10  # eight of the homography, two of the axis
_MOST_STEPS = 60
_PLANE_SMALL = 1e-10  # of the sum of squares, in one step
_HUBER = 2.0  # standard deviations above which a picture counts less


@dataclass(frozen=True, eq=False)
class Plane:
    """Where a mark turned.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        From the plane, the axis at its origin and the side of the mark its unit, to the picture [pixels].
    offset : ndarray, shape (2,)
        From the axis to the middle of the mark at angle 0, in sides.
    angle : ndarray, shape (n,)
        Counter-clockwise as the camera sees it, from any zero, within a turn [rad].
    residual : ndarray, shape (n,)
        Root mean square of each picture's corners [pixels].
    angle_std : ndarray, shape (n,)
        Standard error of each angle by the residuals of all [rad].
    """

    homography: NDArray[np.float64]
    offset: NDArray[np.float64]
    angle: NDArray[np.float64]
    residual: NDArray[np.float64]
    angle_std: NDArray[np.float64]

    def direction(self, corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how marks in this plane, or in a parallel one near it, are turned: corners (n, 4, 2) to (n,) [rad]."""
        return turned(mapped(inverse(self.homography), corners))

    @property
    def local(self) -> NDArray[np.float64]:
        """The homography near the axis: the derivative there, shape (2, 2) [pixels per side]."""
        h = self.homography
        return np.asarray((h[:2, :2] - np.outer(h[:2, 2] / h[2, 2], h[2, :2])) / h[2, 2])

    @property
    def level(self) -> float:
        """How a mark is turned whose arrow points to the right in the picture [rad]."""
        along = np.linalg.solve(self.local, [1.0, 0.0])
        return float(np.arctan2(along[1], along[0]))


def fit_plane(corners: NDArray[np.float64]) -> Plane:
    """Return the plane, the axis and the angles of a mark by nonlinear least squares.

    Parameters
    ----------
    corners : ndarray, shape (n, 4, 2)
        Finite, n ≥ 1 [pixels]

    Notes
    -----
    A picture whose corners fit badly counts less (Huber's weights). Of a mark that does not turn the axis is not known;
    the steps of least norm leave it where the start had it, and the angles do not depend on it.
    """
    middle = corners.mean(axis=(0, 1))
    scale = float(np.mean(np.hypot(*np.moveaxis(np.diff(corners, axis=1), -1, 0))))
    seen = (corners - middle) / scale
    shared, angle = _start(seen)
    damping, weight = 1e-3, np.ones(len(seen))
    error, by_shared, by_angle = _linearised(seen, shared, angle)
    cost = _cost(error, weight)
    for _ in range(_MOST_STEPS):
        step, turn = _step(error, by_shared, by_angle, weight, damping)
        tried = _linearised(seen, shared + step, angle + turn)
        new = _cost(tried[0], weight)
        if not new < cost:
            damping *= 10.0
            if damping > 1e6:
                break
            continue
        shared, angle, damping = shared + step, angle + turn, 0.1 * damping
        error, by_shared, by_angle = tried
        small = cost - new < _PLANE_SMALL * cost
        size = np.sqrt(np.mean(error**2, axis=1))
        usual = float(np.median(size))
        weight = np.ones(len(size))
        if usual > 0.0:
            weight = np.asarray(np.minimum(1.0, _HUBER * usual / np.maximum(size, 1e-300)))
        cost = _cost(error, weight)
        if small:
            break
    return _plane(shared, angle, error, by_angle, middle, scale)


def inverse(homography: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the way back of a homography, shape (3, 3)."""
    return np.asarray(np.linalg.inv(homography), dtype=np.float64)


def mapped(homography: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (..., 2) as a homography maps them."""
    lifted = points @ homography[:, :2].T + homography[:, 2]
    return np.asarray(lifted[..., :2] / lifted[..., 2:])


def turned(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return by how much squares (n, 4, 2) are turned against `SQUARE`, by least squares [rad], shape (n,).

    Examples
    --------
    >>> turned(np.array([[[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]]])).round(4)
    array([1.5708])
    """
    centred = corners - corners.mean(axis=1, keepdims=True)
    return np.asarray(np.angle((centred[..., 0] + 1j * centred[..., 1]) @ (SQUARE[:, 0] - 1j * SQUARE[:, 1])))


def _start(seen: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the search begins: the plane of the first picture, and the axis by the middles of all."""
    first = _square_to(seen[0])
    flat = mapped(inverse(first), seen)
    angle = turned(flat)
    middles = flat.mean(axis=1)
    # middle = axis + R(angle) offset, linear in axis and offset
    c, s = np.cos(angle), np.sin(angle)
    one, none = np.ones_like(c), np.zeros_like(c)
    rows = np.concatenate([np.stack([one, none, c, -s], axis=1), np.stack([none, one, s, c], axis=1)])
    found = np.linalg.lstsq(rows, np.concatenate([middles[:, 0], middles[:, 1]]), rcond=1e-3)[0]
    shift = np.eye(3)
    shift[:2, 2] = found[:2]
    homography = first @ shift
    homography /= homography[2, 2]
    return np.concatenate([homography.ravel()[:8], found[2:]]), angle


def _square_to(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the homography from `SQUARE` to four corners."""
    rows = []
    for (x, y), (u, v) in zip(SQUARE, corners, strict=True):
        rows += [[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y]]
    return np.append(np.linalg.solve(np.array(rows), corners.ravel()), 1.0).reshape(3, 3)


def _linearised(seen: NDArray[np.float64], shared: NDArray[np.float64], angle: NDArray[np.float64],
                ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return model minus picture (n, 8) and its derivatives by the shared numbers (n, 8, 10) and the angle (n, 8)."""
    n = len(seen)
    h = np.append(shared[:8], 1.0).reshape(3, 3)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    body = SQUARE + shared[8:]
    flat = np.einsum("nij,kj->nki", turn, body)
    lifted = flat @ h[:, :2].T + h[:, 2]
    depth = lifted[..., 2:]
    picture = lifted[..., :2] / depth
    local = (h[:2, :2] - picture[..., :, None] * h[2, :2]) / depth[..., None]
    by_shared = np.zeros((n, 4, 2, _SHARED))
    point = np.concatenate([flat, np.ones((n, 4, 1))], axis=-1) / depth
    by_shared[..., 0, 0:3] = point
    by_shared[..., 1, 3:6] = point
    by_shared[..., 6:8] = -picture[..., :, None] * point[..., None, :2]
    by_shared[..., 8:] = np.einsum("nkij,njl->nkil", local, turn)
    across = np.stack([-flat[..., 1], flat[..., 0]], axis=-1)
    by_angle = np.einsum("nkij,nkj->nki", local, across)
    return (picture - seen).reshape(n, 8), by_shared.reshape(n, 8, _SHARED), by_angle.reshape(n, 8)


def _step(error: NDArray[np.float64], by_shared: NDArray[np.float64], by_angle: NDArray[np.float64],
          weight: NDArray[np.float64], damping: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a damped Gauss-Newton step; the angles, each of one picture, are eliminated first."""
    w = weight[:, None]
    own = np.sum(w * by_angle**2, axis=1) * (1.0 + damping)
    cross = np.einsum("n,ni,nij->nj", weight, by_angle, by_shared)
    slope_own = np.sum(w * by_angle * error, axis=1)
    full = np.einsum("n,nij,nik->jk", weight, by_shared, by_shared)
    slope = np.einsum("n,nij,ni->j", weight, by_shared, error)
    reduced = full + damping * np.diag(np.diag(full)) - cross.T @ (cross / own[:, None])
    step = -np.linalg.lstsq(reduced, slope - cross.T @ (slope_own / own), rcond=1e-12)[0]
    return step, -(slope_own + cross @ step) / own


def _cost(error: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    return float(np.sum(weight[:, None] * error**2))


def _plane(shared: NDArray[np.float64], angle: NDArray[np.float64], error: NDArray[np.float64],
           by_angle: NDArray[np.float64], middle: NDArray[np.float64], scale: float) -> Plane:
    """Return the plane in pixels."""
    back = np.array([[scale, 0.0, middle[0]], [0.0, scale, middle[1]], [0.0, 0.0, 1.0]])
    size = np.sqrt(np.mean(error**2, axis=1))
    # of the eight numbers of a picture one went into its angle
    spread = float(np.median(size)) * np.sqrt(8.0 / 7.0)
    return Plane(homography=back @ np.append(shared[:8], 1.0).reshape(3, 3), offset=shared[8:].copy(), angle=angle,
                 residual=size * scale, angle_std=spread / np.sqrt(np.sum(by_angle**2, axis=1)))

# --- A camera that moves: what the mark on the case says of it is taken out of the picture ----------------------------

_SEEN = 0.5  # of the pictures: a mark on the case that counts
_STILL = 0.3  # pixels: less than that is no motion, and taking it out would only add noise


def steadied(corners: NDArray[np.float64], case: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the corners as a camera at rest would have seen them, and by how much it moved.

    Shift, turn and scale of the mark on the case are taken back; a camera that swings by degrees does more than that.

    Parameters
    ----------
    corners, case : ndarray, shape (n, 4, 2)
        Of the mark on the horn and on the case, nan where they were not seen [pixels]

    Returns
    -------
    corners : ndarray, shape (n, 4, 2)
        As they were where the camera stood still, or the case was hardly ever seen.
    moved : float
        Root mean square of the case's corners around their usual place; nan where it was not seen [pixels].
    """
    there = np.isfinite(case).all(axis=(1, 2))
    if there.mean() < _SEEN:
        return corners, float("nan")
    usual = np.median(case[there], axis=0)
    moved = float(np.sqrt(np.mean((case[there] - usual)**2)))
    if moved < _STILL:
        return corners, moved
    z, z0 = case[..., 0] + 1j * case[..., 1], usual[:, 0] + 1j * usual[:, 1]
    middle = z.mean(axis=1)
    back = z0 - z0.mean()
    grow = (z - middle[:, None]) @ back.conj() / np.sum(np.abs(back)**2)  # turn and scale in one complex number
    seen = corners[..., 0] + 1j * corners[..., 1]
    steady = (seen - middle[:, None]) / grow[:, None] + z0.mean()
    return np.stack([steady.real, steady.imag], axis=-1), moved

# --- From a clip to the angle of the horn in it -----------------------------------------------------------------------

_FEWEST = 3  # pictures with the mark
_MISREAD = 8.0  # usual residuals: a picture that is not counted
_LEAST_MISREAD = 0.03  # of the mark's side (assumed): a rolling shutter bends a fast mark, and its angle is right
_MOVED = 0.01  # of the side, and half a pixel: a usual residual that no camera at rest leaves
_REACH = 1.5  # of the circle that the mark's corners are in: where no light is looked for
_SMALL = 30.0  # pixels, below which a blurred mark is missed (measured, see the guide)


@dataclass(frozen=True, kw_only=True, eq=False)
class Filmed:
    """The angle of a horn, picture by picture.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Of all pictures, from the common instant on [s]
    angle : ndarray, shape (n,)
        nan where the mark was not seen; positive counter-clockwise as the camera sees it, unless flipped [rad].
    angle_std : float
        Usual standard error of an angle [rad]
    instant : Instant
        Time 0, in the clip's own time.
    facts : mapping
        Of clip, mark and instant, in plain JSON, as a log's sidecar has them.
    remarks : tuple of str
        Remarks for the user.
    """

    time: NDArray[np.float64] = field(repr=False)
    angle: NDArray[np.float64] = field(repr=False)
    angle_std: float
    instant: Instant
    facts: Mapping[str, Any] = field(repr=False)
    remarks: tuple[str, ...] = ()

    @property
    def interval(self) -> float:
        """From picture to picture, usually [s]."""
        return float(np.median(np.diff(self.time)))


@dataclass
class _Seen:
    """The marks in the pictures of a clip."""

    time: list[float] = field(default_factory=list)
    horn: list[NDArray[np.float64]] = field(default_factory=list)
    case: list[NDArray[np.float64]] = field(default_factory=list)
    shape: tuple[int, ...] = ()


def read_clip(path: str | Path, *, mark: int = HORN, instant: str | float = JUMP, led: Region | None = None,
              flip: bool = False, zero: float | None = None, slow: float = 1.0) -> Filmed:
    """Return the angle of the mark in a clip.

    Angles count from where the mark's arrow points to the right in the picture, which is the same in all clips of a
    camera that is not touched; from that of a mark with id 1 on the case, if there is one; or as `zero` says. A fit has
    one offset for all its logs.

    The camera's tilt is found from all pictures at once, see above; neither its focal length
    nor the size of the mark has to be known. A mark on the case is also what shows that a camera moves.

    Parameters
    ----------
    path : str or Path
    mark : int
        Id of the mark on the horn.
    instant : {"jump", "led", "none"} or float
        Time 0: the first motion, a light that turns on, the first picture, or a time in the clip [s].
    led : tuple of int, optional
        Where the light is: left, top, width, height [pixels]; makes the instant that of the light.
    flip : bool
        Count clockwise as positive.
    zero : float, optional
        Angle in the first picture [rad].
    slow : float
        By how much the clip plays slower than what it shows: 8 for 240 pictures a second that play at 30.

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    InputError
        If the clip cannot be read or is cut, shows no mark or two with the same id, or the instant is not in it.
    """
    if isinstance(instant, str) and instant not in (JUMP, LED, NONE):
        raise InputError("instant", got=instant, allowed=f"{LED}, {JUMP}, {NONE} or a time in the clip")
    clip = Clip(path, slow)
    lights = Lights(led) if led is not None or instant == LED else None
    seen, finder = _look(clip, mark, lights)
    time, horn, case = np.array(seen.time), np.array(seen.horn), np.array(seen.case)
    there = np.isfinite(horn).all(axis=(1, 2))
    if there.sum() < _FEWEST:
        others = ", ".join(str(one) for one in sorted(finder.seen) if one != mark)
        raise InputError(f"{path}: mark {mark} of {DICTIONARY}", got=f"seen in {there.sum()} of {len(time)} pictures"
                         + (f"; other marks: {others}" if others else ""), allowed=f"in {_FEWEST} or more: nearer, "
                         "sharper, with white paper all around it")
    steady, moved = steadied(horn, case)
    there &= np.isfinite(steady).all(axis=(1, 2))
    plane = fit_plane(steady[there])
    side = float(np.median(np.hypot(*np.moveaxis(np.diff(horn[there], axis=1), -1, 0))))
    good = plane.residual <= max(_MISREAD * float(np.median(plane.residual)), _LEAST_MISREAD * side)
    angle = np.full(len(time), np.nan)
    angle[np.flatnonzero(there)[good]] = np.unwrap(plane.angle[good])
    angle = (-1.0 if flip else 1.0) * _zeroed(angle, plane, case if np.isfinite(moved) else None, zero, flip=flip)
    error = float(np.median(plane.angle_std))
    found = _instant(instant, lights, time, angle, error, plane, horn[there])
    facts = {**_clip_facts(clip, seen, time, slow), **_mark_facts(plane, mark, side, angle, error, moved),
             "zero": "the first picture" if zero is not None else "the mark on the case" if np.isfinite(moved) else
             "the picture's horizontal",
             "turned": "clockwise" if flip else "counter-clockwise, as the camera sees it",
             "instant": {"kind": found.kind, "clip_time_s": found.time, "std_s": found.error}}
    return Filmed(time=time - found.time, angle=angle, angle_std=error, instant=found, facts=facts,
                  remarks=_remarks(time, angle, int((~good).sum()), side, plane, moved))


def _look(clip: Clip, mark: int, lights: Lights | None) -> tuple[_Seen, Finder]:
    """Return what all pictures show."""
    cv2 = load_opencv()
    wanted = (mark, CASE) if mark != CASE else (mark,)
    finder = Finder(wanted, str(clip.path))
    seen, nothing = _Seen(), np.full((4, 2), np.nan)
    for picture in clip.pictures():
        found = finder.corners(cv2.cvtColor(picture.colours, cv2.COLOR_BGR2GRAY))
        seen.time.append(picture.time)
        seen.horn.append(found.get(mark, nothing))
        seen.case.append(found.get(CASE, nothing) if mark != CASE else nothing)
        seen.shape = picture.colours.shape
        if lights is not None:
            lights.add(picture.colours)
    return seen, finder


def _zeroed(angle: NDArray[np.float64], plane: Plane, case: NDArray[np.float64] | None, zero: float | None, *,
            flip: bool) -> NDArray[np.float64]:
    """Return angles that count from what was asked for."""
    first = angle[np.flatnonzero(np.isfinite(angle))[0]]
    if zero is not None:
        return np.asarray(angle - first + (-zero if flip else zero))
    level = plane.level if case is None else float(plane.direction(np.nanmedian(case, axis=0)[None])[0])
    turns = 2.0 * np.pi * np.round((first - level) / (2.0 * np.pi))
    return np.asarray(angle - level - turns)


def _instant(asked: str | float, lights: Lights | None, time: NDArray[np.float64], angle: NDArray[np.float64],
             error: float, plane: Plane, horn: NDArray[np.float64]) -> Instant:
    if lights is not None:
        axis = mapped(plane.homography, np.zeros(2))
        return lights.instant(time, axis, _REACH * float(np.hypot(*np.moveaxis(horn - axis, -1, 0)).max()))
    if asked == JUMP:
        return jump(time, angle, error)
    if asked == NONE:
        return Instant(NONE, 0.0, 0.0)
    if not (is_finite(asked) and 0.0 <= asked <= time[-1]):
        raise InputError("instant", got=asked, allowed=f"a time in the clip, 0 to {time[-1]:.3f} s")
    return Instant("given", float(asked), 0.0)


def _clip_facts(clip: Clip, seen: _Seen, time: NDArray[np.float64], slow: float) -> dict[str, Any]:
    steps = np.diff(time)
    return {"file": clip.path.name, "codec": clip.codec, "width_px": seen.shape[1], "height_px": seen.shape[0],
            "pictures": len(time), "seconds": round(float(time[-1]), 6), "slow": slow,
            "pictures_per_s": round(float((len(time) - 1) / time[-1]), 4),
            "shortest_interval_s": round(float(steps.min()), 6), "longest_interval_s": round(float(steps.max()), 6)}


def _mark_facts(plane: Plane, mark: int, side: float, angle: NDArray[np.float64], error: float, moved: float,
                ) -> dict[str, Any]:
    # at the axis, a plane that is tilted by t looks shorter by cos t one way
    widths = np.linalg.svd(plane.local, compute_uv=False)
    return {"mark": mark, "dictionary": DICTIONARY, "side_px": round(side, 2),
            "tilt_deg": round(float(np.degrees(np.arccos(widths[1] / widths[0]))), 1),
            "seen": int(np.isfinite(angle).sum()), "corner_residual_px": round(float(np.median(plane.residual)), 4),
            "angle_std_deg": round(float(np.degrees(error)), 5),
            "case_seen": bool(np.isfinite(moved)), "camera_moved_px": round(moved, 3) if np.isfinite(moved) else None}


def _remarks(time: NDArray[np.float64], angle: NDArray[np.float64], misread: int, side: float, plane: Plane,
             moved: float) -> tuple[str, ...]:
    seen = np.flatnonzero(np.isfinite(angle))
    said = []
    if seen.size < angle.size:
        gap = float(np.diff(time[seen]).max(initial=0.0))
        said.append(f"the angle is missing in {angle.size - seen.size} of {angle.size} pictures (mark not seen"
                    + (f", or misread: {misread}" if misread else "") + f"), for {gap:.3f} s at most")
    if side < _SMALL:
        said.append(f"the mark is only {side:.0f} pixels wide: go nearer")
    if float(np.median(plane.residual)) > max(0.5, _MOVED * side):
        said.append(f"the corners do not turn about one axis, they are {np.median(plane.residual):.1f} pixels off: "
                    "does the camera move, or the mark wobble?")
    if np.isfinite(moved) and moved > 0.05 * side:
        said.append(f"the camera moved by {moved:.1f} pixels; the mark on the case was followed")
    return tuple(said)
