"""The arguments of `identify`, checked before anything runs, and what is wrong with logs before any fit.

No check of logs fits a parameter or runs a simulation, and nothing is mended unless the caller asks for it.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import TIME, with_loop_gain
from servotwin.identification.fitting.suspicions.followed import centred, not_followed, spans, turned, wraps
from servotwin.identification.fitting.suspicions.look import Finding, Look, look, missing_rows, refused, wrong_stamps
from servotwin.logs.log import Log
from servotwin.models import BoundedServo, DigitalServo, Model, PulseServo, PulseServoInductive, default_model
from servotwin.parameters import Servo
from servotwin.simulation.lanes.inputs import LOAD_NAMES
from servotwin.simulation.progress import duration_left, lines, on_terminal
from servotwin.units import is_finite

if TYPE_CHECKING:
    pass


# --- The arguments of `identify`, checked before anything runs, and the warnings for a reader afterwards --------------

_KINDS = (PulseServo, PulseServoInductive, BoundedServo, DigitalServo)
_PLANT = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque")
_LOOP_GAIN = "firmware.proportional_gain"
_FITTED = ("output_angle", "feedback_voltage", "armature_current", "supply_current")
_TOO_FAST = 4.0  # times the speed without load
_PATIENCE = 1.0  # s before time left is shown


def checked_logs(logs: Any) -> tuple[Log, ...]:
    """Return logs, at least one of which moves."""
    from servotwin.logs.readers import read_logs

    found = read_logs(logs) if isinstance(logs, str | Path) else [logs] if isinstance(logs, Log) else logs
    if not isinstance(found, Sequence) or not found or not all(isinstance(log, Log) for log in found):
        raise InputError("logs", got=found, allowed="a list of at least one Log, or a path of logs")
    names = [log.name for log in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"logs: {twice!r}", got=f"{names.count(twice)} logs of this name", allowed="one")
    if all(log.is_constant for log in found):
        raise InputError(f"log {names[0]!r}" if len(found) == 1 else f"all {len(found)} logs",
                         got="an angle that never changes", allowed="a log in which the servo moves")
    return tuple(found)


def checked_servo(servo: Any, kind: Any) -> Model:
    """Return the model that is fitted: of class `kind`, or where that is None the one that stands for the servo."""
    if not isinstance(servo, Servo):
        raise InputError("servo of a fit", got=servo, allowed="a servo, such as load_servo(...)")
    if kind is None:
        return default_model(servo)
    if kind not in _KINDS:
        raise InputError("model of a fit", got=getattr(kind, "__name__", kind),
                         allowed=", ".join(k.__name__ for k in _KINDS))
    model: Model = kind(servo)
    return model


def usual_free(model: Model, logs: Sequence[Log] = ()) -> tuple[str, ...]:
    """Return what is searched unless the caller says: what an angle under command and load can tell.

    Of a servo on a bus that is the plant, and the gain of its loop where neither registers nor logs say it.
    """
    if isinstance(model, DigitalServo):
        if not model.takes_goals:
            return (*_PLANT, _LOOP_GAIN, "firmware.derivative_gain", "firmware.deadband_angle",
                    "potentiometer.feedback_gain")
        said = model.servo.source(_LOOP_GAIN) if model.servo.get(_LOOP_GAIN) is not None else None
        knows_gain = said is not None and said.origin in ("literature", "datasheet", "measured")
        known = knows_gain or any(_LOOP_GAIN in with_loop_gain(log, model).parameters for log in logs)
        return (*_PLANT, "motor.motor_viscous_friction", *(() if known else (_LOOP_GAIN,)))
    gain, deadband = (("electronics.bridge_gain", "electronics.voltage_deadband") if isinstance(model, BoundedServo)
                      else ("electronics.stretcher_gain", "electronics.deadband"))
    return (*_PLANT, gain, deadband, "potentiometer.feedback_gain")


def checked_sensors(logs: Sequence[Log], sensors: Sequence[str] | None, model: Model) -> tuple[str, ...]:
    """Return the names of measured signals that are compared."""
    there = dict.fromkeys(name for log in logs for name in log.measured)
    known = model.signals_with(*(log.load for log in logs))
    if sensors is not None:
        if isinstance(sensors, str) or not isinstance(sensors, Sequence):
            raise InputError("sensors", got=sensors, allowed="a list of " + ", ".join(there))
        for name in sensors:
            if name not in there or name not in known:
                got = f"{name}, which {type(model).__name__} does not have" if name in there else name
                raise InputError("sensors", got=got, allowed=", ".join(n for n in there if n in known))
        if not any(name in ("output_angle", "feedback_voltage") for name in sensors):
            raise InputError("sensors", got=", ".join(sensors), allowed="output_angle or feedback_voltage among them")
        return tuple(dict.fromkeys(sensors))
    found = [name for name in _FITTED if name in there and name in known]
    without_angle = any("output_angle" not in log.measured for log in logs)
    return tuple(name for name in found if name != "feedback_voltage" or without_angle or "output_angle" not in found)


def shared_load(logs: Sequence[Log], free: Sequence[str]) -> dict[str, float]:
    """Return what the logs' loads give for the load parameters that are searched; it has to be the same in all."""
    found = {}
    for name in free:
        if name not in LOAD_NAMES:
            continue
        values = {_of_load(log, name) for log in logs}
        if len(values) > 1:
            raise InputError(f"free: {name}", got=f"{len(values)} different values in the logs",
                             allowed="one and the same load in all logs")
        value = values.pop()
        if value is None:
            raise InputError(f"free: {name}", got=f"a load without it in log {logs[0].name!r}",
                             allowed="a load that has it")
        found[name] = value
    return found


def _of_load(log: Log, name: str) -> float | None:
    _, *part, key = name.split(".")
    if not part:
        return float(getattr(log.load, key))
    parts = getattr(log.load, f"{part[0]}s")
    value = getattr(parts[0], key) if len(parts) == 1 else None
    return None if value is None else float(value)


def check_speeds(logs: Sequence[Log], model: Model) -> None:
    """Raise if a log shows the shaft faster than the servo could be by far: another servo, or another unit."""
    gain = model.value("gear.gear_reduction") * model.value("motor.back_emf_constant")
    for log in logs:
        if log.angle_name != "output_angle":
            continue
        voltage = log.parameters.get("supply.open_circuit_voltage", model.value("supply.open_circuit_voltage"))
        used = log.used("output_angle") & log.sent
        time, angle = log.time[used], log.measured["output_angle"][used]
        if len(time) < 5:
            continue
        speed = float(np.quantile(np.abs((angle[4:] - angle[:-4]) / (time[4:] - time[:-4])), 0.98))
        limit = voltage / gain
        if speed > _TOO_FAST * limit:
            raise InputError(
                f"log {log.name!r} contradicts the servo", got=f"a shaft at {speed:.3g} rad/s",
                allowed=f"about {limit:.3g} rad/s, the speed of {model.servo.name} without load at {voltage:g} V; "
                        "check the unit of the angle, and the servo")


def checked_loss(loss: str, huber: float) -> float:
    """Return the limit beyond which residuals count in proportion."""
    if loss not in ("huber", "squares"):
        raise InputError("loss", got=loss, allowed='"huber" or "squares"')
    return huber if loss == "huber" else math.inf


def checked_list(what: str, names: Any) -> tuple[str, ...]:
    """Return a list of names."""
    if isinstance(names, str) or not isinstance(names, Sequence) or not all(isinstance(n, str) for n in names):
        raise InputError(what, got=names, allowed="a list of names")
    return tuple(names)


def checked_words(what: str, words: Any, allowed: Sequence[str]) -> tuple[str, ...]:
    """Return a list of words out of some, none of them twice."""
    if isinstance(words, str) or not isinstance(words, Sequence) or not all(isinstance(w, str) for w in words):
        raise InputError(what, got=words, allowed="a list of " + ", ".join(allowed))
    for word in words:
        if word not in allowed or list(words).count(word) > 1:
            raise InputError(what, got=word if word not in allowed else f"{word} twice", allowed=", ".join(allowed))
    return tuple(words)


def checked_flag(what: str, flag: Any) -> bool:
    """Return whether something is wanted."""
    if not isinstance(flag, bool):
        raise InputError(what, got=flag, allowed="True or False")
    return flag


def checked_level(level: Any) -> float:
    """Return the level of intervals."""
    if isinstance(level, bool) or not isinstance(level, int | float) or not 0.0 < level < 1.0:
        raise InputError("level", got=level, allowed="a number between 0 and 1, such as 0.95")
    return float(level)


def checked_noise(noise: Any, sensors: Sequence[str]) -> dict[str, float] | None:
    """Return the noise of sensors [SI], as far as it is given."""
    if noise is None:
        return None
    if not isinstance(noise, Mapping):
        raise InputError("noise", got=noise, allowed="a mapping of sensors to standard deviations (SI)")
    for name, value in noise.items():
        if name not in (*sensors, TIME):
            raise InputError("noise", got=name, allowed=", ".join((*sensors, TIME)))
        if not (is_finite(value) and value > 0.0):
            raise InputError(f"noise of {name}", got=value, allowed="a positive number (SI)")
    return {name: float(value) for name, value in noise.items()}


def check_fitted(logs: Sequence[Log], fitted: Sequence[int], sensors: Sequence[str], numbers: int) -> None:
    """Raise if the logs that are fitted are too little for what is searched."""
    some = [logs[k] for k in fitted]
    if all(log.is_constant for log in some):
        raise InputError("logs that are fitted", got="an angle that never changes", allowed="a log in which the servo "
                         "moves; hold out others")
    values = sum(int(log.used(name).sum()) for log in some for name in sensors if name in log.measured)
    if values <= numbers:
        raise InputError("logs that are fitted", got=f"{values} samples with a value",
                         allowed=f"more than the {numbers} numbers that are searched")


def checked_count(what: str, number: Any, *, least: int) -> int:
    """Return a whole number."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
        raise InputError(what, got=number, allowed=f"a whole number of at least {least}")
    return int(number)


@contextmanager
def shown(progress: Any) -> Iterator[Callable[[float, str], None]]:
    """Give a function that is called with the share that is done and the work in progress."""
    if callable(progress):
        yield lambda share, text: (progress(share, text), None)[1]
        return
    if not isinstance(progress, bool):
        raise InputError("progress", got=progress, allowed="True, False or a function of the share done and a text")
    if not progress:
        yield lambda share, text: None
        return
    if not on_terminal():
        yield lines("fit")
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(),
                   TextColumn("{task.fields[left]}"), console=Console(stderr=True), transient=True)
    task, began = bar.add_task("fit", total=1.0, left=""), time.monotonic()

    def tell(share: float, text: str) -> None:  # rich would tell the time left by the latest steps alone
        gone = time.monotonic() - began
        left = f"about {duration_left(gone, share)} left" if share > 0.0 and gone > _PATIENCE else ""
        bar.update(task, completed=share, description=text, left=left)

    bar.start()
    try:
        yield tell
    finally:
        with contextlib.suppress(OSError):  # a terminal that was closed takes nothing along that was found
            bar.stop()


# --- Faults of logs before any fit ------------------------------------------------------------------------------------

_CHECKS: Mapping[str, Callable[[Sequence[Look]], list[Finding]]] = {
    "wrap": wraps, "stamps": wrong_stamps, "sign": turned, "span": spans, "rows": missing_rows,
    "not followed": not_followed, "pulses": refused,
}  # each looks at logs that the ones before have put right
KINDS = tuple(_CHECKS)
_STEADIED = ("wrap", "stamps")  # what makes a shaft look faster than any servo
MENDED = tuple(kind for kind in KINDS if kind != "pulses")
"""Kinds of findings that can be mended."""
BY_ITSELF = ("wrap", "sign")
"""Kinds that a fit mends unasked, as no servo does so and nothing is lost: a search would be in vain."""


def findings(logs: Sequence[Log], model: Model) -> tuple[Finding, ...]:
    """Return what is probably wrong with logs, without fitting anything.

    Parameters
    ----------
    logs : sequence of Log
    model : Model
        Over the servo that the logs are of; its calibration, speed and stops count, by a wide margin.

    Returns
    -------
    tuple of Finding
        In the order of `KINDS`. The mended log of a finding has the kinds before it mended too.

    Examples
    --------
    >>> import numpy as np, servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> run = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0,
    ...                   output_step=0.02)
    >>> log = Log(name="step", time=run.time, command=run["pulse_width"], command_kind="pulse_width",
    ...           measured={"output_angle": -run["output_angle"]})
    >>> [one.kind for one in findings([log], st.PulseServo(servo))]
    ['sign']
    """
    return _checked(logs, model, KINDS).findings


class Mended(NamedTuple):
    """Logs with some kinds of findings mended, and the findings that were."""

    logs: tuple[Log, ...]
    findings: tuple[Finding, ...]


class _Checked(NamedTuple):
    """Logs with all that is found mended, what is found, and the logs with jumps and stamps mended only."""

    logs: tuple[Log, ...]
    findings: tuple[Finding, ...]
    steadied: tuple[Log, ...]


def mended(logs: Sequence[Log], model: Model, kinds: Sequence[str]) -> Mended:
    """Return logs with these kinds of findings mended, in the order of `KINDS`."""
    done = _checked(logs, model, [kind for kind in KINDS if kind in kinds])
    return Mended(done.logs, tuple(one for one in done.findings if one.mended is not None))


def _checked(logs: Sequence[Log], model: Model, kinds: Sequence[str]) -> _Checked:
    """Check logs for some kinds of findings, one kind after the other."""
    found: list[Finding] = []
    looks = {log.name: look(log, model) for log in logs} if kinds else {}
    now = {log.name: log for log in logs}
    steadied = tuple(logs)
    for kind in kinds:
        for one in (seen := _CHECKS[kind]([one for one in looks.values() if one is not None and one.counts.any()])):
            if one.mended is not None:
                now[one.log] = one.mended
                looks[one.log] = look(one.mended, model)
        found += seen
        if kind in _STEADIED:
            steadied = tuple(now.values())
    return _Checked(tuple(now.values()), tuple(found), steadied)


def first_looks(logs: Sequence[Log], model: Model, mend: Sequence[str],
                unasked: Sequence[str] = ()) -> tuple[tuple[Log, ...], tuple[str, ...]]:
    """Return logs with some kinds of findings mended, asked for or not, and what has to be said of all findings.

    Raises
    ------
    InputError
        If a kind is unknown, a command lies beyond the travel, whatever its zero, or a shaft turns faster than the
        servo could by far and no finding says why.
    """
    kinds = checked_words("mend", mend, MENDED)
    about = centred(logs, model)
    done = mended(about.logs, model, (*kinds, *unasked))
    left = _checked(done.logs, model, KINDS)
    check_speeds(left.steadied, model)
    return done.logs, (*about.sentences, *(f"mended: {one.sentence}" for one in done.findings),
                       *(one.sentence for one in left.findings))


@contextmanager
def explained(noticed: Sequence[str]) -> Iterator[None]:
    """Add what was noticed first to an error that it may be the cause of."""
    try:
        yield
    except InputError as error:
        if not noticed:
            raise
        raise InputError(f"{error}; {noticed[0]}") from None
