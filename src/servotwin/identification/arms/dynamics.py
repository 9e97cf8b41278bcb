"""What the measured motion of a robot asks of each joint: torques and inertias, link by link.

    tau_j = M_jj q''_j + sum over others of M_jk q''_k + Coriolis + gravity

The first term is that of the joint's own motion, which a simulated servo has itself; the rest is a torque that comes to
it from outside. Both are linear in the masses of the links, where a link keeps its centre and the shape of its inertia.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.rows import Copies, Episode
from servotwin.robots import ServoDrive
from servotwin.robots.coupling import couple, couplings_of
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import ticks_in

# --- What the measured motion of a robot asks of each joint: torques and inertias, link by link -----------------------

Array = NDArray[np.float64]
_NUDGE, _NEAR = 0.01, 0.05  # rad


@dataclass(frozen=True, eq=False)
class Asked:
    """Torques and inertias at the joints that links ask for, each as heavy as the model says.

    Parameters
    ----------
    torque : ndarray, shape (n, joints, links)
        Beside that of the joint's own acceleration [N m]
    inertia : ndarray, shape (n, joints, links)
        [kg m²]
    """

    torque: Array
    inertia: Array

    def of(self, factors: Array) -> tuple[Array, Array]:
        """Return torque and inertia of all links whose masses are so many times those of the model."""
        return self.torque @ factors, self.inertia @ factors


class Demand:
    """What motions of a robot ask of its joints, of zeros near those that were asked for before: worked out once.

    Parameters
    ----------
    model : MjModel
    joints : sequence of str
    links : sequence of int
    """

    def __init__(self, model: Any, joints: Sequence[str], links: Sequence[int]) -> None:
        self.model, self.joints, self.links = model, [*joints], [*links]
        self._known: dict[tuple[int, ...], _Known] = {}

    def torques(self, episode: Episode, zeros: Array, factors: Array) -> list[tuple[Array, Array]]:
        """Return torque [N m] and inertia [kg m²] at the joints, shape (n, joints) each, of several copies.

        All of them are about the zeros near those of the first one, so that differences of copies have no steps.

        Parameters
        ----------
        episode : Episode
        zeros : ndarray, shape (copies, joints)
            [rad]
        factors : ndarray, shape (copies, links)
        """
        key = (id(episode), *np.round(zeros[0] / _NEAR).astype(int).tolist())
        if key not in self._known:
            self._known[key] = _Known(episode, zeros[0], self._asked(episode, zeros[0]), {})
        known, found = self._known[key], []
        for off, masses in zip(zeros - known.zeros, factors, strict=True):
            torque, inertia = known.base.of(masses)
            for j in np.flatnonzero(off).tolist():
                if j not in known.slopes:
                    moved = known.zeros + _NUDGE * (np.arange(len(off)) == j)
                    known.slopes[j] = (self._asked(episode, moved).torque - known.base.torque) / _NUDGE
                torque = torque + off[j] * (known.slopes[j] @ masses)
            found.append((torque, inertia))
        return found

    def _asked(self, episode: Episode, zeros: Array) -> Asked:
        return asked_of(self.model, self.joints, self.links, episode.angle + zeros, episode.speed,
                        episode.acceleration)


class _Known(NamedTuple):
    """What an episode asks for at some zeros, and how the torque changes with those that were asked for."""

    episode: Episode
    zeros: Array
    base: Asked
    slopes: dict[int, Array]


def links_of(model: Any, joints: Sequence[str]) -> list[int]:
    """Return the bodies with a mass that some of the joints move."""
    dofs = {int(model.jnt_dofadr[model.joint(name).id]) for name in joints}
    found = []
    for body in range(1, model.nbody):
        above, moved = body, False
        while above and not moved:
            first = int(model.body_dofadr[above])
            moved = bool(dofs & set(range(first, first + int(model.body_dofnum[above]))))
            above = int(model.body_parentid[above])
        if moved and model.body_mass[body] > 0.0:
            found.append(body)
    return found


def link_names(model: Any, links: Sequence[int]) -> list[str]:
    """Return the names of bodies."""
    return [model.body(body).name or f"body {body}" for body in links]


def with_masses(model: Any, links: Sequence[int], factors: Array) -> Any:
    """Return a copy of a model whose links are so many times as heavy."""
    found = copy.copy(model)
    found.body_mass[links] = model.body_mass[links] * factors
    found.body_inertia[links] = model.body_inertia[links] * factors[:, None]
    load_mujoco().mj_setConst(found, load_mujoco().MjData(found))
    return found


def asked_of(model: Any, joints: Sequence[str], links: Sequence[int], angle: Array, speed: Array,
             acceleration: Array) -> Asked:
    """Return what a motion of the joints asks for, others being where the model has them.

    Parameters
    ----------
    model : MjModel
    joints : sequence of str
    links : sequence of int
    angle, speed, acceleration : ndarray, shape (n, joints)
    """
    mujoco = load_mujoco()
    own = copy.copy(model)
    own.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT) | int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    numbers = [model.joint(name).id for name in joints]
    places, dofs = model.jnt_qposadr[numbers], model.jnt_dofadr[numbers]
    own.dof_armature[:], own.dof_damping[:], own.dof_frictionloss[:] = 0.0, 0.0, 0.0
    masses, inertias = model.body_mass.copy(), model.body_inertia.copy()
    n, count = angle.shape
    torque, inertia = (np.zeros((n, count, len(links) + 1)) for _ in range(2))  # that of all comes last
    data, whole, follow = mujoco.MjData(own), np.zeros((model.nv, model.nv)), bool(couplings_of(model))
    for b in range(-1, len(links)):  # all, then with one twice as heavy: alone, the others would have no inertia
        own.body_mass[:], own.body_inertia[:] = masses, inertias
        if b >= 0:
            own.body_mass[links[b]], own.body_inertia[links[b]] = 2.0 * masses[links[b]], 2.0 * inertias[links[b]]
        for k in range(n):
            data.qpos[places], data.qvel[dofs], data.qacc[dofs] = angle[k], speed[k], acceleration[k]
            if follow:
                couple(own, data.qpos)
            mujoco.mj_inverse(own, data)
            mujoco.mj_fullM(own, data, whole)
            inertia[k, :, b] = whole[dofs, dofs]
            torque[k, :, b] = data.qfrc_inverse[dofs]
    torque, inertia = (some[..., :-1] - some[..., -1:] for some in (torque, inertia))
    return Asked(torque - inertia * acceleration[:, :, None], np.maximum(inertia, 0.0))


# --- The second stage: goals drive the whole arm, with every number moved in a copy of it -----------------------------

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
