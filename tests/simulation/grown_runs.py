"""How far plain servos and lanes of a batch are apart, in a copy of the package that has grown: run as a script.

`grown_runs.py JSON` prints, for each [kind, pulse width (us), what the servo has anyway, what has grown], the largest
difference of angles [rad], how far what has grown moves them plainly, and the kernels that were used.
"""

import json
import sys
from pathlib import Path

import numpy as np

import servotwin as st
from servotwin.simulation.lanes import whole_runs

HELPERS = str(Path(__file__).parents[1] / "physics")  # in the path of the script alone, not of who collects tests


def compared(kind, width, known, grown, used):
    """Return what is printed of one servo; `used` gets the names of kernels."""
    import one_law_runs

    used.clear()
    of = {"digital": st.DigitalServo, "inductive": st.PulseServoInductive}.get(kind, st.PulseServo)
    servo = st.load_servo("hitec-hs-755hb").replace((one_law_runs.PROGRAM if kind == "digital" else {}) | known)
    without, grown_one = of(servo), of(servo.replace(grown))
    load = st.loads.Constant(0.05)
    step = {"duration": 0.11, "output_step": 0.005, "load": load}
    pulses = st.signals.step(700.0, width, at=0.005, unit="us")
    R = without.value("motor.armature_resistance")
    batch = st.simulate_many(grown_one, pulses, parameters={"motor.armature_resistance": [R, 1.01 * R]}, **step)
    plain, before = (st.simulate(model, pulses, seed=0, **step)["output_angle"] for model in (grown_one, without))
    return {"apart": float(np.abs(batch["output_angle"][0] - plain).max()),
            "changed": float(np.abs(plain - before).max()), "used": sorted(set(used))}


def main(cases):
    """Print the results of all cases, in which kernels run as text."""
    import one_law_runs

    one_law_runs.without_compiler()
    used, kernels = [], whole_runs.kernels
    whole_runs.kernels = lambda recipe: (used.append(recipe.name), kernels(recipe))[1]
    sys.stdout.write(json.dumps({"package": st.__file__, "cases": [compared(*case, used) for case in cases]}))


if __name__ == "__main__":
    sys.path.insert(0, HELPERS)
    main(json.loads(sys.argv[1]))
