"""How joints move that equalities of a model couple to others, and what they take of these.

With all equalities r(q) = 0 of joints that follow (f) and those that drive (d), A = ∂r/∂q:

    A_f q̇_f = −A_d q̇_d,    A_f q̈_f = −A_d q̈_d − (d²r/dt² without accelerations),    τ_d += −A_dᵀ A_f⁻ᵀ τ_f

the last by virtual work: what a follower takes counts at the joints that move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.robots.coupling import bound_by, couple, origins

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
