"""Pulses that do not come: one of three lost, and none at all, with a load on the shaft."""

import numpy as np

import servotwin as st

model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
load = st.loads.Constant(0.6)  # N m
FRAME, WIDTH, DURATION = 0.02, 1500.0, 2.0
edges = FRAME * np.arange(100)

drawn = []
for name, kept in {
    "every pulse": edges >= 0.0,
    "one of three lost": np.arange(100) % 3 != 2,
    "none after 1 s": edges < 1.0,
}.items():
    command = st.signals.pulse_train(edges[kept], np.full(kept.sum(), WIDTH))
    result = st.simulate(model, command, duration=DURATION, load=load)
    sag = np.degrees(result["command_angle"] - result["output_angle"])
    print(f"{name:18} sags by {sag[600:1000].mean():5.2f} deg, at the end by {sag[-1]:5.2f} deg")
    drawn.append(st.plotting.Curve(name, result.time, -sag))
figure = st.plotting.curves(drawn, x_label="time (s)", y_label="angle from the command (°)")
figure.axes[0].set_ylim(-25.0, 1.0)
st.plotting.save(figure, "missing_pulses.png", overwrite=True)
