"""A servo file of your own: start from one of the catalog, change what you know, save it, use it."""

import math

import servotwin as st

mine = st.load_servo("towerpro-mg90s").replace({
    "motor.armature_resistance": 4.9,  # measured between the motor's terminals [ohm]
    "supply.open_circuit_voltage": 5.0,
})
mine.save("my-mg90s.toml", overwrite=True)

servo = st.load_servo("my-mg90s.toml")
print(f"{servo.title}: {len(servo.names())} parameters, "
      f"{sum(servo.source(name).origin == 'assumed' for name in servo.names())} of them assumed")
command = st.signals.step(-60.0, 60.0, unit="deg")
for volts in (4.0, 5.0, 6.0):
    model = st.PulseServo(servo.replace({"supply.open_circuit_voltage": volts}))
    metrics = st.simulate(model, command, duration=1.0).step_metrics()
    print(f"{volts:.0f} V: {math.degrees(metrics.slew_rate):4.0f} deg/s, {metrics.peak_current:.2f} A")
