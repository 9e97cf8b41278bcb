"""Servos of all structures, each with random numbers, as C and as Python."""

import warnings
from functools import cache
from typing import NamedTuple

import numpy as np

import servotwin as st

HEAT = {"thermal.winding_capacity": 3.0, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 10.0,
        "thermal.housing_to_ambient": 20.0}
WORN = {"potentiometer.noise": 2e-3, "potentiometer.backlash": 0.01, "potentiometer.quantisation": 2e-3,
        "potentiometer.linearity_angle": [0.0, 2.0], "potentiometer.linearity_error": [0.0, 0.02]}
PROGRAM = {"firmware.control_period": 1e-3, "firmware.proportional_gain": 6.0, "firmware.integral_gain": 1.0,
           "firmware.derivative_gain": 0.01}
INDUCTANCE = {"motor.armature_inductance": 5e-4}
CLOSED, INTEGRATED = 1e-12, 1e-9  # rad that C may be off


class Structure(NamedTuple):
    """What a servo has; its C has the rest left out."""

    kind: type
    changes: dict
    load: object = None
    off: float = CLOSED
    servo: str = "hitec-hs-755hb"


STRUCTURES = {
    "plain": Structure(st.PulseServo, {}),
    "coasting": Structure(st.PulseServo, {"electronics.off_state": "coast", "supply.internal_resistance": 0.5}),
    "silent": Structure(st.PulseServo, {"electronics.silence_state": "coast", "electronics.pulse_timeout": 0.05}),
    "stretcher": Structure(st.PulseServo, {"electronics.stretcher_time_constant": 0.05,
                                           "electronics.back_emf_injection": 0.05}),
    "worn": Structure(st.PulseServo, WORN),
    "regulated": Structure(st.PulseServo, {"supply.current_limit": 0.8, "supply.internal_resistance": 0.2}),
    "shares": Structure(st.PulseServo, {"friction.load_friction": 0.2}, st.loads.Constant(0.1)),
    "creeping": Structure(st.PulseServo, {"friction.breakaway_ratio": 1.4, "friction.stribeck_speed": 5.0},
                          off=INTEGRATED),
    "backlash": Structure(st.PulseServo, {"gear.backlash": 0.02, "gear.output_inertia": 1e-4}),
    "elastic": Structure(st.PulseServo, {"gear.stiffness": 20.0, "gear.output_inertia": 1e-4}, off=INTEGRATED),
    "flexible": Structure(st.PulseServo, {}, st.loads.Flexible(stiffness=2.0, inertia=1e-3), INTEGRATED),
    "warm": Structure(st.PulseServo, HEAT, off=INTEGRATED),
    "pendulum": Structure(st.PulseServo, {}, st.loads.Pendulum(mass=0.1, length=0.12) + st.loads.Coulomb(0.01),
                          INTEGRATED),
    "spring": Structure(st.PulseServo, {}, st.loads.Spring(0.3, 1.0)),
    "endless": Structure(st.PulseServo, {"stops.lower_angle": None, "stops.upper_angle": None,
                                         "stops.restitution": None, "potentiometer.fixed_angle": 1.0}),
    "inductive": Structure(st.PulseServoInductive, INDUCTANCE, off=INTEGRATED),
    "everything": Structure(st.PulseServoInductive, INDUCTANCE | HEAT | WORN | {
        "friction.breakaway_ratio": 1.4, "friction.stribeck_speed": 5.0, "friction.load_friction": 0.1,
        "gear.backlash": 0.02, "gear.output_inertia": 1e-4, "supply.internal_resistance": 0.2}, off=INTEGRATED),
    "bounded": Structure(st.BoundedServo, {}),
    "averaged": Structure(st.AveragedServo, {}, off=INTEGRATED),
    "averaged with inductance": Structure(st.AveragedServoInductive, INDUCTANCE, off=INTEGRATED),
    "on a bus": Structure(st.DigitalServo, {}, st.loads.Inertia(1e-3), servo="feetech-sts3215-12v"),
    "digital": Structure(st.DigitalServo, PROGRAM),
    "digital, worn": Structure(st.DigitalServo, PROGRAM | WORN | HEAT | {"firmware.off_state": "diode"},
                               off=INTEGRATED),
}
VARIED = ("motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
          "friction.coulomb_torque_forward", "friction.coulomb_torque_backward", "electronics.deadband",
          "electronics.stretcher_gain", "firmware.proportional_gain", "supply.open_circuit_voltage",
          "electronics.bridge_gain", "friction.zero_crossing_slope", "gear.backlash", "gear.stiffness",
          "motor.armature_inductance", "friction.load_friction", "thermal.winding_capacity")


@cache
def model_of(name, draw):
    """Return a servo of a structure; draw 0 has the numbers of the catalog, others those within 15 % of them."""
    own = STRUCTURES[name]
    servo = st.load_servo(own.servo).replace(own.changes)
    rng = np.random.default_rng([7, draw, *name.encode()])
    values = {key: servo.get(key) * rng.uniform(0.85, 1.15) for key in VARIED if servo.get(key) is not None}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return own.kind(servo.replace(values) if draw else servo)


def commands(model, rng):
    """Return a pulse [s] or a goal [rad], and its unit."""
    if isinstance(model, st.DigitalServo) and model.takes_goals:
        return float(rng.uniform(0.1, 2.0)), "rad"
    return float(rng.uniform(1.1e-3, 1.8e-3)), "s"
