"""An unpowered servo pushed from outside: friction that grows with the push holds longer than Coulomb friction."""

import numpy as np

import servotwin as st

servo = st.load_servo("hitec-hs-755hb").replace({
    "electronics.off_state": "coast", "friction.breakaway_ratio": 1.1, "friction.stribeck_speed": 20.0})
no_pulse = st.signals.pulse_train([0.0], [1500.0])  # one, at which there is nothing to do
push = st.loads.Recorded([0.0, 4.0], [0.0, 0.8])  # N m towards -q

model = st.PulseServo(servo)
static = 1.1 * model.value("gear.gear_reduction") * model.value("friction.coulomb_torque_backward")
drawn = []
for name, shares in {  # assumed numbers: no sheet has them
    "M2: no load friction": {},
    "M4: 15 % of all torque, 5 % more at rest": {"load_friction": 0.15, "load_friction_stribeck": 0.05},
    "M5: 35 % of the push, 10 % more at rest": {
        "load_friction_motor": 0.05, "load_friction_external": 0.35, "load_friction_external_stribeck": 0.1},
}.items():
    model = st.PulseServo(servo.replace({f"friction.{key}": value for key, value in shares.items()}))
    result = st.simulate(model, no_pulse, duration=4.0, load=push)
    torque, turned = 0.2 * result.time, np.degrees(result["output_angle"] - result["output_angle"][0])
    static_share = sum(value for key, value in shares.items() if "motor" not in key)
    print(f"{name:41} starts at {torque[np.argmax(turned < -1e-3)]:.3f} N m, "
          f"expected {st.physics.back_drive_torque(static, static_share):.3f}")
    drawn.append(st.plotting.Curve(name, torque, turned))
figure = st.plotting.curves(drawn, x_label="push at the output (N m)", y_label="angle turned (°)")
st.plotting.save(figure, "back_driving.png", overwrite=True)
