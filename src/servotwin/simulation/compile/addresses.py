"""Memory at addresses, and functions there: what text that is compiled reads, writes and calls.

In plain Python they are views of memory and calls through ctypes; in compiled text single expressions take their place.
An array shares its numbers with whatever else has the address, which has to be theirs for as long as it is used. A
function that is called keeps Python's lock.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.int64]
Numbers = NDArray[np.float64]
Rows = NDArray[np.float64]
Bytes = NDArray[np.int8]
Halves = NDArray[np.int32]

_kept = [0]  # what `activate` was called with


def words(address: int, count: int) -> Words:
    """Return so many whole numbers of 64 bits at an address, shape (count,)."""
    return _view(address, count, np.dtype(np.int64))


def numbers(address: int, count: int) -> Numbers:
    """Return so many floats of 64 bits at an address, shape (count,)."""
    return _view(address, count, np.dtype(np.float64))


def rows(address: int, count: int, width: int) -> Rows:
    """Return a table of floats of 64 bits at an address, row by row, shape (count, width)."""
    return numbers(address, count * width).reshape(count, width)


def bytes_at(address: int, count: int) -> Bytes:
    """Return so many whole numbers of 8 bits at an address, shape (count,)."""
    return _view(address, count, np.dtype(np.int8))


def halves(address: int, count: int) -> Halves:
    """Return so many whole numbers of 32 bits at an address, shape (count,)."""
    return _view(address, count, np.dtype(np.int32))


def called(function: int, words: int) -> int:
    """Call `int64_t f(int64_t)` at an address, mostly with the address of its words, and return its number."""
    return told(function, words)


def told(function: int, *arguments: int) -> int:
    """Call `int64_t f(int64_t, ...)` at an address, and return its number, which counts where it has one."""
    return int(_prototype(len(arguments))(int(function))(*map(int, arguments)))


def copied(to: int, of: int, size: int) -> None:
    """Copy so many bytes from the address `of` to another one; they do not overlap."""
    ctypes.memmove(int(to), int(of), int(size))


def activate(word: int) -> None:
    """Keep a word for `active`; there is one for all text that is compiled together."""
    _kept[0] = int(word)


def active() -> int:
    """Return the word that was kept, at first 0."""
    return _kept[0]


def _view(address: int, count: int, kind: np.dtype[Any]) -> NDArray[Any]:
    memory = (ctypes.c_char * (int(count) * kind.itemsize)).from_address(int(address))
    return np.ndarray((int(count),), kind, memoryview(memory))


@cache
def _prototype(arguments: int) -> Any:
    return ctypes.PYFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * arguments)
