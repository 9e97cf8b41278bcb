"""What the bridge does between its drives: a step with a bridge that brakes, and with one that coasts."""

import numpy as np

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
command = st.signals.step(60.0, 120.0, at=0.05, unit="deg")

drawn = []
for name in ("brake", "coast"):
    model = st.PulseServo(servo.replace({"electronics.off_state": name}))
    result = st.simulate(model, command, duration=0.8)
    metrics = result.step_metrics()
    print(f"{name}: overshoots by {60.0 * metrics.overshoot:.2f} deg, "
          f"stands {np.degrees(metrics.steady_error):+.2f} deg short, {result.energy.supply:.2f} J")
    drawn.append(st.plotting.Curve(name, 1e3 * result.time, np.degrees(result["output_angle"])))
figure = st.plotting.curves(drawn, x_label="time (ms)", y_label="output angle (°)",
                            limits=[st.plotting.Limit("command", 120.0)])
st.plotting.save(figure, "brake_or_coast.png", overwrite=True)
