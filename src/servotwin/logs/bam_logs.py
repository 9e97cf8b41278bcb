"""Raw logs of BAM (github.com/Rhoban/bam): a servo that swings a pendulum, in and out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.loads import Pendulum
from servotwin.logs.bam_convention import BAM_ACTUATORS, BamConvention
from servotwin.logs.csv_logs import in_file
from servotwin.logs.log import Log
from servotwin.logs.reading import ReadColumn, Reading
from servotwin.logs.sidecar import read_json, write_json
from servotwin.units import is_finite

GRAVITY = 9.80665  # m/s², as in BAM's test bench
# key of an entry -> signal; those with True have to be there
_MEASURED = {"position": ("output_angle", True), "speed": ("output_speed", False),
             "input_volts": ("bus_voltage", False)}
_TEXTS = ("motor", "trajectory")


def read_bam_log(path: str | Path, *, convention: BamConvention | None = None) -> Log:
    """Return the log in a raw file of BAM.

    The pendulum's point mass m and its arm m_a have inertia (m + m_a/3) l² and gravity torque (m + m_a/2) g l sin q
    (Duclusaud et al., 2025); an arm that is not recorded weighs nothing. The firmware gain becomes
    `electronics.stretcher_gain` by what BAM's code says of the log's `motor`; a log that names none is read as an
    XL330's, and the gain of a motor whose current or torque BAM sets stays a condition alone. Where torque is off BAM's
    motor is disconnected.

    Parameters
    ----------
    path : str or Path
    convention : BamConvention, optional
        Instead of what BAM's code says of the motor.

    Raises
    ------
    InputError
        If it is no such file, an entry lacks a number, or BAM has no such motor and there is no convention.
    """
    return _log(Path(path), read_json(path), convention)


def recognises(content: object) -> bool:
    """Return whether the content of a JSON file looks like a raw log of BAM."""
    return isinstance(content, Mapping) and "entries" in content


def logs_of(path: Path, content: object) -> list[Log]:
    """Return the log that the content of a file is, alone in a list."""
    return [_log(path, content)]


def _log(path: Path, content: object, convention: BamConvention | None = None) -> Log:
    if not isinstance(content, Mapping) or not isinstance(content.get("entries"), list):
        raise InputError(f"{path}", got=type(content).__name__, allowed='an object with "entries", as BAM records it')
    number = {key: _number(path, content, key) for key in ("mass", "length", "kp", "vin")}
    number["arm_mass"] = _number(path, content, "arm_mass") if "arm_mass" in content else 0.0
    text = {key: content.get(key, "") for key in _TEXTS}
    for key, value in text.items():
        if not isinstance(value, str):
            raise InputError(f"{path}: {key}", got=value, allowed="a text")
    entries = content["entries"]
    first = _entry(path, entries, 0) if entries else {}
    time, command = _column(path, entries, "timestamp"), _column(path, entries, "goal_position", null=True)
    measured = {name: _column(path, entries, key) for key, (name, required) in _MEASURED.items()
                if required or key in first}
    on = _column(path, entries, "torque_enable", default=True) == 1.0
    reading = Reading(file=str(path), remarks=tuple(_left_as_found(text["motor"])), columns=(
        ReadColumn("goal_position", "command_angle", "rad", "BAM's format"),
        *(ReadColumn(key, name, "V" if name == "bus_voltage" else "rad/s" if name == "output_speed" else "rad",
                     "BAM's format") for key, (name, _) in _MEASURED.items() if name in measured)))
    with in_file(path, path.stem):
        return Log(
            name=path.stem, source=str(path), motion=text["trajectory"], time=time, command=command, reading=reading,
            command_kind="angle", measured=measured, torque_on=None if on.all() else on,
            load=_pendulum(number["mass"], number["arm_mass"], number["length"]).as_load(),
            parameters=_loop(path, text["motor"], number["kp"], number["vin"], convention),
            conditions={"gain": number["kp"], "voltage": number["vin"],
                        **({"motor": text["motor"]} if text["motor"] else {})})


def _left_as_found(motor: str) -> list[str]:
    """Return what a log says of registers: which gains its recorder wrote, and that all others are as they were."""
    one = BAM_ACTUATORS.get(motor)
    if one is None or not (one.writes or motor.startswith("sts")):
        return []
    if "P" not in one.writes:
        return [f"BAM's recorder wrote no register of a {motor}: kp is what it was told, not what the servo had; all "
                "registers are as whoever had it before left them"]
    wrote = "P = kp" + (" and D = 0" if "D" in one.writes else "")
    return [f"BAM's recorder wrote {wrote} into this {motor}; the other registers, its profile too, are as whoever had "
            "it before left them"]


def _loop(path: Path, motor: str, gain: float, voltage: float, convention: BamConvention | None) -> dict[str, float]:
    """Return what stands for the loop, by dotted name."""
    if convention is None and motor:
        if motor not in BAM_ACTUATORS:
            raise InputError(f"{path}: motor, to which the gain kp belongs", got=motor,
                             allowed=f"{', '.join(BAM_ACTUATORS)}; of another, read_bam_log(…, "
                                     "convention=BamConvention(error_gain=…)) says its duty per radian")
        if BAM_ACTUATORS[motor].error_gain is None:
            BamConvention().stretcher_gain(gain)  # a gain it has to be
            return {"supply.open_circuit_voltage": voltage}
        convention = BamConvention.of(motor)
    return (convention or BamConvention()).parameters(gain, voltage)


def write_bam_log(log: Log, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a log as BAM records it; `read_bam_log` reads the same samples back.

    Parameters
    ----------
    log : Log
        Of angle commands held between samples, with `output_angle` at each, a pendulum that hangs at 0 and nothing else
        on the shaft, and the conditions `gain` and `voltage`.
    path : str or Path
    overwrite : bool
        Replace a file that is there.

    Raises
    ------
    InputError
        If BAM's file has no place for something in the log.
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    what = f"log {log.name!r} as a log of BAM"
    if log.command_kind != "angle" or log.command_hold != "previous":
        raise InputError(f"{what}: command", got=f"{log.command_kind}, {log.command_hold}", allowed="angle, previous")
    for name in ("gain", "voltage"):
        if not is_finite(log.conditions.get(name)):
            raise InputError(f"{what}: conditions, {name}", got=log.conditions.get(name, "nothing"), allowed="a number")
    columns = {"timestamp": log.time, "goal_position": log.command}
    for key, (name, required) in _MEASURED.items():
        if name not in log.measured and not required:
            continue
        if name not in log.measured or not np.isfinite(log.measured[name]).all():
            raise InputError(f"{what}: {name}", got="samples without a value", allowed="a value at every sample")
        columns[key] = log.measured[name]
    on = np.ones(log.time.size, dtype=bool) if log.torque_on is None else log.torque_on
    rows = zip(*([None if math.isnan(x) else x for x in values.tolist()] for values in columns.values()), on.tolist(),
               strict=True)
    content = {**_pendulum_words(what, log), "kp": log.conditions["gain"], "vin": log.conditions["voltage"],
               "motor": str(log.conditions.get("motor", "")), "trajectory": log.motion,
               "entries": [dict(zip((*columns, "torque_enable"), row, strict=True)) for row in rows]}
    write_json(path, content, overwrite=overwrite)


def _pendulum(mass: float, arm: float, length: float) -> Pendulum:
    inertia = None if arm == 0.0 else (mass + arm / 3.0) * length**2
    return Pendulum(mass=mass + arm / 2.0, length=length, inertia=inertia, gravity=GRAVITY)


def _pendulum_words(what: str, log: Log) -> dict[str, float]:
    """Return mass, arm and length of the pendulum, which has to be all of the load."""
    pendulums = log.load.pendulums
    if len(pendulums) != 1 or log.load != pendulums[0].as_load():
        raise InputError(f"{what}: load", got=log.load, allowed="one pendulum and nothing else")
    pendulum = pendulums[0]
    if pendulum.hanging_angle != 0.0 or pendulum.gravity != GRAVITY or pendulum.length == 0.0:
        raise InputError(f"{what}: pendulum", got=pendulum, allowed=f"hanging at 0, {GRAVITY} m/s2 and a length")
    if pendulum.inertia is None:
        return {"mass": pendulum.mass, "arm_mass": 0.0, "length": pendulum.length}
    arm = 6.0 * (pendulum.mass - pendulum.inertia / pendulum.length**2)
    if arm < -1e-9 * pendulum.mass or arm > 2.0 * pendulum.mass * (1.0 + 1e-9):
        raise InputError(f"{what}: pendulum, inertia", got=pendulum.inertia,
                         allowed="that of a point mass on a rod, between m l²/3 and m l²")
    arm = min(max(arm, 0.0), 2.0 * pendulum.mass)
    return {"mass": pendulum.mass - 0.5 * arm, "arm_mass": arm, "length": pendulum.length}


def _number(path: Path, content: Mapping[str, Any], key: str) -> float:
    value = content.get(key)
    if not is_finite(value) or value < 0.0:
        raise InputError(f"{path}: {key}", got="nothing" if value is None else value, allowed="a number of at least 0")
    return float(value)


def _entry(path: Path, entries: list[Any], k: int) -> Mapping[str, Any]:
    entry = entries[k]
    if not isinstance(entry, Mapping):
        raise InputError(f"{path}: entry {k}", got=entry, allowed="an object")
    return entry


def _column(path: Path, entries: list[Any], key: str, default: object = None, *,
            null: bool = False) -> NDArray[np.float64]:
    """Return the values of all entries; null is nan where it may be."""
    values = []
    for k in range(len(entries)):
        entry = _entry(path, entries, k)
        value = entry.get(key, default)
        if isinstance(value, bool) and key == "torque_enable":
            value = int(value)
        absent = null and value is None and key in entry
        if not absent and not is_finite(value):
            raise InputError(f"{path}: entry {k}, {key}", got="nothing" if value is None else value, allowed="a number")
        values.append(math.nan if absent else float(value))
    return np.array(values, dtype=np.float64)
