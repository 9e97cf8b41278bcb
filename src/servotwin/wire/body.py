"""Servos of a wire at the links of a robot in MuJoCo: what hangs on their shafts is the rest of the arm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from servotwin.errors import InputError, MissingExtraError
from servotwin.models import DigitalServo
from servotwin.parameters.groups import Supply
from servotwin.wire.crew import Crew

_STEP = 2e-3  # s, of MuJoCo
_ROUNDING = 1e-9  # s


def body_of(source: str, joints: Sequence[str]) -> Callable[..., LinkCrew] | None:
    """Return what makes the crew of a robot's joints; None where MuJoCo is not installed.

    Parameters
    ----------
    source : str
        Name of a robot that comes with the package, or path of an MJCF file.
    joints : sequence of str
        Of the servos, in their order.

    Raises
    ------
    InputError
        Or one of its kinds, if there is no such robot, or it lacks a joint.
    """
    from servotwin.robots.model_file import joint_names, robot_model

    try:
        plant = robot_model(source)
    except MissingExtraError:
        return None
    there = joint_names(plant)
    for joint in joints:
        if joint not in there:
            raise InputError(f"joint of {source}", got=joint or "none", allowed=", ".join(there))
    plant.opt.timestep = _STEP

    def made(models: Sequence[DigitalServo], supplies: Sequence[tuple[Supply, list[int]]], angles: Sequence[float],
             loads: Sequence[Any], seed: int, say: Callable[[str], None]) -> LinkCrew:
        return LinkCrew(plant, joints, models, supplies, angles, say)

    return made


class LinkCrew(Crew):
    """Servos at joints, led on by MuJoCo's steps: what shows is that of the last one."""

    def __init__(self, plant: Any, joints: Sequence[str], models: Sequence[DigitalServo],
                 supplies: Sequence[tuple[Supply, list[int]]], angles: Sequence[float],
                 say: Callable[[str], None]) -> None:
        from servotwin.robots import ServoDrive
        from servotwin.robots.places import load_mujoco

        mujoco = load_mujoco()
        self._joints = tuple(joints)
        self._drive = ServoDrive(plant, dict(zip(joints, models, strict=True)), joint_friction="keep",
                                 bus=[(supply, [joints[k] for k in places]) for supply, places in supplies])
        self._data = mujoco.MjData(self._drive.model)
        model = self._drive.model
        self._place = [int(model.jnt_qposadr[model.joint(name).id]) for name in joints]
        self._speed = [int(model.jnt_dofadr[model.joint(name).id]) for name in joints]
        low, high = np.array([model.joint(name).range if model.jnt_limited[model.joint(name).id] else (-1e9, 1e9)
                              for name in joints]).T
        self._data.qpos[self._place] = np.clip(angles, low, high)
        mujoco.mj_forward(model, self._data)
        simulators, lanes = self._drive.simulators(self._data), self._drive.crew_joints(self._data)
        if lanes != (self._joints,):
            raise InputError("servos of an arm", got=" | ".join(", ".join(some) for some in lanes),
                             allowed="one kind, on supplies in the order of the IDs")
        self.begin(models, simulators[0], self._data.qpos[self._place].copy(), say)
        self._behind, self._dirty = 0.0, True
        self._drive.command(self._data, dict(zip(joints, self._goals.tolist(), strict=True)))
        self._drive.step(self._data)
        self.sims.set(torque_enable=False)

    def lead(self, duration: float) -> None:
        """Let MuJoCo and the servos go on by whole steps; what is left waits."""
        if self._told:
            self._drive.command(self._data, dict(zip(self._joints, self._goals.tolist(), strict=True)))
            self._told = False
        self._behind += duration
        steps = int((self._behind + _ROUNDING) / _STEP)
        self._behind -= steps * _STEP
        if not steps:
            return
        if self._dirty:
            self._drive.changed(self._data)
            self._dirty = False
        held = [(k, angle) for k, angle in self._hands.items() if not self._torque[k]]
        if not held:
            self._drive.step(self._data, steps)
            return
        for _ in range(steps):
            for k, angle in held:
                self._data.qpos[self._place[k]], self._data.qvel[self._speed[k]] = angle, 0.0
            self._drive.step(self._data)

    def touched(self) -> None:
        """Let compiled code find what the servos remember, before the next step."""
        self._dirty = True

    def restart(self, servo: int) -> None:
        """Let a servo's program begin anew, limp; where its shaft is, MuJoCo knows."""
        self._goals[servo] = self.seen(servo).angle
        self.torque(servo, False)
        self._told, self._rows = True, None
