"""A figure with the range that guesses leave it, as text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from servotwin.datasheet.guesses import Span


def with_span(value: float, span: Span | None, form: str, unit: str, *, scale: float = 1.0) -> str:
    """Return a value with its unit and, where it rests on guesses, its range behind it.

    Parameters
    ----------
    value : float
        In the unit.
    span : Span, optional
        In SI; `scale` leads to the unit.
    form : str
        Of a number, such as ".2f".
    unit : str
    scale : float

    Examples
    --------
    >>> from servotwin.datasheet.guesses import Span
    >>> with_span(3.99, Span(0.04, 0.12), ".1f", "deg", scale=57.3), with_span(3.99, None, ".1f", "deg")
    ('4.0 deg (2.3 to 6.9)', '4.0 deg')
    >>> with_span(0.1, Span(0.1, math.inf), ".1f", "s")
    '0.1 s (0.1 to never)'
    """
    shown = f"{value:z{form}}"
    if span is None:
        return f"{shown} {unit}"
    low, high = ("never" if math.isinf(end) else f"{scale * end:z{form}}" for end in span)
    return f"{shown} {unit}" if low == high == shown else f"{shown} {unit} ({low} to {high})"
