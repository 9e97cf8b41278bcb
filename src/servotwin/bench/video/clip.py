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
            # one thread, or what others complain of would be told between two pictures
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

