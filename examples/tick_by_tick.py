"""Five hundred servos of one kind, none like the other, hold an arm that is pushed: what a policy meets at every tick.

`VectorSimulator` stops after each tick and goes on with new commands and torques. An outer loop at 50 Hz sees the
angle of each horn alone and corrects its command by the integral of the error.
"""

import numpy as np

import servotwin as st

LANES, TICK, SECONDS = 500, 1e-3, 3.0
rng = np.random.default_rng(4)
model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
spread = {"electronics.stretcher_gain": rng.uniform(60.0, 180.0, LANES),
          "electronics.deadband": rng.uniform(3e-6, 12e-6, LANES),
          "motor.armature_resistance": rng.uniform(2.8, 3.7, LANES)}
wanted = np.full(LANES, np.radians(90.0))


def held(correcting: bool) -> np.ndarray:
    """Return how far each horn is from where it should be, after pushes that change twice a second [deg]."""
    sims = st.VectorSimulator(model, LANES, load=st.loads.Inertia(2e-3), parameters=spread, seed=1)
    sims.reset(command_angle=wanted)
    pushes = np.random.default_rng(5)
    command, torque = wanted.copy(), np.zeros(LANES)
    for k in range(round(SECONDS / TICK)):
        if k % 500 == 0:
            torque = pushes.uniform(-0.4, 0.4, LANES)
        if correcting and k % 20 == 0:
            command += 0.15 * (wanted - sims["output_angle"])
        sims.advance(TICK, command_angle=command, external_torque=torque)
    return np.degrees(np.abs(sims["output_angle"] - wanted))


for name, error in (("as it is", held(False)), ("with an outer loop", held(True))):
    print(f"{name}: off by {np.median(error):.2f} deg in the median, {np.quantile(error, 0.95):.2f} deg for one in 20")
