"""Which servo for a motion: a candidate at the joints of a robot, or at one joint with a mass on an arm."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple
from xml.sax.saxutils import escape

from servotwin.datasheet.choice import Candidate, Limits, Reason
from servotwin.errors import InputError, SimulationError, UnknownNameError
from servotwin.models import mid_travel
from servotwin.robots.model_file import Plant, driven_joints, joint_names, robot_model
from servotwin.robots.motion import Motion
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import RobotRun, run_motion
from servotwin.robots.servos.mount import Mount
from servotwin.robots.sizing import Sizing, sizing_of

if TYPE_CHECKING:
    from servotwin.parameters import Supply
    from servotwin.physics import Temperatures

_ARM = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body>
<joint name="{joint}" axis="0 -1 0"/><inertial pos="{arm:.9g} 0 0" mass="{mass:.9g}" diaginertia="1e-12 1e-12 1e-12"/>
</body></worldbody></mujoco>"""
_NOTHING = (1e-9, 1e-3)  # kg, m: what a free shaft carries
_REST = 1e-6  # rad, by which a travel may be passed: rounding of a table


class Tried(NamedTuple):
    """A candidate that has followed a motion.

    Parameters
    ----------
    candidate : Candidate
        With the reasons that the motion adds.
    run : RobotRun, optional
        None where it could not begin.
    sizing : dict of str to Sizing
        By joint.
    """

    candidate: Candidate
    run: RobotRun | None
    sizing: dict[str, Sizing]

    @property
    def worst(self) -> Sizing | None:
        """The joint with the smallest margin."""
        return min(self.sizing.values(), key=lambda each: each.margin, default=None)

    @property
    def margin(self) -> float:
        """That margin; nan where the candidate could not begin."""
        return math.nan if self.worst is None else self.worst.margin

    def peak(self, joint: str) -> float:
        """Return the most that the servo of a joint took of its supply during the motion, at the ends of ticks [A]."""
        if self.run is None:
            return math.nan
        record = self.run.record[joint]
        drawn = record["supply_current" if "supply_current" in record else "armature_current"]
        return float(drawn[record.time >= 0.0].max())

    def hottest(self) -> Temperatures | None:
        """Return the temperatures of the hottest joint after ten minutes of the motion; None if one is not known."""
        found = [each.heating.soon for each in self.sizing.values() if each.heating is not None]
        return max(found, key=lambda now: now.winding) if found and len(found) == len(self.sizing) else None


def arm_of(joint: str, lift: tuple[float, float] | None) -> Any:
    """Return a robot of one joint: a mass [kg] on an arm [m] that is horizontal at 0 and goes up, or a free shaft.

    Examples
    --------
    >>> arm_of("arm", (0.1, 0.2)).body_mass.tolist()
    [0.0, 0.1]
    """
    mass, arm = _NOTHING if lift is None else lift
    return robot_model(load_mujoco().MjSpec.from_string(_ARM.format(
        joint=escape(joint, {'"': "&quot;"}), mass=mass, arm=arm)))


def moved_joints(plant: Plant, motion: Motion, joints: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the joints that candidates are put at: hinges that the robot drives, and those that are named.

    Raises
    ------
    InputError, UnknownNameError
        If there is no such joint, the motion says nothing of it, or a joint that moves is a slide.
    """
    kinds, driven = joint_names(plant.model), driven_joints(plant, motion.joints).joints
    for joint in joints:
        if joint not in kinds:
            raise UnknownNameError("joint of --joint", joint, kinds)
        if joint not in motion.angles:
            raise InputError(f"--joint {joint}", got=f"no column of it in {motion.source}",
                             allowed=", ".join(motion.joints))
    slide = next((joint for joint in motion.joints if kinds[joint] == "length"), None)
    if slide is not None:
        raise InputError(f"joint {slide} of {motion.source}", got="a slide",
                         allowed="hinges; servotwin robot run takes slides, with --mount")
    return tuple(joint for joint, kind in kinds.items() if kind == "angle" and (joint in driven or joint in joints))


def try_motion(candidate: Candidate, plant: Plant, motion: Motion, *, joints: Sequence[str] = (),
               bus: Supply | None = None, limits: Limits | None = None, overlap: str = "keep") -> Tried:
    """Let a candidate at all joints follow a motion, and say what speaks against it at those that are asked about.

    The middle of the way of each joint is the middle of the servo's travel.

    Parameters
    ----------
    candidate : Candidate
        With a model.
    plant : Plant
    motion : Motion
    joints : sequence of str
        That count; those that the motion moves unless given.
    bus : Supply, optional
        That the joints share.
    limits : Limits, optional
        Of which the current is that of the run.
    overlap : str
        As of `run_motion`; a candidate that cannot be judged has that as its reason.
    """
    at, asked = moved_joints(plant, motion, joints), joints or motion.joints
    model = candidate.model
    if model is None:
        return Tried(candidate, None, {})
    too_far = [reason for joint in asked for reason in _too_far(candidate, motion, joint)]
    if too_far:
        return Tried(_with(candidate, too_far), None, {})
    mounts = {joint: Mount(model, zero=_middle(plant.model, motion, joint) - mid_travel(model)) for joint in at}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            run = run_motion(plant, mounts, motion, bus=bus, joint_friction="clear", overlap=overlap)
            sizing = sizing_of(run)
    except (InputError, SimulationError) as error:
        return Tried(_with(candidate, [Reason("motion", str(error))]), None, {})
    done = Tried(candidate, run, {joint: sizing[joint] for joint in asked if joint in sizing})
    found = []
    for joint, each in done.sizing.items():
        where = f"{joint}: " if len(done.sizing) > 1 else ""
        found += [Reason("motion", where + text) for text in each.problems]
        if limits is not None and limits.current is not None and done.peak(joint) > limits.current:
            found.append(Reason("current", f"{where}draws up to {done.peak(joint):.2f} A"))
    return done._replace(candidate=_with(candidate, found))


def _with(candidate: Candidate, found: Sequence[Reason]) -> Candidate:
    return replace(candidate, reasons=(*candidate.reasons, *found))


def _middle(plant: Any, motion: Motion, joint: str) -> float:
    if joint not in motion.angles:
        return float(plant.qpos0[plant.jnt_qposadr[plant.joint(joint).id]])
    return 0.5 * float(motion.angles[joint].min() + motion.angles[joint].max())


def _too_far(candidate: Candidate, motion: Motion, joint: str) -> list[Reason]:
    way = float(motion.angles[joint].max() - motion.angles[joint].min()) if joint in motion.angles else 0.0
    if not way > candidate.travel + _REST:
        return []
    return [Reason("travel", f"{joint} moves {math.degrees(way):.4g} deg, the servo travels "
                             f"{math.degrees(candidate.travel):.4g} deg")]

