"""Where the energy went: an integral of every power over the continuous solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import physics
from servotwin.models.engine.observe import stored_energy
from servotwin.models.outputs import electrical_of, motor_speed_of, torques_of, warm_plant
from servotwin.models.state.modes import Vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.models.samples import Samples
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces
    from servotwin.simulation.trajectory import Trajectory


@dataclass(frozen=True)
class Energy:
    """Energy balance of a run [J]; supply = winding + bridge + brush + friction + stops + load + stored + residual.

    Parameters
    ----------
    supply : float
        Delivered by the supply: ∫ V_bus i dt of a pulse servo's bus, ∫ v_a i_a dt at the motor's terminals for models
        with a mean voltage; negative when the motor feeds back.
    winding : float
        Heat in the armature resistance.
    bridge, brush : float
        Heat in the bridge and at the brushes; zero for models with a mean armature voltage.
    conversion : float
        Mechanical power that k_a ≠ k_b makes of electrical power; zero for an ideal motor.
    friction : float
        Heat in motor and gear, viscous and dry, and in the damper of an elastic gear.
    stops : float
        Lost in impacts, on the end stops and at the ends of the gear's play.
    load : float
        Given to the load: its damping, dry friction and external torque (its inertia counts as stored, and so does a
        spring between shaft and load).
    stored : float
        Increase of kinetic and magnetic energy, and of that in a spring between two bodies.
    residual : float
        What does not balance; rounding and quadrature.
    """

    supply: float
    winding: float
    bridge: float
    brush: float
    conversion: float
    friction: float
    stops: float
    load: float
    stored: float
    residual: float


def energy_of(model: Model, trajectory: Trajectory, drive: Pieces, load: Load) -> Energy:
    """Return the energy balance of a whole run."""
    def powers(samples: Samples) -> NDArray[np.float64]:
        plant = warm_plant(model, samples, load)
        circuit = electrical_of(plant, samples, drive)
        i, w_m = circuit.armature_current, motor_speed_of(plant, samples)
        torques = torques_of(model, samples, drive, load)
        converted = physics.back_emf(w_m, plant.motor.K_b) * i - torques.motor * w_m
        return np.array(np.broadcast_arrays(
            circuit.supply_power, physics.copper_loss(i, plant.motor.R), circuit.bridge_power, circuit.brush_power,
            converted, torques.gear_loss, torques.load_power))

    supply, winding, bridge, brush, conversion, friction, to_load = trajectory.integral(powers).tolist()
    stored, stops = _kinetic(model.plant(load), trajectory)
    return Energy(supply, winding, bridge, brush, conversion, friction, stops, to_load, stored,
                  supply - winding - bridge - brush - conversion - friction - stops - to_load - stored)


def _kinetic(plant: Numbers, trajectory: Trajectory) -> tuple[float, float]:
    """Return the energy stored over the run, and what impacts took."""
    own = trajectory.segments
    if not len(own):
        return 0.0, 0.0

    def stored(index: Any, ages: Any, ends: bool) -> list[float]:
        states = own.shown(np.asarray(index), np.asarray(ages), ends=ends)[:7].T.tolist()
        return [stored_energy(plant, Vector(*y)) for y in states]

    lengths = own.ends - own.anchors
    met = np.flatnonzero(own.anchors[1:] == own.starts[1:])
    lost = sum((before - after for before, after in zip(
        stored(met, lengths[met], True), stored(met + 1, np.zeros(len(met)), False), strict=True)), 0.0)
    last, first = stored([len(own) - 1, 0], [lengths[-1], own.starts[0] - own.anchors[0]], False)
    return last - first, lost
