"""Joints that constraints of a model couple to others: they follow these, and have no servo of their own.

An equality of MuJoCo couples two joints (MJCF `<equality><joint>`, URDF `<mimic>`) or those of two fixed tendons
(`<equality><tendon>`), or holds one where it is. Each takes away one degree of freedom, that of the joint that follows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from servotwin.robots.places import load_mujoco

# --- Joints that constraints of a model couple to others --------------------------------------------------------------

_TERMS = 5  # of the polynomial of an equality
_ROUNDS = 50  # of Newton's method
_CLOSE = 1e-12  # rad or m
FORCES = ("gaintype", "biastype", "gainprm", "biasprm", "armature", "damping", "dampingpoly")  # of an actuator


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """A joint that follows others.

    Parameters
    ----------
    joint : str
    drivers : tuple of str
        Joints that move it; none where it is held.
    """

    joint: str
    drivers: tuple[str, ...]

    @property
    def words(self) -> str:
        """One sentence.

        Examples
        --------
        >>> Coupling(joint="grip2", drivers=("grip",)).words
        'grip2 follows grip and gets no servo'
        """
        moved = f"follows {' and '.join(self.drivers)}" if self.drivers else "is held by an equality"
        return f"{self.joint} {moved} and gets no servo"


@dataclass(frozen=True)
class Equality:
    """left − left₀ = p(right − right₀), in joints with coefficients, by number; no right side: left − left₀ = p(0)."""

    number: int
    left: Mapping[int, float]
    right: Mapping[int, float]
    polynomial: Polynomial
    rest: tuple[float, float]

    @property
    def joints(self) -> tuple[int, ...]:
        """Numbers of all joints that it couples."""
        return tuple(dict.fromkeys((*self.left, *self.right)))

    def residual(self, angles: Mapping[int, float]) -> float:
        """Return left − left₀ − p(right − right₀) [rad or m]."""
        left = sum(c * angles[k] for k, c in self.left.items()) - self.rest[0]
        return float(left - self.polynomial(self._right(angles)))

    def slope(self, angles: Mapping[int, float], joint: int) -> float:
        """Return the derivative of the residual by the angle of a joint."""
        of_right = self.right.get(joint, 0.0)
        return self.left.get(joint, 0.0) - float(of_right * self.polynomial.deriv()(self._right(angles)))

    def bend(self, angles: Mapping[int, float], speeds: Mapping[int, float]) -> float:
        """Return what the residual's second derivative by time has that is no acceleration of a joint."""
        turning = sum(c * speeds[k] for k, c in self.right.items())
        return -float(self.polynomial.deriv(2)(self._right(angles)) * turning**2)

    def _right(self, angles: Mapping[int, float]) -> float:
        return sum(c * angles[k] for k, c in self.right.items()) - self.rest[1]


def couplings_of(model: Any) -> Mapping[str, Coupling]:
    """Return the joints of an MjModel that follow others, by name.

    Of two joints the one without an actuator follows; else the first one of the equality, as in URDF.

    Examples
    --------
    >>> import mujoco
    >>> fingers = mujoco.MjModel.from_xml_string('''<mujoco><worldbody>
    ...   <body><joint name="left" axis="0 1 0"/><geom size=".1"/></body>
    ...   <body><joint name="right" axis="0 1 0"/><geom size=".1"/></body></worldbody>
    ...   <equality><joint joint1="right" joint2="left" polycoef="0 -1 0 0 0"/></equality></mujoco>''')
    >>> [coupling.words for coupling in couplings_of(fingers).values()]
    ['right follows left and gets no servo']
    """
    bound, found = bound_by(model), {}
    for follower in bound:
        drivers = [k for k in range(model.njnt) if k not in bound and k in origins(follower, bound)]
        if model.joint(follower).name:
            found[model.joint(follower).name] = Coupling(
                joint=model.joint(follower).name, drivers=tuple(_name(model, k) for k in drivers))
    return MappingProxyType(found)


def couple(model: Any, qpos: Array) -> None:
    """Put the joints that follow others where the others in `qpos` have them, in place, by Newton's method."""
    bound = bound_by(model)
    equalities, followers = list(bound.values()), list(bound)
    angles = {k: float(qpos[model.jnt_qposadr[k]]) for each in equalities for k in each.joints}
    for _ in range(_ROUNDS if bound else 0):
        off = np.array([each.residual(angles) for each in equalities])
        if np.abs(off).max() <= _CLOSE:
            break
        slopes = np.array([[each.slope(angles, k) for k in followers] for each in equalities])
        for k, change in zip(followers, np.linalg.lstsq(slopes, off, rcond=None)[0].tolist(), strict=True):
            angles[k] -= change
    for k in followers:
        qpos[model.jnt_qposadr[k]] = angles[k]


def bound_by(model: Any) -> dict[int, Equality]:
    """Return the number of each joint that follows, with what binds it."""
    actuated = {int(model.actuator_trnid[k, 0]) for k in actuators_at_joints(model)}
    found: dict[int, Equality] = {}
    for equality in equalities_of(model):
        free = [k for k in equality.joints if k not in found]
        if free:  # the first of those without an actuator
            found[min(free, key=lambda k: k in actuated)] = equality
    return found


def origins(follower: int, bound: Mapping[int, Equality], seen: frozenset[int] = frozenset()) -> set[int]:
    """Return all joints that a joint follows, directly or by others that follow themselves."""
    seen |= {follower}
    direct = {k for k in bound[follower].joints if k not in seen}
    return direct | {k for one in direct if one in bound for k in origins(one, bound, seen | direct)}


def equalities_of(model: Any) -> Iterable[Equality]:
    """Give the active equalities of joints and fixed tendons."""
    mujoco = load_mujoco()
    for n in range(model.neq):
        kind = mujoco.mjtEq(int(model.eq_type[n]))
        if not model.eq_active0[n] or kind not in (mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtEq.mjEQ_TENDON):
            continue
        ends = [int(end) for end in (model.eq_obj1id[n], model.eq_obj2id[n]) if end >= 0]
        joint = kind == mujoco.mjtEq.mjEQ_JOINT
        sides = [{end: 1.0} if joint else _of_tendon(mujoco, model, end) for end in ends]
        if all(sides):
            rests = [float(model.qpos0[model.jnt_qposadr[end]] if joint else model.tendon_length0[end]) for end in ends]
            polynomial = Polynomial(model.eq_data[n, :_TERMS if len(ends) == 2 else 1])
            yield Equality(n, sides[0], sides[1] if len(sides) == 2 else {}, polynomial, (rests[0], (*rests, 0.0)[1]))


def _of_tendon(mujoco: Any, model: Any, tendon: int) -> dict[int, float]:
    """Return joints and coefficients of a fixed tendon; none of another."""
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = range(first, first + count)
    if any(model.wrap_type[k] != mujoco.mjtWrap.mjWRAP_JOINT for k in wraps):
        return {}
    return {int(model.wrap_objid[k]): float(model.wrap_prm[k]) for k in wraps}


def actuators_at_joints(model: Any) -> list[int]:
    """Return the numbers of actuators that move one joint."""
    mujoco = load_mujoco()
    at_joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    return [k for k, kind in enumerate(model.actuator_trntype) if int(kind) in at_joint]


def other_actuators(model: Any) -> list[tuple[str, str]]:
    """Return name and transmission, such as "tendon" or "site", of actuators that are at no joint."""
    mujoco, at_joints = load_mujoco(), set(actuators_at_joints(model))
    return [(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) or str(k),
             mujoco.mjtTrn(int(model.actuator_trntype[k])).name.removeprefix("mjTRN_").lower())
            for k in range(model.nu) if k not in at_joints]


def silence(model: Any, actuator: int) -> None:
    """Take away all force of an actuator."""
    for field in FORCES:
        if hasattr(model, f"actuator_{field}"):
            getattr(model, f"actuator_{field}")[actuator] = 0


def led(model: Any, joint: str) -> list[str]:
    """Take away the force of actuators at a joint that follows others; return their names."""
    mujoco, number = load_mujoco(), model.joint(joint).id
    found = [k for k in actuators_at_joints(model) if model.actuator_trnid[k, 0] == number]
    for k in found:
        silence(model, k)
    return [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) or str(k) for k in found]


def tendon_actuators(model: Any, joint: int) -> list[str]:
    """Return the names of actuators that pull at fixed tendons of a joint."""
    mujoco = load_mujoco()
    tendon = int(mujoco.mjtTrn.mjTRN_TENDON)
    return [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) or str(k)
            for k, kind in enumerate(model.actuator_trntype) if int(kind) == tendon
            and joint in _of_tendon(mujoco, model, int(model.actuator_trnid[k, 0]))]


def _name(model: Any, joint: int) -> str:
    return model.joint(joint).name or f"joint {joint}"


# --- How joints move that equalities of a model couple to others, and what they take of these -------------------------

# With all equalities r(q) = 0 of joints that follow (f) and those that drive (d), A = ∂r/∂q:
#
#     A_f q̇_f = −A_d q̇_d,    A_f q̈_f = −A_d q̈_d − (d²r/dt² without accelerations),    τ_d += −A_dᵀ A_f⁻ᵀ τ_f
#
# the last by virtual work: what a follower takes counts at the joints that move it.

Array = NDArray[np.float64]


class Linkage:
    """Joints that follow those of some names, and no others.

    Parameters
    ----------
    model : MjModel
    driven : sequence of str
        Joints whose motion is given.

    Attributes
    ----------
    joints : list of int
        Numbers of those that follow.
    equalities : list of int
        Numbers of what binds them.
    """

    def __init__(self, model: Any, driven: Sequence[str]) -> None:
        bound, self._drivers = bound_by(model), [model.joint(name).id for name in driven]
        known = {*self._drivers, *bound}
        whole = {k: each for k, each in bound.items() if origins(k, bound) <= known}
        self._model, self._bound = model, list(whole.values())
        self.joints, self.equalities = list(whole), [each.number for each in self._bound]

    def follow(self, qpos: Array, qvel: Array, qacc: Array) -> Array:
        """Put angle, speed and acceleration of the followers, in place.

        Returns
        -------
        ndarray, shape (followers, drivers)
            Speed of each follower per speed of each driver.
        """
        if not self.joints:
            return np.zeros((0, len(self._drivers)))
        couple(self._model, qpos)
        dofs = {k: int(self._model.jnt_dofadr[k]) for each in self._bound for k in each.joints}
        angles = {k: float(qpos[self._model.jnt_qposadr[k]]) for k in dofs}
        own, others = (np.array([[each.slope(angles, k) if k in dofs else 0.0 for k in some] for each in self._bound])
                       for some in (self.joints, self._drivers))
        shares = -np.linalg.lstsq(own, others, rcond=None)[0]
        at, driving = self._model.jnt_dofadr[self.joints], self._model.jnt_dofadr[self._drivers]
        qvel[at] = shares @ qvel[driving]
        speeds = {k: float(qvel[dof]) for k, dof in dofs.items()}
        bends = np.array([each.bend(angles, speeds) for each in self._bound])
        qacc[at] = shares @ qacc[driving] - np.linalg.lstsq(own, bends, rcond=None)[0]
        return np.asarray(shares)
