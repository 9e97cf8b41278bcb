"""One look for pictures and pages: colours, lines, units that people read, and HTML that needs nothing but itself.

What plotting, reports and the command line share. matplotlib is loaded when a picture is made.
"""

from servotwin.look.files import FORMATS, to_bytes
from servotwin.look.numbers import figure_in, label_of, readable, unit_for
from servotwin.look.page import document
from servotwin.look.pages import on_page, pages
from servotwin.look.style import (
    COLOURS,
    CURVES_A_PAGE,
    LINES,
    WIDTH,
    axes_grid,
    context,
    finished,
    new_figure,
    plain_decades,
)
from servotwin.look.words import MINUS, TIMES, fixed, number, picture, plain, table, with_error
from servotwin.text import escape

__all__ = [
    "COLOURS",
    "CURVES_A_PAGE",
    "FORMATS",
    "LINES",
    "MINUS",
    "TIMES",
    "WIDTH",
    "axes_grid",
    "context",
    "document",
    "escape",
    "figure_in",
    "finished",
    "fixed",
    "label_of",
    "new_figure",
    "number",
    "on_page",
    "pages",
    "picture",
    "plain",
    "plain_decades",
    "readable",
    "table",
    "to_bytes",
    "unit_for",
    "with_error",
]
