"""One look for pictures and pages: colours, lines, units that people read, and HTML that needs nothing but itself.

Common parts of plotting, reports and the command line. matplotlib is loaded when a picture is made.
"""

from servotwin.look.page import (
    MINUS,
    TIMES,
    document,
    figure_in,
    fixed,
    label_of,
    number,
    picture,
    readable,
    table,
    unit_for,
    untagged,
    with_error,
)
from servotwin.look.style import (
    COLOURS,
    CURVES_A_PAGE,
    FORMATS,
    LINES,
    WIDTH,
    axes_grid,
    context,
    finished,
    new_figure,
    on_page,
    pages,
    plain_decades,
    to_bytes,
)
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
    "plain_decades",
    "readable",
    "table",
    "to_bytes",
    "unit_for",
    "untagged",
    "with_error",
]
