"""C of doubles as C of floats: the same text with other types, literals and functions of the library."""

from __future__ import annotations

import re

from servotwin.simulation.compile.c_functions import MATH

_FUNCTIONS = re.compile(rf"\b({'|'.join((*MATH, 'fabs', 'floor', 'ceil', 'rint'))})\(")
_LITERALS = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)(?![\w.])")
_OWN = re.compile(r"\b(two_power|binary_exponent)f\b")


def in_floats(text: str) -> str:
    """Return a text of C with floats in the place of doubles.

    Examples
    --------
    >>> in_floats("double half = 0.5 * sqrt(x) + 1e-06;")
    'float half = 0.5f * sqrtf(x) + 1e-06f;'
    """
    text = re.sub(r"\bdouble\b", "float", _OWN.sub(r"\1", text))
    return _LITERALS.sub(r"\1f", _FUNCTIONS.sub(r"\1f(", text))
