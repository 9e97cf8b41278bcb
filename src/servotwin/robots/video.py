"""Videos that a browser plays, written picture by picture with OpenCV."""

from __future__ import annotations

import io
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import OutputError
from servotwin.look.opencv import load_opencv, quiet

Picture = NDArray[np.uint8]
CODECS = {".webm": ("VP80", "VP90"), ".mp4": ("avc1", "vp09")}
"""By the ending of a file, what browsers play, what is tried first standing first: VP8 is written five times as fast as
VP9, and H.264 not at all by the wheels of OpenCV, whose licence forbids it."""


class Video:
    """A video file; close it, or use it in a `with` statement.

    Parameters
    ----------
    path : Path
        Ends in .webm or .mp4; replaced if it is there.
    width, height : int
        [pixels]
    rate : float
        Pictures a second [Hz]

    Raises
    ------
    MissingExtraError
        If OpenCV is not installed.
    OutputError
        If the file ends otherwise, or OpenCV cannot write it.
    """

    def __init__(self, path: Path, width: int, height: int, rate: float) -> None:
        cv2 = load_opencv()
        if path.suffix.lower() not in CODECS:
            raise OutputError("video", got=str(path), allowed="a name that ends in " + " or ".join(CODECS))
        self.codec = ""
        known = CODECS[path.suffix.lower()]
        for codec in known:
            with quiet():  # it tells on stderr of each codec that it does not have
                self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), float(rate), (width, height))
            if self._writer.isOpened():
                self.codec = codec
                return
            self._writer.release()
        raise OutputError(f"{path} cannot be written (this OpenCV has none of {', '.join(known)})")

    def add(self, picture: Picture) -> None:
        """Write a picture, shape (height, width, 3), red, green, blue."""
        self._writer.write(np.ascontiguousarray(picture[:, :, ::-1]))

    def close(self) -> None:
        """Write what is left."""
        self._writer.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def png(picture: Picture) -> bytes:
    """Return a picture as a PNG file; Pillow, which writes it, comes with matplotlib.

    Examples
    --------
    >>> png(np.zeros((2, 3, 3), np.uint8))[1:4]
    b'PNG'
    """
    from PIL import Image

    with io.BytesIO() as stream:
        Image.fromarray(picture).save(stream, format="png")
        return stream.getvalue()
