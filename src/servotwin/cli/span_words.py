"""A figure with the range that guesses leave it, as text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from servotwin.datasheet.guesses import Span


def with_span(value: float, span: Span | None, form: str, unit: str, *, scale: float = 1.0, note: str = "") -> str:
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
    note : str
        What stands in brackets behind the value; the range then follows a comma.

    Examples
    --------
    >>> from servotwin.datasheet.guesses import Span
    >>> with_span(3.99, Span(0.04, 0.12), ".1f", "deg", scale=57.3), with_span(3.99, None, ".1f", "deg")
    ('4.0 deg (2.3 to 6.9)', '4.0 deg')
    >>> with_span(0.1, Span(0.1, math.inf), ".1f", "s", note="within 1 deg")
    '0.1 s (within 1 deg), 0.1 to never'
    """
    number = f"{value:z{form}}"
    shown = f"{number} {unit}" + (f" ({note})" if note else "")
    low, high = (number, number) if span is None else (
        "never" if math.isinf(end) else f"{scale * end:z{form}}" for end in span)
    if low == high == number:
        return shown
    return f"{shown}, {low} to {high}" if note else f"{shown} ({low} to {high})"
