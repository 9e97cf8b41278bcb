"""A step from 0 to 180 degrees: the paper's model, and the servo pulse by pulse."""

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
command = st.signals.step(0.0, 180.0, at=0.1, unit="deg")

for model in (st.AveragedServo(servo), st.PulseServo(servo)):
    result = st.simulate(model, command, duration=1.5, load=st.loads.Inertia(1e-3))
    metrics = result.step_metrics()
    print(f"{type(model).__name__:14} rise {metrics.rise_time:.3f} s, peak {result.peak('armature_voltage'):5.1f} V, "
          f"{metrics.peak_current:5.2f} A, solved in {result.stats.method}")

st.plotting.save(st.plotting.time_response(result), "step_response.png", overwrite=True)
result.save("step_response.csv", overwrite=True)
