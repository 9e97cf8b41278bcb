"""The second stage: goals drive the whole arm, with every number moved in a copy of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.copies import Copies
from servotwin.identification.arms.dynamics import with_masses
from servotwin.identification.arms.episodes import Episode
from servotwin.robots import ServoDrive
from servotwin.robots.coupling import couple
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import ticks_in

Array = NDArray[np.float64]
_SETTLE = 0.5  # s, at the first goals


class WholeArm(Copies):
    """A robot with its servos, driven by goals."""

    def angles(self, episode: Episode, points: Array, *, fine: bool = False) -> Array:
        """Return where the joints are, shape (copies, n, joints) [rad]."""
        return np.stack([self._one(episode, x, fine=fine) for x in points])

    def _one(self, episode: Episode, x: Array, *, fine: bool) -> Array:
        self.look()
        mujoco, numbers = load_mujoco(), self.numbers
        model = with_masses(self.plant, self.links, numbers.masses(x))
        drive = ServoDrive(model, numbers.mounts_at(x, fine=fine), bus=numbers.supply(x), joint_friction="keep",
                           assume_heat=False)
        data, step, zeros = mujoco.MjData(drive.model), float(drive.model.opt.timestep), numbers.zeros(x)
        places = [int(model.jnt_qposadr[model.joint(name).id]) for name in drive.joints]
        goals = episode.goals + zeros
        data.qpos[places] = goals[0]
        couple(drive.model, data.qpos)
        data.time = -_SETTLE
        mujoco.mj_forward(drive.model, data)
        drive.record(data)
        drive.command(data, dict(zip(drive.joints, goals[0].tolist(), strict=True)))
        drive.step(data, round(_SETTLE / step))
        turn = numbers.turn(x)
        spans = turn * np.diff(np.append(episode.time, episode.time[-1] + _SETTLE))
        for row, span in zip(goals.tolist(), spans.tolist(), strict=True):
            count = ticks_in(span, step)
            drive.model.opt.timestep = span / count  # a row acts at its time, not with the next tick
            drive.command(data, dict(zip(drive.joints, row, strict=True)))
            drive.step(data, count)
        record = drive.result(data)
        at = turn * episode.time - numbers.latency(x)
        return np.stack([np.interp(at, record.time, record[name]["joint_angle"]) for name in drive.joints],
                        axis=1) - zeros
