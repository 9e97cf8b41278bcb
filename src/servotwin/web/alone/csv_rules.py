"""Which tables the page as one file reads as logs: those that need no guess, by the rules of the one reader."""

from __future__ import annotations

from typing import Any

import numpy as np

from servotwin.identification.report.pictures import sensor_shown
from servotwin.logs.columns import COMMANDS, SWITCH, TIME, own_columns
from servotwin.logs.log_checks import FEWEST, LIMITS, PULSES
from servotwin.tables.reading import BY_POINTS, MISSING, WHOLE, WHOLE_OR_POINT
from servotwin.web.live.overlay import STRETCHES
from servotwin.web.server.own.reading import DIGITS, MOST_PLAYED, UNITS

ANGLE = "output_angle"
_NAMED = "named"  # how such a column is known


def csv_rules() -> dict[str, Any]:
    """Return the rules of such tables, as plain values.

    Examples
    --------
    >>> rules = csv_rules()
    >>> rules["columns"]["time_ms"], rules["limits"]["pulse_width"]
    (['time', 'ms', 0.001], [0.1, 's', 'microseconds?'])
    """
    return {
        "columns": {name: [signal, column.unit, float(column.to_si(np.ones(1), signal)[0])]
                    for name, (signal, column) in own_columns().items()},
        "time": TIME, "angle": ANGLE, "switch": SWITCH, "commands": COMMANDS, "positive": "pulse_width",
        "units": {kind: [unit, factor] for kind, (unit, factor) in UNITS.items()},
        "known": _NAMED, "missing": sorted(MISSING), "number": WHOLE_OR_POINT.pattern, "fewest": FEWEST,
        "grouped": BY_POINTS, "whole": WHOLE.pattern, "pulses": PULSES,
        "limits": {name: [limit, unit, meant] for name, (unit, limit, meant) in LIMITS.items()},
        "played": MOST_PLAYED, "digits": DIGITS, "stretches": STRETCHES, "shown": sensor_shown(ANGLE),
        "hold": "previous"}
