"""Bandwidth depends on the amplitude: the supply ends large sines, deadband and friction small ones."""

import numpy as np

import servotwin as st

model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
frequencies = np.array([0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0])  # Hz

drawn = []
for amplitude in (1.0, 5.0, 20.0, 60.0):  # deg
    gains = []
    for frequency in frequencies:
        command = st.signals.sine(mean=90.0, amplitude=amplitude, frequency=frequency, unit="deg")
        turns = max(6, round(1.5 * frequency))
        result = st.simulate(model, command, duration=2 * turns / frequency)
        time = result.time[result.time >= turns / frequency]  # the second half: settled, and whole turns
        wave = np.exp(-2j * np.pi * frequency * time)
        angle = np.degrees(result["output_angle"][-len(time):])
        gains.append(2.0 * abs(np.mean((angle - angle.mean()) * wave)) / amplitude)
    level = 20.0 * np.log10(gains)
    if level[0] > -3.0:
        limit = np.exp(np.interp(3.0, -level, np.log(frequencies)))
        print(f"{amplitude:4.0f} deg: {limit:.1f} Hz")
    else:
        print(f"{amplitude:4.0f} deg: below {frequencies[0]} Hz")
    drawn.append(st.plotting.Curve(f"±{amplitude:g}°", frequencies, level))
figure = st.plotting.curves(drawn, x_label="frequency (Hz)", y_label="gain (dB)",
                            limits=[st.plotting.Limit("−3 dB", -3.0)])
figure.axes[0].set_xscale("log")
figure.axes[0].set_xticks([0.5, 1.0, 2.0, 5.0, 10.0], ["0.5", "1", "2", "5", "10"])
st.plotting.save(figure, "bandwidth.png", overwrite=True)
