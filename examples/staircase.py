"""Commands in steps of a microsecond, up and down again: where the shaft follows, and where it stands."""

import numpy as np

import servotwin as st

HOLD = 0.5  # s, time of a step
servo = st.load_servo("hitec-hs-755hb")
widths = np.concatenate((np.arange(1500.0, 1514.0), np.arange(1512.0, 1497.0, -1.0)))
command = st.signals.samples(HOLD * np.arange(len(widths)), widths, unit="us")
pulsed = st.PulseServo(servo)

drawn = []
for name, model in {
    "pulse servo": pulsed,
    "drives of 0.5 ms at least": st.PulseServo(servo.replace({"electronics.minimum_drive_time": 0.5e-3})),
    "mean of the pulses": pulsed.averaged(),
}.items():
    result = st.simulate(model, command, duration=HOLD * len(widths), output_step=0.01)
    angle = np.degrees(result["output_angle"])
    jumps = np.abs(np.diff(angle[int(100 * HOLD) - 1::int(100 * HOLD)]))  # between the ends of two steps
    print(f"{name:25} stands for {np.sum(jumps < 1e-3)} of {len(jumps)} steps, jumps by {jumps.max():.2f} deg at most")
    drawn.append(st.plotting.Curve(name, result.time, angle))
asked = np.degrees(result["command_angle"])
figure = st.plotting.curves([*drawn, st.plotting.Curve("asked for", result.time, asked)],
                            x_label="time (s)", y_label="output angle (°)", height=3.4)
figure.axes[0].set_ylim(top=asked.max() + 0.7)  # room for the legend
st.plotting.save(figure, "staircase.png", overwrite=True)
