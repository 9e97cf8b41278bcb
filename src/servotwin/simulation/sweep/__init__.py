"""Tolerance studies: parameters drawn from distributions, many servos, a few metrics of each, and what moves them."""

from servotwin.simulation.sweep import distributions
from servotwin.simulation.sweep.api import sweep
from servotwin.simulation.sweep.distributions import (
    Choice,
    Distribution,
    LogNormal,
    Normal,
    Offset,
    Relative,
    Triangular,
    Uniform,
    stated,
)
from servotwin.simulation.sweep.metrics import METRICS
from servotwin.simulation.sweep.names import dimension_of
from servotwin.simulation.sweep.study import LaneFailure, Study
from servotwin.simulation.sweep.tables import read_columns
from servotwin.simulation.sweep.tornado import Bar, Tornado, variance_share

__all__ = ["METRICS", "Bar", "Choice", "Distribution", "LaneFailure", "LogNormal", "Normal", "Offset", "Relative",
           "Study", "Tornado", "Triangular", "Uniform", "dimension_of", "distributions", "read_columns", "stated",
           "sweep", "variance_share"]
