"""What was recorded of a robot, made ready for a fit: goals and positions of its joints, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.registers import busiest
from servotwin.logs.log import Log
from servotwin.robots import Motion, joint_names, joint_ranges, read_motion
from servotwin.robots.episode import episodes_of

Array = NDArray[np.float64]
_FEWEST = 30  # samples
_SAME = 1e-6  # s
_STILL = 2.5e-3  # rad, between samples: a joint that rests
_WINDOW = 0.25  # s, over which measured positions are smoothed


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of a robot.

    Parameters
    ----------
    motion : Motion
    time : ndarray, shape (n,)
        [s]
    goals, measured : ndarray, shape (n, joints)
        [rad]
    angle, speed, acceleration : ndarray, shape (n, joints)
        As smoothed from the measured positions [rad], [rad/s], [rad/s²]
    """

    motion: Motion
    time: Array
    goals: Array
    measured: Array
    angle: Array
    speed: Array
    acceleration: Array

    @property
    def name(self) -> str:
        """Where it was read."""
        return self.motion.source

    def busiest(self, seconds: float) -> NDArray[np.bool_]:
        """Return which samples the part of so many seconds has in which goals go furthest, from rest on."""
        span = busiest(self.time, self.goals, self.measured, _STILL, seconds)
        return np.ones(len(self.time), np.bool_) if span is None else (self.time >= span[0]) & (self.time <= span[1])

    def part(self, rows: NDArray[np.bool_]) -> Episode:
        """Return some samples of it."""
        return replace(self, **{name: getattr(self, name)[rows] for name in (
            "time", "goals", "measured", "angle", "speed", "acceleration")})


def motions_of(logs: Any, plant: Any) -> list[Motion]:
    """Return recorded motions: those of a dataset's or table's path, of logs of joints, or as they are.

    Raises
    ------
    InputError
        If there are none, or they are nothing that was measured of the robot's joints: one line.
    """
    if isinstance(logs, str | Path):
        path = Path(logs)
        return [read_motion(path, joint_names(plant), ranges=joint_ranges(plant), episode=number)
                for number in episodes_of(path)]
    given = [logs] if isinstance(logs, Motion | Log) else list(logs)
    if of_logs := [one for one in given if isinstance(one, Log)]:
        return _of_logs(of_logs)
    motions = [one for one in given if isinstance(one, Motion)]
    if not motions or len(motions) < len(given):
        raise InputError("logs of a robot", got=logs, allowed="a path, motions with measured positions, or logs that "
                         "say their joint (conditions)")
    return motions


def _of_logs(logs: Sequence[Log]) -> list[Motion]:
    """Return the motions of logs of single joints, of which each says its joint and episode."""
    found: dict[str, list[Log]] = {}
    for log in logs:
        if "joint" not in log.conditions or log.command_kind != "angle" or "output_angle" not in log.measured:
            raise InputError(f"log {log.name!r} of a robot", got="no condition joint, no goals or no angle",
                             allowed="logs of joints, such as read_lerobot_logs(...)")
        found.setdefault(f"{log.source}, episode {log.conditions.get('episode', 0.0):.0f}", []).append(log)
    motions = []
    for name, some in found.items():
        first = some[0]
        if any(len(log) != len(first) or np.abs(log.time - first.time).max() > _SAME for log in some):
            raise InputError(f"logs of {name}", got="joints at different times", allowed="the same times")
        robot = str(first.conditions.get("robot", ""))
        motions.append(Motion(time=first.time - first.time[0], source=name, robot=robot,
                              angles={str(log.conditions["joint"]): log.held for log in some},
                              measured={str(log.conditions["joint"]): log.measured["output_angle"] for log in some}))
    return motions


def episodes_from(motions: Sequence[Motion], joints: Sequence[str], servos: Mapping[str, object]) -> list[Episode]:
    """Return episodes of the joints with servos.

    Raises
    ------
    InputError
        If a joint has no goals or positions, or an episode is too short.
    """
    made = []
    for motion in motions:
        for what, there in (("goals", motion.angles), ("measured positions", motion.measured)):
            lacking = [joint for joint in joints if joint not in there]
            if lacking:
                raise InputError(f"{what} of {motion.source}", got=f"none of {', '.join(lacking)}",
                                 allowed=f"all joints with servos: {', '.join(servos)}")
        if len(motion.time) < _FEWEST:
            raise InputError(f"{motion.source}", got=f"{len(motion.time)} samples", allowed=f"at least {_FEWEST}")
        goals, measured = (np.stack([some[joint] for joint in joints], axis=1)
                           for some in (motion.angles, motion.measured))
        made.append(Episode(motion, motion.time, goals, measured, *_smooth(motion.time, measured)))
    if not made:
        raise InputError("logs of a robot", got="none", allowed="at least one episode")
    if all(float(np.ptp(one.measured, axis=0).max()) < 1e-2 for one in made):
        raise InputError("logs of a robot", got="joints that never move", allowed="an episode in which they do")
    return made


def _smooth(time: Array, measured: Array) -> tuple[Array, Array, Array]:
    """Return positions, speeds and accelerations, by parabolas over a window that moves along (Savitzky, Golay)."""
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(time)))
    even = time[0] + step * np.arange(round((time[-1] - time[0]) / step) + 1)
    size = max(2 * round(0.5 * _WINDOW / step) + 1, 5)
    table = np.stack([np.interp(even, time, column) for column in measured.T], axis=1)
    found = []
    for order in range(3):
        smooth = savgol_filter(table, min(size, 2 * ((len(even) - 1) // 2) + 1), 3, deriv=order, delta=step, axis=0)
        found.append(np.stack([np.interp(time, even, column) for column in smooth.T], axis=1))
    return found[0], found[1], found[2]
