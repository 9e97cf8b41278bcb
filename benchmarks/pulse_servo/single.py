"""Part 2: one servo: compiled beside SciPy's LSODA, by `simulate`, and what a lane costs beyond its call."""

import runpy
import sys
from pathlib import Path

import numpy as np
import ours
from fleet import random_fleet

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import TIMES, best

import servotwin as st

MANY = 2000


def bounded() -> None:
    """One `BoundedServo` with 201 outputs, as in the scenario of that name, and many at once."""
    stepped = runpy.run_path(str(Path(__file__).resolve().parents[1] / "bounded_servo" / "run.py"))["stepped"]
    model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    command = st.signals.step(0.0, 180.0, unit="deg")
    v_c = float(model.command(command)(1.0))
    gains = np.linspace(20.0, 60.0, MANY)

    def run(parameters: dict[str, object]) -> np.ndarray:
        return st.simulate_many(model, command, duration=2.0, output_times=TIMES, parameters=parameters)["output_angle"]

    lsoda = best(lambda: stepped(model, v_c, "LSODA", 1e-8), 10)
    apart = np.abs(run({})[0] - stepped(model, v_c, "LSODA", 1e-8)).max()
    one = best(lambda: run({}), 30)
    each = best(lambda: run({"electronics.bridge_gain": gains}), 5) / MANY
    print(f"BoundedServo, 180 deg step, 2 s, 201 outputs; LSODA at rtol 1e-8 {1e3 * lsoda:.2f} ms, "
          f"{apart:.0e} rad apart")
    print(f"  compiled, one servo, whole call  {1e6 * one:9.1f} us   LSODA over that {lsoda / one:8.0f}x")
    print(f"  compiled, each of {MANY} in a call {1e6 * each:9.1f} us   LSODA over that {lsoda / each:8.0f}x")


def pulse() -> None:
    """One `PulseServo` for 2 s, only the last angle kept when compiled."""
    fleet = random_fleet(1)
    signal = fleet.signals()[0]
    start = {"output_angle": float(fleet.angle[0])}
    servo = ours.MODEL.servo.replace({name: float(x[0]) for name, x in fleet.parameters.items()
                                      if not name.startswith("load.")})
    load = (st.loads.Inertia(float(fleet.parameters["load.inertia"][0]))
            + st.loads.Constant(float(fleet.parameters["load.torque"][0])))
    model = st.PulseServo(servo)

    def alone() -> float:
        return float(st.simulate(model, signal, duration=2.0, load=load, initial=start,
                                 output_times=[2.0])["output_angle"][0])

    def many(duration: float, dtype: str, **more: object) -> float:
        return float(st.simulate_many(model, signal, duration=duration, load=load, initial=start, dtype=dtype,
                                      output_times=[duration], **more)["output_angle"][0, 0])

    def kernel(duration: float, dtype: str) -> float:
        recorder = ours.Recorder()
        many(duration, dtype, executor=recorder)
        (job, arguments), = recorder.jobs
        return best(lambda: job(*arguments), 200)

    print(f"PulseServo, one, 2 s; `simulate` and a lane {abs(alone() - many(2.0, 'float64')):.0e} rad apart")
    print(f"  st.simulate                      {1e3 * best(alone, 5):9.2f} ms")
    for dtype in ("float64", "float32"):
        many(2.0, dtype)
        whole, long, short = best(lambda d=dtype: many(2.0, d), 50), kernel(2.0, dtype), kernel(1e-3, dtype)
        print(f"  compiled, {dtype}: whole call {1e6 * whole:.0f} us; kernel alone {1e6 * long:.1f} us, for 1 ms "
              f"{1e6 * short:.1f} us, so 2 s cost {1e6 * (long - short):.1f} us beyond calling it")


def main() -> None:
    bounded()
    pulse()


if __name__ == "__main__":
    main()
