"""Pulse servos that warm up, or whose current has inertia, drawn with whatever else a stranger's servo may have."""

from dataclasses import dataclass
from typing import Any

import numpy as np

import servotwin as st
from servotwin.errors import ParameterError

DURATION = 0.24  # s
GIVEN = {
    "motor": {"armature_resistance": 3.1, "torque_constant": 3.7e-3, "back_emf_constant": 3.8e-3,
              "rotor_inertia": 8e-8, "motor_viscous_friction": 1e-7},
    "gear": {"gear_reduction": 280.0, "output_inertia": 5e-4},
    "friction": {"coulomb_torque_forward": 9e-4, "coulomb_torque_backward": 8e-4},
    "electronics": {"bridge_gain": 40.0, "comparator_gain": 0.8, "voltage_to_pulse_gain": 1.09e-3,
                    "command_pulse_offset": 0.0, "one_shot_slope": 1.36e-3, "one_shot_offset": 1e-4,
                    "pulse_to_voltage_gain": 1.0 / 1.36e-3, "command_offset": -1e-4 / 1.36e-3, "deadband": 6e-6,
                    "stretcher_gain": 80.0, "frame_period": 0.02, "off_state": "brake"},
    "potentiometer": {"feedback_gain": 0.42, "feedback_offset": 0.6},
    "supply": {"open_circuit_voltage": 6.0},
}


@dataclass(frozen=True)
class Case:
    """A model, what it is told, what hangs on it, how it starts, and numbers of its lanes."""

    model: st.PulseServo | st.PulseServoInductive
    command: st.signals.Signal
    load: Any
    initial: dict[str, float]
    parameters: dict[str, np.ndarray]
    said: str

    def alone(self, lane: int) -> tuple[Any, Any]:
        """Return model and load of one lane by itself."""
        own = {name: values[lane].item() for name, values in self.parameters.items()}
        load = self.load + st.loads.Inertia(own.pop("load.inertia")) + st.loads.Constant(own.pop("load.torque"))
        return type(self.model)(self.model.servo.replace(own)), load


def heat(rng: np.random.Generator) -> dict[str, float]:
    """Return two thermal masses: as usual, so small that they follow at once, or so large that nothing warms."""
    size = rng.choice([1.0, 1.0, 1.0, 0.03, 1e-3, 1e9])
    ways = 10.0 ** rng.uniform(-1.0, 3.0, 2) if rng.integers(4) == 0 else rng.uniform(4.0, 30.0, 2)
    found = {"thermal.winding_capacity": size * rng.uniform(0.3, 3.0),
             "thermal.housing_capacity": size * rng.uniform(3.0, 60.0), "thermal.winding_to_housing": ways[0],
             "thermal.housing_to_ambient": ways[1]}
    if rng.integers(2):
        large = 2e-2 / size if size > 1.0 else -4e-3
        found["thermal.magnet_coefficient"] = rng.choice([-1e-3, -2e-3, 1e-3, 0.0, large])
    if rng.integers(3) == 0:
        found["thermal.ambient"] = rng.uniform(220.0, 360.0)
    return found


def others(rng: np.random.Generator) -> dict[str, Any]:
    """Return what else a servo has: much of this, or little."""
    share = rng.choice([4, 8, 12])
    may = (
        {"electronics.off_state": "coast"}, {"electronics.silence_state": str(rng.choice(["coast", "brake"]))},
        {"electronics.pulse_timeout": rng.uniform(0.004, 0.05)}, {"electronics.pulse_width_max": 1.8e-3},
        {"electronics.minimum_drive_time": rng.uniform(1e-4, 2e-3)},
        {"electronics.back_emf_injection": 0.01}, {"electronics.supply_coupling": 0.02},
        {"electronics.stretcher_time_constant": 0.02},
        {"supply.internal_resistance": rng.uniform(0.05, 1.0)}, {"supply.current_limit": rng.uniform(0.3, 1.8)},
        {"supply.bridge_drop_voltage": rng.uniform(0.05, 0.5)}, {"supply.bridge_drop_resistance": 0.15},
        {"motor.brush_drop_voltage": rng.uniform(0.05, 0.4)},
        {"friction.breakaway_ratio": rng.uniform(1.0, 1.6)},
        {"stops.upper_angle": rng.uniform(0.7, 1.4), "stops.lower_angle": rng.uniform(-0.4, 0.4),
         "stops.restitution": rng.choice([0.0, 0.4, 0.9])},
        {"gear.backlash": 10.0 ** rng.uniform(-4.0, -1.5)}, {"gear.backlash": 0.01},
        {"potentiometer.backlash": 0.01}, {"potentiometer.noise": 1e-3})
    found: dict[str, Any] = {}
    for one in may:
        found |= one if rng.integers(share) == 0 else {}
    if rng.integers(3) == 0:
        found |= {"friction.load_friction_motor": rng.uniform(0.0, 0.3),
                  "friction.load_friction_external": rng.uniform(0.0, 0.3)}
    if rng.integers(6) == 0:
        found |= {"friction.breakaway_ratio": 1.3, "friction.stribeck_speed": 10.0 ** rng.uniform(0.0, 2.0)}
    return found


def hung(rng: np.random.Generator) -> Any:
    """Return a load, to which each lane adds a torque and an inertia of its own."""
    load = st.loads.Inertia(0.0) + st.loads.Constant(0.0)
    may = (st.loads.Pendulum(mass=0.1, length=0.08), st.loads.Spring(0.15, 0.5), st.loads.Coulomb(0.04),
           st.loads.Viscous(3e-3), st.loads.Recorded([0.0, 0.05, 0.11, 9.0], [0.0, 0.2, -0.15, 0.1]))
    for one in may:
        load = load + one if rng.integers(14) == 0 else load
    return load


def told(rng: np.random.Generator) -> tuple[st.signals.Signal, dict[str, float]]:
    """Return a command and the frame that goes with it: a train with gaps, or pulses that change in each frame."""
    kind, frame = rng.integers(4), rng.choice([0.003, 0.02, 0.025])
    if kind == 0:
        gaps = rng.choice([0.004, 0.02, 0.06], 40)
        edges = 0.002 + np.cumsum(gaps)
        edges = edges[edges < DURATION]
        return st.signals.pulse_train(list(edges), list(rng.uniform(900.0, 2000.0, len(edges)))), {}
    if kind == 1:
        at = np.arange(0.0, DURATION, frame)
        widths = rng.uniform(0.9e-3, 2.0e-3, len(at))
        return st.signals.samples(at, widths, unit="s"), {"electronics.frame_period": frame}
    at = np.concatenate(([0.0], np.sort(rng.uniform(0.0, DURATION, 3))))
    widths = rng.uniform(0.9e-3, 2.0e-3, 4)
    if kind == 2 and frame > 0.003:
        widths[rng.integers(4)] = 3e-3  # no servo with a limit takes it
    return st.signals.samples(at, widths, unit="s"), {"electronics.frame_period": frame}


def case(seed: int, lanes: int = 4) -> Case:
    """Return the case of a seed."""
    rng = np.random.default_rng([seed, 71])
    while True:
        command, frame = told(rng)
        warms, coiled = [(True, False), (True, True), (False, True)][rng.integers(3)]
        changes = frame | others(rng) | (heat(rng) if warms else {})
        if coiled:
            changes["motor.armature_inductance"] = 10.0 ** rng.uniform(-4.5, -2.5)
        if warms and not coiled and rng.integers(2):
            changes = {name: x for name, x in changes.items() if not name.startswith("friction.stri")}
        changes = {name: x if isinstance(x, str) else float(x) for name, x in changes.items()}
        load = hung(rng)
        try:
            servo = st.servo_from_values("drawn", GIVEN).replace(changes)
            model = (st.PulseServoInductive if coiled else st.PulseServo)(servo)
            break
        except ParameterError:
            continue
    parameters = {
        "motor.armature_resistance": 3.1 * rng.uniform(0.8, 1.2, lanes),
        "friction.coulomb_torque_forward": 9e-4 * rng.uniform(0.3, 1.5, lanes),
        "electronics.stretcher_gain": 80.0 * rng.uniform(0.5, 1.5, lanes),
        "load.inertia": rng.uniform(0.0, 5e-3, lanes), "load.torque": rng.uniform(-0.25, 0.25, lanes)}
    initial = {"output_angle": rng.uniform(0.5, 0.7), "output_speed": float(rng.choice([0.0, 0.0, -3.0, 4.0]))}
    return Case(model, command, load, initial, parameters, str(changes | {"load": load}))
