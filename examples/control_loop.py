"""A loop around the servo: it reads the angle 50 times a second and integrates the error away that friction leaves."""

import math

import servotwin as st

sim = st.Simulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), load=st.loads.Constant(0.1))
target = math.radians(60.0)
correction = 0.0
state = sim.initial(st.signals.constant(0.0, unit="rad"))

for frame in range(1, 151):
    command = st.signals.constant(target + correction, unit="rad")
    state = sim.advance(state, 0.02 * frame, command)
    error = target - state["output_angle"]
    if abs(error) < math.radians(10.0):
        correction += 0.02 * error
    if frame % 25 == 0:
        print(f"t = {state.time:.2f} s   angle {math.degrees(state['output_angle']):7.3f} deg   "
              f"correction {math.degrees(correction):6.3f} deg")
