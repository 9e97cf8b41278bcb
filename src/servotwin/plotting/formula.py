"""Formulas as pictures, for pages that must read without the network."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import cache

from servotwin.look import context


@dataclass(frozen=True, kw_only=True)
class Formula:
    """A formula as an SVG picture.

    Parameters
    ----------
    svg : str
        The picture.
    width, height : float
        Its size at 10 pt letters [pt].
    """

    svg: str
    width: float
    height: float


@cache
def formula_svg(source: str, size: float = 10.0) -> Formula:
    r"""Return a formula in matplotlib's math text as an SVG picture.

    Parameters
    ----------
    source : str
        Such as ``r"$v_o = p\,q + b_o$"``.
    size : float
        Of the letters [pt].

    Raises
    ------
    ValueError
        If the math text is malformed.

    Examples
    --------
    >>> formula_svg(r"$k_a i_a$").svg.startswith("<svg")
    True
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import MathTextParser

    with context():
        prop = FontProperties(size=size)
        width, height, depth, *_ = MathTextParser("path").parse(source, dpi=72, prop=prop)
        margin = 0.15 * size
        width, height = width + 2 * margin, height + 2 * margin
        figure = Figure(figsize=(width / 72.0, height / 72.0))
        figure.patch.set_visible(False)
        FigureCanvasSVG(figure)
        figure.text(margin / width, (depth + margin) / height, source, fontproperties=prop, parse_math=True)
        with io.StringIO() as stream:
            figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
            text = stream.getvalue()
    return Formula(svg=text[text.index("<svg"):], width=width, height=height)
