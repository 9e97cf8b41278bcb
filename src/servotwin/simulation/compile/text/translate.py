"""Translate a recipe to C99: one text with a function for each entry and each kind of arguments that it takes.

A function of an entry gets the address of words of eight bytes. A number is a word; an array is its address and its
lengths, a record its address; a tuple is all that is in it. Behind them there is room for the numbers that the kernel
returns; a whole number or a truth value is returned by the function itself, which returns 1 otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from servotwin.simulation.compile.c_types import Types
from servotwin.simulation.compile.printing import Printer
from servotwin.simulation.compile.text.derive import Derived
from servotwin.simulation.compile.text.inference import Module
from servotwin.simulation.compile.text.kinds import (
    BOOL,
    FLOAT32,
    FLOAT64,
    Array,
    Kind,
    Record,
    Scalar,
    TranslationError,
    Tuple,
    told,
)


@dataclass(frozen=True)
class Entry:
    """A function of a translated recipe.

    Parameters
    ----------
    name : str
        Of the entry.
    symbol : str
        Of the function in C.
    arguments : tuple of kinds
    result : str
        Result of the kernel: "" for nothing, "i" and "b" for a whole number and a truth value that the function
        itself returns, else what stands behind the arguments: "d" for a float, brackets around what is in a tuple.
    """

    name: str
    symbol: str
    arguments: tuple[Kind, ...]
    result: str


@dataclass(frozen=True)
class Translation:
    """A recipe in C."""

    text: str
    entries: tuple[Entry, ...]


def translated(derived: Derived, signatures: Sequence[tuple[str, tuple[Kind, ...]]]) -> Translation:
    """Translate a derived module, whose entries are called with arguments of these kinds.

    Raises
    ------
    TranslationError
        If a kernel contains what has no form in C; it names function and line, and says what to write instead.
    """
    module = Module(derived)
    printer = Printer(derived.vector, derived.in_any_order, derived.called)
    entries, texts = [], []
    for name, kinds in signatures:
        function = module.specialised(derived.entries[name], kinds)
        symbol = printer.types.fresh(f"servotwin_{name}")
        called = printer.name_of(function)
        make = _entry_by_numbers if derived.recipe.by_numbers else _entry
        texts.append(make(printer.types, symbol, called, kinds, function.result))
        entries.append(Entry(name, symbol, kinds, _letters(function.result)))
    types = printer.types
    parts = [f"/* Printed by servotwin from its kernels: {derived.recipe.name}. */", header(), *types.structs,
             *types.tables, *types.helpers, "", *printer.functions, *texts]
    return Translation("\n".join(parts), tuple(entries))


@cache
def header() -> str:
    """Return the text on which all others stand."""
    return "\n".join(map(part_of_header, ("kernels.h", "arithmetic.h", "doubles.h", "floats.h", "addresses.h")))


@cache
def part_of_header(name: str) -> str:
    """Return a part of it."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def _letters(kind: Kind | None) -> str:
    """Return a result as `Entry` has it."""
    if kind is None:
        return ""
    if isinstance(kind, Scalar):
        return "d" if kind in (FLOAT64, FLOAT32) else "b" if kind == BOOL else "i"
    if isinstance(kind, Tuple):
        return f"({''.join(map(_letters, kind.elements))})"
    raise TranslationError("", told(kind), "an entry returns numbers")


def _entry(types: Types, symbol: str, called: str, kinds: tuple[Kind, ...], result: Kind | None) -> str:
    reading = _Reading(types)
    arguments = []
    for kind in kinds:
        text = reading.read(kind)
        pointer = isinstance(kind, Tuple) and len(kind.elements) > 0
        arguments.append(f"({types.of(kind)}[1]){{{text}}}" if pointer else text)
    call = f"{called}({', '.join(arguments)})"
    lines = _returning(types, call, result, reading.place)
    unused = [] if reading.place or len(lines) > 2 else ["    (void)w;"]
    return "\n".join([f"EXPORTED int64_t {symbol}(int64_t *w);", f"EXPORTED int64_t {symbol}(int64_t *w) {{", *unused,
                      *lines, "}", ""])


def _entry_by_numbers(types: Types, symbol: str, called: str, kinds: tuple[Kind, ...], result: Kind | None) -> str:
    names = [f"word_{k}" for k in range(len(kinds))]
    head = f"EXPORTED int64_t {symbol}({', '.join(f'int64_t {name}' for name in names)})"
    lines = _returning(types, f"{called}({', '.join(names)})", result, 0)
    return "\n".join([f"{head};", f"{head} {{", *lines, "}", ""])


def _returning(types: Types, call: str, result: Kind | None, place: int) -> list[str]:
    if result is None:
        return [f"    {call};", "    return 1;"]
    if isinstance(result, Scalar) and result not in (FLOAT64, FLOAT32):
        return [f"    return (int64_t){call};"]
    lines = [f"    const {types.of(result)} result = {call};"]
    numbers: list[tuple[str, Scalar]] = []
    _numbers_of(types, "result", result, numbers)
    for k, (text, kind) in enumerate(numbers):
        value = f"word_of({text})" if kind in (FLOAT64, FLOAT32) else text
        lines.append(f"    w[{place + k}] = {value};")
    return [*lines, "    return 1;"]


def _numbers_of(types: Types, text: str, kind: Kind, found: list[tuple[str, Scalar]]) -> None:
    if isinstance(kind, Scalar):
        found.append((text, kind))
    elif isinstance(kind, Tuple):
        for place, element in enumerate(kind.elements):
            _numbers_of(types, types.part(text, kind, place), element, found)


class _Reading:
    """Reads arguments from words."""

    def __init__(self, types: Types) -> None:
        self._types, self.place = types, 0

    def _next(self) -> str:
        self.place += 1
        return f"w[{self.place - 1}]"

    def read(self, kind: Kind) -> str:
        """Return the text that reads the next argument."""
        if isinstance(kind, Tuple):
            return self._types.made(kind, [self.read(element) for element in kind.elements])
        if isinstance(kind, Scalar):
            word = self._next()
            if kind == BOOL:
                return f"({word} != 0)"
            return f"({kind.c})float_of({word})" if kind in (FLOAT64, FLOAT32) else f"({kind.c}){word}"
        if isinstance(kind, Record):
            return f"({self._types.record(kind)} *)(intptr_t){self._next()}"
        if isinstance(kind, Array):
            address = f"({self._types.element(kind.element)} *)(intptr_t){self._next()}"
            lengths = ", ".join(self._next() for _ in range(kind.dimensions))
            return f"(({self._types.of(kind)}){{{address}, {{{lengths}}}}})"
        raise TranslationError("", told(kind), "it is no argument of an entry")
