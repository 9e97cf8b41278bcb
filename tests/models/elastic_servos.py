"""Servos with a spring between two bodies, and what the independent reference makes of them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import servotwin as st
from reference.elastic import Pair, Trace, solve

N = 200.0
VALUES: dict[str, dict[str, Any]] = {
    "motor": {"armature_resistance": 3.0, "torque_constant": 1.0 / N, "back_emf_constant": 1.0 / N,
              "rotor_inertia": 4e-3 / N**2, "motor_viscous_friction": 1e-3 / N**2},
    "gear": {"gear_reduction": N, "output_inertia": 1e-3, "stiffness": 80.0, "damping": 0.02},
    "friction": {"coulomb_torque_forward": 0.1 / N, "coulomb_torque_backward": 0.12 / N},
    "supply": {"open_circuit_voltage": 6.0},
    "potentiometer": {"feedback_gain": 0.44, "feedback_offset": 0.5},
    "electronics": {"one_shot_slope": 1.3e-3, "stretcher_gain": 60.0, "deadband": 8e-6, "off_state": "brake"},
}
STIFF = {"gear.stiffness": None, "gear.damping": None}
SMOOTH = {"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0}
IDLE = {"electronics.deadband": 5e-3}  # the chip never drives
STOPS = {"stops.lower_angle": -0.05, "stops.upper_angle": 0.4, "stops.restitution": 0.5}
STEP = st.signals.step(0.0, 40.0, at=0.02, unit="deg")
AGAINST_STOP = st.signals.step(700.0, 1100.0, at=0.02, unit="us")
HELD = st.signals.constant(0.0, unit="deg")
DRIVES = {"drive forward": 1, "drive backward": -1, "drive ends": 0}


class Case(NamedTuple):
    """A servo, its load and what it is told."""

    changes: dict[str, Any]
    load: Any
    command: st.signals.Signal = STEP
    initial: dict[str, float] | None = None


Inertia, Coulomb, Constant, Flexible = st.loads.Inertia, st.loads.Coulomb, st.loads.Constant, st.loads.Flexible
CASES = {
    "damped": Case({}, Inertia(2e-3)),
    "undamped": Case({"gear.damping": None}, Inertia(2e-3)),
    "load that sticks": Case({}, Inertia(2e-3) + Coulomb(0.1) + Constant(0.05)),
    "breakaway and drops": Case({"friction.breakaway_ratio": 1.5, "supply.bridge_drop_voltage": 0.4},
                                Inertia(2e-3) + Coulomb(0.05)),
    "play": Case({"gear.backlash": 0.02}, Inertia(2e-3) + Coulomb(0.02)),
    "play, much damping": Case({"gear.backlash": 0.02, "gear.damping": 0.3}, Inertia(2e-3) + Coulomb(0.02)),
    "play, no damping": Case({"gear.backlash": 0.02, "gear.damping": None},
                             Inertia(2e-3) + Coulomb(0.02) + Constant(0.1)),
    "pendulum": Case({}, st.loads.Pendulum(mass=0.2, length=0.15)),
    "spring on the load": Case({}, st.loads.Spring(0.5, 0.2) + Inertia(1e-3)),
    "friction by the torques": Case({"friction.load_friction": 0.2}, Inertia(2e-3) + Constant(0.2)),
    "stops": Case(STOPS, Inertia(2e-3) + Coulomb(0.01), AGAINST_STOP),
    "arm": Case(STIFF, Flexible(stiffness=100.0, inertia=0.01, damping=0.01) + Coulomb(0.02)),
    "heavy arm": Case(STIFF | {"friction.load_friction": 0.2}, Flexible(
        stiffness=30.0, mass=0.2, length=0.15, damping=0.02, viscous_friction=1e-3) + Constant(0.05)),
    "arm against a stop": Case(STIFF | STOPS, Flexible(stiffness=30.0, inertia=5e-3) + Coulomb(0.02), AGAINST_STOP),
}


def random_case(seed: int) -> Case:
    """Return a servo and a load with some of everything, the same for the same seed."""
    rng = np.random.default_rng(seed)
    changes: dict[str, Any] = {}
    load = Inertia(10.0 ** rng.uniform(-3.5, -2.0)) + Coulomb(rng.choice([0.0, rng.uniform(0.0, 0.15)]))
    load += Constant(rng.choice([0.0, rng.uniform(-0.3, 0.3)]))
    if rng.random() < 0.3:
        load += st.loads.Pendulum(mass=0.1, length=rng.uniform(0.05, 0.2), hanging_angle=rng.uniform(-2.0, 2.0))
    if rng.random() < 0.3:
        load += st.loads.Spring(rng.uniform(0.1, 1.0), rng.uniform(-0.3, 0.3))
    damping = rng.choice([0.0, 10.0 ** rng.uniform(-3.0, 0.0)])
    if rng.random() < 0.35:
        changes |= STIFF
        load += Flexible(stiffness=10.0 ** rng.uniform(1.0, 2.5), inertia=10.0 ** rng.uniform(-3.0, -1.7),
                         damping=damping, viscous_friction=rng.choice([0.0, 1e-3]), mass=rng.choice([0.0, 0.1]),
                         length=0.1)
    else:
        changes |= {"gear.stiffness": 10.0 ** rng.uniform(1.3, 2.7), "gear.damping": damping,
                    "gear.backlash": rng.choice([0.0, rng.uniform(2e-3, 0.06)])}
    changes["supply.bridge_drop_voltage"] = rng.choice([0.0, 0.4])
    if rng.random() < 0.5:
        changes["friction.breakaway_ratio"] = rng.uniform(1.0, 2.0)
    else:
        changes["friction.load_friction"] = rng.uniform(0.05, 0.5)
    against = rng.random() < 0.5
    changes |= STOPS | {"stops.restitution": rng.choice([0.0, rng.uniform(0.0, 0.9)])} if against else {}
    return Case(changes, load, AGAINST_STOP if against else STEP)


def servo(changes: dict[str, Any]) -> st.Servo:
    """Return the servo of VALUES with some numbers changed."""
    return st.servo_from_values("elastic", VALUES).replace(changes)


def pair_of(model: st.PulseServo, load: st.loads.Load) -> Pair:
    """Return what the reference solves for, from the servo's own numbers."""
    given, arm = model.servo, load.flexibles[0] if load.flexibles else None

    def value(name: str) -> float:
        number = given.get(name)
        return float(number) if isinstance(number, int | float) else 0.0

    J_m = N**2 * value("motor.rotor_inertia")
    J_2 = value("gear.output_inertia") + load.total_inertia
    gravity, hanging = load.gravity
    stiffness, rest = load.elasticity
    stops = given.stops
    return Pair(
        J1=J_m if arm is None else J_m + J_2, J2=J_2 if arm is None else arm.moment_of_inertia,
        B1=N**2 * value("motor.motor_viscous_friction"), B2=0.0 if arm is None else arm.viscous_friction,
        k=value("gear.stiffness") if arm is None else arm.stiffness,
        c=value("gear.damping") if arm is None else arm.damping, play=value("gear.backlash"), at_gear=arm is None,
        K=N * value("motor.torque_constant"), K_b=N * value("motor.back_emf_constant"),
        R=value("motor.armature_resistance"), R_off=value("motor.armature_resistance"),
        V=value("supply.open_circuit_voltage"), drop=value("supply.bridge_drop_voltage"),
        forward=N * value("friction.coulomb_torque_forward"), backward=N * value("friction.coulomb_torque_backward"),
        breakaway=value("friction.breakaway_ratio") or 1.0, share=value("friction.load_friction"),
        dry=load.coulomb_torque, torque=load.torque, gravity=gravity, hanging=hanging, spring=stiffness, rest=rest,
        weight=0.0 if arm is None else arm.gravity_torque, weight_hanging=0.0 if arm is None else arm.hanging_angle,
        lower=-np.inf if stops.lower_angle is None else stops.lower_angle,
        upper=np.inf if stops.upper_angle is None else stops.upper_angle, restitution=stops.restitution or 0.0)


def bodies(result: st.Result) -> np.ndarray:
    """Return the angles before and behind the spring at the output shaft, shape (n, 2)."""
    if result.load.flexibles:
        return np.array([result["output_angle"], result["load_angle"]]).T
    return np.array([result["motor_angle"] / N, result["output_angle"]]).T


def referred(result: st.Result) -> Trace:
    """Return what the reference says of a run from rest, whose chip drives when it did there."""
    load = result.load
    drives = [(event.time, DRIVES[event.kind]) for event in result.events if event.kind in DRIVES]
    start = float(result["output_angle"][0])
    model = result.model
    assert isinstance(model, st.PulseServo)
    return solve(pair_of(model, load), [(0.0, 0), *drives], (start, 0.0, start, 0.0), result.time)
