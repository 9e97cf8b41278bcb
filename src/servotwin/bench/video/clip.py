"""A clip: its pictures, and the times that its file gives them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.look.opencv import load_opencv, quiet
from servotwin.units import is_finite

_HEAD = 64  # bytes
_SLACK = 0.1  # s that a clip may end before what its file says, beside three frames


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
        with quiet():
            self._film = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG)
        if not self._film.isOpened():
            raise _unreadable(self.path, head)
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
        if not steps:
            raise InputError(f"{self.path}", got="fewer than two pictures", allowed="a clip of a turning horn")
        if self._said - last > 3.0 * float(np.median(steps)) + _SLACK * self._slow:
            raise InputError(f"{self.path}: its pictures end after {last:.2f} s of {self._said:.2f} s: the clip is cut "
                             "or damaged; copy it from the phone again")


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


def _unreadable(path: Path, head: bytes) -> InputError:
    if head[4:8] == b"ftyp":  # an mp4, whose table of pictures often comes last
        return InputError(f"{path}: the clip is cut or damaged (its table of pictures cannot be read); copy it from "
                          "the phone again")
    return InputError(f"{path}", got="no video that OpenCV reads", allowed="a video, such as .mp4 or .mov")


def _word(code: int) -> str:
    """Return the four letters of a codec.

    Examples
    --------
    >>> _word(0x34363248)
    'H264'
    """
    letters = "".join(chr(code >> 8 * k & 0xFF) for k in range(4))
    return letters if letters.isprintable() and letters.strip() else "unknown"

