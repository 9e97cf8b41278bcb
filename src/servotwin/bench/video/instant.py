"""The instant that a clip and a log have in common: a light that goes on, or the first motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.look.opencv import load_opencv

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
        """Return when the light went on.

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
            If none goes on, or one of two things may be it.
        """
        seen = np.array(self._seen)
        stay = max(2, min(round(_STAY / float(np.median(np.diff(time)))), (len(time) - 2) // 2))
        steps = _steps(seen, stay)
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


def _steps(seen: NDArray[np.uint8], stay: int) -> NDArray[np.float32]:
    """Return by how much blocks are brighter after a picture than before it, shape (n - 2 stay, rows, columns)."""
    sums = np.concatenate([np.zeros((1, *seen.shape[1:]), np.float32), np.cumsum(seen, axis=0, dtype=np.float32)])
    mean = (sums[stay:] - sums[:-stay]) / stay  # of pictures k to k + stay - 1
    # picture k + stay itself is in neither: the light may go on while it is taken
    return np.asarray(mean[stay + 1:] - mean[:-stay - 1])


def _switched(time: NDArray[np.float64], level: NDArray[np.float64], k: int, stay: int) -> Instant:
    """Return the middle between the last picture without light and the first one with all of it."""
    dark, light = np.median(level[max(k - stay, 0):k]), np.median(level[k + 1:k + 1 + stay])
    share = (level - dark) / (light - dark)
    on = next((j for j in range(max(k - 2, 1), len(level)) if share[j] >= _ON), k + 1)
    off = next((j for j in range(on - 1, -1, -1) if share[j] <= _OFF), on - 1)
    # no wider than a picture: where one was taken while the light went on, that is the one
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
