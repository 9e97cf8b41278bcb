"""Which friction law the logs pay for: two rungs of the ladder M1 to M6, judged by logs that were held out."""

import numpy as np

import servotwin as st

sheet = st.load_servo("hitec-hs-755hb")
real = sheet.replace({"friction.load_friction": 0.15, "motor.motor_viscous_friction": 1e-6})  # what nobody knows

rng = np.random.default_rng(0)
time = np.arange(0.0, 1.0, 0.02)
logs = []
for weight in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.15, 0.35):  # on a drum at the shaft [N m]
    angle = 90.0 + 50.0 * np.repeat(rng.uniform(-1.0, 1.0, 5), 10)
    load = st.loads.Constant(weight) + st.loads.Inertia(1e-3)
    run = st.simulate(st.PulseServo(real), st.signals.samples(time, angle, unit="deg"), duration=1.0, load=load,
                      output_times=time)
    logs.append(st.Log(name=f"{weight:g} N m", motion="steps", time=time, command=np.radians(angle), load=load,
                       command_kind="angle",
                       measured={"output_angle": run["output_angle"] + rng.normal(0.0, np.radians(0.1), time.size)}))

ladder = st.friction_ladder(logs, sheet, free=["output_inertia"], rungs=("M1", "M3"), starts=1, nuisance=())
for rung in ladder.rungs:
    print(f"{rung.name}: {np.degrees(rung.training):.2f}° on fitted logs, {np.degrees(rung.holdout):.2f}° on others"
          + (", fits what does not repeat" if rung.overfits else ""))
print(f"{ladder.chosen}: {ladder.reason}")
found = ladder.fit.intervals()["friction.load_friction"]
print(f"load friction {100 * found.lower:.1f} to {100 * found.upper:.1f} % (truth: 15 %)")
