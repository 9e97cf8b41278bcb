"""Pictures: results over time, straight lines through data, pulses, and the paper's block diagrams.

Everything is drawn with matplotlib's objects and without its global state; matplotlib is loaded when a picture is
asked for. Angles are in degrees and pulses in microseconds.
"""

from servotwin.plotting.block_diagrams import PAPER_DIAGRAMS, block_diagram
from servotwin.plotting.diagram import Diagram
from servotwin.plotting.files import save
from servotwin.plotting.formula import Formula, formula_svg
from servotwin.plotting.panels import Curve, Limit, curves, pulses
from servotwin.plotting.responses import SHOWN, Shown, shown, time_response
from servotwin.plotting.tornado import metric_shown, tornado
from servotwin.units.look import COLOURS, LINES, axes_grid, finished, readable, to_bytes

__all__ = [
    "COLOURS",
    "LINES",
    "PAPER_DIAGRAMS",
    "SHOWN",
    "Curve",
    "Diagram",
    "Formula",
    "Limit",
    "Shown",
    "axes_grid",
    "block_diagram",
    "curves",
    "finished",
    "formula_svg",
    "metric_shown",
    "pulses",
    "readable",
    "save",
    "shown",
    "time_response",
    "to_bytes",
    "tornado",
]
