"""Bandwidth depends on the amplitude: the supply ends large sines, deadband and friction small ones."""

import numpy as np

import servotwin as st

model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
frequencies = np.geomspace(0.5, 11.0, 14)  # Hz
amplitudes = [1.0, 5.0, 20.0, 60.0]  # deg

seen = st.linear.frequency_response(model, 2.0 * np.pi * frequencies, amplitude=np.radians(amplitudes))
for amplitude, limit in zip(amplitudes, seen.bandwidth(reference=1.0) / (2.0 * np.pi), strict=True):
    below = np.isnan(limit)  # from the lowest frequency on
    print(f"{amplitude:4.0f} deg: " + (f"below {frequencies[0]} Hz" if below else f"{limit:.1f} Hz"))

figure = st.plotting.curves(
    [st.plotting.Curve(f"±{amplitude:g}°", frequencies, 20.0 * np.log10(gain))
     for amplitude, gain in zip(amplitudes, seen.gain, strict=True)],
    x_label="frequency (Hz)", y_label="gain (dB)", limits=[st.plotting.Limit("−3 dB", -3.0)])
figure.axes[0].set_xscale("log")
figure.axes[0].set_xticks([0.5, 1.0, 2.0, 5.0, 10.0], ["0.5", "1", "2", "5", "10"])
st.plotting.save(figure, "bandwidth.png", overwrite=True)
