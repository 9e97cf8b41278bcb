"""What the name of a foreign column says: a role, and perhaps a unit. Names in English and German."""

from __future__ import annotations

import re
import unicodedata
from typing import NamedTuple

from servotwin.units.words import COUNTS, unit_word

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
    """What a name says.

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
