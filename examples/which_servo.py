"""A mass has to be lifted: which servos can, what the lightest of them does with it, and its curves."""

import servotwin as st

MASS, ARM, VOLTAGE = 0.25, 0.1, 5.0  # kg, m, V
found = st.servos_that_lift(MASS, ARM, voltage=VOLTAGE, time=0.4)
print(f"{found.torque:.3f} N m at {VOLTAGE} V, 60 degrees within 0.4 s: {len(found.found)} servos can")
for each in found.found[:5]:
    print(f"  {each.servo.name}: {1e3 * each.mass:.0f} g, {each.margin:.1f} times the torque, {each.time:.2f} s "
          f"{'; '.join(each.notes)}")

model = st.models.default_model(found.found[0].servo)
sheet = st.curves(model, VOLTAGE, (MASS, ARM), bandwidth=False)
part = sheet.at(VOLTAGE)
print(f"{sheet.servo.title}: {part.cold.stall_torque:.2f} N m cold, {part.hot.stall_torque:.2f} N m hot; moving it "
      f"draws {part.lift.swing.mean_current:.2f} A, holding it {part.lift.held.current:.2f} A")
print(f"ten minutes of holding: winding at {part.lift.warming.now.winding - 273.15:.0f} deg C, by masses that are "
      f"{'assumed' if part.lift.warming.masses.assumed else 'known'}")
st.plotting.save(st.plotting.speed_curves(sheet), "which_servo.png", overwrite=True)
