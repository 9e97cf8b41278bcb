"""What kernels may call beside functions of their own, and its form in C."""

from __future__ import annotations

from typing import NamedTuple

from servotwin.simulation.compile.kinds import FLOAT64, INT8, INT32, INT64, Array, Kind


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
    "floor": Primitive("FLOOR{s}({0})"),
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
