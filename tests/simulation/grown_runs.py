"""How far plain servos and lanes of a batch are apart, in a copy of the package that has grown: run as a script."""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "physics"))
import one_law_runs

import servotwin as st
from servotwin.simulation import lane_runs


def main(grown, digital):
    """Print the largest difference of angles [rad], what the number changes plainly, and the kernels that were used."""
    one_law_runs.without_compiler()
    used, kernels = [], lane_runs.kernels
    lane_runs.kernels = lambda recipe: (used.append(recipe.name), kernels(recipe))[1]
    servo = st.load_servo("hitec-hs-755hb").replace(one_law_runs.PROGRAM if digital else {})
    kind = st.DigitalServo if digital else st.PulseServo
    without, grown_one = kind(servo), kind(servo.replace(grown))
    step = {"duration": 0.11, "output_step": 0.005}
    pulses = st.signals.step(700.0, 1200.0, at=0.005, unit="us")
    R = without.value("motor.armature_resistance")
    batch = st.simulate_many(grown_one, pulses, parameters={"motor.armature_resistance": [R, 1.01 * R]}, **step)
    plain, before = (st.simulate(model, pulses, seed=0, **step)["output_angle"] for model in (grown_one, without))
    sys.stdout.write(json.dumps({
        "package": st.__file__, "apart": float(np.abs(batch["output_angle"][0] - plain).max()),
        "changed": float(np.abs(plain - before).max()), "used": used}))


main(json.loads(sys.argv[1]), sys.argv[2] == "digital")
