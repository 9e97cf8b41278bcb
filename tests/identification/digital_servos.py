"""Digital servos whose parameters are known, with pulses and on a bus, and logs of them."""

from dataclasses import replace

import numpy as np

import servotwin as st
from identification.synthetic_logs import shape
from servotwin.identification import Log

REDUCTION = 250.0
TICK = 5e-3  # s
DISC = st.loads.Inertia(4e-3) + st.loads.Constant(0.2)
_PLANT = {
    "motor": {"armature_resistance": 2.0, "torque_constant": 0.9 / REDUCTION, "back_emf_constant": 0.9 / REDUCTION,
              "rotor_inertia": 6e-3 / REDUCTION**2, "motor_viscous_friction": 0.02 / REDUCTION**2},
    "gear": {"gear_reduction": REDUCTION},
    "friction": {"coulomb_torque_forward": 0.12 / REDUCTION, "coulomb_torque_backward": 0.12 / REDUCTION},
    "supply": {"open_circuit_voltage": 6.0, "bridge_drop_voltage": 0.1},
}
PULSED = replace(st.servo_from_values("digital", {
    **_PLANT,
    "electronics": {"one_shot_slope": 1e-3, "one_shot_offset": 1.5e-3, "frame_period": 0.01},
    "potentiometer": {"feedback_gain": 0.6, "feedback_offset": 0.0},
    "firmware": {"control_period": TICK, "proportional_gain": 4.0, "derivative_gain": 0.03,
                 "deadband_angle": 6e-3}}), kind="digital")
ON_BUS = replace(st.servo_from_values("bus", {
    **_PLANT, "firmware": {"control_period": TICK, "proportional_gain": 3.0, "command_kind": "goal"}}), kind="bus")
PLANT = {"motor.armature_resistance": 1.2, "motor.torque_constant": 0.85, "motor.back_emf_constant": 0.85,
         "motor.rotor_inertia": 1.4, "friction.coulomb_torque_forward": 0.7, "friction.coulomb_torque_backward": 0.7}


def off(servo, factors):
    """Return a servo some of whose numbers are so many times as large."""
    return servo.replace({name: factor * servo.get(name) for name, factor in factors.items()})


def digital_log(servo, motion, *, seed=0, std=1e-3, duration=1.2, sample=0.02, name=None, gain=None, phase=0.0,
                delay=0.0, reach=0.8, load=DISC):
    """Return a log of a digital servo with white noise; of another gain of its loop where one is given, which it says.

    Its ticks begin at `phase` of their period; what is measured is as old as the delay, before which the shaft rests.
    """
    time = np.arange(0.0, duration, sample)
    command = reach * shape(motion, time, seed)
    own = {} if gain is None else {"firmware.proportional_gain": gain}
    log = Log(name=name or f"{motion} {seed}", time=time, command=command, command_kind="angle",
              measured={"output_angle": np.zeros(len(time))}, load=load, motion=motion, parameters=own)
    there = servo.replace({**own, "firmware.control_phase": phase * servo.firmware.control_period})
    result = st.simulate(st.DigitalServo(there), log.signal(servo.electronics.frame_period), load=load,
                         duration=float(time[-1]), initial={"output_angle": 0.0, "output_speed": 0.0})
    angle = result.at("output_angle", np.maximum(time - delay, 0.0))
    noise = std * np.random.default_rng(seed).normal(size=len(time))
    return replace(log, measured={"output_angle": angle + noise})
