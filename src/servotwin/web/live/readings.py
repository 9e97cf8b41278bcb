"""The display of the bench: the paper's seven readings, of a servo as it stands."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin.bench import FEEDBACK_CONVERTER, INPUT_CONVERTER
from servotwin.errors import ServotwinError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from servotwin.bench import Converter

Reading = dict[str, float | None]


def reading_of(columns: Sequence[str], row: Sequence[float], rate: float) -> Reading:
    """Return the seven readings by name (SI); None of what a servo does not have.

    Parameters
    ----------
    columns : sequence of str
        Names of what the row holds.
    row : sequence of float
        (SI)
    rate : float
        Of the transmitter [Hz].

    Examples
    --------
    >>> reading_of(("command_voltage", "pulse_width", "output_angle"), (1.425, 1.53e-3, 1.5), 50.0)["command_count"]
    582
    """
    seen = dict(zip(columns, row, strict=True))
    pulsed = "pulse_width" in seen
    return {
        "command_voltage": _shown(seen.get("command_voltage")),
        "command_count": _count(INPUT_CONVERTER, seen.get("command_voltage")),
        "feedback_voltage": _shown(seen.get("feedback_voltage")),
        "feedback_count": _count(FEEDBACK_CONVERTER, seen.get("feedback_voltage")),
        "pulse_rate": rate if pulsed else None,
        "output_angle": _shown(seen.get("output_angle")),
        "pulse_width": _shown(seen.get("pulse_width"))}


def _shown(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _count(converter: Converter, voltage: float | None) -> int | None:
    try:
        return None if voltage is None else converter.count(voltage)
    except ServotwinError:
        return None
