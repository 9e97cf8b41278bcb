"""What leads to each way in which the lanes of a `VectorSimulator` run."""

import servotwin as st
from conftest import EVERYTHING

WIDTHS = (1100e-6, 1900e-6, 1500e-6)  # s, one after the other
CASES = {  # what leads to each way in which lanes run
    "plain": ({}, None),
    "coasting, with noise": ({"electronics.off_state": "coast", "potentiometer.noise": 1e-3}, st.loads.Inertia(1e-3)),
    "couplings": ({"electronics.back_emf_injection": 0.02, "electronics.supply_coupling": 0.02,
                   "supply.internal_resistance": 0.3, "electronics.stretcher_time_constant": 0.02}, None),
    "limp after a while": ({"electronics.pulse_timeout": 0.013}, st.loads.Constant(0.1)),
    "frames as short as pulses": ({"electronics.frame_period": 3e-3}, None),
    "stops": ({"stops.lower_angle": 1.2, "stops.upper_angle": 1.9, "stops.restitution": 0.5}, None),
    "spring": ({}, st.loads.Spring(0.1, 0.5)),
    "pendulum": ({}, st.loads.Pendulum(mass=0.1, length=0.1)),
    "recorded": ({}, st.loads.Recorded([0.0, 0.2, 10.0], [0.0, 0.1, -0.1])),
    "play": ({"gear.backlash": 0.02, "gear.output_inertia": 1e-3}, None),
    "limp in another way": ({"electronics.silence_state": "coast", "electronics.pulse_timeout": 0.013}, None),
    "dry load": ({"supply.internal_resistance": 0.3}, st.loads.Inertia(1e-3) + st.loads.Coulomb(0.1)),
    "regulator, load friction": ({"supply.current_limit": 1.2, "supply.internal_resistance": 0.2,
                                  "friction.load_friction_motor": 0.06, "friction.load_friction_external": 0.1}, None),
    "friction that fades with speed": ({"friction.breakaway_ratio": 1.3, "friction.stribeck_speed": 10.0,
                                        "friction.stribeck_exponent": 1.5, "friction.load_friction_motor": 0.06,
                                        "friction.load_friction_motor_stribeck": 0.05}, None),
    "worn potentiometer": ({"potentiometer.backlash": 0.02}, None),
    "everything": (EVERYTHING, st.loads.Recorded([0.0, 0.2, 10.0], [0.0, 0.1, -0.1])),
}
# Those that run side by side with inductance too, or hit stops
INDUCTIVE = ("plain", "coasting, with noise", "couplings", "limp after a while", "frames as short as pulses", "stops",
             "dry load", "worn potentiometer")
INTEGRATED = ("spring", "pendulum")  # side by side by steps of their own: right to 1e-9, not to rounding


def model_of(servo, changes, kind=st.PulseServo):
    if kind is st.PulseServoInductive:
        changes = {"motor.armature_inductance": 5e-4, **changes}
    return kind(servo.replace(changes))
