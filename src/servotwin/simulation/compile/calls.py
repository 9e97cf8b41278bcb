"""Kernels as C functions of one address: that of the words which say where their arguments are.

A number is a word; an array is its address and its lengths; a named tuple is all that is in it. The kernels themselves
are those that Python calls, compiled once.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.simulation.compile import Recipe, is_plain, kernels, plain, source_key
from servotwin.simulation.compile.derive import derive, surroundings
from servotwin.simulation.compile.storage import key_of, loaded, stored

_HEAD = """# Derived from servotwin's kernels; do not edit.
from numba import cfunc, types

from servotwin.simulation.compile.intrinsics import array_maker
from {module} import {entry} as kernel
{imports}
_words = array_maker("<i8", 1, True)
_numbers = array_maker("<f8", 1, True)
{makers}

@cfunc(types.int64(types.int64), cache=True, error_model="numpy")
def call(address):
    w, x = _words(address, ({size},)), _numbers(address, ({size},))
    {line}
"""


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
    """A kernel with its arguments, to be called from compiled code.

    Parameters
    ----------
    function : int
        Address of the C function `long long f(long long words)`.
    words : ndarray of int64
        What it is called with the address of.
    kept : tuple
        The arguments, whose memory it uses.
    """

    function: int
    words: NDArray[np.int64]
    kept: tuple[Any, ...]


def call_of(recipe: Recipe, entry: str, *arguments: Any, returns: bool = False) -> Call:
    """Return a call of a kernel; it returns the kernel's whole number where that `returns` one, else 1."""
    if is_plain():
        return _plain_call(getattr(kernels(recipe), entry), arguments, returns)
    block = _Block()
    text = ", ".join(block.put(argument) for argument in arguments)
    line = f"return kernel({text})" if returns else f"kernel({text})\n    return 1"
    size = len(block.words)
    rest = (entry, tuple(block.imports), tuple(block.makers), size, line)
    return Call(_compiled(recipe, rest), np.array(block.words, np.int64), arguments)


def _plain_call(kernel: Callable[..., Any], arguments: tuple[Any, ...], returns: bool) -> Call:
    """Return a call of a kernel in plain Python, which has its arguments without words."""
    def call(_: int) -> int:
        found = kernel(*(_as_now(argument) for argument in arguments))
        return int(found) if returns else 1

    callback = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(call)
    return Call(plain.address(callback), np.zeros(1, np.int64), (callback, *arguments))


def _as_now(argument: Any) -> Any:
    """Return what a kernel gets for an argument at this moment."""
    if isinstance(argument, Now):
        value = argument.array[argument.place]
        return bool(value != 0.0) if argument.truth else value
    if isinstance(argument, Some):
        return argument.array[:argument.number[0]]
    return argument


@dataclass
class _Block:
    """Words of arguments, and the text that reads them."""

    words: list[int] = field(default_factory=list)
    imports: list[str] = field(default_factory=list)
    makers: list[str] = field(default_factory=list)

    def put(self, argument: Any) -> str:
        """Put an argument in, and return the text that reads it."""
        place = len(self.words)
        if isinstance(argument, Now):
            self.words.append(argument.array.ctypes.data + 8 * argument.place)
            text = f"_numbers(w[{place}], (1,))[0]"
            return f"{text} != 0.0" if argument.truth else text
        if isinstance(argument, Some):
            self.words.append(argument.number.ctypes.data)
            return self._array(argument.array, f"_words(w[{place}], (1,))[0]")
        if isinstance(argument, np.ndarray):
            return self._array(argument, None)
        if hasattr(argument, "_fields"):
            kind = type(argument)
            self.imports.append(f"from {kind.__module__} import {kind.__name__}")
            return f"{kind.__name__}({', '.join(map(self.put, argument))})"
        if isinstance(argument, bool | int):
            self.words.append(int(argument))
            return f"w[{place}] != 0" if isinstance(argument, bool) else f"w[{place}]"
        self.words.append(int(np.float64(argument).view(np.int64)))
        return f"x[{place}]"

    def _array(self, array: NDArray[Any], length: str | None) -> str:
        if not array.flags.c_contiguous:
            raise ValueError("an array that kernels share with C has its numbers in a row")
        maker = f"array_maker({described(array.dtype)!r}, {array.ndim}, {array.flags.aligned})"
        if maker not in self.makers:
            self.makers.append(maker)
        place = len(self.words)
        self.words += [array.ctypes.data, *array.shape]
        lengths = [f"w[{place + 1 + k}]" for k in range(array.ndim)]
        if length is not None:
            lengths[0] = length
        return f"_array_{self.makers.index(maker)}(w[{place}], ({', '.join(lengths)},))"


def described(kind: np.dtype[Any]) -> Any:
    """Return a type of numbers or records as plain words."""
    if kind.names is None or kind.fields is None:
        return kind.str
    found = []
    for name in kind.names:
        base, shape = kind.fields[name][0].base, kind.fields[name][0].shape
        found.append((name, described(base), shape))
    return found


@cache
def _compiled(recipe: Recipe, rest: tuple[str, tuple[str, ...], tuple[str, ...], int, str]) -> int:
    entry, imports, makers, size, line = rest
    module = kernels(recipe)
    text = _HEAD.format(
        module=module.__name__, entry=entry, imports="\n".join(sorted(set(imports))), size=size, line=line,
        makers="\n".join(f"_array_{k} = {maker}" for k, maker in enumerate(makers)))
    path, _ = stored(f"servotwin_call_{recipe.name}_{entry}_{key_of(text)}", lambda: text)
    return int(loaded(path).call.address)


TICK = Recipe("tick", ("servotwin.simulation.compile.tick:advance",))
JOINTS = Recipe("joints", tuple(f"servotwin.simulation.compile.joints:{name}" for name in ("control", "step")))
_LAST_LINES = {TICK: """
from numba import cfunc, types
advance_at = cfunc(types.int32(types.int64), cache=True, error_model="numpy")(advance.py_func)
""", JOINTS: """
from numba import cfunc, types
control_at = cfunc(types.void(types.int64, types.int64), cache=True, error_model="numpy")(control.py_func)
step_at = cfunc(types.int64(*[types.int64] * 4), cache=True, error_model="numpy")(step.py_func)
"""}


@cache
def tick_address() -> int:
    """Return the address of the C function `int servotwin_advance(servotwin_tick *tick)`."""
    if is_plain():
        return plain.address_of(kernels(TICK).advance, ctypes.c_int32, ctypes.c_int64)
    return int(_module(TICK).advance_at.address)


@cache
def joint_addresses() -> tuple[int, int]:
    """Return the addresses of two C functions of `joints`.

    They are `void control(const mjModel *m, mjData *d)` and
    `long long step(long long *drive, const mjModel *m, mjData *d, long long steps)`.
    """
    if is_plain():
        own, word = kernels(JOINTS), ctypes.c_int64
        return plain.address_of(own.control, None, word, word), plain.address_of(own.step, word, *[word] * 4)
    module = _module(JOINTS)
    return int(module.control_at.address), int(module.step_at.address)


def _module(recipe: Recipe) -> ModuleType:
    """Return the text of this folder as a compiled module, with its entries for C."""
    text = derive(recipe) + _LAST_LINES[recipe]
    path, _ = stored(f"servotwin_{recipe.name}_{key_of(source_key(), surroundings(recipe), text)}", lambda: text)
    return loaded(path)


def program(chains: Sequence[Sequence[Call]]) -> NDArray[np.int64]:
    """Return chains of calls as words: how many there are, then for each how many calls, and these."""
    words = [len(chains)]
    for chain in chains:
        words.append(len(chain))
        for call in chain:
            words += [call.function, call.words.ctypes.data]
    return np.array(words, np.int64)
