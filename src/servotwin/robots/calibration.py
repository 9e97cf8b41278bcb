"""What LeRobot's normalised goals mean: counts of a servo, and from these angles of a joint.

A calibration of LeRobot says of each joint between which counts it moves, `range_min` and `range_max`. A goal becomes
a whole count as `_unnormalize` makes it (huggingface/lerobot, src/lerobot/motors/motors_bus.py, commit
049856c7cb2c719d0644004b5884a51c3ab9ed2b); what is behind the point is cut off:

- -100 to 100: range_min + (x + 100)/200 (range_max - range_min), x held within -100 and 100;
- 0 to 100, the gripper: range_min + x/100 (range_max - range_min), x held within 0 and 100;
- degrees: (range_min + range_max)/2 + 4095/360 x, held nowhere: LeRobot gives 4095 counts to 360 degrees.

`drive_mode` turns the first two round, -x and 100 - x, and leaves degrees as they are. `homing_offset` is in the servo,
whose counts have it already. A servo has 4096 counts a turn, so the angle of a joint from the middle of its calibrated
range is 2π/4096 (count - (range_min + range_max)/2): LeRobot's degrees up to the last count and one part in 4096. A
dataset holds goals as float32, so where one lies on a count, it may become the count before.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.sidecar import read_json

RANGE, OPENING, DEGREES = "-100 to 100", "0 to 100", "degrees"
_COUNTS = 4096  # a turn, of Feetech STS and SMS and of Dynamixel X
_ANGLE = 2.0 * math.pi / _COUNTS  # of one count [rad]
_FORM = '{"shoulder_pan": {"drive_mode": 0, "range_min": 700, "range_max": 3300}, ...}, as LeRobot writes it'


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """The calibration of one joint.

    Parameters
    ----------
    range_min, range_max : int
        Counts of its servo at both ends of its range.
    inverted : bool
        Whether -100 is at `range_max`.

    Examples
    --------
    >>> elbow = Calibration(range_min=900, range_max=3100)
    >>> elbow.counts(np.array([-100.0, 0.0, 50.0]), RANGE).tolist()
    [900.0, 2000.0, 2550.0]
    >>> np.degrees(elbow.angles(elbow.counts(np.array([90.0]), DEGREES))).round(2).tolist()
    [89.91]
    """

    range_min: int
    range_max: int
    inverted: bool = False

    def counts(self, goals: NDArray[np.float64], form: str) -> NDArray[np.float64]:
        """Return the whole counts that LeRobot sends for goals.

        Parameters
        ----------
        goals : (n,) array
        form : {"-100 to 100", "0 to 100", "degrees"}
        """
        return np.trunc(self._unrounded(goals, form))

    def read_counts(self, positions: NDArray[np.float64], form: str) -> NDArray[np.float64]:
        """Return the whole counts that positions were made of.

        Examples
        --------
        >>> Calibration(range_min=900, range_max=3100).read_counts(np.array([49.9999]), RANGE).tolist()
        [2550.0]
        """
        return np.rint(self._unrounded(positions, form))

    def _unrounded(self, goals: NDArray[np.float64], form: str) -> NDArray[np.float64]:
        if form == DEGREES:
            return np.asarray(goals * (_COUNTS - 1) / 360.0 + (self.range_min + self.range_max) / 2.0)
        if self.inverted:
            goals = -goals if form == RANGE else 100.0 - goals
        return np.asarray(range_share(goals, form) * (self.range_max - self.range_min) + self.range_min)

    def angles(self, counts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the angles from the middle of the range [rad]."""
        return np.asarray(_ANGLE * (counts - (self.range_min + self.range_max) / 2.0))


def range_share(goals: NDArray[np.float64], form: str) -> NDArray[np.float64]:
    """Return how far into a range normalised goals are: 0 at its lower end, 1 at its upper one.

    Examples
    --------
    >>> range_share(np.array([-120.0, 50.0]), RANGE).tolist(), range_share(np.array([50.0]), OPENING).tolist()
    ([0.0, 0.75], [0.5])
    """
    return np.clip((goals + 100.0) / 200.0 if form == RANGE else goals / 100.0, 0.0, 1.0)


def joint_angles(goals: NDArray[np.float64], form: str, calibration: Calibration | None,
                 limits: tuple[float, float] | None, *, measured: bool = False) -> NDArray[np.float64]:
    """Return goals as angles of a joint [rad].

    Parameters
    ----------
    goals : (n,) array
    form : {"-100 to 100", "0 to 100", "degrees"}
        All but degrees need a calibration or limits.
    calibration : Calibration, optional
    limits : (float, float), optional
        Of the joint in the robot's model. Without a calibration they are the ends of -100 to 100. With one, they only
        say where the calibrated range lies: the middle of both is the same, or where 0 to 100 is meant, the lower end.
        Unless given, the middle is at 0 [rad]
    measured : bool
        They are positions, not goals: rounded to the nearest count, not cut off.

    Raises
    ------
    InputError
        If both are missing, and the goals are no degrees.

    Examples
    --------
    >>> joint_angles(np.array([0.0, 50.0]), OPENING, None, (-0.2, 1.8)).tolist()
    [-0.2, 0.8]
    """
    middle = 0.0 if limits is None else 0.5 * (limits[0] + limits[1])
    if calibration is not None:
        counts = calibration.read_counts(goals, form) if measured else calibration.counts(goals, form)
        if form == OPENING and limits is not None:
            closed = calibration.counts(np.zeros(1), form)
            return np.asarray(limits[0] + _ANGLE * np.abs(counts - closed))
        return middle + calibration.angles(counts)
    if form == DEGREES:
        return middle + np.radians(goals)
    if limits is None:
        raise InputError(f"goals of {form}", allowed="with a calibration, or limits of the joint")
    return limits[0] + (limits[1] - limits[0]) * range_share(goals, form)


def read_calibration(source: str | Path | Mapping[str, Any], *, drive_mode: bool = True) -> dict[str, Calibration]:
    """Return LeRobot's calibration of a robot, by joint.

    Parameters
    ----------
    source : str, Path or mapping
        Its JSON file, ``~/.cache/huggingface/lerobot/calibration/robots/TYPE/ID.json``, or what such a file holds.
    drive_mode : bool
        Whether LeRobot heeds `drive_mode`, as it does with Feetech; Dynamixel servos do so themselves.

    Raises
    ------
    InputError
        If it cannot be read, or is no calibration.

    Examples
    --------
    >>> read_calibration({"gripper": {"id": 6, "drive_mode": 0, "homing_offset": 12, "range_min": 2030,
    ...                               "range_max": 3500}})["gripper"].range_max
    3500
    """
    is_file = not isinstance(source, Mapping)
    where = f"{source}" if is_file else "calibration"
    content = read_json(source) if isinstance(source, (str, Path)) else source
    if not isinstance(content, Mapping) or not content:
        raise InputError(where, got=content, allowed=_FORM)
    return {str(joint): _calibration(f"{where}: {joint}", said, drive_mode) for joint, said in content.items()}


def _calibration(where: str, said: object, drive_mode: bool) -> Calibration:
    if not isinstance(said, Mapping):
        raise InputError(where, got=said, allowed=_FORM)
    low, high, inverted = (said.get(key, default) for key, default in (
        ("range_min", None), ("range_max", None), ("drive_mode", 0)))
    for key, value in (("range_min", low), ("range_max", high)):
        if not isinstance(value, int) or isinstance(value, bool):
            raise InputError(f"{where} {key}", got="nothing" if value is None else value, allowed="a whole number")
    if not low < high:
        raise InputError(f"{where} range_min and range_max", got=f"{low} and {high}", allowed="the smaller one first")
    if inverted not in (0, 1):
        raise InputError(f"{where} drive_mode", got=inverted, allowed="0 or 1")
    return Calibration(range_min=low, range_max=high, inverted=bool(inverted) and drive_mode)
