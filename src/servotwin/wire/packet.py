"""A packet of either protocol."""

from __future__ import annotations

from typing import NamedTuple

ALL = 0xFE
"""The ID of a broadcast."""


class Packet(NamedTuple):
    """An instruction, or an answer.

    Parameters
    ----------
    id : int
        Of the servo that it goes to, or comes from.
    code : int
        Instruction, or error byte of an answer.
    data : bytes
    """

    id: int
    code: int
    data: bytes = b""
