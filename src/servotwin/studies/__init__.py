"""Tolerance studies: parameters drawn from distributions, many servos, a few metrics of each, and what moves them."""

from servotwin.studies import distributions
from servotwin.studies.api import sweep
from servotwin.studies.distributions import (
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
from servotwin.studies.lane_metrics import METRICS
from servotwin.studies.plan import dimension_of
from servotwin.studies.study import Bar, LaneFailure, Study, Tornado, variance_share

__all__ = ["METRICS", "Bar", "Choice", "Distribution", "LaneFailure", "LogNormal", "Normal", "Offset", "Relative",
           "Study", "Tornado", "Triangular", "Uniform", "dimension_of", "distributions", "stated",
           "sweep", "variance_share"]
