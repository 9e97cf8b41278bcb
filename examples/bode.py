"""Transfer functions: the geared motor of eq. (22), and the servo's loop for small signals."""

import math

import control

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
load = st.loads.Inertia(1e-3) + st.loads.Viscous(1e-4)
print(st.linear.transfer_function(st.GearedMotor(servo), load=load))

loop = st.linear.transfer_function(st.PulseServo(servo), input="command_angle", load=load)
print(f"bandwidth of the angle command: {control.bandwidth(loop) / (2.0 * math.pi):.1f} Hz")
print("poles:", ", ".join(f"{p:.1f}" for p in loop.poles()))
