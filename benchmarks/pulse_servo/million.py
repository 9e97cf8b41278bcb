"""A million random servos for 1 s, run by cost.py in a process of its own: prints seconds and peaks of memory [MiB]."""

import resource
import sys
import time

import numpy as np
import ours
from fleet import SERVO

import servotwin as st

FEW = 1000  # servos of the first call, which loads everything


def run(lanes: int, dtype: str) -> None:
    """Run servos that differ in stretcher, deadband, inertia and torque."""
    rng = np.random.default_rng(0)
    parameters = {"electronics.stretcher_gain": rng.uniform(40.0, 120.0, lanes),
                  "electronics.deadband": rng.uniform(4e-6, 10e-6, lanes),
                  "load.inertia": rng.uniform(0.0, 5e-3, lanes),
                  "load.torque": rng.uniform(-0.1, 0.1, lanes)}
    command = st.signals.samples([0.0, 0.3, 0.7], [1000.0, 1900.0, 1300.0], unit="us")
    st.simulate_many(st.PulseServo(SERVO), command, duration=1.0, load=ours.LOAD, parameters=parameters,
                     output_times=[1.0], dtype=dtype)


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    lanes, dtype = int(sys.argv[1]), sys.argv[2]
    run(FEW, dtype)
    before, start = peak(), time.perf_counter()
    run(lanes, dtype)
    print(time.perf_counter() - start, before, peak())


if __name__ == "__main__":
    main()
