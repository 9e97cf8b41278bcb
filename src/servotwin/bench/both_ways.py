"""A table that was read on the way up and on the way down: hysteresis, told apart from noise."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from servotwin.bench.fits import LineFit, TableFit
from servotwin.bench.table_words import plus_minus
from servotwin.parameters import Servo

LEVEL = 0.05
"""Chance that a table without hysteresis is said to have one: shared among its lines."""


def both_ways(lines: Mapping[str, TableFit], servo: Servo) -> Iterator[str]:
    """Yield what a table that was read both ways says of hysteresis; nothing for one that was read one way.

    Parameters
    ----------
    lines : mapping of str to TableFit
    servo : Servo
        Its deadband is set beside the hysteresis of angle over pulse, where it gives one.
    """
    told = {name: fit for name, fit in lines.items() if fit.ways is not None and "q" in (
        fit.x_column.symbol, fit.y_column.symbol)}
    for name, fit in told.items():
        line = fit.line
        size, half = abs(line.hysteresis), line.wide(line.hysteresis_error)
        noise = math.sqrt(sum(r * r for r in line.residuals) / line.freedom)
        if line.hysteresis_p * len(told) < LEVEL:
            yield (f"{name} differs by {plus_minus(size, line.hysteresis_error)} {fit.unit} between the way up and the "
                   f"way down, {size - half:.3g} to {size + half:.3g} {fit.unit}: hysteresis, p = "
                   f"{line.hysteresis_p:.1g}; the noise beside it is {noise:.2g} {fit.unit}, and the line runs "
                   "between both ways" + _behind(name, line, servo))
        else:
            yield (f"{name} shows no hysteresis: both ways differ by {size:.2g} {fit.unit}, which noise of "
                   f"{noise:.2g} {fit.unit} does by itself (p = {line.hysteresis_p:.2g}); it is less than "
                   f"{size + half:.2g} {fit.unit}")


def _behind(name: str, line: LineFit, servo: Servo) -> str:
    """Return what a hysteresis of angle over pulse is made of: a dial cannot tell which."""
    if name != "q(t_a)":
        return ""
    width = servo.electronics.deadband
    known = "" if width is None else (f"; the deadband of the servo, {1e6 * width:.3g} µs, is worth "
                                      f"{abs(line.slope) * 1e6 * width:.2g} ° of it at most")
    return (f"{known}. Play of the gear, deadband and friction make it together and a dial cannot tell them apart: no "
            "parameter is set; push the horn by hand both ways for the play, and step the pulse by 1 µs for the "
            "deadband")


def ways_facts(fit: TableFit) -> dict[str, float] | None:
    """Return the hysteresis of a line as plain data, None where the table was read one way."""
    if fit.ways is None:
        return None
    line = fit.line
    half = line.wide(line.hysteresis_error)
    return {"value": line.hysteresis, "std": line.hysteresis_error, "lower": line.hysteresis - half,
            "upper": line.hysteresis + half, "p": line.hysteresis_p,
            "noise": float(np.sqrt(np.sum(np.square(line.residuals)) / line.freedom))}
