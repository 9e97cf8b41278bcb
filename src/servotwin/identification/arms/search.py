"""The problem of a robot's fit, and how far simulated joints are off it."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.rows import (
    Copies,
    Episode,
    Linear,
    Mask,
    Noise,
    Numbers,
    linear_at,
    model_columns,
    parts_of,
    residuals,
    steps_by,
    used_rows,
    usual_steps,
)
from servotwin.identification.fitting.search.case import HUBER
from servotwin.identification.fitting.search.least_squares import Loss, Prior, block, bounded_step
from servotwin.robots import ServoDrive
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import ticks_in
from servotwin.robots.servos.coupling import couple, couplings_of
from servotwin.simulation import VectorSimulator

# --- Demands of a robot's measured motion on each joint: torques and inertias, link by link ---------------------------

# tau_j = M_jj q''_j + sum over others of M_jk q''_k + Coriolis + gravity
#
# The first term is that of the joint's own motion, which a simulated servo has itself; the rest is a torque that comes
# to it from outside. Both are linear in the masses of the links, where a link keeps its centre and the shape of its
# inertia.

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
    """Demands of a robot's motions on its joints, of zeros near those that were asked for before: worked out once.

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
    """Demands of an episode at some zeros, and how the torque changes with those that were asked for."""

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


# --- The first stage --------------------------------------------------------------------------------------------------

# All joints, and copies of them with one number moved, run side by side, each as if it were alone on the supply; what
# the others draw, and how long turns take that stamps only count, counts in the second stage. Time is that of the
# goals: a joint at a stamp t is where its lane is at t less the latency.

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
_PARTS = 2  # of a sample: over each of them the torque stays
_DIGITS = 12  # of torques [N m] and inertias [kg m²] that tell lanes apart


class JointLanes(Copies):
    """Lanes of the joints of a robot; parameters as of `Copies`, and what its motions ask of them."""

    def __init__(self, plant: Any, numbers: Numbers, links: Sequence[int], look: Callable[[], object],
                 demand: Demand) -> None:
        super().__init__(plant, numbers, links, look)
        self.demand = demand
        self.models = [mount.model for mount in numbers.mounts.values()]
        self._gain = np.array([mount.gain for mount in numbers.mounts.values()])
        self._zero = np.array([mount.zero for mount in numbers.mounts.values()])

    def angles(self, episode: Episode, points: Array, *, fine: bool = False) -> Array:
        """Return where the joints are, shape (copies, n, joints) [rad]; nan of a failed lane."""
        return self.run(episode, points, self.numbers.columns(points), fine=fine)

    def run(self, episode: Episode, points: Array, columns: Sequence[Mapping[str, Array]], *,
            fine: bool = False) -> Array:
        """Return where the joints are with servos whose numbers are columns (copies,), a mapping for each joint."""
        copies, joints = len(points), len(self.models)
        time = episode.time
        grid = np.interp(np.arange(_PARTS * (len(time) - 1) + 1) / _PARTS, np.arange(len(time)), time)
        torque, inertia = self._asked(episode, points, grid)
        numbers = model_columns(self.models, columns, copies, fine=fine)
        own, same = _alike(joints, torque, inertia, numbers)
        torque, inertia = (np.ascontiguousarray(some[:, own]) for some in (torque, inertia))
        sims = VectorSimulator(self.models[0], len(own), threads=1,
                               parameters={name: values[own] for name, values in numbers.items()})
        goals = np.ascontiguousarray(((episode.goals - self._zero) / self._gain)[:, own % joints])
        first = ((episode.measured[0] - self._zero) / self._gain)[own % joints]
        sims.reset(command_angle=goals[0], output_angle=first)
        angle, speed = np.zeros((2, len(grid), len(own)))
        angle[0] = first
        entry = sims.c_entry()  # one call of compiled code for each step
        tick, row = entry.tick(), angle.strides[0]
        command, outside, load, angles, speeds = (some.ctypes.data for some in (goals, torque, inertia, angle, speed))
        for k, step in enumerate(np.diff(grid).tolist()):
            begins = k % _PARTS == 0
            if begins:
                self.look()
            tick.duration = step
            tick.command_angle = command + k // _PARTS * row if begins else None
            tick.set_load_inertia = load + k * row if begins else None
            tick.external_torque = outside + k * row
            tick.output_angle, tick.output_speed = angles + (k + 1) * row, speeds + (k + 1) * row
            entry.advance(tick)
        late = np.array([self.numbers.latency(x) for x in points])
        angle, speed = (some[:, same].reshape(-1, copies, joints) for some in (angle, speed))
        found = _hermite(grid, angle, speed, time[:, None] - late)
        return np.asarray(np.moveaxis(found, 0, 1) * self._gain + self._zero)

    def _asked(self, episode: Episode, points: Array, grid: Array) -> tuple[Array, Array]:
        """Return external torques and inertias at the servos between the times of a grid, shape (parts, lanes)."""
        middles, found = 0.5 * (grid[1:] + grid[:-1]), []
        zeros, masses = (np.array([of(x) for x in points]) for of in (self.numbers.zeros, self.numbers.masses))
        for x, (torque, inertia) in zip(points, self.demand.torques(episode, zeros, masses), strict=True):
            late = middles + self.numbers.latency(x)
            found.append([np.stack([np.interp(late, episode.time, column) for column in some.T], axis=1)
                          for some in (torque * self._gain, inertia * self._gain**2)])
        torques, inertias = (np.concatenate([one[k] for one in found], axis=1) for k in range(2))
        return torques, inertias


def _alike(joints: int, torque: Array, inertia: Array, numbers: Mapping[str, Array]) -> tuple[Indices, Indices]:
    """Return lanes that differ, and which of these each lane is like: many a number moves few joints."""
    lanes = torque.shape[1]
    rows = np.column_stack([np.arange(lanes) % joints, *(some for some in numbers.values() if some.dtype.kind == "f"),
                            np.round(torque.T, _DIGITS), np.round(inertia.T, _DIGITS)])
    _, own, same = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return own, same.ravel()


def _hermite(grid: Array, angle: Array, speed: Array, at: Array) -> Array:
    """Return angles between the times of a grid by cubics, shape (n, copies, joints); before it the first one."""
    place = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
    step = grid[place + 1] - grid[place]
    s = np.clip((at - grid[place]) / step, 0.0, None)[..., None]
    copy = np.arange(angle.shape[1])[None, :]
    a, b = angle[place, copy], angle[place + 1, copy]
    va, vb = speed[place, copy] * step[..., None], speed[place + 1, copy] * step[..., None]
    return np.asarray(a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb))))


# --- The search of a robot's numbers: bounded least squares with a robust loss (Levenberg, Marquardt) -----------------

Tell = Callable[[int, Array], object]  # the number of a step, and the best point so far
_DAMPINGS = (1e-4, 0.1, 10.0)  # tried side by side
_LEAST_GAIN = 3e-3  # of the cost: servos that count make it rough
_LEAST_GAIN_ALONG = 3e-4  # likewise, where a step costs little
_ROUGH = 2e-3  # of the cost: what counting servos scatter it by
_RETRIES, _FIRMER = 2, 300.0  # of steps that gained nothing, with so many times the damping


class Trial(NamedTuple):
    """A point that a step leads to, its cost, and the residuals of all episodes there."""

    x: Array
    cost: float
    residuals: list[Array]


class ArmSearch:
    """A least-squares problem over episodes of a robot.

    Parameters
    ----------
    simulated : Copies
    episodes : sequence of Episode
    used : sequence of ndarray of bool
        Which samples of each count.
    noise : Noise
    loss : Loss
    prior : Prior
    held : ndarray of bool
        Numbers that stay.
    steps : ndarray, optional
        For derivatives, on the scales of the numbers; the longest ones unless given. Each derivative mends them.
    """

    def __init__(self, simulated: Copies, episodes: Sequence[Episode], used: Sequence[Mask], noise: Noise,
                 loss: Loss, prior: Prior, held: Mask, steps: Array | None = None) -> None:
        self.simulated, self.episodes, self.used = simulated, list(episodes), list(used)
        self.noise, self.loss, self.prior, self.held = noise, loss, prior, held
        self.steps = usual_steps(simulated.numbers) if steps is None else steps

    def cost(self, x: Array, found: Sequence[Array]) -> float:
        """Return the cost of a point whose residuals are known; inf where a lane failed."""
        total = self.prior.cost(x)
        for episode, residual, used in zip(self.episodes, found, self.used, strict=True):
            total += sum(self.loss.cost(part.residual) for part in parts_of(episode, residual, None, self.noise, used))
        return total if math.isfinite(total) else math.inf

    def costs(self, points: Array) -> list[float]:
        """Return the costs of several points."""
        return [self.cost(x, found) for x, found in zip(points, self.left(points), strict=True)]

    def left(self, points: Array) -> list[list[Array]]:
        """Return the residuals of all episodes at several points."""
        found = [residuals(self.simulated, episode, points) for episode in self.episodes]
        return [[one[k] for one in found] for k in range(len(points))]

    def linear(self, x: Array, *, central: bool = False) -> list[Linear]:
        """Return residuals and derivatives of all episodes at a point."""
        found = [linear_at(self.simulated, episode, x, self.held, self.steps, central=central)
                 for episode in self.episodes]
        self.steps = steps_by(usual_steps(self.simulated.numbers), np.concatenate(
            [part.shared for episode, one, used in zip(self.episodes, found, self.used, strict=True)
             for part in parts_of(episode, one.residual, one.slopes, self.noise, used)]))
        return found

    def normal(self, x: Array, found: Sequence[Array], slopes: Sequence[Array]) -> tuple[Array, Array]:
        """Return gradient and matrix of the normal equations."""
        g, H = (x - self.prior.mean) * self.prior.weight**2, np.diag(self.prior.weight**2)
        for episode, residual, slope, used in zip(self.episodes, found, slopes, self.used, strict=True):
            for part in parts_of(episode, residual, slope, self.noise, used):
                one = block(part, self.loss)
                g, H = g + one.g_s, H + one.H_ss
        return g, H

    def tried(self, x: Array, g: Array, H: Array, scale: float) -> list[Trial]:
        """Return points of steps that are damped more and more, their costs and residuals."""
        lower, upper = self.simulated.numbers.lower, self.simulated.numbers.upper
        own = np.diag(np.maximum(np.diag(H), 1e-9))
        points = np.stack([np.clip(x + bounded_step(x, g, H + scale * damping * own, lower, upper, self.held), lower,
                                   upper) for damping in _DAMPINGS])
        return [Trial(point, self.cost(point, found), found)
                for point, found in zip(points, self.left(points), strict=True)]

    def along(self, x: Array, slopes: Sequence[Array], *, most: int, tell: Tell = lambda step, x: None) -> Array:
        """Return the best point that steps by the same derivatives come to."""
        scale, found = 1.0, self.left(x[None])[0]
        best = self.cost(x, found)
        for turn in range(most):
            tell(turn, x)
            trials = self.tried(x, *self.normal(x, found, slopes), scale)
            k = int(np.argmin([one.cost for one in trials]))
            if turn == 0 and trials[0].cost < best * (1.0 + _ROUGH):  # what no data hold goes back to what is believed
                k = 0
            elif not trials[k].cost < best * (1.0 - _LEAST_GAIN_ALONG):
                break
            (x, best, found), scale = trials[k], scale * (1.0 if k < 2 else 10.0)
        return x

    def run(self, x: Array, *, most: int, tell: Tell = lambda step, x: None) -> Array:
        """Return the best point that a search from another one comes to."""
        best, scale = math.inf, 1.0
        for step in range(most):
            tell(step, x)
            linear = self.linear(x)
            found = [one.residual for one in linear]
            best = self.cost(x, found)
            normal = self.normal(x, found, [one.slopes for one in linear])
            for _ in range(_RETRIES):
                trials = self.tried(x, *normal, scale)
                k = int(np.argmin([one.cost for one in trials]))
                if trials[k].cost < best:
                    break
                scale *= _FIRMER
            else:
                break
            gain = best - trials[k].cost
            x, scale = trials[k].x, max(scale * (0.3 if k == 0 else 1.0), 1e-3)
            if gain < _LEAST_GAIN * best:
                break
        return x


# --- The problem of a robot's fit, and how far simulated joints are off it --------------------------------------------

class Problem(NamedTuple):
    """A fit's robot, numbers, links, episodes and their samples, what is called, and what motions ask for."""

    plant: Any
    numbers: Numbers
    links: list[int]
    episodes: list[Episode]
    used: list[Mask]
    look: Callable[[], object]
    demand: Demand

    @property
    def prior(self) -> Prior:
        """The beliefs."""
        return Prior(self.numbers.start, self.numbers.weight)

    def shorter(self, seconds: float) -> Problem:
        """Return the problem of the parts of so many seconds in which goals go furthest."""
        parts = [(one, used) if rows.all() else (part := one.part(rows), used[rows] & used_rows(part))
                 for one, used in zip(self.episodes, self.used, strict=True) for rows in (one.busiest(seconds),)]
        return self._replace(episodes=[one for one, _ in parts], used=[used for _, used in parts])

    def lanes(self) -> JointLanes:
        """Return the joints one by one."""
        return JointLanes(self.plant, self.numbers, self.links, self.look, self.demand)

    def whole(self) -> WholeArm:
        """Return the whole robot."""
        return WholeArm(self.plant, self.numbers, self.links, self.look)

    def search(self, simulated: Copies, noise: Noise, prior: Prior | None = None,
               steps: Array | None = None) -> ArmSearch:
        """Return the least-squares problem of a stage; `steps` are those of derivatives."""
        return ArmSearch(simulated, self.episodes, self.used, noise, Loss(HUBER), prior or self.prior,
                         np.zeros(len(self.numbers), np.bool_), steps)

    def left(self, simulated: Copies, x: Array) -> list[Array]:
        """Return simulated less measured angles of all episodes at a point, shape (n, joints) each."""
        return [residuals(simulated, episode, x[None])[0] for episode in self.episodes]

    def at_bound(self, x: Array) -> Mask:
        """Return which numbers are at a bound."""
        return np.asarray((x <= self.numbers.lower + 1e-9) | (x >= self.numbers.upper - 1e-9))
