"""Know your servo: from logs of what it did to parameters with intervals, and a report."""

import numpy as np

import servotwin as st

sheet = st.load_servo("hitec-hs-755hb")
mine = sheet.replace({"motor.armature_resistance": 3.4, "motor.rotor_inertia": 6e-8,
                      "electronics.stretcher_gain": 90.0})  # what nobody knows: this servo stands for yours

rng = np.random.default_rng(1)
time = np.arange(0.0, 2.0, 0.02)
steps = [1500.0 + np.repeat([0.0, size, -size, size / 4.0], 25) for size in (200.0, 400.0, 600.0, 800.0)]
toggles = [1500.0 + size * np.repeat(rng.choice([-1.0, 1.0], 20), 5) for size in (100.0, 200.0, 300.0, 400.0)]
logs = []
for motion, widths in (("steps", steps), ("random", toggles)):
    for k, width in enumerate(widths):
        load = st.loads.Inertia(5e-3 * (k % 2))  # every other one with a disc on the horn
        run = st.simulate(st.PulseServo(mine), st.signals.samples(time, width, unit="us"), duration=2.0, load=load,
                          output_step=1e-3)
        angle = np.interp(time - 0.03, run.time, run["output_angle"])  # the rig sees it 30 ms later
        logs.append(st.Log(name=f"{motion} {k}", motion=motion, time=time, command=1e-6 * width, load=load,
                           command_kind="pulse_width",
                           measured={"output_angle": angle + rng.normal(0.0, np.radians(0.1), time.size)}))

free = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "electronics.stretcher_gain"]
fit = st.identify(logs, sheet, free=free, compare_with=("slew",), progress=True)
for name, (low, high, method) in fit.intervals().items():
    print(f"{name:26} {fit.estimates[name]:9.4g} ({low:.4g} to {high:.4g}) {fit.units[name]}, {method}")
for item in fit.unidentifiable:
    print(item)
for motion, errors in fit.holdout.by("motion").items():
    print(f"{motion}, held out:", ", ".join(f"{model} {np.degrees(error):.2f}°" for model, error in errors.items()))
fit.servo.save("fitted-servo.toml", overwrite=True)
fit.report("fit.html", overwrite=True)
