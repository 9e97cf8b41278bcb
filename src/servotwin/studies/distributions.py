"""Distributions that parameters are drawn from, and those that a servo file states."""

from servotwin.studies.joint import stated
from servotwin.studies.kinds import (
    Affine,
    Choice,
    Distribution,
    LogNormal,
    Normal,
    Offset,
    Relative,
    Triangular,
    Truncated,
    Uniform,
)
from servotwin.studies.plan import drawn_parameters

__all__ = ["Affine", "Choice", "Distribution", "LogNormal", "Normal", "Offset", "Relative", "Triangular", "Truncated",
           "Uniform", "drawn_parameters", "stated"]
