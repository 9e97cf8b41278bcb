"""Random digital servos with random subsets of what real ones have, the same for the same seed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import servotwin as st
from models.digital_servos import COUNT, PLANT

T_C, N = 1e-3, 345.0  # s, reduction of `PLANT`
FIRMWARE = {"control_period": T_C, "command_kind": "goal", "proportional_gain": 6.0, "compute_delay": T_C}


class Drawn(NamedTuple):
    """A servo, its load, and the names of what was drawn."""

    model: st.DigitalServo
    load: st.loads.Load
    terms: tuple[str, ...]


def terms(rng: np.random.Generator) -> dict[str, dict[str, Any]]:
    """Return the numbers of every term by its name, or the load under "load"."""
    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    coulomb = between(1e-4, 4e-4)
    trip = {"firmware.overload_duty": 0.5, "firmware.overload_time": 0.02, "firmware.overload_output": 0.2,
            "firmware.stall_travel": 0.05}
    return {
        "play": {"gear.backlash": between(2e-3, 0.04), "gear.output_inertia": 2e-6},
        "load friction": {"friction.load_friction_motor": between(0.05, 0.4),
                          "friction.load_friction_external": between(0.05, 0.4)},
        "bridge drop": {"supply.bridge_drop_voltage": between(0.1, 0.5), "supply.bridge_drop_resistance": 0.2},
        "battery": {"supply.internal_resistance": between(0.05, 0.5)},
        "brush drop": {"motor.brush_drop_voltage": between(0.1, 0.3)},
        "elastic gear": {"gear.stiffness": between(50.0, 250.0), "gear.damping": between(0.01, 0.1),
                         "gear.output_inertia": 2e-6},
        "stops": {"stops.lower_angle": -between(0.1, 0.4), "stops.upper_angle": between(0.1, 0.4),
                  "stops.restitution": float(rng.choice([0.0, 0.4]))},
        "potentiometer": {"potentiometer.feedback_gain": 0.42, "potentiometer.feedback_offset": 1.2,
                          "potentiometer.noise": 1e-3},
        "quantum": {"firmware.angle_quantum": COUNT, "firmware.derivative_gain": 0.03,
                    "firmware.derivative_ticks": 5.0},
        "whole counts": {"firmware.angle_quantum": COUNT, "firmware.duty_quantum": 1e-3,
                         "firmware.whole_counts": "yes", "firmware.minimum_duty": 0.016,
                         "firmware.deadband_angle": COUNT, "firmware.filter_weight": 0.8},
        "delay": {"firmware.compute_delay": float(rng.choice([0.0, 0.4e-3]))},
        "profile": {"firmware.speed_limit": between(2.0, 6.0), "firmware.acceleration_limit": between(15.0, 60.0)},
        "overload": trip,
        "current": {"firmware.trip_current": between(0.8, 2.0), "firmware.trip_time": 0.01},
        "off state": {"firmware.off_state": str(rng.choice(["diode", "coast"]))},
        "torque off": {"firmware.torque_off_state": "brake"},
        "sides": {"friction.coulomb_torque_forward": coulomb, "friction.coulomb_torque_backward": 1.5 * coulomb},
        "breakaway": {"friction.breakaway_ratio": between(1.1, 1.6)},
        "integral": {"firmware.integral_gain": 20.0, "firmware.integral_limit": 0.2},
        "current limit": {"firmware.current_limit": between(0.2, 1.2),
                          "firmware.current_sense": str(rng.choice(["motor", "bus"]))},
        "slew": {"firmware.duty_slew": between(20.0, 100.0)},
        "feedforward": {"firmware.velocity_feedforward": 0.05, "firmware.acceleration_feedforward": 1e-3},
        "measured derivative": {"firmware.derivative_gain": 0.03, "firmware.derivative_of": "measurement"},
        "silence": {"firmware.signal_timeout": 0.03, "firmware.signal_loss": str(rng.choice(["limp", "failsafe"])),
                    "firmware.failsafe_angle": 0.1},
        "soft start": {"firmware.soft_start_duty": 0.3, "firmware.soft_start_time": 0.03},
        "undervoltage": {"supply.internal_resistance": between(0.5, 1.5), "firmware.undervoltage": 11.0,
                         "firmware.undervoltage_action": str(rng.choice(["stop", "reset"])),
                         "firmware.restart_time": 0.01},
        "Coulomb load": {"load": st.loads.Coulomb(between(0.01, 0.1))},
        "viscous load": {"load": st.loads.Viscous(between(0.005, 0.05))},
        "spring": {"load": st.loads.Spring(between(0.1, 0.6), between(-0.2, 0.2))},
    }


def drawn(seed: int, among: tuple[str, ...] = (), without: tuple[str, ...] = ()) -> Drawn:
    """Return a servo with about a third of the terms, those of `among` in any case."""
    rng = np.random.default_rng(seed)
    every = terms(rng)
    wanted = {name for name in every if rng.random() < 0.3} | set(among)
    chosen = [name for name in every if name in wanted and name not in without]
    load = st.loads.Inertia(float(10.0 ** rng.uniform(-3.3, -2.2))) + st.loads.Constant(float(rng.uniform(-0.3, 0.3)))
    changes: dict[str, Any] = {}
    for name in chosen:
        numbers = dict(every[name])
        load = load + numbers.pop("load") if "load" in numbers else load
        changes |= numbers
    servo = st.servo_from_values("drawn", {**PLANT, "firmware": FIRMWARE}, kind="bus").replace(changes)
    return Drawn(st.DigitalServo(servo), load, tuple(chosen))


def goals(model: st.DigitalServo, seed: int, steps: int, lanes: int) -> np.ndarray:
    """Return goals [rad], new at every step, some of them near each other, as far as the stops let any through."""
    rng, stops = np.random.default_rng((seed, 7)), model.servo.stops
    found = rng.uniform(-0.5, 0.5, (steps, lanes)) * rng.choice([0.1, 1.0], (steps, lanes))
    low, high = (-1.0 if stops.lower_angle is None else stops.lower_angle,
                 1.0 if stops.upper_angle is None else stops.upper_angle)
    return np.asarray(np.clip(found, low, high))


def spread(model: st.DigitalServo, lanes: int, seed: int) -> dict[str, np.ndarray]:
    """Return numbers of lanes that differ: of motor and load, and of what the servo has; some have none of it."""
    rng = np.random.default_rng((seed, 8))
    found = {"motor.armature_resistance": rng.uniform(2.5, 3.5, lanes), "load.torque": rng.uniform(-0.3, 0.3, lanes)}
    for name in ("gear.backlash", "friction.load_friction_motor", "supply.bridge_drop_voltage"):
        value = model.servo.get(name)
        if value:
            found[name] = value * rng.uniform(0.5, 1.0, lanes)
            if name != "gear.backlash" or not model.servo.gear.stiffness:
                found[name] *= rng.random(lanes) < 0.7
    return found
