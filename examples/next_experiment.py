"""What to record next: which log would narrow the widest interval most, before a single one is recorded."""

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
free = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque"]
for words, sensors in (("angle alone", ()), ("with a current sensor at hand", ("supply_current",))):
    advice = st.advise(servo, free=free, priors=None, sensors=sensors)
    print(f"{words}: best, middle and last of {len(advice.experiments)} experiments")
    for experiment in (advice.experiments[0], advice.experiments[len(advice.experiments) // 2],
                       advice.experiments[-1]):
        widths = ", ".join(f"{name.split('.')[-1]} ±{100.0 * width:.2g} %" if width < 10.0 else
                           f"{name.split('.')[-1]} undetermined" for name, width in experiment.widths.items())
        print(f"  {experiment}: {widths}")
