"""Kernels of a library, as Python calls them: arguments are checked and laid out as words, whose address is given."""

from __future__ import annotations

import ctypes
import inspect
import struct
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.simulation.compile.finding import Built, built, problems
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.signatures import signatures
from servotwin.simulation.compile.text.kinds import (
    BOOL,
    FLOAT32,
    FLOAT64,
    Array,
    Kind,
    Record,
    Scalar,
    Tuple,
    told,
    words_of,
)

Words = list[int | float]


class MisfitError(TypeError):
    """An argument of a kernel is not of the kind that it was compiled for."""


class Function:
    """One function of a library.

    Parameters
    ----------
    address : int
        Of `int64_t f(int64_t *words)`.
    kinds : tuple of kinds
        Of its arguments.
    result : str
        Returned values, as `translate.Entry` says them.
    """

    def __init__(self, address: int, kinds: tuple[Kind, ...], result: str) -> None:
        self.address, self.kinds, self.result = address, kinds, result
        self.size = sum(map(words_of, kinds))
        self.call: Callable[[int], int] = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)(address)
        self._format = "".join(map(_format, kinds))
        self._room = result.count("d") + result.count("i") + result.count("b")
        self._fillers = tuple(map(filler, kinds))

    def words(self, arguments: Sequence[Any]) -> NDArray[np.int64]:
        """Return the words of arguments, with room for what is returned.

        Raises
        ------
        MisfitError
            If one is not of its kind.
        """
        if len(arguments) != len(self._fillers):
            raise MisfitError(f"got {len(arguments)} arguments, allowed: {len(self._fillers)}")
        values: Words = []
        for fill, argument in zip(self._fillers, arguments, strict=True):
            fill(argument, values)
        found = np.empty(self.size + self._room, np.int64)
        struct.pack_into(self._format, found.data, 0, *values)
        return found

    def __call__(self, arguments: Sequence[Any]) -> Any:
        """Call the kernel."""
        words = self.words(arguments)
        returned = self.call(words.ctypes.data)
        if self.result in ("", "i"):
            return returned if self.result else None
        if self.result == "b":
            return returned != 0
        return _read(self.result, words[self.size:])


_OF_WORD: dict[str, Callable[[Any], Any]] = {"d": lambda word: float(word.view(np.float64)), "b": bool, "i": int}


def _read(result: str, words: NDArray[np.int64]) -> Any:
    """Return what stands behind the arguments."""
    stack: list[list[Any]] = [[]]
    place = 0
    for letter in result:
        if letter == "(":
            stack.append([])
        elif letter == ")":
            stack[-2].append(tuple(stack.pop()))
        else:
            word = words[place]
            place += 1
            stack[-1].append(_OF_WORD[letter](word))
    return stack[0][0]


class Entry:
    """An entry of a recipe: a function for each combination of kinds that it takes.

    Parameters
    ----------
    name : str
        "module:function".
    functions : sequence of Function
    """

    def __init__(self, name: str, functions: Sequence[Function]) -> None:
        self.name, self.functions = name, tuple(functions)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the kernel as Python's own function is called."""
        if named:
            module, function = self.name.split(":")
            bound = inspect.signature(getattr(import_module(module), function)).bind(*arguments, **named)
            bound.apply_defaults()
            arguments = tuple(bound.arguments.values())
        return self.fitting(arguments)(arguments)

    def fitting(self, arguments: Sequence[Any]) -> Function:
        """Return the function for these arguments.

        Raises
        ------
        MisfitError
            If there is none; it says which argument is not of its kind.
        """
        if len(self.functions) == 1:
            return self.functions[0]
        for function in self.functions:
            if all(fits(kind, argument) for kind, argument in zip(function.kinds, arguments, strict=True)):
                return function
        raise MisfitError(f"{self.name}: no tile of such a layout is known")


class Kernels:
    """The kernels of a recipe, each an attribute under its entry's name."""

    def __init__(self, recipe: Recipe, library: Any, made: Built) -> None:
        self._library = library  # stays loaded for as long as this does
        found: dict[str, list[Function]] = {}
        for (name, kinds), (symbol, result) in zip(signatures(recipe), made.functions, strict=True):
            address = ctypes.cast(getattr(library, symbol), ctypes.c_void_p).value or 0
            found.setdefault(name, []).append(Function(address, kinds, result))
        for entry in recipe.entries:
            name = entry.split(":")[1]
            setattr(self, name, Entry(entry, found[name]))

    def __getattr__(self, name: str) -> Entry:
        raise AttributeError(f"the recipe has no entry {name}")


def loaded(recipe: Recipe) -> Kernels | None:
    """Return the kernels of a recipe; None where no library can be had."""
    for made in built(recipe):
        try:
            if _is_cut_off(made.path):
                raise OSError(f"{made.path} is cut off")
            found = Kernels(recipe, ctypes.CDLL(str(made.path)), made)
            problems.clear()
            return found
        except (OSError, AttributeError, ValueError) as error:  # of another C library, or not what its name says
            problems.append(str(error))
    return None


def _is_cut_off(path: Path) -> bool:
    """Tell whether a library of Linux lacks its end, with its table of sections: to load it would end the process."""
    with path.open("rb") as file:
        head = file.read(64)
        size = file.seek(0, 2)
    if len(head) < 64 or head[:4] != b"\x7fELF":
        return False
    start, (each, count) = int.from_bytes(head[40:48], sys.byteorder), struct.unpack_from("2H", head, 58)
    return bool(size < start + each * count)


# --- arguments --------------------------------------------------------------------------------------------------------


def _format(kind: Kind) -> str:
    """Return how the words of an argument are laid out, in the letters of `struct`."""
    if isinstance(kind, Tuple):
        return "".join(map(_format, kind.elements))
    return "d" if kind in (FLOAT64, FLOAT32) else "q" * words_of(kind)


def fits(kind: Kind, value: Any) -> bool:
    """Tell whether an array, or each one in a tuple, has the type of a kind."""
    if isinstance(kind, Tuple):
        return all(map(fits, kind.elements, value))
    return not isinstance(kind, Array) or (value.ndim == kind.dimensions and _same(value.dtype, _dtype(kind.element)))


@cache
def filler(kind: Kind) -> Callable[[Any, Words], None]:
    """Return the function that checks an argument of a kind, and appends its words."""
    if isinstance(kind, Tuple):
        return _tuple_filler(kind)
    if isinstance(kind, Array):
        return _array_filler(kind)
    if isinstance(kind, Record):
        raise MisfitError("a record is given as an array of one")
    return _number_filler(kind)


def _number_filler(kind: Kind) -> Callable[[Any, Words], None]:
    real = kind in (FLOAT64, FLOAT32)
    allowed: tuple[Any, ...] = (bool, np.bool_) if kind == BOOL else (int, np.integer, bool, np.bool_)
    if real:
        allowed = (float, int, np.floating, np.integer)

    def fill(value: Any, values: Words) -> None:
        if not isinstance(value, allowed):
            raise MisfitError(f"got {value!r}, allowed: {told(kind)}")
        values.append(float(value) if real else int(value))

    return fill


def _tuple_filler(kind: Tuple) -> Callable[[Any, Words], None]:
    fillers = tuple(map(filler, kind.elements))

    def fill(value: Any, values: Words) -> None:
        if len(value) != len(fillers):
            raise MisfitError(f"got {len(value)} values, allowed: {told(kind)}")
        for inner, each in zip(fillers, value, strict=True):
            inner(each, values)

    return fill


def _array_filler(kind: Array) -> Callable[[Any, Words], None]:
    dtype, dimensions = _dtype(kind.element), kind.dimensions

    def fill(value: Any, values: Words) -> None:
        if not isinstance(value, np.ndarray) or value.ndim != dimensions or not _same(value.dtype, dtype):
            got = f"{value.ndim} dimensions of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            raise MisfitError(f"got {got:.80}, allowed: {dimensions} dimensions of {dtype!s:.80}")
        if not value.flags.c_contiguous:
            raise MisfitError("an array that kernels work on has its numbers in a row")
        values.append(value.ctypes.data)
        values += value.shape

    return fill


def _dtype(kind: Kind) -> np.dtype[Any]:
    if isinstance(kind, Record):
        return kind.dtype
    if isinstance(kind, Scalar):
        return np.dtype(kind.dtype)
    raise MisfitError("an array holds numbers or records")


def _same(a: np.dtype[Any], b: np.dtype[Any]) -> bool:
    return a is b or _equal(a, b)


@cache
def _equal(a: np.dtype[Any], b: np.dtype[Any]) -> bool:
    return a == b
