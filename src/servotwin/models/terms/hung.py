"""What hangs on the shaft, as numbers alone: what terms make their own numbers of, in plain Python and compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from servotwin.models.terms.given import Given, either

if TYPE_CHECKING:
    from servotwin.loads import Load


class Hung(NamedTuple):
    """A load in SI, each a number or a column of lanes; torques that depend on time alone are inputs."""

    inertia: float  # pendulums included
    viscous_friction: float
    coulomb_torque: float
    stiffness: float
    rest_angle: float
    gravity_torque: float  # m g l
    hanging_angle: float
    flexible_stiffness: float  # of the shaft to another body; 0: there is none
    flexible_damping: float
    flexible_inertia: float
    flexible_viscous_friction: float
    flexible_gravity_torque: float
    flexible_hanging_angle: float


NOTHING_HUNG = Hung(*[0.0] * len(Hung._fields))


def hung_of(load: Load) -> Hung:
    """Return the numbers of a load."""
    flexible = (0.0,) * 6
    if load.flexibles:
        arm = load.flexible
        flexible = (arm.stiffness, arm.damping, arm.moment_of_inertia, arm.viscous_friction, arm.gravity_torque,
                    arm.hanging_angle)
    return Hung(load.total_inertia, load.viscous_friction, load.coulomb_torque, *load.elasticity, *load.gravity,
                *flexible)


def inertia_on(given: Given, hung: Hung) -> float:
    """Return J_L [kg m²]: the load's, and that of gear wheel and horn where the servo gives it."""
    return hung.inertia + either(given.gear_output_inertia, 0.0)
