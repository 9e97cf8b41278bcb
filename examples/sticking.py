"""Friction that holds, and the smoothed friction of the paper that creeps: the same weight on two models."""

import math

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
weight = st.loads.Constant(0.2)  # N m, less than the gear holds
command = st.signals.constant(90.0, unit="deg")

for model in (st.BoundedServo(servo), st.AveragedServo(servo)):
    result = st.simulate(model, command, duration=1000.0, load=weight, output_step=1.0)
    angle = result["output_angle"]
    print(f"{type(model).__name__:14} moved {math.degrees(angle[0] - angle[-1]):.6f} deg in 1000 s")
