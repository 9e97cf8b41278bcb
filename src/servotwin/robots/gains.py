"""The same robot with MuJoCo's `<position>` actuators, with numbers that people use for arms of bus servos.

    torque = clip(kp (goal - q) - kv q', force) - damping q',    with friction loss and armature of the joint

Numbers are those of files for the SO-100 and SO-101: `so101_new_calib.xml` of TheRobotStudio/SO-ARM100, which MuJoCo
Menagerie has too (`robotstudio_so101`), its defaults for joints of no class, and `joints_properties.xml` beside it.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.robots.coupling import couple, silence
from servotwin.robots.mount import joints_of
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import RobotRun

Array = NDArray[np.float64]
_SAME = 1e-9  # s


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Numbers of a `<position>` actuator and of its joint.

    Parameters
    ----------
    name : str
    stiffness, velocity_gain : float
        kp [N m/rad], kv [N m s/rad]
    damping, friction, armature : float
        Of the joint [N m s/rad], [N m], [kg m²]
    force : float
        Range of the force, either way [N m]
    """

    name: str
    stiffness: float
    velocity_gain: float = 0.0
    damping: float
    friction: float
    armature: float
    force: float = np.inf


COMMON = (
    Gains(name="<position> kp 998", stiffness=998.22, velocity_gain=2.731, damping=0.60, friction=0.052,
          armature=0.028, force=2.94),
    Gains(name="<position> kp 50", stiffness=50.0, damping=1.0, friction=0.1, armature=0.005),
    Gains(name="<position> kp 17.8", stiffness=17.8, damping=0.60, friction=0.052, armature=0.028, force=3.35),
)
"""What people write for an SO-100 or SO-101."""


def position_run(run: RobotRun, gains: Gains) -> dict[str, Array]:
    """Return where the joints of a robot that has followed a motion are with such actuators, at the same times.

    Parameters
    ----------
    run : RobotRun
    gains : Gains
    """
    mujoco, model = load_mujoco(), copy.copy(run.model)
    joints = joints_of(model, run.mounts)
    at, dofs = ([getattr(joint, name) for joint in joints] for name in ("angle_at", "speed_at"))
    for values, value in ((model.dof_damping, gains.damping), (model.dof_frictionloss, gains.friction),
                          (model.dof_armature, gains.armature)):
        values[dofs] = value
    for joint in joints:
        if joint.actuator >= 0:
            silence(model, joint.actuator)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data = mujoco.MjData(model)
    names = [joint.name for joint in joints]
    data.qpos[:], data.time = _start(run, names, at), run.time[0] - model.opt.timestep
    couple(model, data.qpos)
    angles = np.zeros((len(run.time), len(joints)))
    for k, goals in enumerate(_goals(run, names)):
        force = gains.stiffness * (goals - data.qpos[at]) - gains.velocity_gain * data.qvel[dofs]
        data.qfrc_applied[dofs] = np.clip(force, -gains.force, gains.force)
        mujoco.mj_step(model, data)
        angles[k] = data.qpos[at]
    return dict(zip(names, angles.T, strict=True))


def _start(run: RobotRun, names: Sequence[str], at: Sequence[int]) -> Array:
    found = np.array(run.model.qpos0)
    for name, place in zip(names, at, strict=True):
        found[place] = run.goal(name)[0]
    return found


def _goals(run: RobotRun, names: Sequence[str]) -> Iterator[Array]:
    """Give the goals of all joints, held between samples as LeRobot sends them."""
    time = run.time - (run.time[1] - run.time[0])
    which = np.clip(np.searchsorted(run.motion.time, time + _SAME, side="right") - 1, 0, None)
    table = np.stack([run.motion.angles[name][which] if name in run.motion.angles else run.goal(name)
                      for name in names], axis=1)
    yield from table
