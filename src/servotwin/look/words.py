"""Numbers and tables as HTML."""

from __future__ import annotations

import base64
import html
import math
import re
from collections.abc import Sequence

from servotwin.text import escape

MINUS, TIMES = "−", "×"
_SMALL, _LARGE = 1e-3, 1e5


def number(value: float, digits: int = 4) -> str:
    """Return a number with so many significant digits, as a reader expects it.

    Examples
    --------
    >>> number(-0.00000123), number(1234.5), number(0.5)
    ('−1.23×10<sup>−6</sup>', '1234', '0.5')
    """
    if not math.isfinite(value):
        return "–" if math.isnan(value) else ("∞" if value > 0.0 else f"{MINUS}∞")
    if value == 0.0:
        return "0"
    if _SMALL <= abs(value) < _LARGE:
        places = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
        text = f"{value:.{places}f}"
        return (text.rstrip("0").rstrip(".") if "." in text else text).replace("-", MINUS)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa}{TIMES}10<sup>{int(exponent)}</sup>".replace("-", MINUS)


def fixed(value: float, places: int) -> str:
    """Return a number with so many decimals; what rounds to zero has no sign, and what is none is a dash.

    Examples
    --------
    >>> fixed(-0.9779, 2), fixed(-0.0001, 2)
    ('−0.98', '0.00')
    """
    return f"{value:z.{places}f}".replace("-", MINUS) if math.isfinite(value) else number(value)


def with_error(value: float, error: float, unit: str = "") -> str:
    """Return a value with its standard error, both to two digits of the error.

    Examples
    --------
    >>> with_error(109.7699, 0.6892, "°/V")
    '109.77 ± 0.69 °/V'
    """
    places = max(1 - math.floor(math.log10(error)), 0) if error > 0.0 else 3
    return f"{fixed(value, places)} ± {fixed(error, places)} {unit}".rstrip()


def table(head: Sequence[str], rows: Sequence[Sequence[str]], *, caption: str = "", text_columns: int = 1) -> str:
    """Return an HTML table; its cells are HTML, all but the first `text_columns` columns are numbers."""
    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(f'<{tag}{"" if k < text_columns else " class=n"}>{cell}</{tag}>' for k, cell in enumerate(row))

    title = f"<caption>{caption}</caption>" if caption else ""
    body = "".join(f"<tr>{cells('td', row)}</tr>\n" for row in rows)
    return (f'<div class="scroll"><table>{title}<thead><tr>{cells("th", head)}</tr></thead>\n'
            f"<tbody>\n{body}</tbody></table></div>\n")


def picture(image: bytes | str, words: str, *, style: str = "", kind: str = "", media: str = "image/svg+xml") -> str:
    """Return a picture inside the page itself: one file, and no names that could collide."""
    data = base64.b64encode(image.encode() if isinstance(image, str) else image).decode("ascii")
    attributes = (f' class="{kind}"' if kind else "") + (f' style="{style}"' if style else "")
    return f'<img{attributes} alt="{escape(plain(words))}" src="data:{media};base64,{data}">'


def plain(text: str) -> str:
    """Return HTML without its tags, for places that take words only.

    Examples
    --------
    >>> plain("V<sub>i</sub> &lt; 2")
    'Vi < 2'
    """
    return html.unescape(re.sub(r"<[^>]*>", "", text))
