"""What a multimeter says of the wires: reference of the converter, divider, shunt, each with its error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from servotwin.bench.recording.wiring import FULL, Wiring
from servotwin.bench.table_columns import LineFit, fit_line
from servotwin.errors import InputError, UnknownNameError
from servotwin.parameters import Quantity

FEWEST = 3  # points: a line, and how far they are off it
CHANNEL = {"reference": "command", "supply": "supply", "shunt": "shunt"}
"""Which channel each calibration reads; the reference is measured by a voltage at the pin of the command."""
UNIT = {"reference": "V", "supply": "V", "shunt": "A"}
_SURE = 3.0  # standard errors: a zero further away is told


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A wiring with what was measured.

    Parameters
    ----------
    wiring : Wiring
    changed : tuple of str
        Its entries that are new.
    line : LineFit
        Through meter and counts.
    remarks : tuple of str
        What is worth a look.
    """

    wiring: Wiring
    changed: tuple[str, ...]
    line: LineFit
    remarks: tuple[str, ...]


def calibrated(wiring: Wiring, what: str, meter: Sequence[float], counts: Sequence[float]) -> Calibration:
    """Return the wiring that a meter's values and the mean counts at the same time say.

    Parameters
    ----------
    wiring : Wiring
    what : {"reference", "supply", "shunt"}
    meter : sequence of float
        What the meter showed, at least three values, not all alike [V or A].
    counts : sequence of float
        Mean counts of the converter.

    Raises
    ------
    UnknownNameError, InputError
        If there is no such calibration, or its points do not make a line that rises.

    Examples
    --------
    >>> found = calibrated(Wiring(), "supply", [4.8, 6.0, 7.4], [490.6, 613.5, 756.8])
    >>> found.changed, round(found.wiring.supply_ratio.value, 3), found.wiring.supply_ratio.origin
    (('supply_ratio',), 4.0, 'measured')
    """
    if what not in CHANNEL:
        raise UnknownNameError("calibration", what, CHANNEL)
    x, y = np.asarray(meter, dtype=np.float64), np.asarray(counts, dtype=np.float64)
    if len(x) != len(y) or len(x) < FEWEST or not (np.isfinite(x).all() and np.isfinite(y).all()) or not np.ptp(x):
        raise InputError(f"calibration of {what}", got=f"{len(x)} values of the meter",
                         allowed=f"at least {FEWEST} finite ones, not all alike")
    if (y >= FULL - 1).any():
        raise InputError(f"calibration of {what}", got="a count at the end of the converter", allowed="smaller values")
    volts = (y + 0.5) / FULL * (1.0 if what == "reference" else wiring.reference_voltage.value)
    # Both read with an error; the meter's is told by its maker, the counts' by the line: counts are what scatters
    line = fit_line(x, volts)
    if line.slope <= 0.0:
        raise InputError(f"calibration of {what}", got="counts that fall while the meter rises", allowed="a line up")
    changes, remarks = _changes(what, line)
    return Calibration(wiring=wiring.replace(**changes), changed=tuple(changes), line=line, remarks=remarks)


def _changes(what: str, line: LineFit) -> tuple[dict[str, Quantity], tuple[str, ...]]:
    inverse, error = 1.0 / line.slope, line.slope_error / line.slope**2
    off = abs(line.intercept) > _SURE * line.intercept_error > 0.0
    if what == "shunt":
        return {"shunt_gain": _measured(line.slope, "V/A", line.slope_error),
                "shunt_zero": _measured(line.intercept, "V", line.intercept_error)}, ()
    remark = (f"the line does not go through zero: {line.intercept * inverse:+.3g} V, by more than {_SURE:g} standard "
              "errors; look for a loose ground or a loaded divider",) if off else ()
    if what == "supply":
        return {"supply_ratio": _measured(inverse, "V/V", error)}, remark
    return {"reference_voltage": _measured(inverse, "V", error)}, remark


def _measured(value: float, unit: str, std: float) -> Quantity:
    day = datetime.now(UTC).date().isoformat()
    return Quantity(value=value, unit=unit, origin="measured", std=std,
                    source=f"servotwin bench calibrate, {day}; the meter's own error apart")
