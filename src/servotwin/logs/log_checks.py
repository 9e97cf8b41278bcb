"""What a log has to fulfil; every failure is one line that names the log and the column."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.logs.columns import UNITS
from servotwin.parameters import GROUPS
from servotwin.parameters.group import AT_LEAST_ONE, FRACTION, NOT_NEGATIVE, POSITIVE
from servotwin.parameters.servo import check_name, unit_of
from servotwin.text import LONGEST_FILE_NAME, checked_name
from servotwin.units import is_finite, is_masked

FEWEST = 3  # samples
_Kind = TypeVar("_Kind", bound=np.generic)
_LARGEST_EDGES = 10_000_000
# signal or kind of command -> (SI unit, largest magnitude that a servo's log can hold, what was probably meant)
LIMITS = {
    **dict.fromkeys(("output_angle", "load_angle", "command_angle", "angle"), ("rad", 100.0, "degrees or counts?")),
    "pulse_width": ("s", 0.1, "microseconds?"),
    **dict.fromkeys(("voltage", "command_voltage", "feedback_voltage", "bus_voltage", "armature_voltage"),
                    ("V", 1e3, "millivolts or counts?")),
    **dict.fromkeys(("armature_current", "supply_current"), ("A", 100.0, "milliamperes?")),
}
_COMMANDS = ("pulse_width", "command_angle", "command_voltage")
_RANGES = {POSITIVE: (np.nextafter(0.0, 1.0), np.inf), NOT_NEGATIVE: (0.0, np.inf), AT_LEAST_ONE: (1.0, np.inf),
           FRACTION: (0.0, 1.0)}


def texts(name: object, motion: object, source: object) -> str:
    """Return how errors call a log."""
    if not isinstance(name, str) or not name:
        raise InputError("name of a log", got=name, allowed='a text, such as "run 1"')
    for key, value in (("motion", motion), ("source", source)):
        if not isinstance(value, str):
            raise InputError(f"log {name!r}: {key}", got=value, allowed="a text")
    checked_name("name of a log", name, LONGEST_FILE_NAME)
    checked_name(f"log {name!r}: motion", str(motion))
    return f"log {name!r}"


def choice(what: str, value: object, allowed: tuple[str, ...]) -> None:
    """Raise unless it is one of a few words."""
    if value not in allowed:
        raise InputError(what, got=value, allowed=", ".join(allowed))


def too_few(where: str, got: int) -> InputError:
    """Return the error of a log that is too short."""
    return InputError(where, got=f"{got} sample{'s' * (got != 1)}", allowed=f"at least {FEWEST} samples")


def times(where: str, time: object) -> NDArray[np.float64]:
    """Return the times; they increase, and there are at least three."""
    t = _numbers(f"{where}: time", time)
    if t.size < FEWEST:
        raise too_few(where, t.size)
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise InputError(f"{where}: time of sample {bad[0]}", got=float(t[bad[0]]), allowed="a finite number [s]")
    bad = np.flatnonzero(np.diff(t) <= 0.0)
    if bad.size:
        k = int(bad[0]) + 1
        stands = "stands still" if t[k] == t[k - 1] else "runs backwards"
        raise InputError(f"{where}: time {stands} at sample {k}", got=f"{t[k]:.9g} s after {t[k - 1]:.9g} s",
                         allowed="increasing times")
    return frozen(t)


def command(where: str, values: object, kind: str, hold: str, n: int) -> NDArray[np.float64]:
    """Return the command; it is finite or, of pulses and angles that are held, nan; a pulse width is positive."""
    y = _column(f"{where}: command", values, n)
    silent = np.isnan(y)
    if n and silent.all():
        raise InputError(f"{where}: command", got="no value in any sample", allowed="at least one value")
    bad = np.flatnonzero(~np.isfinite(y) & ~(silent & (kind != "voltage") & (hold == "previous")))
    if bad.size:
        why = "a finite number" + ("" if not silent[bad[0]] else "; only pulses and angles may have nan, for no pulses"
                                   if kind == "voltage" else '; nan means no pulses only with command_hold "previous"')
        raise InputError(f"{where}: command of sample {bad[0]}", got=float(y[bad[0]]), allowed=why)
    y[silent] = np.nan  # one and the same for hashes, whatever nan was given
    if kind == "pulse_width" and (y <= 0.0).any():
        k = int(np.argmax(y <= 0.0))
        raise InputError(f"{where}: pulse width of sample {k}", got=f"{y[k]:g} s",
                         allowed="a positive width, or nan where no pulse is sent")
    _plausible(f"{where}: command ({kind})", y, kind)
    return frozen(y)


def measured(where: str, columns: object, n: int, angles: tuple[str, ...]) -> dict[str, NDArray[np.float64]]:
    """Return what was measured; one signal tells the angle, and no value is infinite."""
    if not isinstance(columns, Mapping):
        raise InputError(f"{where}: measured", got=type(columns).__name__, allowed="a mapping of names to arrays")
    made = {}
    for name, values in columns.items():
        if name not in UNITS:
            raise UnknownNameError(f"signal of {where}", str(name), UNITS)
        if name in _COMMANDS:
            raise InputError(f"{where}: measured signals", got=name, allowed="no command, which belongs in `command`")
        y = _column(f"{where}: {name}", values, n)
        bad = np.flatnonzero(np.isinf(y))
        if bad.size:
            raise InputError(f"{where}: {name} of sample {bad[0]}", got=float(y[bad[0]]),
                             allowed="a finite number, or nan where nothing was measured")
        _plausible(f"{where}: {name}", y, name)
        made[name] = frozen(y)
    if not any(name in made for name in angles):
        raise InputError(f"{where}: measured signals", got=", ".join(made) or "none",
                         allowed=f"among them {' or '.join(angles)}")
    return made


def not_measured(log: str, name: str, known: Iterable[str]) -> UnknownNameError:
    """Return the error of a signal that a log does not have."""
    return UnknownNameError(f"measured signal of log {log!r}", name, known)


def switch(where: str, values: object, n: int) -> NDArray[np.bool_]:
    """Return an array of true and false, which may be given as 1 and 0."""
    y = _column(f"{where}: torque_on", values, n)
    bad = np.flatnonzero((y != 0.0) & (y != 1.0))
    if bad.size:
        raise InputError(f"{where}: torque_on of sample {bad[0]}", got=float(y[bad[0]]), allowed="true or false")
    return frozen(np.asarray(y == 1.0))


def parameters(where: str, values: object) -> dict[str, float]:
    """Return the servo parameters of a log; their names are known, and each is a number within its range."""
    made = {}
    for name, value in _mapping(f"{where}: parameters", values).items():
        group, key = check_name(name)
        rule = GROUPS[group].__dataclass_fields__[key].metadata["rule"]
        if isinstance(rule, tuple) or rule == "table":
            raise InputError(f"{where}: parameters, {name}", got=value, allowed="the name of a number")
        low, high = _RANGES.get(rule, (-np.inf, np.inf))
        if not is_finite(value) or not low <= float(value) <= high:
            raise InputError(f"{where}: parameters, {name}", got=value, allowed=f"{rule} [{unit_of(name)}]")
        made[name] = float(value)
    return made


def conditions(where: str, values: object) -> dict[str, float | str]:
    """Return the labels of a log: texts and finite numbers."""
    made: dict[str, float | str] = {}
    for name, value in _mapping(f"{where}: conditions", values).items():
        if not isinstance(name, str) or not (isinstance(value, str) or is_finite(value)):
            raise InputError(f"{where}: conditions, {name}", got=value, allowed="a text or a finite number")
        for text in (name, value):
            if isinstance(text, str):
                checked_name(f"{where}: conditions, {name}", text)
        made[name] = value if isinstance(value, str) else float(value)
    return made


def windows(where: str, values: object) -> tuple[tuple[float, float], ...]:
    """Return the windows of time that are left out; each starts before it stops."""
    made = []
    if not isinstance(values, list | tuple):
        raise InputError(f"{where}: left_out", got=values, allowed="a list of windows [start, stop]")
    for window in values:
        if (not isinstance(window, list | tuple) or len(window) != 2 or not all(is_finite(x) for x in window)
                or not window[0] < window[1]):
            raise InputError(f"{where}: left_out", got=window, allowed="windows [start, stop] with start < stop [s]")
        made.append((float(window[0]), float(window[1])))
    return tuple(made)


def frame_edges(time: NDArray[np.float64], sent: NDArray[np.bool_], period: object) -> NDArray[np.float64]:
    """Return regular frame edges [s], counted from the first sample, without those while no pulses are sent."""
    if not is_finite(period) or not period > 0.0:
        raise InputError("frame_period", got=period, allowed="a positive number [s]")
    since = time - time[0]
    count = np.floor(since[-1] / period * (1.0 + 1e-12)) + 1.0
    if not count <= _LARGEST_EDGES:
        raise InputError("frame_period", got=period, allowed=f"at most {_LARGEST_EDGES} frames in a log")
    edges = np.arange(int(count)) * float(period)
    # a sample that is a rounding later than the edge still decides it
    latest = np.searchsorted(since, edges + 1e-9 * period, side="right") - 1
    return np.asarray(edges[sent[latest]])


def _mapping(what: str, values: object) -> Mapping[str, Any]:
    if not isinstance(values, Mapping):
        raise InputError(what, got=values, allowed="a mapping of names to values")
    return values


def _numbers(what: str, values: object) -> NDArray[np.float64]:
    try:
        y = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(what, got="values that are no numbers", allowed="an array of numbers") from None
    if is_masked(values):  # what a mask hides would count
        raise InputError(what, got="a masked array", allowed="numbers, nan where nothing was measured")
    if y.ndim != 1:
        raise InputError(what, got=f"an array of shape {y.shape}", allowed="an array with one dimension")
    return y


def _column(what: str, values: object, n: int) -> NDArray[np.float64]:
    y = _numbers(what, values)
    if y.size != n:
        raise InputError(what, got=f"{y.size} values", allowed=f"{n}, as many as times")
    return y


def largest_of(name: str) -> float:
    """Return the largest magnitude (SI) that a servo's log can hold of a signal or kind of command."""
    return LIMITS.get(name, ("", np.inf, ""))[1]


def _plausible(what: str, values: NDArray[np.float64], name: str) -> None:
    """Raise if a value is too large for its unit."""
    unit, limit, meant = LIMITS.get(name, ("", np.inf, ""))
    largest = values[np.argmax(np.abs(np.nan_to_num(values)))]
    if abs(largest) > limit:
        raise InputError(what, got=f"{largest:g} {unit}", allowed=f"at most {limit:g} {unit} in magnitude: {meant}")


def frozen(values: NDArray[_Kind]) -> NDArray[_Kind]:
    """Return an array to which nobody writes any more."""
    values.setflags(write=False)
    return values
