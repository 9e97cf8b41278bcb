"""What goes between a server and its processes: pieces of bytes, each behind its length, and a refusal with some."""

from __future__ import annotations

from typing import BinaryIO

from servotwin.errors import ServotwinError

HEAD = 8
"""Bytes of a length."""
MOST = 500_000_000
"""Bytes of a piece: more is a mistake."""


class RefusedError(ServotwinError):
    """What is wrong, in a line, with bytes that are given back nevertheless."""

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
