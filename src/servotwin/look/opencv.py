"""OpenCV, where it is installed, and without what its compiled code tells on stderr."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any

from servotwin.errors import MissingExtraError


def load_opencv() -> Any:
    """Return OpenCV's package.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise MissingExtraError("opencv-python-headless", "video") from None
    return cv2


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep from the terminal what compiled code writes to stderr."""
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # there is none
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
