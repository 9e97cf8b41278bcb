"""The energies of the last row of a record: its tick ends where MuJoCo's data stand now."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.robots.crews import Instance
from servotwin.robots.joints_layout import BOOKS, KEPT, ROW
from servotwin.robots.places import load_mujoco

_SAME = 1e-6  # of a tick: within it one instant is another
_WORK = KEPT.index("joint_work")
_COPIED = ("qpos", "qvel", "mocap_pos", "mocap_quat")


def close_books(model: Any, data: Any, instance: Instance, speed_at: Sequence[int], rows: NDArray[np.float64]) -> None:
    """Complete the last row; compiled code has completed the others, each at the beginning of the next tick.

    Parameters
    ----------
    model, data : MjModel, MjData
    instance : Instance
    speed_at : sequence of int
        Places of the joints in qvel.
    rows : ndarray, shape (n, numbers)
        Of the record, changed in place. Where the data have gone elsewhere since, the last row stays nan.
    """
    if not len(rows):
        return
    books = dict(zip(BOOKS, instance.books.tolist(), strict=False))
    n, dofs = len(speed_at), int(model.nv)
    works, speed, force = np.split(instance.books[len(BOOKS):], [n, n + dofs])
    if books["kept"] and abs(data.time - rows[-1, 0]) <= _SAME * books["tick"]:
        mean = 0.5 * (speed + data.qvel) * books["tick"]
        energy, balanced = _energies(model, data)
        torque = rows[-1, _of_each(rows, n, KEPT.index("joint_torque"))]
        rows[-1, _of_each(rows, n, _WORK)] = works + torque * mean[list(speed_at)]
        nowhere = max(books["nowhere"], balanced - books["first"] - books["work"] - float(force @ mean))
        rows[-1, 1:len(ROW)] = energy, nowhere
    if model.nmocap:
        rows[:, ROW.index("energy_from_nowhere")] = math.nan


def _of_each(rows: NDArray[np.float64], servos: int, signal: int) -> NDArray[np.int64]:
    """Return the columns of a signal of all servos."""
    return np.asarray(len(ROW) + signal + (rows.shape[1] - len(ROW)) // servos * np.arange(servos))


def _energies(model: Any, data: Any) -> tuple[float, float]:
    """Return kinetic and potential energy [J] of a state, and what of it counts in the balance of compiled code."""
    mujoco = load_mujoco()
    scratch = mujoco.MjData(model)
    for name in _COPIED:
        getattr(scratch, name)[:] = getattr(data, name)
    mujoco.mj_fwdPosition(model, scratch)
    mujoco.mj_fwdVelocity(model, scratch)
    mujoco.mj_energyPos(model, scratch)
    mujoco.mj_energyVel(model, scratch)
    energy = float(scratch.energy.sum())
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        return energy, energy
    power = float((scratch.qfrc_spring - scratch.qfrc_bias) @ scratch.qvel)
    return energy, energy + 0.5 * model.opt.timestep * power
