"""`AveragedServo`, 180° step of 2 s, 201 outputs, for the range of slopes of tanh, beside LSODA at equal error."""

import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import TIMES, averaged_right_side, best

import servotwin as st

SLOPES = (0.5, 1.0, 10.0, 100.0, 1000.0)
TOLERANCES = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)


def equal_error(f: object, exact: np.ndarray, error: float) -> tuple[float, float, float]:
    """Return time [s], error and tolerance of the fastest LSODA run that is as good; the most exact if none is."""
    runs = []
    for rtol in TOLERANCES:
        def run(rtol: float = rtol) -> object:
            return solve_ivp(f, (0.0, 2.0), (0.0, 0.0), method="LSODA", t_eval=TIMES, rtol=rtol, atol=1e-2 * rtol)
        runs.append((best(run, 5), float(np.abs(run().y[0] - exact).max()), rtol))
    good = [r for r in runs if r[1] <= error]
    return min(good) if good else min(runs, key=lambda r: r[1])


def main() -> None:
    servo = st.load_servo("hitec-hs-755hb")
    command = st.signals.step(0.0, 180.0, unit="deg")
    print("AveragedServo, 180 deg step, 2 s, 201 outputs; errors [rad] against Radau at rtol 1e-12")
    print(f"{'k':>6} {'servotwin':>10} {'error':>8}   {'LSODA':>9} {'error':>8} {'rtol':>6}   ratio")
    for slope in SLOPES:
        model = st.AveragedServo(servo.replace({"friction.zero_crossing_slope": slope}))
        f = averaged_right_side(model, float(model.command(command)(1.0)))
        exact = solve_ivp(f, (0.0, 2.0), (0.0, 0.0), method="Radau", t_eval=TIMES, rtol=1e-12, atol=1e-14).y[0]

        def run(model: st.AveragedServo = model) -> np.ndarray:
            return st.simulate(model, command, duration=2.0, output_times=TIMES)["output_angle"]

        ours, error = best(run), float(np.abs(run() - exact).max())
        theirs, their_error, rtol = equal_error(f, exact, error)
        note = "" if their_error <= error else " (no tolerance of LSODA is as good)"
        print(f"{slope:6g} {1e3 * ours:8.2f} ms {error:8.1e}   {1e3 * theirs:6.2f} ms {their_error:8.1e} {rtol:6.0e}   "
              f"{theirs / ours:.1f}{note}")


if __name__ == "__main__":
    main()
