"""A page of HTML that needs nothing but itself: readable on a phone and in print."""

from __future__ import annotations

import base64
import html
import math
import re
from collections.abc import Sequence

from servotwin import units
from servotwin.text import escape

# --- Numbers and tables as HTML ---------------------------------------------------------------------------------------

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
    return f'<img{attributes} alt="{escape(untagged(words))}" src="data:{media};base64,{data}">'


def untagged(text: str) -> str:
    """Return HTML without its tags, for places that take words only.

    Examples
    --------
    >>> untagged("V<sub>i</sub> &lt; 2")
    'Vi < 2'
    """
    return html.unescape(re.sub(r"<[^>]*>", "", text))


# --- Values in the unit in which people read them ---------------------------------------------------------------------

_FOREIGN = ("N cm", "kgf cm", "gf cm", "ozf in", "V/krpm", "min", "%", "%/K", "s/deg", "N m/deg", "V/deg", "rpm",
            "deg/s", "oz", "lb", "in")
_PRINTED = {"ohm": "Ω", "mohm": "mΩ", "us": "µs", "uH": "µH", "us/V": "µs/V", "deg": "°", "1": "",
            "mV/us": "mV/µs", "deg/us": "°/µs",
            "deg/s": "°/s"}


def readable(value: float | str, dimension: str) -> str:
    """Return a value (SI) with the unit in which its number is neither long nor small; a word as it is.

    Examples
    --------
    >>> readable(8e-6, "time"), readable(3.04101, "resistance"), readable("coast", "word")
    ('8 µs', '3.041 Ω', 'coast')
    >>> readable(-0.0, "angle")
    '0°'
    """
    if isinstance(value, str):
        return value
    unit = unit_for(value, dimension)
    text = label_of(unit)
    return f"{units.from_si(value, unit, dimension):z.4g}{'' if text in ('', '°') else ' '}{text}"


def unit_for(value: float, dimension: str) -> str:
    """Return the unit in which a value (SI) is neither long nor small; angles are in degrees.

    Examples
    --------
    >>> unit_for(3.7e-3, "torque per current"), unit_for(1.0, "angle")
    ('mN m/A', 'deg')
    """
    known = [unit for unit in units.DIMENSIONS[dimension] if unit not in _FOREIGN]
    for usual in ("deg", "deg/us"):
        if usual in known:
            return usual
    if dimension == "output speed":  # of a shaft that turns by degrees; motors are read in rad/s
        return "deg/s"
    if not value or not math.isfinite(value):
        return known[0]
    numbers = {unit: abs(units.from_si(value, unit, dimension)) for unit in known}
    return min(known, key=lambda unit: abs(math.log10(numbers[unit]) - 1.0))


def label_of(unit: str) -> str:
    """Return a unit as it is printed.

    Examples
    --------
    >>> label_of("kg m2"), label_of("ohm"), label_of("1")
    ('kg m²', 'Ω', '')
    """
    return _PRINTED.get(unit, unit.replace("m2", "m²"))


def figure_in(value: float, unit: str, dimension: str, *, within: float = math.nan) -> str:
    """Return the number of a value (SI) in a unit, to two digits of what it is uncertain by; else to four digits.

    Parameters
    ----------
    value : float
    unit, dimension : str
        Of `servotwin.units`.
    within : float
        Uncertainty, in the unit of the value (SI); nan or 0 where there is none.

    Examples
    --------
    >>> figure_in(3.7188e-3, "mN m/A", "torque per current", within=2e-5)
    '3.719'
    >>> figure_in(0.0123456, "V", "voltage"), figure_in(float("nan"), "V", "voltage")
    ('0.01235', '–')
    """
    if not math.isfinite(value):
        return "–"
    shown = units.from_si(value, unit, dimension)
    spread = abs(units.from_si(within, unit, dimension)) if math.isfinite(within) else 0.0
    if spread == 0.0 or spread < 1e-6 * abs(shown):
        return f"{shown:z.4g}"
    places = 1 - math.floor(math.log10(spread))
    least = 2 - math.floor(math.log10(abs(shown))) if shown else 0  # never fewer than three digits of the value
    places = max(places, min(least, places + 2), 0)
    text = f"{shown:z.{places}f}"
    return text if len(text) <= 12 else f"{shown:z.4g}"


# --- A page of HTML that needs nothing but itself: readable on a phone and in print -----------------------------------

STYLE = """
:root{color-scheme:light;--ink:#1b1f24;--soft:#57606a;--line:#d0d7de;--wash:#f6f8fa;--blue:#0072b2}
*{box-sizing:border-box}
body{margin:0 auto;max-width:64rem;padding:1rem 1.2rem 4rem;background:#fff;color:var(--ink);
font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif}
td code{overflow-wrap:normal}
h1{font-size:1.7rem;line-height:1.25;margin:1rem 0 .3rem}h2{font-size:1.3rem;margin:2.6rem 0 .6rem;padding-top:.4rem;
border-top:2px solid var(--line)}h3{font-size:1.05rem;margin:1.6rem 0 .4rem}
p{margin:.5rem 0}a{color:var(--blue)}code{font-size:.9em;overflow-wrap:anywhere}.lead{color:var(--soft)}
.note{border-left:4px solid #d55e00;background:#fff6ef;padding:.5rem .9rem;margin:1rem 0}
.numbers{display:grid;grid-template-columns:repeat(auto-fit,minmax(13rem,1fr));gap:.8rem;padding:0;margin:1rem 0;
list-style:none}
.numbers li{border:1px solid var(--line);border-radius:8px;padding:.6rem .8rem;background:var(--wash);font-size:.9rem}
.numbers b{display:block;font-size:1.35rem;color:var(--blue);font-variant-numeric:tabular-nums}
nav ol{columns:2;column-gap:2rem;margin:.4rem 0}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,26rem),1fr));gap:1rem;align-items:start}
figure{margin:.8rem 0;padding:.6rem;border:1px solid var(--line);border-radius:8px;break-inside:avoid;min-width:0}
figure>div{overflow-x:auto}figure img{display:block;max-width:100%;height:auto;margin:0 auto}
figure.wide img.drawing{width:var(--w);max-width:max(100%,40rem)}
figcaption{font-size:.9rem;color:var(--soft);margin-top:.4rem}figcaption b{color:var(--ink)}
img.formula{vertical-align:middle;max-width:none;height:auto}.formulas{overflow-x:auto;padding:.3rem 0}
.formulas p{white-space:nowrap;margin:.5rem 0}.formulas span{color:var(--soft);font-size:.85rem;padding-left:.8rem}
.scroll{overflow-x:auto;margin:.8rem 0}table{border-collapse:collapse;font-size:.86rem;width:100%}
caption{text-align:left;color:var(--soft);padding:.3rem 0;font-size:.9rem}
th,td{padding:.3rem .55rem;border-bottom:1px solid var(--line);text-align:left;vertical-align:top}
th{background:var(--wash);font-weight:600}td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;
white-space:nowrap}th.n{white-space:normal}
.measured,.identified{color:#00664a;font-weight:600}.datasheet,.literature{color:#005a8d;font-weight:600}
.assumed{color:#a34700;font-weight:600}footer{margin-top:3rem;color:var(--soft);font-size:.85rem}
@media(max-width:40rem){body{font-size:15px;padding:.6rem .8rem 3rem}nav ol{columns:1}}
@media print{body{max-width:none;font-size:9.5pt;padding:0}h2{break-after:avoid}.scroll,figure>div,.formulas{overflow:
visible}.figures{grid-template-columns:1fr 1fr}tr{break-inside:avoid}table{font-size:7.5pt}
figure.wide img.drawing{max-width:100%}a{color:inherit;text-decoration:none}}
"""


def document(title: str, body: str, *, style: str = "") -> str:
    """Return a whole page.

    Parameters
    ----------
    title : str
        Plain words.
    body : str
        HTML.
    style : str
        Further CSS.

    Examples
    --------
    >>> document("a < b", "<p>text</p>").count("a &lt; b")
    1
    """
    from servotwin import __version__

    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<style>{STYLE}{style}</style></head>
<body>
{body}<footer>servotwin {escape(__version__)}. This page loads nothing from the network.</footer>
</body></html>
"""
