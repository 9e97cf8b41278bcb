"""From a data sheet to a servo with ranges, and a sheet that cannot be true."""

import math

import servotwin as st

point = st.SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=math.pi / 3 / 0.23, no_load_current=0.285)
sheet = st.Sheet(name="acme-s1", points=(point,), deadband=8e-6, source="the maker's list")
servo = st.servo_from_sheet(sheet)
for name in ("motor.armature_resistance", "motor.torque_constant", "friction.coulomb_torque_forward",
             "electronics.deadband", "motor.rotor_inertia"):
    known = servo.source(name)
    print(f"{name:32} {known.value:10.4g} {known.unit:7} {known.origin:9} {known.spread}")
print("flags:", "; ".join(st.identification.sheet_flags(sheet)))

result = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0)
metrics = result.step_metrics()
print(f"60° in {metrics.rise_time:.2f} s, up to {metrics.peak_current:.2f} A")
servo.save("acme-s1.toml", overwrite=True)

wonder = st.SheetPoint(supply_voltage=6.0, stall_torque=2.5, no_load_speed=math.pi / 3 / 0.11, no_load_current=0.1,
                       stall_current=2.1)
try:
    st.servo_from_sheet(st.Sheet(name="wonder", points=(wonder,)))
except st.errors.InputError as error:
    print(error)
