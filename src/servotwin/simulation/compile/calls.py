"""Kernels with their arguments, to be called by address: from compiled code, and from Python again and again.

A number is a word; an array is its address and its lengths; a tuple is all that is in it. Values that change from call
to call, `Now` and `Some`, are put into the words by a call before.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.simulation.compile import Recipe, backend, is_plain, kernels
from servotwin.simulation.compile.text.kinds import Tuple, words_of

_WORD = 8  # bytes


class Now(NamedTuple):
    """A number that stands in an array when the call is made; `truth` where it is a condition."""

    array: NDArray[np.float64]
    place: int
    truth: bool = False


class Some(NamedTuple):
    """The first of an array, as many as `number[0]` says when the call is made."""

    array: NDArray[Any]
    number: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Call:
    """A kernel with its arguments.

    Parameters
    ----------
    function : int
        Address of the C function `int64_t f(int64_t *words)`.
    words : ndarray of int64
        Words of which the function is given the address.
    kept : tuple
        Objects of which it uses the memory.
    before : Call or None
        Call that has to precede it, each time.
    """

    function: int
    words: NDArray[np.int64]
    kept: tuple[Any, ...]
    before: Call | None = None

    def __call__(self) -> int:
        """Call it, and return its number."""
        for function, words in self._steps:
            found: int = function(words)
        return found

    @cached_property
    def _steps(self) -> list[tuple[Any, int]]:
        calls = (self,) if self.before is None else (self.before, self)
        return [(_FUNCTION(call.function), call.words.ctypes.data) for call in calls]


_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)
DRIVERS = Recipe("drivers", tuple(f"servotwin.{entry}" for entry in (
    "simulation.compile.tick:renew", "simulation.compile.tick:advance", "robots.servos.joints:control",
    "robots.servos.joints:step")), by_numbers=True)
"""Functions called with numbers, by kernels, by a program in C and by a rigid-body engine."""


def call_of(recipe: Recipe, entry: str, *arguments: Any, returns: bool = False) -> Call:
    """Return a call of a kernel; it returns the kernel's whole number where that `returns` one, else 1."""
    kernel = getattr(kernels(recipe), entry)
    if is_plain():
        return _plain_call(kernel, arguments, returns)
    function = kernel.fitting([_whole(argument) for argument in arguments])
    words = function.words([_whole(argument) for argument in arguments])
    copies, truths = list[int](), list[int]()
    place = words.ctypes.data
    for kind, argument in zip(function.kinds, arguments, strict=True):
        _note(kind, argument, place, copies, truths)
        place += _WORD * words_of(kind)
    before = None
    if copies or truths:
        pairs = np.array([len(copies) // 2, len(truths) // 2, *copies, *truths], np.int64)
        before = Call(_address("renew"), pairs, ())
    return Call(function.address, words, arguments, before)


def _whole(argument: Any) -> Any:
    """Return an argument of the same kind without anything that changes."""
    if isinstance(argument, Now):
        return bool(argument.array[argument.place]) if argument.truth else float(argument.array[argument.place])
    if isinstance(argument, Some):
        return argument.array
    if isinstance(argument, tuple) and hasattr(argument, "_fields"):
        return type(argument)(*map(_whole, argument))
    return argument


def _note(kind: Any, argument: Any, place: int, copies: list[int], truths: list[int]) -> None:
    """Note which words from a place on are copied from where: numbers as they are, conditions as 0 or 1."""
    if isinstance(argument, Now):
        (truths if argument.truth else copies).extend((place, argument.array.ctypes.data + _WORD * argument.place))
    elif isinstance(argument, Some):
        copies += (place + _WORD, argument.number.ctypes.data)
    elif isinstance(kind, Tuple):
        for inner, each in zip(kind.elements, argument, strict=True):
            _note(inner, each, place, copies, truths)
            place += _WORD * words_of(inner)


def _plain_call(kernel: Callable[..., Any], arguments: tuple[Any, ...], returns: bool) -> Call:
    """Return a call of a kernel in plain Python, which has its arguments without words."""
    def call(_: int) -> int:
        found = kernel(*(_as_now(argument) for argument in arguments))
        return int(found) if returns else 1

    callback = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(call)
    return Call(backend.address(callback), np.zeros(1, np.int64), (callback, *arguments))


def _as_now(argument: Any) -> Any:
    """Return what a kernel gets for an argument at this moment."""
    if isinstance(argument, Now):
        value = argument.array[argument.place]
        return bool(value != 0.0) if argument.truth else value
    if isinstance(argument, Some):
        return argument.array[:argument.number[0]]
    if isinstance(argument, tuple) and hasattr(argument, "_fields"):
        return type(argument)(*map(_as_now, argument))
    return argument


@cache
def tick_address() -> int:
    """Return the address of the C function `int servotwin_advance(servotwin_tick *tick)`."""
    if is_plain():
        return backend.address_of(kernels(DRIVERS).advance, ctypes.c_int32, ctypes.c_int64)
    return _address("advance")


@cache
def joint_addresses() -> tuple[int, int]:
    """Return the addresses of two C functions of `robots.servos.joints`.

    They are `void control(const mjModel *m, mjData *d)` and
    `int64_t step(int64_t *drive, const mjModel *m, mjData *d, int64_t steps)`.
    """
    if is_plain():
        own, word = kernels(DRIVERS), ctypes.c_int64
        return backend.address_of(own.control, None, word, word), backend.address_of(own.step, word, *[word] * 4)
    return _address("control"), _address("step")


def _address(entry: str) -> int:
    """Return the address of a driver."""
    return int(getattr(kernels(DRIVERS), entry).functions[0].address)


def program(chains: Sequence[Sequence[Call]]) -> NDArray[np.int64]:
    """Return chains of calls as words: how many there are, then for each how many calls, and these."""
    words = [len(chains)]
    for chain in chains:
        calls = [each for call in chain for each in (call.before, call) if each is not None]
        words.append(len(calls))
        for call in calls:
            words += [call.function, call.words.ctypes.data]
    return np.array(words, np.int64)
