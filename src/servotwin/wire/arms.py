"""Arms that are on a wire: which servo has which ID, and at which joint."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from servotwin.errors import InputError, UnknownNameError
from servotwin.parameters import Servo, load_servo
from servotwin.parameters.groups import Supply
from servotwin.tables.reading import read_text
from servotwin.text import checked_name, load_toml
from servotwin.wire.bus import Bus, Faults

# --- A hand that moves limp servos, by a file of angles over time -----------------------------------------------------

def hand_of(path: str | Path, bus: Bus, names: Mapping[int, str]) -> Callable[[Bus], None]:
    """Return what moves the servos of a bus as a file says: columns time_s, and degrees by joint or ID.

    Between rows angles are straight lines; at the end it begins anew. A servo whose torque is on does not feel it.

    Raises
    ------
    InputError
        If the file has no times, or columns of joints that there are not.
    """
    rows = _table(Path(path))
    time, ids = rows.pop("time_s"), {name: id for id, name in names.items() if name}
    of: dict[int, np.ndarray] = {}
    for column, values in rows.items():
        word = column.removesuffix("_deg")
        id = ids.get(word, int(word) if word.isdecimal() else None)
        if not column.endswith("_deg") or id not in bus.ids:
            raise InputError(f"{path}: column", got=column, allowed=", ".join(
                f"{names.get(one) or one}_deg" for one in bus.ids))
        of[id] = np.radians(values)
    span = float(time[-1] - time[0])

    def move(moved: Bus) -> None:
        now = float(time[0]) + (math.fmod(moved.time, span) if span > 0.0 else 0.0)
        for id, angles in of.items():
            moved.hand(id, float(np.interp(now, time, angles)))

    return move


def _table(path: Path) -> dict[str, np.ndarray]:
    text = read_text(path)
    lines = [line.strip() for line in (*text.lines, text.rest) if line.strip() and line[:1] != "#"]
    head = [word.strip() for word in lines[0].split(",")] if lines else []
    if "time_s" not in head or len(head) < 2 or len(set(head)) < len(head):
        raise InputError(f"{path}", got=", ".join(head) or "nothing",
                         allowed="columns time_s and angles, each once, such as time_s,shoulder_pan_deg")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            row = [float(word) for word in line.split(",")]
        except ValueError:
            row = []
        if len(row) != len(head) or not all(map(math.isfinite, row)):
            raise InputError(f"{path}, row {number}", got=line, allowed=f"{len(head)} numbers")
        rows.append(row)
    columns = np.array(rows, dtype=np.float64).reshape(-1, len(head)).T
    found = dict(zip(head, columns, strict=True))
    if not rows or np.any(np.diff(found["time_s"]) < 0.0):
        raise InputError(f"{path}", got="no rows" if not rows else "times that go back",
                         allowed="rows in order of time")
    return found


# --- Arms that are on a wire: which servo has which ID, and at which joint --------------------------------------------

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
ARMS: Mapping[str, Mapping[int, tuple[str, str]]] = {
    "so101": {k: (joint, "feetech-sts3215-12v") for k, joint in enumerate(JOINTS, start=1)},
    "koch": {k: (joint, "dynamixel-xl430-w250" if k < 3 else "dynamixel-xl330-m288")
             for k, joint in enumerate(JOINTS, start=1)}}
"""By ID: the joint as LeRobot names it, and the servo."""

_KEYS = ("supply", "body", "servo")
_SERVO_KEYS = ("id", "servo", "joint", "registers", "angle_deg")


@dataclass(frozen=True, kw_only=True)
class Asked:
    """The goals of a person.

    Parameters
    ----------
    arm : str, optional
        Name, or path of an arm file.
    servos : mapping of int to str
        By ID, beside the arm's or instead of them.
    supply : str, optional
    registers : tuple of str
        Written into all servos.
    lock, firmware, faults, seed
        As of `Bus`.
    body : bool
        Whether an arm that has links hangs at them.
    """

    arm: str | None = None
    servos: Mapping[int, str] = field(default_factory=dict)
    supply: str | None = None
    registers: tuple[str, ...] = ()
    lock: str = "keep"
    firmware: tuple[int, ...] | None = None
    faults: Faults | None = None
    body: bool = True
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class _Arm:
    """An arm as it is read."""

    joints: dict[int, str]
    servos: dict[int, str]
    registers: dict[int, tuple[str, ...]] = field(default_factory=dict)
    angles: dict[int, float] = field(default_factory=dict)
    supply: str | None = None
    body: str | None = None


def arm_bus(asked: Asked, *, registers: Callable[[Servo, tuple[str, ...]], Servo]) -> tuple[Bus, dict[int, str]]:
    """Return the bus that is asked for, and the joint of each ID.

    Parameters
    ----------
    asked : Asked
    registers : callable
        Returns a servo with registers that words say.

    Raises
    ------
    InputError
        Or one of its kinds, if there is no such arm or servo.
    """
    arm = _arm(asked.arm)
    named = {**arm.servos, **asked.servos}
    if not named:
        raise InputError("servotwin wire", got="no servos",
                         allowed=f"{' or '.join(ARMS)}, an arm file, or --servo ID=SERVO")
    servos = {id: registers(registers(load_servo(name), arm.registers.get(id, ())), asked.registers)
              for id, name in named.items()}
    words = asked.supply or arm.supply
    more: dict[str, Any] = {}
    if asked.body and arm.body is not None and not asked.servos:
        from servotwin.wire.twins import body_of

        made = body_of(arm.body, [arm.joints[id] for id in named])
        if made is not None:
            more["body"] = made
    bus = Bus(servos, supply=None if words is None else Supply.of(words), angles=arm.angles, lock=asked.lock,
              firmware=asked.firmware, faults=asked.faults, seed=asked.seed, **more)
    return bus, {id: arm.joints.get(id, "") for id in named}


def _arm(name: str | None) -> _Arm:
    if name is None:
        return _Arm(joints={}, servos={})
    if name in ARMS:
        return _Arm(joints={id: joint for id, (joint, _) in ARMS[name].items()},
                    servos={id: servo for id, (_, servo) in ARMS[name].items()},
                    body="so101" if name == "so101" else None)
    path = Path(name)
    if path.suffix != ".toml" and not path.exists():
        raise UnknownNameError("arm", name, ARMS, allowed=f"{', '.join(ARMS)}, or path of an arm file (.toml)")
    return _read(path)


def _read(path: Path) -> _Arm:
    """Read an arm file: `supply`, `body` and a table `[[servo]]` for each servo."""
    try:
        found = load_toml(path.read_text("utf-8-sig"))
    except ValueError as error:
        raise InputError(f"{path}", got=str(error), allowed="an arm file in TOML") from None
    _known(f"{path}: key", found, _KEYS)
    tables = found.get("servo")
    if not isinstance(tables, list) or not tables or not all(isinstance(one, dict) for one in tables):
        raise InputError(f"{path}", got="no [[servo]]", allowed="a table [[servo]] with id and servo for each")
    servos, joints = dict[int, str](), dict[int, str]()
    angles, registers = dict[int, float](), dict[int, tuple[str, ...]]()
    for one in tables:
        _known(f"{path}: key of a servo", one, _SERVO_KEYS)
        id = one.get("id")
        if type(id) is not int or not isinstance(one.get("servo"), str):
            raise InputError(f"{path}: [[servo]]", got=one, allowed='id = 1 and servo = "feetech-sts3215-12v"')
        if id in servos:
            raise InputError(f"{path}: id of a servo", got=f"{id} twice", allowed="each ID once")
        servos[id] = one["servo"]
        joints[id] = checked_name(f"{path}: joint of servo {id}", str(one.get("joint", "")))
        value = one.get("angle_deg", 0.0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 36000.0:
            raise InputError(f"{path}: angle_deg", got=value, allowed="a number of degrees")
        angles[id] = math.radians(value)
        words = one.get("registers", [])
        if not isinstance(words, str | list):
            raise InputError(f"{path}: registers of servo {id}", got=words, allowed='such as ["P_Coefficient=16"]')
        registers[id] = (words,) if isinstance(words, str) else tuple(str(word) for word in words)
    for key in ("supply", "body"):
        if key in found and not isinstance(found[key], str):
            raise InputError(f"{path}: {key}", got=found[key], allowed="a word in quotes")
    body = found.get("body")
    if body is not None and body != "so101":
        beside = path.parent / body
        body = str(beside) if beside.exists() else body
    return _Arm(joints=joints, servos=servos, registers=registers, angles=angles, supply=found.get("supply"), body=body)


def _known(what: str, found: Mapping[str, Any], names: tuple[str, ...]) -> None:
    unknown = next((name for name in found if name not in names), None)
    if unknown is not None:
        raise UnknownNameError(what, unknown, names)
