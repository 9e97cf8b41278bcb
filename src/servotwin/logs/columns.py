"""Columns of a log file: which signal each one is, and in which unit."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import InputError, UnitError
from servotwin.models.outputs import SIGNALS
from servotwin.tables import TextTable
from servotwin.units.words import COUNTS, unit_word

if TYPE_CHECKING:
    from collections.abc import Callable, Container


# --- Dates and times of day as time stamps ----------------------------------------------------------------------------

_ISO = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d(?:[.,]\d{1,9})?)?)(Z|[+-]\d\d:?\d\d)?", re.IGNORECASE)
_CLOCK = re.compile(r"(?:(\d{1,2}[./-]\d{1,2}[./-]\d{2,4}),?[ T])?"  # of which day, whatever comes first
                    r"(\d{1,2}):(\d\d):(\d\d)(?:[.,](\d{1,9}))?(?: ?([AP])\.?M\.?)?", re.IGNORECASE)
_SECOND = 1_000_000_000  # ns
_DAY = 86400 * _SECOND
CLOCKS = {"iso": "dates such as 2024-05-03T12:00:01.250", "clock": "times such as 12:00:01.250"}


class Stamps(NamedTuple):
    """Times from the first row on [s], and what they were written as: "iso" or "clock"."""

    unit: str
    time: NDArray[np.float64]

    @property
    def form(self) -> str:
        """Their meaning, in words."""
        return "dates" if self.unit == "iso" else "times of day"


def clock_of(cell: str) -> str:
    """Return what a cell is as a time: "iso" for a date, "clock" for a time of day, else nothing.

    Examples
    --------
    >>> clock_of("12:00:01.25"), clock_of("3.5.2024 12:00:01"), clock_of("2024-05-03T12:00"), clock_of("1.25")
    ('clock', 'clock', 'iso', '')
    """
    if ":" not in cell:
        return ""
    return "iso" if _ISO.fullmatch(cell) else "clock" if _CLOCK.fullmatch(cell) else ""


def stamps_of(table: TextTable, column: str) -> Stamps | None:
    """Return the times of a column of ISO 8601 dates or times of day, None where its first cell is neither.

    Raises
    ------
    InputError
        If a further cell is none: names the line.
    """
    cells = table.cells(column)
    unit = clock_of(cells[0])
    return Stamps(unit, (_iso if unit == "iso" else _clock)(table, column, cells)) if unit else None


def _iso(table: TextTable, column: str, cells: Sequence[str]) -> NDArray[np.float64]:
    found = [_matched(_ISO, table, k, column, cell, "iso") for k, cell in enumerate(cells)]
    plain = [f"{match[1]}T{match[2].replace(',', '.')}" for match in found]
    try:
        stamps = np.array(plain, dtype="datetime64[ns]")
    except ValueError as error:
        raise InputError(f"{table.path}: {column}", got=str(error), allowed=CLOCKS["iso"]) from None
    nanoseconds = (stamps - stamps[0]).astype(np.int64)
    zones = [match[3] or "" for match in found]
    if len(set(zones)) > 1:
        if "" in zones:
            k = zones.index("") if zones[0] else next(k for k, zone in enumerate(zones) if zone)
            raise InputError(f"{table.path}: line {table.rows[k].line}, {column}", got=cells[k],
                             allowed="a time zone in all rows, or in none")
        shift = np.array([_zone(zone) for zone in zones], dtype=np.int64) * 60 * _SECOND
        nanoseconds = nanoseconds - (shift - shift[0])
    return np.asarray(nanoseconds / _SECOND)


def _zone(text: str) -> int:
    """Return minutes from UTC."""
    if text.upper() == "Z":
        return 0
    return (1 if text[0] == "+" else -1) * (60 * int(text[1:3]) + int(text[-2:]))


def _clock(table: TextTable, column: str, cells: Sequence[str]) -> NDArray[np.float64]:
    found = [_matched(_CLOCK, table, k, column, cell, "clock") for k, cell in enumerate(cells)]
    times = np.array([(3600 * _hour(m[2], m[6]) + 60 * int(m[3]) + int(m[4])) * _SECOND
                      + int((m[5] or "0").ljust(9, "0")) for m in found], dtype=np.int64)
    dated = all(m[1] for m in found)
    later = np.array([a[1] != b[1] for a, b in pairwise(found)], bool) if dated else np.diff(times) < -_DAY // 2
    days = np.cumsum(np.append(0, later))  # past midnight
    return np.asarray((times + _DAY * days - times[0]) / _SECOND)


def _hour(hour: str, half: str | None) -> int:
    """Return the hour of the day; of its halves the first begins with 12 AM, the second with 12 PM."""
    return int(hour) if half is None else int(hour) % 12 + 12 * (half.upper() == "P")


def _matched(form: re.Pattern[str], table: TextTable, k: int, column: str, cell: str, unit: str) -> re.Match[str]:
    match = form.fullmatch(cell)
    if match is None:
        raise InputError(f"{table.path}: line {table.rows[k].line}, {column}", got=cell or "nothing",
                         allowed=CLOCKS[unit])
    return match

# --- Names of foreign columns: a role, and perhaps a unit. Names in English and German --------------------------------

TIME, PULSE, COMMAND, COMMAND_ANGLE = "time", "pulse", "command", "command angle"
ANGLE, FEEDBACK, SOME_TIME = "angle", "feedback", "some time"
UNIT_IN_NAME = "its name"
SUPPLY_CURRENT, ARMATURE_CURRENT, VOLTAGE, SPEED = "supply_current", "armature_current", "bus_voltage", "output_speed"
_ROLES: dict[str, frozenset[str]] = {name: frozenset(words.split()) for name, words in {
    TIME: "time timestamp stamp ts zeit zeitstempel uhrzeit clock elapsed date datetime datum temps tiempo",
    COMMAND: "cmd command commanded target setpoint set sp goal desired demand demanded ref reference soll sollwert "
             "sollwinkel vorgabe befehl input action request requested",
    PULSE: "pwm pulse pulses pulsewidth pw ppm puls pulsbreite pulsweite impuls impulsbreite impulslaenge",
    ANGLE: "angle ang winkel istwinkel sollwinkel pos position theta phi rotation encoder enc angulo angolo",
    "measured": "actual ist istwert measured meas feedback fb present",
    COUNTS: "adc raw analog analogread pot poti potentiometer wiper ticks counts",
    "current": "current curr strom stromaufnahme amperage corriente corrente courant",
    VOLTAGE: "voltage spannung vcc vbat vin vbus vsupply battery",
    SPEED: "speed velocity vel omega drehzahl geschwindigkeit",
}.items()}
_LEROBOT = frozenset(("observation", "state"))
_ALONE = {"t": TIME, "q": ANGLE, "i": "current"}  # letters that mean this where they stand alone
_MOTOR = frozenset(("motor", "armature", "winding", "anker"))
_OTHER = frozenset((
    "error err fehler index idx id sample samples number nr no frame seq sequence checksum crc temp temperature "
    "temperatur load torque last drehmoment acc accel acceleration mode state status gain kp ki kd duty count delta dt "
    "period frequency freq").split())
_BRACKETS = re.compile(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\)|\{([^}]*)\}|<([^>]*)>)\s*")
_DIVIDED = re.compile(r"(.+?)\s*(?:/|\bin\b)\s*(\S+)")
_ARDUINO = re.compile(r"[Aa][0-7]")  # its analog inputs
_PARTS = re.compile(r"[^\W_]+|[°%]")
_CAMEL = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^\W\d_]+|[°%]")


class Meaning(NamedTuple):
    """The meaning of a name.

    Parameters
    ----------
    role : str
    unit : str
        As `servotwin.units` writes it, or one that is none there; empty where the name has none.
    dimension : str
        Of the unit; empty where it is not known.
    """

    role: str
    unit: str
    dimension: str


def meaning_of(column: str, below: str = "") -> Meaning | None:
    """Return what a column's name says, None where it says nothing.

    Parameters
    ----------
    column : str
    below : str
        Its unit, where a line below the header has units.

    Examples
    --------
    >>> meaning_of("Angle [deg]"), meaning_of("millis")
    (Meaning(role='angle', unit='deg', dimension='angle'), Meaning(role='time', unit='ms', dimension='time'))
    >>> meaning_of("Strom / mA").role, meaning_of("target_us").role, meaning_of("note")
    ('supply_current', 'pulse', None)
    """
    if _ARDUINO.fullmatch(column.strip()):
        return Meaning(COUNTS, "", "")
    words, unit = _parts(column, below)
    if words and words <= _LEROBOT:  # "observation.state": where the joint is
        words = frozenset(("position",))
    dimension = (unit_word(unit) or ("", ""))[1]
    if words & _OTHER:
        return None
    role = _role(words, dimension)
    return None if role is None else Meaning(role, (unit_word(unit) or (unit, ""))[0], dimension)


def words_and_unit(column: str, below: str = "") -> tuple[frozenset[str], str]:
    """Return the words of a name in small letters, and its unit; empty where it has none.

    Examples
    --------
    >>> words_and_unit("Weight [kg]")
    (frozenset({'weight'}), 'kg')
    """
    return _parts(column, below)


def _parts(column: str, below: str) -> tuple[frozenset[str], str]:
    """Return the words of a name in small letters, and its unit."""
    text, unit = column.strip(), below.strip().strip("[](){}")
    if match := _BRACKETS.fullmatch(text):
        inside = next(group for group in match.groups()[1:] if group is not None).strip()
        text = match[1]
        if unit_word(inside) or match[2] is not None:
            unit = inside or unit
        else:
            text = f"{text} {inside}"
    elif not unit and (match := _DIVIDED.fullmatch(text)) and unit_word(match[2]):
        both = f"{match[1].split()[-1]}/{match[2]}"  # "speed deg/s"
        text, unit = (text.removesuffix(both), both) if unit_word(both) and text.endswith(both) else match.groups()
    words = [word for part in _PARTS.findall(text) for word in ([part] if unit_word(part) else _CAMEL.findall(part))]
    if not unit:
        for count in (3, 2, 1):  # "deg per s" before "s"
            last = " ".join(words[-count:])
            if len(words) >= count and (found := unit_word(last)) and (
                    len(words) > count or found[1] != COUNTS) and _is_a_unit(last, alone=len(words) == count):
                words, unit = words[:-count], last
                break
    return frozenset(_plain(word) for word in words if not word.isdigit()), unit


def _is_a_unit(word: str, *, alone: bool) -> bool:
    """Return whether a last word is a unit and not a part of the name: "pos_m" and "q_a" may be either."""
    return len(word) > 1 or word in ("s", "V", "A", "K", "°", "%") or (alone and word in ("v", "S"))


def _plain(word: str) -> str:
    folded = unicodedata.normalize("NFKD", word.casefold().replace("ä", "ae").replace("ö", "oe").replace("ü", "ue"))
    return "".join(c for c in folded if not unicodedata.combining(c)).rstrip("0123456789")


def _role(words: frozenset[str], dimension: str) -> str | None:
    if not words:
        return {"time": TIME, "angle": ANGLE, "current": SUPPLY_CURRENT, "voltage": VOLTAGE,
                "speed": SPEED}.get(dimension)
    if len(words) == 1 and (alone := _ALONE.get(next(iter(words)))):
        words = frozenset((*words, {"current": "current", TIME: "time", ANGLE: "angle"}[alone]))
    has = {name for name, known in _ROLES.items() if words & known}
    if PULSE in has:
        return PULSE
    if COMMAND in has:
        return _command(has, dimension)
    if SPEED in has:
        return SPEED
    if ANGLE in has:
        return ANGLE  # "current position" is no current
    if COUNTS in has or "measured" in has:
        return _measured(has, words, dimension)
    if "current" in has:
        return ARMATURE_CURRENT if words & _MOTOR else SUPPLY_CURRENT
    if VOLTAGE in has:
        return VOLTAGE
    if TIME in has:
        return TIME
    return SOME_TIME if dimension == "time" else None


def _command(has: set[str], dimension: str) -> str | None:
    if TIME in has or SPEED in has or "current" in has:
        return None
    if dimension == "time":
        return PULSE
    return COMMAND_ANGLE if ANGLE in has or dimension == "angle" else COMMAND


def _measured(has: set[str], words: frozenset[str], dimension: str) -> str | None:
    if "current" in has or dimension == "current":
        return ARMATURE_CURRENT if words & _MOTOR else SUPPLY_CURRENT
    if dimension == "voltage":
        return FEEDBACK
    if dimension in ("time", "torque", "temperature"):
        return None
    if COUNTS in has and dimension != "angle":
        return COUNTS
    return ANGLE

# --- Values of a column -----------------------------------------------------------------------------------------------

_SINCE_1970 = 1e8  # s; times that are larger count from no start of a run
MOST_DEGREES = 400.0
"""The largest angle in degrees that is one without being said."""
_TURN = 7.0  # above it no angle of one turn is in radians
_PULSES = (300.0, 3000.0)  # us; what receivers send, and servos take, is 500 to 2500
_STEPS = (5e-4, 0.2)  # s, between samples: one unit of time only puts a step between these
_SAME = 0.8  # of the values differ from all others: nobody counts so finely that it matters
_WHOLE = 0.02  # of a step
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class Guess(NamedTuple):
    """A unit, and what it was seen by."""

    unit: str
    dimension: str
    why: str
    from_first: bool = False


def guess(table: TextTable, column: str, role: str) -> Guess | None:
    """Return the unit that the values of a column can be in, None where that is in doubt."""
    if role in (TIME, SOME_TIME):
        return _time(table, column)
    values = _values(table, column)
    if values is None:
        return None
    largest = float(np.max(np.abs(values)))
    unit: tuple[str, str] | None = None
    if role in (PULSE, COMMAND):
        sent = values[values != 0.0]
        unit = next((("time", name) for name, by in (("us", 1.0), ("ms", 1e3), ("s", 1e6))
                     if sent.size and _PULSES[0] <= by * sent.min() and by * sent.max() <= _PULSES[1]
                     and (role == PULSE or name == "us")), None)
    if unit is None and role in (COMMAND, COMMAND_ANGLE, ANGLE):
        unit = ("angle", "deg") if _TURN < largest <= MOST_DEGREES else None
    elif role in (SUPPLY_CURRENT, ARMATURE_CURRENT):
        whole = bool((values == np.round(values)).all())
        unit = ("current", "mA") if largest > 30.0 else None if whole else ("current", "A")
    elif role == VOLTAGE:
        unit = ("voltage", "mV") if largest > 1000.0 else ("voltage", "V") if 1.0 < largest < 60.0 else None
    return None if unit is None else Guess(unit[1], unit[0], f"its values, {_shown(values)}")


def _time(table: TextTable, column: str) -> Guess | None:
    stamps = stamps_of(table, column)
    if stamps is not None:
        return Guess(stamps.unit, "time", f"its values, {stamps.form}", from_first=True)
    values = _values(table, column)
    if values is None or values.size < 2:
        return None
    steps = np.diff(values)
    steps = steps[steps > 0.0]
    if not steps.size:
        return None
    step = float(np.median(steps))
    unit = next((name for name, by in _TIMES.items() if _STEPS[0] <= by * step <= _STEPS[1]), None)
    if unit is None:
        return None
    return Guess(unit, "time", f"its values, steps of {step:.3g}",
                 from_first=abs(values[0]) * _TIMES[unit] > _SINCE_1970)


def is_increasing(table: TextTable, column: str) -> bool:
    """Return whether a column can be a time: it holds stamps, or numbers that mostly grow."""
    if stamps_of(table, column) is not None:
        return True
    values = _values(table, column)
    return values is not None and values.size > 1 and bool(np.mean(np.diff(values) > 0.0) > 0.5)


def are_counts(table: TextTable, column: str) -> bool:
    """Return whether the values of a column look like counts of a converter: whole, none below 0, beyond a turn."""
    values = _values(table, column) if column in table.header else None
    return values is not None and bool((values == np.round(values)).all() and values.min() >= 0.0
                                       and values.max() > MOST_DEGREES)


def range_of(table: TextTable, column: str) -> str:
    """Return what the values of a column are, for a message.

    Raises
    ------
    InputError
        If a cell holds no number.
    """
    values = table.numbers(column, missing=np.nan)
    finite = values[np.isfinite(values)]
    return f"values {_shown(finite)}" if finite.size else "without values"


def _shown(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.6g} to {high:.6g}" if low < high else f"{low:.6g} throughout"


def _values(table: TextTable, column: str) -> NDArray[np.float64] | None:
    """Return the finite numbers of a column, None where there are none."""
    try:
        values = table.numbers(column, missing=np.nan)
    except InputError:
        return None
    finite = values[np.isfinite(values)]
    return finite if finite.size else None


def step_of(values: NDArray[np.float64]) -> float:
    """Return the step of an instrument that counts; 0 where none is seen.

    All differences are then whole multiples of it, and many values are the same.

    Examples
    --------
    >>> angle = np.sin(np.arange(100) / 20.0)
    >>> round(step_of(0.05 * np.round(angle / 0.05)), 3), step_of(angle)
    (0.05, 0.0)
    """
    apart = np.diff(np.unique(values))
    apart = apart[apart > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-12)]
    if not len(apart) or len(apart) > _SAME * len(values):
        return 0.0
    step = float(np.median(apart[apart < 1.5 * apart.min()]))
    off = np.abs(apart / step - np.round(apart / step))
    return step if float(np.quantile(off, 0.98)) < _WHOLE * max(1.0, float(np.median(apart / step))) else 0.0


# --- Columns of a log file: which signal each one is, and in which unit -----------------------------------------------

SWITCH = "torque_on"
# column -> (kind of command, SI unit); where a file has several, the first of these counts
COMMANDS = {"pulse_width": "pulse_width", "command_angle": "angle", "command_voltage": "voltage"}
UNITS = {name: output.unit for name, output in SIGNALS.items()}
"""SI unit of each signal that a log may hold; one behind the shaft may be measured before a model has it."""
NAMES = (TIME, *COMMANDS, SWITCH, *(name for name in UNITS if name not in COMMANDS))
_OF_SI = {"s": "time", "V": "voltage", "A": "current", "rad": "angle", "rad/s": "speed", "N m": "torque",
          "K": "temperature", "1": "number"}
# dimension -> {suffix of a column: unit}
_SUFFIXES = {
    "time": {"s": "s", "ms": "ms", "us": "us", "ns": "ns"}, "voltage": {"V": "V", "mV": "mV"},
    "current": {"A": "A", "mA": "mA"}, "angle": {"deg": "deg", "rad": "rad"},
    "speed": {"deg_per_s": "deg/s", "rad_per_s": "rad/s", "rpm": "rpm"},
    "torque": {"Nm": "N m", "mNm": "mN m"}, "temperature": {"K": "K"}, "number": {},
}
_NANOSECOND = 1e-9


@dataclass(frozen=True)
class Column:
    """Where a file holds a signal, and what its numbers mean: (scale · number + offset) in `unit`.

    Raw numbers of a program's memory may say minus in a bit, or be written without the sign that they had.

    Parameters
    ----------
    column : str
        As the header says it.
    unit : str
        Of the number after `scale` and `offset`; "iso" and "clock" for times that are dates and times of day.
    scale, offset : float
        Of raw numbers, such as counts.
    from_first : bool
        Times count from the first row; for stamps that count from 1970.
    sign_bit : int, optional
        Bit of the number that says minus, the lower bits the magnitude.
    bits : int, optional
        Of a two's complement: numbers of the upper half are negative.
    """

    column: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    from_first: bool = False
    sign_bit: int | None = None
    bits: int | None = None

    def to_si(self, values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
        """Return the values of the signal `name` in SI; exact where they are in SI already."""
        if self.sign_bit is not None:
            values = np.where(values >= 2.0**self.sign_bit, 2.0**self.sign_bit - values, values)
        if self.bits is not None:
            values = np.where(values >= 2.0 ** (self.bits - 1), values - 2.0**self.bits, values)
        if self.scale != 1.0 or self.offset != 0.0:
            values = self.scale * values + self.offset
        if self.unit == "ns":
            return np.asarray(values / round(1.0 / _NANOSECOND))
        return np.asarray(units.to_si(values, self.unit, dimension_of_signal(name)))


def dimension_of_signal(name: str) -> str:
    """Return the dimension of a column's signal, as `servotwin.units` calls it.

    Examples
    --------
    >>> dimension_of_signal("time"), dimension_of_signal("output_angle")
    ('time', 'angle')
    """
    return "time" if name == TIME else "number" if name == SWITCH else _OF_SI[UNITS[name]]


def si_unit_of(name: str) -> str:
    """Return the SI unit of a column's signal."""
    return units.si_unit(dimension_of_signal(name))


def check_unit(what: str, unit: object, name: str) -> str:
    """Return a unit that measures the signal.

    Raises
    ------
    UnitError
        If it does not.
    """
    if unit == "ns" and dimension_of_signal(name) == "time":
        return "ns"
    if isinstance(unit, str) and unit in CLOCKS and name == TIME:
        return unit
    if not isinstance(unit, str):
        raise UnitError(what, got=unit, allowed="a text, such as " + si_unit_of(name))
    try:
        units.factor(unit, dimension_of_signal(name))
    except UnitError as error:
        more = (", ns" if dimension_of_signal(name) == "time" else "") + (", iso, clock" if name == TIME else "")
        raise UnitError(what, got=error.got, allowed=f"{error.allowed}{more}") from None
    return unit


def columns_of(header: Sequence[str], where: object, *, taken: Container[str] = (),
               says_more: Callable[[str], object] = lambda column: None) -> dict[str, Column]:
    """Return which columns of a header hold which signal, by their names; others are passed over.

    Parameters
    ----------
    header : sequence of str
    where : object
        Place that errors name.
    taken : container of str
        Signals that are known already.
    says_more : callable
        Whether a name that is nearly one of these says something else.

    Raises
    ------
    InputError
        If a signal comes twice, in a unit that is not its own, or is nearly but not quite spelled right.

    Examples
    --------
    >>> columns_of(["time_s", "output_angle_deg", "remark"], "run.csv")["output_angle"].unit
    'deg'
    """
    found: dict[str, Column] = {}
    for column in header:
        name = _name_of(column, where, says_more)
        if name is None or name in taken:
            continue
        if name in found:
            raise InputError(f"{where}: {name}", got=f"columns {found[name].column} and {column}",
                             allowed="one of them")
        found[name] = Column(column, _unit_behind(column, name) or si_unit_of(name))
    return found


def own_columns() -> dict[str, tuple[str, Column]]:
    """Return every name of a column that needs no guess: which signal it is, and what its numbers mean.

    Examples
    --------
    >>> name, column = own_columns()["output_angle_deg"]
    >>> name, column.unit, "angle" in own_columns()
    ('output_angle', 'deg', False)
    """
    names = (f"{name}_{suffix}" if suffix else name for name in NAMES
             for suffix in ("", *_SUFFIXES[dimension_of_signal(name)]))
    return {column: found for column in names for found in columns_of([column], column).items()}


def _unit_behind(column: str, name: str) -> str | None:
    """Return the unit behind a name, None where it is none of the signal's."""
    suffix = column[len(name) + 1:]
    known = _SUFFIXES[dimension_of_signal(name)]
    if suffix in known:
        return known[suffix]
    unit, dimension = unit_word(suffix) or ("", "")
    return unit if suffix and dimension == dimension_of_signal(name) else None


def _name_of(column: str, where: object, says_more: Callable[[str], object]) -> str | None:
    """Return the signal that a column's name says, None where it says none."""
    if column in NAMES:
        return column
    name = max((name for name in NAMES if column.startswith(f"{name}_")), key=len, default="")
    if name:
        if _unit_behind(column, name) is not None:
            return name
        if name in (TIME, SWITCH, "drive"):  # "time_of_day", "drive_mode": another thing
            return None
        raise UnitError(f"{where}: unit of column {column}", got=column[len(name) + 1:],
                        allowed=f"{', '.join(_SUFFIXES[dimension_of_signal(name)]) or 'none'}; without one it is in "
                        f"{si_unit_of(name)}")
    suffixes = sorted({s for known in _SUFFIXES.values() for s in known}, key=len, reverse=True)
    stem = next((column[:-len(s) - 1] for s in suffixes if column.endswith(f"_{s}")), column)
    near = get_close_matches(stem, NAMES, n=1, cutoff=0.85)
    if near and not says_more(column):
        raise InputError(f"{where}: column", got=column,
                         allowed=f'{near[0]}, if that is meant; --columns or "columns" of a sidecar says which column '
                         "is what")
    return None


def switch_value(text: str) -> float:
    """Return 1 or 0 for a word that means on or off, nan for any other.

    Examples
    --------
    >>> switch_value("True"), switch_value("0")
    (1.0, 0.0)
    """
    word = text.strip().lower()
    return 1.0 if word in ("1", "1.0", "true", "on", "yes") else 0.0 if word in (
        "0", "0.0", "false", "off", "no") else math.nan
