"""The corners of the marks in each picture of a clip."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.video.edges import sharpened
from servotwin.bench.video.marker import dictionary
from servotwin.errors import InputError
from servotwin.look.opencv import load_opencv

_WHOLE = 15  # pictures: how often the whole picture is searched, for a second mark with the same id
_MARGIN = 0.8  # of a mark's size, around the place where it was last
_ALIKE = 0.5  # of the larger one's side: a second mark rather than a speck
_BLURS = (0.0, 1.0, 2.0)  # pixels: small marks want none, large ones in noise are found only so (measured)
_SMALLEST = 8  # pixels: a picture in which there may be a mark
_CONTRAST = 12.0  # grey levels (measured: 7, which is usual, loses half the marks in noise)


class Finder:
    """What finds marks, picture after picture; it looks first where they were last.

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
