"""Frame rate and stiffness: how far a servo sags under a load, when its pulses come more or less often."""

import math

import numpy as np

import servotwin as st

TORQUE = 0.5  # N m
servo = st.load_servo("hitec-hs-755hb")
model = st.PulseServo(servo)

reduction = model.value("gear.gear_reduction")
friction = reduction * model.value("friction.coulomb_torque_forward")
per_angle = model.value("potentiometer.feedback_gain") * model.value("electronics.one_shot_slope")
periods = np.linspace(0.004, 0.024, 11)
stiffness = st.physics.pulse_stiffness(
    reduction * model.value("motor.torque_constant") / model.value("motor.armature_resistance"),
    model.value("supply.open_circuit_voltage") - model.value("supply.bridge_drop_voltage"),
    model.value("electronics.stretcher_gain"), per_angle, periods)
deadband = 0.5 * model.value("electronics.deadband") / per_angle

sags = []
for period in periods:
    command = st.signals.constant(1500.0, unit="us", frame_period=period)
    result = st.simulate(model, command, duration=3.0, load=st.loads.Constant(TORQUE))
    sag = math.degrees(result["command_angle"][0] - result["output_angle"][2000:].mean())
    sags.append(sag)
    print(f"{1e3 * period:4.0f} ms: {sag:5.2f} deg")

Curve = st.plotting.Curve
figure = st.plotting.curves(
    [Curve("half deadband + torque / stiffness", 1e3 * periods, np.degrees(deadband + TORQUE / stiffness)),
     Curve("the same, less what friction holds", 1e3 * periods, np.degrees(deadband + (TORQUE - friction) / stiffness)),
     Curve("pulse servo, mean of the third second", 1e3 * periods, sags, points=True)],
    x_label="frame period (ms)", y_label=f"sag under {TORQUE} N m (°)")
st.plotting.save(figure, "frame_rate.png", overwrite=True)
