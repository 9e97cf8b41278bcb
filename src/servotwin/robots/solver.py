"""How often MuJoCo's solver iterates where motor and output of a servo move apart.

There the joint's armature is the output's alone, a few g cm², so that what touches the ground is nearly massless. A
solver that is stopped before it has converged then gives it contact forces that do work: energy from nowhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from servotwin.errors import InputError
from servotwin.robots.mount import Joint

LEAST = {"iterations": 10, "ls_iterations": 20}
"""Of MuJoCo's `opt`. A solver that converges earlier stops earlier; on legs of servos with play 3 and 5 suffice."""
_CHOICES = ("raised", "given")
_LOOSE = ("gear.backlash", "gear.stiffness")


RAISED, TOO_FEW = "solver iterations raised", "few solver iterations"


class SolverNote(NamedTuple):
    """What was done about a model's solver: kind of the remark, `RAISED` or `TOO_FEW`, and a sentence."""

    kind: str
    words: str


def set_iterations(model: Any, joints: Sequence[Joint], solver: str) -> SolverNote | None:
    """Raise the iterations of a model's solver to `LEAST` if a servo has play or an elastic gear.

    Parameters
    ----------
    model : MjModel
    joints : sequence of Joint
    solver : str
        "raised", or "given": leave them as they are.

    Returns
    -------
    SolverNote or None
        What was raised, or what is low and was left; None if neither.

    Raises
    ------
    InputError
        If `solver` is neither.
    """
    if solver not in _CHOICES:
        raise InputError("solver", got=solver, allowed="'raised' or 'given'")
    loose = [joint.name for joint in joints if any(joint.mount.model.value_or(name, 0.0) > 0.0 for name in _LOOSE)]
    low = {name: int(getattr(model.opt, name)) for name, least in LEAST.items() if getattr(model.opt, name) < least}
    if not loose or not low:
        return None
    where = f"joint {loose[0]}" + (f" and {len(loose) - 1} more" if len(loose) > 1 else "")
    if solver == "given":
        found = " and ".join(f"{name} = {given} (at least {LEAST[name]} is safe)" for name, given in low.items())
        return SolverNote(TOO_FEW, f"{found} of MuJoCo's solver may let energy appear from nowhere at {where}, with "
                                   "play or an elastic gear")
    for name in low:
        setattr(model.opt, name, LEAST[name])
    found = " and ".join(f"{name} from {given} to {LEAST[name]}" for name, given in low.items())
    return SolverNote(RAISED, f"MuJoCo's solver was raised, {found}, for {where} with play or an elastic gear")
