"""The robot of a fit: its model, its servos, and what stands for them where nobody says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree as Xml

from servotwin.errors import InputError, UnknownNameError
from servotwin.models import Model, default_model
from servotwin.parameters import Servo, Supply, load_servo
from servotwin.parameters.registers.robots import as_robot_has_it, said_of, set_of_robot
from servotwin.robots import Motion, Mount, joint_names, robot_model
from servotwin.robots.coupling import couplings_of

UNKNOWN = "unknown"
_SO101, _ARM_SERVO = "so101", "feetech-sts3215-12v"
_MASS, _REACH, _SPREAD = 0.2, 0.1, 1e-3  # kg, m, kg m²: of the pendulum that stands for an unknown arm


def plant_of(robot: Any, joints: Sequence[str]) -> tuple[Any, tuple[str, ...]]:
    """Return the MjModel of a robot, and what was assumed; "unknown" gives every joint a pendulum of its own."""
    if robot != UNKNOWN:
        return robot_model(robot), ()
    root = Xml.Element("mujoco", model=UNKNOWN)
    Xml.SubElement(root, "option", timestep="0.002")
    Xml.SubElement(root, "compiler", angle="radian", inertiafromgeom="false")
    world = Xml.SubElement(root, "worldbody")
    for k, joint in enumerate(joints):
        body = Xml.SubElement(world, "body", name=f"{joint}_weight", pos=f"0 {k} 0")
        Xml.SubElement(body, "joint", name=joint, axis="0 1 0")
        Xml.SubElement(body, "inertial", pos=f"{_REACH} 0 0", mass=str(_MASS), diaginertia="1e-6 1e-6 1e-6")
        wheel = Xml.SubElement(body, "body", name=f"{joint}_inertia")
        Xml.SubElement(wheel, "inertial", pos="0 0 0", mass="1e-3", diaginertia=f"{_SPREAD} {_SPREAD} {_SPREAD}")
    return robot_model(_spec(Xml.tostring(root, encoding="unicode"))), (
        "no robot file: each joint is a bare servo with an unknown arm, a weight that hangs at an unknown angle and an "
        "inertia; what joints do to each other is not in it",)


def _spec(xml: str) -> Any:
    from servotwin.robots.places import load_mujoco

    return load_mujoco().MjSpec.from_string(xml)


def mounts_of(servos: Any, robot: Any, plant: Any, motions: Sequence[Motion]) -> tuple[dict[str, Mount],
                                                                                       tuple[str, ...]]:
    """Return the servos at the joints of a robot, and what was assumed of them.

    Raises
    ------
    InputError
        If there is no servo, or the joints do not match.
    """
    recorded = [joint for joint in motions[0].measured if all(joint in one.angles for one in motions)]
    joints = [name for name, kind in joint_names(plant).items() if kind == "angle" and name in recorded]
    if not joints:
        raise InputError(f"joints of {motions[0].source}", got=", ".join(motions[0].angles),
                         allowed=f"joints of the robot: {', '.join(joint_names(plant))}")
    kind = motions[0].robot
    if servos is None:
        if robot != _SO101:
            raise InputError("servo of a robot", got="none", allowed="a servo, or one of each joint by its name")
        servos, kind = load_servo(_ARM_SERVO), kind or _SO101
    given = dict(servos) if isinstance(servos, Mapping) else dict.fromkeys(joints, servos)
    for joint in given:
        if joint not in joint_names(plant):
            raise UnknownNameError("joint of the robot", joint, joint_names(plant))
    made, changed = {}, []
    for joint in joints:
        if joint not in given:
            continue
        mount = _mount(given[joint])
        servo = as_robot_has_it(mount.model.servo, kind, joint) if kind else mount.model.servo
        if servo is not mount.model.servo:
            changed.append(set_of_robot(kind, joint))
            mount = Mount(type(mount.model)(servo), mount.zero, mount.direction, mount.ratio)
        made[joint] = mount
    if not made:
        raise InputError("servos", got=", ".join(given), allowed=f"some at recorded joints: {', '.join(joints)}")
    kinds = {type(mount.model) for mount in made.values()}
    if len(kinds) > 1:
        raise InputError("servos of a robot", got=" and ".join(sorted(kind.__name__ for kind in kinds)),
                         allowed="models of one kind")
    free = [name for name in joint_names(plant) if name not in made and name not in couplings_of(plant)]
    return made, (*((said_of(kind, *changed),) if changed else ()), *((
        f"no servo and no recorded goals at {', '.join(free)}: what hangs there moves freely",) if free else ()))


def _mount(given: Any) -> Mount:
    if isinstance(given, Mount):
        return given
    model: Model = default_model(given) if isinstance(given, Servo) else given
    return Mount(model)


def supply_of(bus: Supply | None, mounts: Mapping[str, Mount]) -> Supply | None:
    """Return the supply that all servos share: the given one, or that of the first servo's file."""
    if bus is not None:
        return bus
    model = next(iter(mounts.values())).model
    volts = model.value_or("supply.open_circuit_voltage", 0.0)
    return Supply(open_circuit_voltage=volts, internal_resistance=model.value_or("supply.internal_resistance", 0.0)
                  or None) if volts > 0.0 else None
