"""Ten thousand servos with the spread of a production, and how far off they stop under a load."""

import numpy as np
from matplotlib.figure import Figure

import servotwin as st

servo = st.load_servo("hitec-hs-755hb")
random = np.random.default_rng(0)
spread = {"motor.armature_resistance": 0.08, "friction.coulomb_torque_forward": 0.25,
          "electronics.stretcher_gain": 0.2, "electronics.deadband": 0.3}  # relative standard deviations, assumed
parameters = {name: servo.get(name) * np.exp(deviation * random.standard_normal(10_000))
              for name, deviation in spread.items()}

batch = st.simulate_many(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.5,
                         load=st.loads.Constant(0.2), parameters=parameters, output_times=[1.5], progress=True)
error = 60.0 - np.degrees(batch.raise_if_failed()["output_angle"][:, -1])
for share in (5, 50, 95):
    print(f"{share:2d} % of {len(batch)} servos stop less than {np.percentile(error, share):.2f} deg short of 60 deg")

figure = Figure()
axes = figure.subplots()
axes.hist(error, bins=80)
axes.set(xlabel="steady error with 0.2 N m [deg]", ylabel="servos")
st.plotting.save(figure, "many_servos.png", overwrite=True)
