"""Types of C for kinds of values, and what functions of others kernels may call."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from servotwin.simulation.compile.text.kind_rules import field_kind
from servotwin.simulation.compile.text.kinds import (
    BOOL,
    FLOAT32,
    FLOAT64,
    INT8,
    INT32,
    INT64,
    Array,
    Fixed,
    Kind,
    Record,
    Scalar,
    TranslationError,
    Tuple,
    of_value,
)

# --- Functions that kernels may call beside their own, and their forms in C -------------------------------------------

class Primitive(NamedTuple):
    """A function of Python that C has an expression for.

    `text` gets the arguments, `n` is their number less one; `s` is "f" where they have 32 bits. `result` is None where
    it is that of the arguments; it `writes` where it changes memory.
    """

    text: str
    result: Kind | None = None
    writes: bool = False


PRIMITIVES = {
    "fma": Primitive("FMA{s}({0}, {1}, {2})"), "two_power": Primitive("two_power{s}({0})"),
    "binary_exponent": Primitive("binary_exponent{s}({0})"), "scaled": Primitive("scaled({0}, {1})"),
    "nearest": Primitive("NEAREST{s}({0})"),
    "floor": Primitive("FLOOR{s}({0})"), "anew": Primitive("ANEW({0})"),
    "words": Primitive("words({0}, {1})", Array(INT64, 1)),
    "numbers": Primitive("numbers({0}, {1})", Array(FLOAT64, 1)),
    "rows": Primitive("rows({0}, {1}, {2})", Array(FLOAT64, 2)),
    "bytes_at": Primitive("bytes_at({0}, {1})", Array(INT8, 1)),
    "halves": Primitive("halves({0}, {1})", Array(INT32, 1)),
    "called": Primitive("TOLD(told_1, {0}, {1})", INT64, True),
    "told": Primitive("TOLD(told_{n}, {all})", INT64, True),
    "copied": Primitive("copied({0}, {1}, {2})", None, True),
    "activate": Primitive("activate({0})", None, True), "active": Primitive("active()", INT64),
}
"""Of `models.engine.motions.elementary` and `physics.elementary`, single instructions in the vector form, and of
`compile.addresses`."""
VOID = ("copied", "activate")
MATH = {name: name for name in (
    "sqrt", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "tanh", "atan", "atan2", "atanh", "asin", "acos",
    "sinh", "cosh", "asinh", "copysign", "hypot", "fmod", "pow")}
"""Functions of `math` that C's library has under the same name, for 32 bits with an f behind it."""
OF_TWO = ("atan2", "copysign", "hypot", "fmod", "pow")
"""Those of them that take two numbers."""
ROUNDED = {"floor": "FLOOR", "ceil": "CEIL"}
"""Functions of `math` that return a whole number."""
TRUTHS = {"isfinite": "isfinite", "isnan": "isnan", "isinf": "isinf"}


# --- Types of C for kinds of values, and what changes one into another ------------------------------------------------

_TAKEN = frozenset(
    "auto bool break case char const continue default do double else enum extern false float for goto if inline int "
    "long main register restrict return short signed sizeof static struct switch true typedef union unsigned void "
    "volatile while int8_t int32_t int64_t uint32_t uint64_t size_t intptr_t INT64_C UINT64_C INT64_MIN INT64_MAX NAN "
    "ANEW INFINITY NULL EXPORTED SMALL INLINED ASIDE PACKED FMA FMAf NEAREST NEARESTf FLOOR FLOORf CEIL CEILf AS_TEXT "
    "PRAGMA SUM_IN_ANY_ORDER CHECKED_SIZE TOLD told_1 told_2 told_3 told_4 told_5 told_6 told_7 floor_div floor_mod "
    "mod_float floor_div_float whole_power moved_left moved_right whole clamped words numbers rows bytes_at halves "
    "copied activate active active_word float_of word_of two_power two_powerf binary_exponent binary_exponentf scaled "
    "scaledf isfinite isnan isinf floor fabs fabsf llabs memcpy memmove".split()) | {
        name + end for name in MATH for end in ("", "f")}
_OURS = re.compile(r"\w+_(\d+|end|given|)|(as|equal|slice_of|array|min|max)_\w+|in_order|is_in|record|table")
"""Names that are made here: of types, tables, helpers, and of what a statement needs beside its variables."""
_NAMED = ((FLOAT64, 1), (FLOAT64, 2), (INT64, 1), (INT8, 1), (INT32, 1))  # arrays that the header has


def identifier(name: str) -> str:
    """Return a name as C may have it."""
    return f"{name}_" if name in _TAKEN or _OURS.fullmatch(name) else name


_ROUNDED = ("whole(FLOOR(", "whole(CEIL(")


class Types:
    """Structs, tables and small functions that a text needs, in the order in which they are asked for.

    Parameters
    ----------
    unstored : set of tuple of str
        Elements of named tuples, by the names of both, that no struct has: nothing may read them.

    Attributes
    ----------
    missed : set of tuple of str
        Those of them that something reads all the same: such a text is none.
    """

    def __init__(self, unstored: frozenset[tuple[str, str]] = frozenset()) -> None:
        self.unstored, self.missed = unstored, set[tuple[str, str]]()
        self.structs: list[str] = []
        self.tables: list[str] = []
        self.helpers: list[str] = []
        self._names: dict[Any, str] = {}
        self._wanted: dict[Any, str] = {}
        self._used = set(_TAKEN)

    def fresh(self, name: str) -> str:
        """Return a name that nothing has yet."""
        free, number = name, 1
        while free in self._used:
            number += 1
            free = f"{name}_{number}"
        self._used.add(free)
        return free

    def call(self, kind: Kind, name: str) -> None:
        """Define the struct of a tuple or a record now, under a name that is not taken."""
        self._wanted[kind] = name
        if isinstance(kind, Record):
            self.record(kind)
        else:
            self.of(kind)

    # --- types --------------------------------------------------------------------------------------------------------

    def of(self, kind: Kind | None) -> str:
        """Return the type of a value."""
        if kind is None:
            return "void"
        if isinstance(kind, Scalar):
            return kind.c
        if isinstance(kind, Record):
            return f"{self.record(kind)} *"
        if isinstance(kind, Fixed):
            return f"{self.element(kind.element)} *"
        return self._array(kind) if isinstance(kind, Array) else self._tuple(kind)

    def declared(self, kind: Kind, name: str) -> str:
        """Return type and name of a variable."""
        type_ = self.of(kind)
        return f"{type_}{name}" if type_.endswith("*") else f"{type_} {name}"

    def element(self, kind: Kind) -> str:
        """Return the type of an element of an array."""
        return self.record(kind) if isinstance(kind, Record) else self.of(kind)

    def _array(self, kind: Array) -> str:
        if (kind.element, kind.dimensions) in _NAMED:
            return f"array_{self.of(kind.element)}_{kind.dimensions}"
        if kind not in self._names:
            element = self.element(kind.element)
            self._names[kind] = name = self.fresh(f"array_{element.strip(' *')}_{kind.dimensions}")
            self.structs.append(f"typedef struct {{ {element} *p; int64_t n[{kind.dimensions}]; }} {name};")
        return self._names[kind]

    def _tuple(self, kind: Tuple) -> str:
        if kind not in self._names:
            elements = [self.declared(each, self.field(kind, k)) for k, each in self._stored(kind, kind.elements)]
            if not kind.elements:
                body = "char nothing;"
            elif kind.uniform:
                body = f"{self.declared(kind.elements[0], 'v')}[{len(elements)}];"
            else:
                body = " ".join(f"{each};" for each in elements)
            self._names[kind] = name = self.fresh(self._wanted.get(kind) or kind.name or f"tuple_{len(elements)}")
            self.structs.append(f"typedef struct {{ {body} }} {name};")
        return self._names[kind]

    def _stored(self, kind: Tuple, values: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Return the values of the elements that a struct has, with their places."""
        return ((k, x) for k, x in enumerate(values)
                if not kind.fields or (kind.name, kind.fields[k]) not in self.unstored)

    @staticmethod
    def field(kind: Tuple, place: int) -> str:
        """Return the name of an element of a tuple in its struct."""
        return identifier(kind.fields[place]) if kind.fields else f"f{place}"

    def record(self, kind: Record) -> str:
        """Return the type of a record, laid out as numpy has it."""
        if kind not in self._names:
            body, dtype = [], kind.dtype
            for name in dtype.names or ():
                own = field_kind(kind, name)
                length = f"[{own.count}]" if isinstance(own, Fixed) else ""
                element = own.element if isinstance(own, Fixed) else own
                body.append(f"{self.element(element)} {identifier(name)}{length};")
            self._names[kind] = name = self.fresh(self._wanted.get(kind, "record"))
            if sum(dtype[name].itemsize for name in dtype.names or ()) != dtype.itemsize:
                raise TranslationError("", str(dtype), "a record has no gaps between its fields")
            attribute = "" if _aligned(dtype) else "PACKED "
            self.structs.append(f"typedef struct {attribute}{{ {' '.join(body)} }} {name};\n"
                                f"CHECKED_SIZE({name}, {dtype.itemsize});")
        return self._names[kind]

    # --- values -------------------------------------------------------------------------------------------------------

    def helper(self, key: Any, name: str, make: Callable[[str], str]) -> str:
        """Return the name of a small function, which `make` writes when it is first asked for."""
        if key not in self._names:
            self._names[key] = own = self.fresh(name)
            self.helpers.append(make(own))
        return self._names[key]

    def made(self, kind: Tuple, parts: list[str]) -> str:
        """Return a tuple of these values."""
        inner = ", ".join(x for _, x in self._stored(kind, parts)) or ("" if parts else "0")
        return f"(({self.of(kind)}){{{{{inner}}}}})" if kind.uniform else f"(({self.of(kind)}){{{inner}}})"

    def part(self, text: str, kind: Tuple, place: int) -> str:
        """Return an element of a tuple."""
        if kind.fields and (kind.name, kind.fields[place]) in self.unstored:
            self.missed.add((kind.name, kind.fields[place]))
        return member(text, f"v[{place}]" if kind.uniform else self.field(kind, place))

    def converted(self, text: str, kind: Kind | None, to: Kind | None) -> str:
        """Return a value as one of another kind, which it may be."""
        if kind == to or kind is None or to is None:
            return text
        if isinstance(to, Scalar):
            if to == FLOAT64 and text.startswith(_ROUNDED) and _enclosed(text.removeprefix("whole")):
                return f"({text.removeprefix('whole(')[:-1]} + 0.0)"  # the whole number need not be one of integers
            return f"({text} != 0)" if to == BOOL else f"({to.c}){bracketed(text)}"
        if isinstance(kind, Fixed) and isinstance(to, Array):
            lengths = ", ".join(map(str, kind.shape))
            return f"(({self.of(to)}){{{text}, {{{lengths}}}}})"
        return self._as_tuple(text, cast("Tuple", kind), cast("Tuple", to))

    def _as_tuple(self, text: str, kind: Tuple, to: Tuple) -> str:
        """Return a tuple as one of other kinds."""
        old, new = self.of(kind), self.of(to)

        def make(name: str) -> str:
            parts = [self.converted(self.part("x", kind, k), x, y)
                     for k, (x, y) in enumerate(zip(kind.elements, to.elements, strict=True))]
            return f"static inline {new} {name}({old} x) {{ return {self.made(to, parts)}; }}"

        return f"{self.helper(('converted', kind, to), f'as_{new}', make)}({text})"

    def equal(self, a: str, kind_a: Kind, b: str, kind_b: Kind) -> str:
        """Return the condition that two values are equal."""
        if isinstance(kind_a, Scalar):
            return f"{a} == {b}"
        return self._equal_tuples(a, cast("Tuple", kind_a), b, cast("Tuple", kind_b))

    def _equal_tuples(self, a: str, kind_a: Tuple, b: str, kind_b: Tuple) -> str:
        """Return the condition that two tuples are equal."""
        first, second = self.of(kind_a), self.of(kind_b)

        def make(name: str) -> str:
            parts = [self.equal(self.part("x", kind_a, k), x, self.part("y", kind_b, k), y)
                     for k, (x, y) in enumerate(zip(kind_a.elements, kind_b.elements, strict=True))]
            condition = " && ".join(parts) or "true"
            return f"static inline bool {name}({first} x, {second} y) {{ return {condition}; }}"

        return f"{self.helper(('equal', kind_a, kind_b), f'equal_{first}', make)}({a}, {b})"

    def literal(self, value: Any) -> str:
        """Return a constant."""
        kind = of_value(value)
        if kind == BOOL:
            return "true" if value else "false"
        if kind == INT64:
            return f"INT64_C({value})" if abs(int(value)) > 2**31 - 1 else f"{value}" if value >= 0 else f"({value})"
        if kind in (FLOAT32, FLOAT64):
            return _float(float(value), kind == FLOAT32)
        key = ("constant", kind, value.tobytes() if isinstance(value, np.ndarray) else repr(value))
        if key not in self._names:
            self._names[key] = name = self.fresh("table")
            self.tables.append(self._table(name, kind, value))
        name = self._names[key]
        if isinstance(kind, Array):
            lengths = ", ".join(map(str, value.shape))
            return f"(({self.of(kind)}){{({self.element(kind.element)} *){name}, {{{lengths}}}}})"
        return name

    def initial(self, kind: Kind | None, value: Any) -> str:
        """Return what a constant of a kind is initialised with, its type apart."""
        return self._initial(kind, value)

    def _table(self, name: str, kind: Kind | None, value: Any) -> str:
        if isinstance(kind, Array):
            inner = ", ".join(self.literal(x.item()) for x in value.ravel())
            return f"static const {self.element(kind.element)} {name}[] = {{{inner}}};"
        return f"static const {self.of(kind)} {name} = {self._initial(kind, value)};"

    def _initial(self, kind: Kind | None, value: Any) -> str:
        if isinstance(kind, Array):
            return self.literal(value)[1:-1].removeprefix(f"({self.of(kind)})")  # the table says its type
        if not isinstance(kind, Tuple):
            return self.literal(value)
        inner = ", ".join(self._initial(kind.elements[k], x) for k, x in self._stored(kind, value))
        inner = inner or ("" if kind.elements else "0")
        return f"{{{{{inner}}}}}" if kind.uniform else f"{{{inner}}}"


def member(text: str, name: str) -> str:
    """Return a member of a struct, by what stands for the struct."""
    if text.startswith("(*") and text.endswith(")") and "(" not in text[2:]:
        return f"{text[2:-1]}->{name}"
    return f"{text}.{name}"


def bracketed(text: str) -> str:
    """Return an expression that may stand behind an operator."""
    return text if text.replace("_", "").replace(".", "").isalnum() or _enclosed(text) else f"({text})"


def _enclosed(text: str) -> bool:
    """Tell whether one pair of brackets encloses all."""
    if not text.startswith("("):
        return False
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return place == len(text) - 1
    return False


def _aligned(dtype: np.dtype[Any]) -> bool:
    """Tell whether C would lay a record out in the same way."""
    place, most = 0, 1
    for own, offset, *_ in (dtype.fields or {}).values():
        size = _alignment(own)
        most = max(most, size)
        if offset != place or place % size:
            return False
        place = offset + own.itemsize
    return place == dtype.itemsize and place % most == 0


def _alignment(dtype: np.dtype[Any]) -> int:
    base = dtype.base
    return max(_alignment(each[0]) for each in base.fields.values()) if base.fields else base.itemsize


def _float(value: float, single: bool) -> str:
    if math.isinf(value):
        return "(-INFINITY)" if value < 0 else "INFINITY"
    if math.isnan(value):
        return "NAN"
    text = repr(np.float32(value).item() if single else value)
    text += "" if "." in text or "e" in text else ".0"
    return f"({text}{'f' * single})" if text.startswith("-") else f"{text}{'f' * single}"
