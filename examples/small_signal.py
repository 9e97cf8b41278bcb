"""The transfer function of a pulse servo beside simulated sines: where it holds, and what ends it."""

import math

import control
import numpy as np

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
ideal = servo.replace({"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0,
                       "electronics.deadband": 0.0})
loop = st.linear.transfer_function(st.PulseServo(ideal), input="command_angle")
print(f"bandwidth of the mean of the pulses: {control.bandwidth(loop) / (2.0 * math.pi):.2f} Hz")

frequencies = np.geomspace(0.3, 12.0, 20)  # Hz
omega = 2.0 * np.pi * frequencies
formula = np.abs(loop(1j * omega))
drawn = [st.plotting.Curve("transfer function", frequencies, 20.0 * np.log10(formula))]
for label, model, amplitude in (("1°, friction and deadband off", st.PulseServo(ideal), 1.0),
                                ("5°, as it is", st.PulseServo(servo), 5.0),
                                ("40°, as it is", st.PulseServo(servo), 40.0)):
    gain = st.linear.frequency_response(model, omega, amplitude=np.radians(amplitude)).gain[0]
    error = 100.0 * (gain / formula - 1.0)
    print(f"{label}: {error[0]:+.1f} % at {frequencies[0]:g} Hz, {np.interp(1.5, frequencies, error):+.1f} % at 1.5 Hz")
    drawn.append(st.plotting.Curve(label, frequencies, 20.0 * np.log10(gain)))

figure = st.plotting.curves(drawn, x_label="frequency (Hz)", y_label="gain (dB)")
figure.axes[0].set_xscale("log")
figure.axes[0].set_xticks([0.3, 1.0, 3.0, 10.0], ["0.3", "1", "3", "10"])
st.plotting.save(figure, "small_signal.png", overwrite=True)
