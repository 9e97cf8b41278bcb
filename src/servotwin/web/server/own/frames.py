"""Frames between a server and its processes: pieces of bytes, each behind its length, and a refusal with some."""

from __future__ import annotations

import pickle
import zlib
from typing import BinaryIO

from servotwin.errors import InputError, ServotwinError
from servotwin.logs import Log

# --- Logs as they are kept: packed, and only ever unpacked in a process of their own ----------------------------------

def logs_of(packed: bytes) -> list[Log]:
    """Return all logs that were kept.

    Examples
    --------
    >>> log = Log(name="a", time=[0.0, 1.0, 2.0], command=[0.0, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.5, 1.0]})
    >>> logs_of(zlib.compress(pickle.dumps([log])))[0].name
    'a'
    """
    found: list[Log] = pickle.loads(zlib.decompress(packed))  # by our own process
    return found


def run_of(packed: bytes, run: int) -> Log:
    """Return one of the logs.

    Raises
    ------
    InputError
        If there is none of this number.
    """
    logs = logs_of(packed)
    if not 0 <= run < len(logs):
        raise InputError("run of the log", got=run, allowed=f"a whole number from 0 to {len(logs) - 1}")
    return logs[run]


# --- Frames between a server and its processes: pieces of bytes, each behind its length, and a refusal ----------------

HEAD = 8
"""Bytes of a length."""
MOST = 500_000_000
"""Bytes of a piece: more is a mistake."""


class RefusedError(ServotwinError):
    """An error, in a line, with bytes that are given back nevertheless."""

    def __init__(self, line: str, blobs: list[bytes]) -> None:
        super().__init__(line)
        self.blobs = blobs


def framed(data: bytes) -> tuple[bytes, bytes]:
    r"""Return a piece as it goes over a pipe.

    Examples
    --------
    >>> framed(b"ab")
    (b'\x02\x00\x00\x00\x00\x00\x00\x00', b'ab')
    """
    return len(data).to_bytes(HEAD, "little"), data


def taken(stream: BinaryIO) -> bytes:
    """Return the next piece of a pipe.

    Raises
    ------
    EOFError
        If it ends before.
    """
    size = int.from_bytes(_exactly(stream, HEAD), "little")
    return _exactly(stream, size)


def _exactly(stream: BinaryIO, size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data
