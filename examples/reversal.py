"""A slow reversal with play in the gear: the motor crosses the play while the output waits."""

import numpy as np

import servotwin as st

PLAY = 1.0  # deg, the far end of what sheets say
servo = st.load_servo("hitec-hs-755hb").replace({"gear.output_inertia": 1e-5})
load = st.loads.Inertia(1e-4) + st.loads.Coulomb(0.02) + st.loads.Viscous(1e-3)
command = st.signals.samples([0.0, 1.0, 2.0, 3.0], [80.0, 90.0, 80.0, 90.0], unit="deg", hold="linear")

drawn, below = [], []
for name, play in (("without play", 0.0), (f"with a play of {PLAY:g}°", PLAY)):
    model = st.PulseServo(servo.replace({"gear.backlash": np.radians(play)}))
    result = st.simulate(model, command, duration=2.6, load=load)
    angle = np.degrees(result["output_angle"])
    motor = np.degrees(result["motor_angle"]) / model.value("gear.gear_reduction")
    back = result.time[angle > angle.max() - 0.1][-1]
    print(f"{name:20}: the output turns back {1e3 * (back - 1.0):.0f} ms after the command")
    drawn.append(st.plotting.Curve(name, result.time, angle))
    below.append(st.plotting.Curve(name, result.time, motor - angle))
figure = st.plotting.curves(drawn, x_label="time (s)", y_label="output angle (°)", below=below,
                            below_label="motor ahead (°)", height=4.2)
figure.axes[0].set_xlim(0.8, 2.4)
figure.axes[0].set_ylim(80.0, 91.0)
st.plotting.save(figure, "reversal.png", overwrite=True)
