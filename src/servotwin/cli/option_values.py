"""The command signal out of the options of `servotwin simulate`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from servotwin import loads, signals
from servotwin.errors import CommandError, InputError, LoadError, UnitError, UnknownNameError
from servotwin.loads import Load, Part
from servotwin.models import Model, mid_travel
from servotwin.signals import Signal
from servotwin.tables import read_table
from servotwin.units import in_letters, to_si
from servotwin.units.quantities import bare_unit, number_and_unit, quantity, unit_named
from servotwin.units.words import UNSIGNED

# --- Numbers and columns out of words and files -----------------------------------------------------------------------

def numbers(what: str, text: str, names: tuple[str, ...], *, required: int | None = None,
            alone: str = "numbers alone") -> list[float]:
    """Return the numbers of a text such as ``"0:180"``.

    Parameters
    ----------
    what : str
        Name of the quantity in an error.
    text : str
        Numbers, with colons between them.
    names : tuple of str
        Name of each number.
    required : int, optional
        How many must be there; all unless given.
    alone : str
        Text that is allowed where several numbers are asked for, such as where their unit is said.

    Raises
    ------
    InputError
        If there are too few or too many, or one is no number.

    Examples
    --------
    >>> numbers("--step", "0:180", ("BEFORE", "AFTER"))
    [0.0, 180.0]
    """
    least = len(names) if required is None else required
    form = ":".join(names[:least]) + "".join(f"[:{name}]" for name in names[least:])
    words = text.split(":")
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if not least <= len(values) <= len(names):
        raise InputError(what, got=text, allowed=f"{form}, {alone}" if len(names) > 1 else "a number alone")
    return values


def columns_in_si(path: Path, *wanted: Mapping[str, float]) -> list[list[float]]:
    r"""Return columns of a CSV file with a header, in SI.

    Parameters
    ----------
    path : Path
    *wanted : mapping of str to float
        For each column, the names that it may have, and the factor to SI of each.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, lacks a column, or has a value that is no number.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "torque.csv"
    >>> _ = file.write_text("time_s,torque_mNm\n0,0\n1,200\n")
    >>> columns_in_si(file, {"time_s": 1.0}, {"torque_Nm": 1.0, "torque_mNm": 1e-3})
    [[0.0, 1.0], [0.0, 0.2]]
    """
    known = {name for names in wanted for name in names}
    table = read_table(path, lambda name: name in known)
    table.check_lengths(shorter=True)
    columns = []
    for names in wanted:
        name = next((name for name in names if name in table.header), None)
        if name is None:
            raise InputError(f"{path}: columns", got=", ".join(table.header), allowed="one of " + ", ".join(names))
        columns.append([names[name] * value for value in table.numbers(name).tolist()])
    return columns


# --- Figures as sheets print them -------------------------------------------------------------------------------------

_VOLTS = rf"(?P<volts>{UNSIGNED})\s*(?i:v|volts?)(?i:\s*(?:dc))?(?i:[\s,]*(?:no|without)[\s-]*load)?"
# behind the figure, in brackets or not, and in front of it: "(6V)", "@(6.8 V)", "at 6v", "6.0 V", "6V: ..."
_VOLTAGES = (re.compile(rf"\s*(?P<figure>\S.*?)\s*@?\s*[(\[]\s*(?:@|(?i:at)\b)?\s*{_VOLTS}\s*[)\]]\s*"),
             re.compile(rf"\s*(?P<figure>\S.*?)(?:\s*@|\s+(?i:at)\b|\s)\s*{_VOLTS}\s*"),
             re.compile(rf"\s*{_VOLTS}\s*[:=]\s*(?P<figure>\S.*?)\s*"))


def speed(option: str, text: str) -> float:
    """Return a speed in rad/s; sheets print the time for 60 degrees.

    Raises
    ------
    InputError
        If it is no positive number with a unit of speed.

    Examples
    --------
    >>> round(speed("--speed", "0.23 s/60deg"), 3), round(speed("--speed", "60 rpm"), 3)
    (4.553, 6.283)
    >>> round(speed("--speed", "0.23s/60"), 3), round(speed("--speed", "60 degrees in 0.23 sec"), 3)
    (4.553, 4.553)
    """
    allowed = "0.23 s/60deg, or a number with deg/s, rad/s or rpm"
    plain = re.sub(r"\s+(?:per|in)\s+", "/", text)
    number, unit = number_and_unit(plain) or (math.nan, "")
    turned = re.fullmatch(rf"deg(?:rees?)?/({UNSIGNED})s(?:ecs?|econds?)?", re.sub(r"\s", "", in_letters(unit)).lower())
    try:
        if re.fullmatch(r"s(ecs?|econds?)?/60(deg(rees?)?)?", bare_unit(unit)):
            value = math.pi / 3.0 / number if number else math.nan
        elif turned:
            value = math.radians(number) / float(turned[1]) if float(turned[1]) else math.nan
        else:
            value = to_si(number, unit_named(unit, "speed"), "speed")
    except UnitError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise InputError(option, got=text, allowed=allowed)
    return value


def rate(option: str, text: str) -> float:
    """Return an angle per pulse width in rad/s.

    Raises
    ------
    InputError
        If it is none.

    Examples
    --------
    >>> [round(rate("--rate", text)) for text in ("0.1 deg/us", "45deg/400us")]
    [1745, 1963]
    """
    found = re.fullmatch(rf"\s*\+?({UNSIGNED})\s*deg(?:rees?)?\s*/\s*(\d+(?:\.\d+)?)?\s*us(?:ec)?\s*",
                         in_letters(text))
    if found is None or not float(found[1]) > 0.0 or not float(found[2] or 1.0) > 0.0:
        raise InputError(option, got=text, allowed="0.1 deg/us or 45 deg/400us")
    return math.radians(float(found[1])) / (float(found[2] or 1.0) * 1e-6)


def two_ends(option: str, text: str, dimension: str) -> tuple[float, float]:
    """Return the two ends of a range of pulse widths [s] or of voltages [V]: dimension "time" or "voltage".

    Raises
    ------
    InputError
        If there are not two, with a unit.

    Examples
    --------
    >>> two_ends("--pulse-range", "556-2410 us", "time"), two_ends("--voltage-range", "4.8V~7.2V", "voltage")
    ((0.000556, 0.00241), (4.8, 7.2))
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(us|ms|mV|V)?\s*(?:-|to|:|\.\.|\u2013|~)\s*"
                         r"(\d+(?:\.\d+)?)\s*([^\W\d]+)\s*", in_letters(text))
    if found is None:
        raise InputError(option, got=text, allowed={
            "time": "two pulse widths with a unit, such as 500-2500 us",
            "voltage": "two voltages with a unit, such as 4.8-7.2 V"}[dimension])
    return (quantity(option, f"{found[1]} {found[2] or found[4]}", dimension, positive=True),
            quantity(option, f"{found[3]} {found[4]}", dimension, positive=True))


def ratio(option: str, text: str) -> float:
    """Return a gear ratio, motor turns for one turn of the output.

    Raises
    ------
    InputError
        If it is none.

    Examples
    --------
    >>> ratio("--gear-ratio", "280:1"), ratio("--gear-ratio", "1/310")
    (280.0, 310.0)
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(?:[:/]\s*(\d+(?:\.\d+)?))?\s*", text)
    one, two = (float(found[1]), float(found[2] or 1.0)) if found else (0.0, 0.0)
    if not (one > 0.0 and two > 0.0):
        raise InputError(option, got=text, allowed="motor turns for one turn of the output, such as 280 or 280:1")
    return max(one, two) / min(one, two)


def without_voltage(option: str, text: str, usual: float | None) -> tuple[str, float]:
    """Return a figure's text without its voltage, and the voltage [V].

    Parameters
    ----------
    option, text : str
    usual : float, optional
        Voltage of a figure that names none [V].

    Raises
    ------
    InputError
        If there is no voltage, or one that is none.

    Examples
    --------
    >>> without_voltage("--torque", "1.29 N m @ 6.0", None), without_voltage("--torque", "13 kgf.cm at 6V", None)
    (('1.29 N m', 6.0), ('13 kgf.cm', 6.0))
    >>> without_voltage("--speed", "0.17sec/60degree (6v, no load)", None)
    ('0.17sec/60degree', 6.0)
    """
    for form in _VOLTAGES:
        found = form.fullmatch(text)
        if found is not None:
            return found["figure"], quantity(option, f"{found['volts']} V", "voltage", positive=True)
    front, at, back = (part.strip() for part in re.sub(r"\s+at\s+", "@", text, count=1).partition("@"))
    if not at:
        if usual is None:
            raise InputError(option, got=text, allowed="also the supply voltage that it holds for, such as "
                             f'"{text} @6.0V", or --at VOLTAGE for all')
        return front, usual
    return front, quantity(option, back, "voltage", bare=True, positive=True)


# --- The load out of the words of `--load` ----------------------------------------------------------------------------

FORMS = {
    "inertia": "KG_M2", "viscous": "NM_S_PER_RAD", "torque": "NM", "coulomb": "NM", "arm": "MASS:LENGTH",
    "pendulum": "KG:M[:HANGING_DEG]", "spring": "NM_PER_RAD[:REST_DEG]", "recorded": "FILE.csv",
}
_DIMENSIONS = {"inertia": "inertia", "viscous": "torque per speed", "torque": "torque", "coulomb": "torque"}
_NEXT = re.compile(r",(?=\s*[A-Za-z_]+\s*=)")  # a comma that begins another part
_TIMES = {"time_s": 1.0, "time_ms": 1e-3, "time": 1.0}
_TORQUES = {"torque_Nm": 1.0, "torque_mNm": 1e-3, "torque": 1.0}


def load_from(words: Sequence[str], model: Model | None = None) -> Load:
    """Return the load that `--load` options describe; a free shaft without any.

    Parameters
    ----------
    words : sequence of str
        Such as ``"inertia=1e-3,torque=0.5kgf.cm"``; numbers without unit in SI, angles in degrees.
    model : Model, optional
        Servo under the load: where the arm of ``"arm=0.5kg:10cm"`` is horizontal is the middle of its travel.

    Raises
    ------
    LoadError
        If a part is malformed or out of range, or an arm has no servo that it hangs on.
    UnknownNameError
        If there is no such part.

    Examples
    --------
    >>> load = load_from(["inertia=1e-3,torque=0.1", "pendulum=0.1:0.12:90"])
    >>> load.inertia, load.torque, load.pendulum.length
    (0.001, 0.1, 0.12)
    """
    total = Load()
    for name, value in parts_of(words):
        try:
            total = total + (_arm(value, model) if name == "arm" else _MAKERS[name](value))
        except InputError as error:
            what = error.what if error.what == f"--load {name}" else f"--load {name}: {error.what}"
            raise LoadError(what, got=error.got, allowed=error.allowed) from None
    return total


def recorded_files(words: Sequence[str]) -> list[Path]:
    """Return the files that `--load` options read.

    Examples
    --------
    >>> [path.name for path in recorded_files(["inertia=1,recorded=torque.csv"])]
    ['torque.csv']
    """
    return [Path(value) for name, value in parts_of(words) if name == "recorded"]


def described(words: Sequence[str]) -> str:
    """Return the load in words.

    Examples
    --------
    >>> described([])
    'none (free shaft)'
    """
    return ", ".join(f"{name} {value}" for name, value in parts_of(words)) or "none (free shaft)"


def parts_of(words: Sequence[str]) -> list[tuple[str, str]]:
    """Return name and value of each part.

    Raises
    ------
    LoadError, UnknownNameError
        If there is no value, or no such part.

    Examples
    --------
    >>> parts_of(["inertia=1e-3,arm=0.5kg:10cm"])
    [('inertia', '1e-3'), ('arm', '0.5kg:10cm')]
    """
    parts = []
    for text in (piece for word in words for piece in _NEXT.split(word)):
        name, equals, value = (text.partition("=")[k].strip() for k in range(3))
        if not equals or not value:
            raise LoadError("--load", got=text, allowed=" or ".join(f"{key}={form}" for key, form in FORMS.items()))
        if name not in FORMS:
            raise UnknownNameError("part of --load", name, FORMS)
        parts.append((name, value))
    return parts


def mass_on_arm(text: str) -> tuple[float, float]:
    """Return mass [kg] and length [m] of an arm.

    Examples
    --------
    >>> mass_on_arm("0.5kg:10cm")
    (0.5, 0.1)
    """
    mass, colon, length = text.partition(":")
    if not colon:
        raise LoadError("--load arm", got=text, allowed="MASS:LENGTH, such as 0.5kg:10cm")
    return (quantity("--load arm", mass, "mass", positive=True),
            quantity("--load arm", length, "length", positive=True))


def torque_of(text: str) -> float:
    """Return a torque [N m], bare or with a unit; the sign counts.

    Examples
    --------
    >>> torque_of("-0.1"), round(torque_of("1 kgf.cm"), 4)
    (-0.1, 0.0981)
    """
    return _with_unit("torque", text)


def _with_unit(name: str, text: str) -> float:
    """Return a number in SI, or one with a unit; the sign counts."""
    return quantity(f"--load {name}", text, _DIMENSIONS[name], bare=True)


def _single(make: Callable[[float], Part], name: str) -> Callable[[str], Part]:
    return lambda text: make(_with_unit(name, text))


def _arm(text: str, model: Model | None) -> Part:
    mass, length = mass_on_arm(text)
    if model is None:
        raise LoadError("--load arm", got=text, allowed="only where a servo carries it")
    return loads.Pendulum(mass=mass, length=length, hanging_angle=mid_travel(model) - 0.5 * math.pi)


def _pendulum(text: str) -> Part:
    mass, length, *hanging = numbers("--load pendulum", text, ("KG", "M", "HANGING_DEG"), required=2)
    return loads.Pendulum(mass=mass, length=length, hanging_angle=math.radians(hanging[0]) if hanging else 0.0)


def _spring(text: str) -> Part:
    stiffness, *rest = numbers("--load spring", text, ("NM_PER_RAD", "REST_DEG"), required=1)
    return loads.Spring(stiffness, math.radians(rest[0]) if rest else 0.0)


def _recorded(text: str) -> Part:
    time, torque = columns_in_si(Path(text), _TIMES, _TORQUES)
    return loads.Recorded(time, torque)


_MAKERS: dict[str, Callable[[str], Part]] = {
    "inertia": _single(loads.Inertia, "inertia"),
    "viscous": _single(loads.Viscous, "viscous"),
    "torque": _single(loads.Constant, "torque"),
    "coulomb": _single(loads.Coulomb, "coulomb"),
    "pendulum": _pendulum,
    "spring": _spring,
    "recorded": _recorded,
}


# --- Masses, arms and torques out of the words of `--lift`, `--arm` and `--load` --------------------------------------

_HERE = ("arm", "torque")  # parts of a load that a sheet takes


class AskedLift(NamedTuple):
    """The lift, mass [kg] and arm [m], and a torque [N m] whose point on the curves is shown."""

    lift: tuple[float, float] | None
    torque: float | None


def asked_lift(lift: str | None, arm: str | None) -> tuple[float, float] | None:
    """Return mass [kg] and arm [m] of `--lift` and `--arm`; None where neither is given.

    Raises
    ------
    InputError
        If one of them is missing or malformed.

    Examples
    --------
    >>> asked_lift("500g", "10cm")
    (0.5, 0.1)
    """
    if lift is None and arm is None:
        return None
    if lift is None or arm is None:
        raise InputError("--arm needs --lift MASS" if lift is None else "--lift needs --arm LENGTH",
                         allowed="both, such as --lift 0.5kg --arm 10cm")
    return quantity("--lift", lift, "mass", positive=True), quantity("--arm", arm, "length", positive=True)


def loads_of(lift: str | None, arm: str | None, load: Sequence[str]) -> AskedLift:
    """Return what the options ask for.

    Raises
    ------
    InputError
        If something is asked for twice, or the load has a part that no sheet takes.

    Examples
    --------
    >>> loads_of(None, None, ["arm=0.5kg:10cm", "torque=0.3"])
    AskedLift(lift=(0.5, 0.1), torque=0.3)
    """
    found, torque = asked_lift(lift, arm), None
    for name, value in parts_of(load):
        if name not in _HERE:
            raise InputError(f"--load {name} of servotwin curves",
                             allowed=" or ".join(f"{part}={FORMS[part]}" for part in _HERE)
                             + "; servotwin simulate takes all loads")
        if (name == "arm" and found is not None) or (name == "torque" and torque is not None):
            raise InputError(f"--load {name}", got=value, allowed="one of a kind, and not beside --lift")
        if name == "arm":
            found = mass_on_arm(value)
        else:
            torque = torque_of(value)
    return AskedLift(found, torque)


# --- Individual pulses out of a file ----------------------------------------------------------------------------------

_EDGES = {"time_s": 1.0, "time_ms": 1e-3, "time": 1.0}
_WIDTHS = {"pulse_width_us": 1e-6, "pulse_width_ms": 1e-3, "pulse_width_s": 1.0, "pulse_width": 1.0}


def pulses_of(path: Path) -> Signal:
    """Return the pulses of a file."""
    edges, widths = columns_in_si(path, _EDGES, _WIDTHS)
    try:
        return signals.pulse_train(edges, widths, unit="s")
    except InputError as error:
        raise CommandError(f"{path}: {error.what}", got=error.got, allowed=error.allowed) from None
