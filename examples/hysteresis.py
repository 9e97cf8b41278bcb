"""Angle over pulse width, slowly up and down: the loop that deadband and friction leave."""

import numpy as np

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
RISE = 4.0  # s from one end to the other
corners = RISE * np.arange(4)
command = st.signals.samples(corners, [1470.0, 1530.0, 1470.0, 1530.0], unit="us", hold="linear")

drawn = []
for name, model in (("pulse servo", st.PulseServo(servo)), ("servo with the mean of its pulses",
                                                            st.PulseServo(servo).averaged())):
    result = st.simulate(model, command, duration=3.0 * RISE, output_step=0.01)
    settled = result.time >= RISE  # the first way up starts inside the loop
    width, angle = 1e6 * result["pulse_width"][settled], np.degrees(result["output_angle"][settled])
    middle = np.abs(width - 1500.0) < 0.1
    print(f"{name}: the loop is {np.ptp(angle[middle]):.2f} deg wide")
    drawn.append(st.plotting.Curve(name, width, angle))
figure = st.plotting.curves(drawn, x_label="pulse width (µs)", y_label="output angle (°)", height=3.6)
st.plotting.save(figure, "hysteresis.png", overwrite=True)
