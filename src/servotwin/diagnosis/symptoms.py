"""The table of symptoms: how strong each is in a run or a log, and from where on it is one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.datasheet.warming import HOT_WINDING
from servotwin.physics import Temperatures
from servotwin.simulation.metrics import tolerance

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.datasheet import Masses
    from servotwin.diagnosis.record import Hold, Record

HOT_HOUSING = 324.15  # K, 51 °C
_NEAR = math.radians(1.0)
_LEAST_WAY = math.radians(3.0)
_MOVED, _OVERSHOOT = 0.5, 0.1
_WARMS = 600.0  # s


class Judged(NamedTuple):
    """How strong a symptom is.

    Parameters
    ----------
    value, limit : float
        SI; the symptom is there where the value is above the limit; nan where it cannot be told.
    """

    value: float
    limit: float

    @property
    def found(self) -> bool:
        """Whether the symptom is there."""
        return self.value > self.limit


class Symptom(NamedTuple):
    """One row of the table.

    Parameters
    ----------
    name : str
        Such as "overshoots".
    threshold : str
        From where on it is one, as people read it.
    source : str
        Where the threshold is from.
    judge : callable
        Returns from a record and the servo's thermal masses how strong it is.
    hides : tuple of str
        Symptoms that only follow from this one.
    unit : str
        Of value and limit as people read them; `factor` leads there from SI.
    factor : float
    """

    name: str
    threshold: str
    source: str
    judge: Callable[[Record, Masses | None], Judged]
    hides: tuple[str, ...] = ()
    unit: str = ""
    factor: float = 1.0


def _trips(record: Record, masses: Masses | None) -> Judged:
    return Judged(record.tripped, 0.0)


def _stuck(record: Record, masses: Masses | None) -> Judged:
    return max((Judged(max(0.0, 1.0 - (hold.end.angle - hold.before.angle) / hold.way
                           - (hold.end.doubt + hold.before.doubt) / abs(hold.way)), 1.0 - _MOVED)
                for hold in record.holds if abs(hold.way) >= _NEAR), default=Judged(math.nan, 1.0 - _MOVED))


def _buzzes(record: Record, masses: Masses | None) -> Judged:
    rest = record.rest
    if rest is None or record.swing > 0.0:
        return Judged(record.swing, 0.0)
    return Judged((max(rest.duty, rest.swing) if math.isfinite(rest.duty) else rest.swing) if rest.restless else 0.0,
                  0.0)


def _off(hold: Hold, record: Record) -> Judged:
    return Judged(max(0.0, abs(hold.target - hold.end.angle) - hold.end.doubt),
                  max(_NEAR, float(tolerance(hold.farthest, record.finest))))


def _sags(record: Record, masses: Masses | None) -> Judged:
    return max((_off(hold, record) for hold in record.holds), key=lambda one: one.value / one.limit,
               default=Judged(math.nan, _NEAR))


def _overshoots(record: Record, masses: Masses | None) -> Judged:
    wide = [hold for hold in record.holds if hold.jumps and min(
        abs(hold.way), abs(hold.target - hold.before.angle)) >= _LEAST_WAY]
    if not wide:
        return Judged(math.nan, _OVERSHOOT)
    return max(Judged(max(0.0, hold.highest - hold.end.doubt) / abs(hold.target - hold.before.angle)
                      if not (hold.swing > 0.0 or _off(hold, record).found) else 0.0, _OVERSHOOT) for hold in wide)


def _warms(record: Record, masses: Masses | None) -> Judged:
    if masses is None or math.isnan(record.heat):
        return Judged(math.nan, math.nan)
    after = masses.after(_WARMS, record.heat, Temperatures(masses.ambient, masses.ambient))
    return max((Judged(float(now) - masses.ambient, limit - masses.ambient) for now, limit in (
        (after.housing, HOT_HOUSING), (after.winding, HOT_WINDING))), key=lambda one: one.value / one.limit)


SYMPTOMS: tuple[Symptom, ...] = (
    Symptom("trips", "any protection acts", "the servo's own program", _trips,
            ("does not move", "sags", "overshoots"), "% of the time", 100.0),
    Symptom("does not move", "it goes less than half of the way that it is sent, of 1 deg or more",
            "as the smallest move of `curves`", _stuck, ("sags",), "% of the way missing", 100.0),
    Symptom("buzzes", "it swings by 0.1 deg or more where nothing changes, or its bridge switches on and on "
            "where friction holds it",
            "as the remarks of a run; 0.1 deg is about one count of an encoder of 12 bit", _buzzes, ("overshoots",),
            "% of duty or rad", 100.0),
    Symptom("overshoots", "by more than 10 % of a step of 3 deg or more", "assumed", _overshoots, (), "%", 100.0),
    Symptom("sags", "it stands off its command by more than 1 deg, 5 % of the way, and two deadbands no wider "
            "than usual",
            "as `curves` and `simulate` say that a servo has arrived", _sags, (), "deg", math.degrees(1.0)),
    Symptom("gets warm", "ten minutes of this bring its housing above 51 deg C, or its winding above 100 deg C",
            "ISO 13732-1: skin burns after a minute at 51 deg C; a hot winding as in `curves`", _warms, (), "K"),
)
"""In the order in which they are told."""
