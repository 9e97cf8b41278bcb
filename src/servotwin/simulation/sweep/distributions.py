"""Distributions that parameters are drawn from, and those that a servo file states."""

from servotwin.simulation.sweep.kinds import (
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
from servotwin.simulation.sweep.stated import stated

__all__ = ["Affine", "Choice", "Distribution", "LogNormal", "Normal", "Offset", "Relative", "Triangular", "Truncated",
           "Uniform", "stated"]
