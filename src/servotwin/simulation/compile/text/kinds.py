"""Kinds of values that a kernel may work with: what the translator to C has of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from servotwin.errors import ServotwinError


class TranslationError(ServotwinError):
    """Something stands in a kernel that has no form in C.

    Parameters
    ----------
    function : str
        Name of the derived function; "" outside of one.
    line : str
        The text that has no form.
    instead : str
        Text to write in its place.
    """

    def __init__(self, function: str, line: str, instead: str) -> None:
        self.function, self.line, self.instead = function, line, instead
        super().__init__(f"kernel {function}: {line}: {instead}" if function else f"{line}: {instead}")


@dataclass(frozen=True)
class Scalar:
    """A number or a truth value.

    Parameters
    ----------
    c : str
        Its type in C.
    dtype : str
        numpy's name of it.
    """

    c: str
    dtype: str


FLOAT64, FLOAT32 = Scalar("double", "<f8"), Scalar("float", "<f4")
INT64, INT32, INT8 = Scalar("int64_t", "<i8"), Scalar("int32_t", "<i4"), Scalar("int8_t", "|i1")
BOOL = Scalar("bool", "|b1")
SCALARS = {kind.dtype: kind for kind in (FLOAT64, FLOAT32, INT64, INT32, INT8, BOOL)}


@dataclass(frozen=True)
class Tuple:
    """A tuple, or a named one.

    Parameters
    ----------
    elements : tuple of kinds
    name : str
        Of the class; "" for a plain tuple.
    fields : tuple of str
        Names of its elements, none for a plain tuple.
    """

    elements: tuple[Kind, ...]
    name: str = ""
    fields: tuple[str, ...] = ()

    @property
    def uniform(self) -> bool:
        """Whether it is a plain tuple whose elements are all of one kind: an array in C."""
        return not self.fields and len(self.elements) > 0 and len(set(self.elements)) == 1


@dataclass(frozen=True)
class Record:
    """A record in memory, by its address."""

    dtype: np.dtype[Any]


@dataclass(frozen=True)
class Array:
    """An array of numbers or records, its elements in a row."""

    element: Kind
    dimensions: int


@dataclass(frozen=True)
class Fixed:
    """A field of a record that is an array, or a list of a constant length: its address; its shape is known."""

    element: Kind
    shape: tuple[int, ...]

    @property
    def count(self) -> int:
        """How many elements it has."""
        return math.prod(self.shape)


Kind = Scalar | Tuple | Record | Array | Fixed


def of_dtype(dtype: np.dtype[Any]) -> Kind:
    """Return the kind of a number or a record of numpy."""
    if not dtype.names and dtype.str not in SCALARS:
        raise TranslationError("", str(dtype), "arrays hold float64, float32, int64, int32, int8, bool or records")
    return Record(dtype) if dtype.names else SCALARS[dtype.str]


def of_value(value: object) -> Kind | None:
    """Return the kind of a constant or an argument; None where there is none."""
    if isinstance(value, (bool, np.bool_)):
        return BOOL
    if isinstance(value, (int, np.int64)):
        return INT64 if -2**63 <= value < 2**63 else None
    if isinstance(value, np.float32):
        return FLOAT32
    if isinstance(value, float):
        return FLOAT64
    if isinstance(value, np.void):
        return Record(value.dtype)
    if isinstance(value, np.ndarray):
        return Array(of_dtype(value.dtype), value.ndim)
    if isinstance(value, tuple):
        kinds = [of_value(each) for each in value]
        if any(kind is None for kind in kinds):
            return None
        named = hasattr(value, "_fields")
        return Tuple(tuple(kind for kind in kinds if kind is not None), type(value).__name__ if named else "",
                     tuple(getattr(value, "_fields", ())))
    return None


def united(a: Kind | None, b: Kind | None) -> Kind | None:
    """Return the kind of what may be of either, None standing for what is not known yet.

    Raises
    ------
    TypeError
        If there is no such kind.
    """
    if a is None or a == b:
        return b
    if b is None:
        return a
    if isinstance(a, Scalar) and isinstance(b, Scalar):
        return _number(a, b)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.elements) == len(b.elements):
        elements = [united(x, y) for x, y in zip(a.elements, b.elements, strict=True)]
        return Tuple(tuple(kind for kind in elements if kind is not None), a.name or b.name, a.fields or b.fields)
    if isinstance(a, Fixed) and isinstance(b, (Array, Fixed)):
        return united(Array(a.element, len(a.shape)), b)
    if isinstance(a, Array) and isinstance(b, Fixed):
        return united(a, Array(b.element, len(b.shape)))
    raise TypeError(f"{told(a)} or {told(b)}")


def _number(a: Scalar, b: Scalar) -> Scalar:
    both = {a, b}
    if FLOAT64 in both:
        return FLOAT64
    if FLOAT32 in both:
        return FLOAT32 if both <= {FLOAT32, BOOL} else FLOAT64  # as in numpy: float32 with a whole number is float64
    return INT64


def told(kind: Kind | None) -> str:
    """Return a kind in words."""
    if isinstance(kind, Scalar):
        return {"double": "a float64", "float": "a float32", "bool": "a truth value"}.get(kind.c, "a whole number")
    if isinstance(kind, Tuple):
        return f"a {kind.name}" if kind.name else f"a tuple of {len(kind.elements)}"
    if isinstance(kind, Array):
        return f"an array of {kind.dimensions} dimensions"
    if isinstance(kind, Fixed):
        return f"an array of {' x '.join(map(str, kind.shape))}"
    return "a record" if isinstance(kind, Record) else "of a kind that is not known"


def leaves(kind: Kind) -> int:
    """Return how many numbers a tuple holds, those in its tuples included; 1 for anything else."""
    return sum(map(leaves, kind.elements)) if isinstance(kind, Tuple) else 1


def words_of(kind: Kind) -> int:
    """Return how many words a value takes."""
    if isinstance(kind, Tuple):
        return sum(map(words_of, kind.elements))
    return 1 + kind.dimensions if isinstance(kind, Array) else 1
