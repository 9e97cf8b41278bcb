"""An importer for one foreign data set, as a pattern for one's own: a Miuzei 25 kg servo that swings an arm.

The data are those of github.com/mauicv/servo-sysid (Alex Athorne, BSD-3-Clause): runs without time stamps, commands
and angles as fractions of 180°. An importer turns each run into a `Log`: SI units, one kind of command, what was not
measured as nan, the load, and what is known of the supply and the frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.loads import Load, Pendulum
from servotwin.logs.csv_logs import in_file
from servotwin.logs.log import Log
from servotwin.logs.sidecar import read_json
from servotwin.units import is_finite

PERIOD = 0.02  # s, nominal: there are no time stamps
BEFORE = 5  # periods of the command 0 before the first sample: longer than any delay
FRAME_PERIOD = 0.01  # s, pulses of the PCA9685
INERTIA, GRAVITY_TORQUE, GRAVITY = 1.06e-2, 0.587, 9.80665  # of the arm about the shaft: kg m², N m; m/s²


def read_miuzei_logs(path: str | Path) -> list[Log]:
    """Return the runs in a file of the Miuzei data set, one log for each.

    The angle 0 is where the arm is horizontal, the 1500 µs position; gravity pulls towards negative angles. Before the
    first sample the servo was at the command 0, which most runs leave at once. So a log begins with 0.1 s of it in
    which nothing was measured; its time 0 is the first sample.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    InputError
        If it is no such file, or a run lacks something: names the run.
    """
    return logs_of(Path(path), read_json(path))


def recognises(content: object) -> bool:
    """Return whether the content of a JSON file looks like the Miuzei data set."""
    return isinstance(content, Mapping) and isinstance(content.get("data"), list)


def arm() -> Load:
    """Return the arm of the rig: the point mass whose inertia and gravity torque are those that the author states."""
    length = INERTIA * GRAVITY / GRAVITY_TORQUE
    return Pendulum(mass=INERTIA / length**2, length=length, inertia=INERTIA, hanging_angle=-0.5 * math.pi,
                    gravity=GRAVITY).as_load()


def logs_of(path: Path, content: object) -> list[Log]:
    """Return the logs that the content of a file is."""
    if not isinstance(content, Mapping) or not isinstance(content.get("data"), list):
        raise InputError(f"{path}", got=type(content).__name__, allowed='an object with a list "data" of runs')
    return [_log(path, k, run) for k, run in enumerate(content["data"])]


def _log(path: Path, k: int, run: object) -> Log:
    where = f"{path}: run {k}"
    if not isinstance(run, Mapping):
        raise InputError(where, got=run, allowed="an object with type, actions and sensor_data")
    motion, index = run.get("type"), run.get("index", k)
    if not isinstance(motion, str):
        raise InputError(f"{where}, type", got=motion, allowed="a text")
    if not isinstance(index, int) or isinstance(index, bool):
        raise InputError(f"{where}, index", got=index, allowed="a whole number")
    action, angle = (_fractions(f"{where}, {key}", run.get(key)) for key in ("actions", "sensor_data"))
    name = f"{index:03d} {motion}"
    with in_file(path, name):
        command = np.clip(500.0 + (1.0 + np.append(np.zeros(BEFORE), action) * 4.0 / 3.0) * 1000.0, 500.0, 2500.0) / 1e6
        return Log(
            name=name, source=str(path), motion=motion,
            time=np.asarray(PERIOD * np.arange(-BEFORE, action.size), dtype=np.float64),
            command=command, command_kind="pulse_width",
            measured={"output_angle": math.pi * np.append(np.full(BEFORE, math.nan), angle)}, load=arm(),
            parameters={"electronics.frame_period": FRAME_PERIOD},
            conditions={"amplitude_deg": round(180.0 * float(np.nanmax(np.abs(action), initial=0.0)), 6)})


def _fractions(what: str, values: object) -> NDArray[np.float64]:
    if not isinstance(values, list):
        raise InputError(what, got="nothing" if values is None else values, allowed="a list of numbers and null")
    bad = next((v for v in values if v is not None and not is_finite(v)), None)
    if bad is not None:
        raise InputError(what, got=bad, allowed="numbers, or null where there is none")
    return np.array([math.nan if v is None else float(v) for v in values])
