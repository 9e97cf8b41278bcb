"""All that a log says by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.identification.survey.clock import Clock, clock_of
from servotwin.identification.survey.doubts import missing_of, wrong_of
from servotwin.identification.survey.motion import Motion, motion_of
from servotwin.identification.survey.values import Values, values_of
from servotwin.logs.log import Log

FEWEST = 8  # rows that say anything
_MOST_GAPS = 20
_ANGLES = ("output_angle", "load_angle")


class Lowest(NamedTuple):
    """The least voltage of a supply [V], and when it came first [s]."""

    voltage: float
    time: float


@dataclass(frozen=True, kw_only=True)
class Survey:
    """What a log says by itself, in SI.

    Parameters
    ----------
    log : Log
    clock : Clock
    values : mapping of str to Values
        By measured signal.
    motion : Motion
    wrong : tuple of str
        What cannot be right, each in one sentence that says what to do.
    missing : tuple of str
        Experiments that it lacks, and what they would tell.
    """

    log: Log
    clock: Clock
    values: Mapping[str, Values]
    motion: Motion
    wrong: tuple[str, ...]
    missing: tuple[str, ...]

    @property
    def supply(self) -> Lowest | None:
        """Least voltage of the supply and when it came first [s]; None where it was not logged."""
        volts = self.log.measured.get("bus_voltage")
        if volts is None or not np.isfinite(volts).any():
            return None
        k = int(np.nanargmin(volts))
        return Lowest(float(volts[k]), float(self.log.time[k]))

    @property
    def facts(self) -> dict[str, Any]:
        """All of it as plain data."""
        log, clock = self.log, self.clock
        reading = log.reading
        return {
            "name": log.name, "rows": len(log), "duration": log.duration,
            "columns": [] if reading is None else [vars(one) for one in reading.columns],
            "unread": [] if reading is None else list(reading.unread),
            "remarks": [] if reading is None else list(reading.remarks),
            "command": {"kind": log.command_kind, "low": float(log.held.min()), "high": float(log.held.max()),
                        "changes": len(log.changes)},
            "clock": {**clock._asdict(), "gaps": [gap._asdict() for gap in clock.gaps[:_MOST_GAPS]],
                      "gap_count": len(clock.gaps)},
            "supply": None if self.supply is None else self.supply._asdict(),
            "signals": {name: found._asdict() for name, found in self.values.items()},
            "motion": self.motion._asdict(), "wrong": list(self.wrong), "missing": list(self.missing)}


def survey_of(log: Log) -> Survey:
    """Return what a log says by itself: no servo, no fit.

    Raises
    ------
    InputError
        If it has next to no rows.

    Examples
    --------
    >>> import numpy as np
    >>> time = 0.01 * np.arange(300.0)
    >>> command = np.where(time < 1.0, 0.0, 1.0)
    >>> log = Log(name="a", time=time, command=command, command_kind="angle", measured={
    ...     "output_angle": -np.interp(time, [1.05, 1.25], [0.0, 1.0])})
    >>> survey_of(log).wrong[0]
    'the angle falls where the command grows; unless the servo is built in reverse, a scale of the angle turns it'
    """
    if len(log) < FEWEST:
        raise InputError(f"log {log.name!r}" if log.reading is None else log.reading.file, got=f"{len(log)} rows",
                         allowed=f"at least {FEWEST}")
    clock, motion = clock_of(log.time), motion_of(log)
    values = {name: values_of(found, angle=name in _ANGLES) for name, found in log.measured.items()}
    return Survey(log=log, clock=clock, values=values, motion=motion,
                  wrong=tuple(wrong_of(log, clock, values[log.angle_name], motion)),
                  missing=tuple(missing_of(log, clock, motion)))
