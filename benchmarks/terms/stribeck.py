"""Part 6: friction that fades with the speed, over Stribeck speeds and exponents: cost and error, beside plain servos.

Times are of the CPU and of one thread, kernels alone. The error is that of the angles beside steps by time (DOP853) of
the same lanes at a finer accuracy, which a torque that is told by time asks for.
"""

import sys
from pathlib import Path

import numpy as np
from servos import DURATION, PLAIN, SERVO, TERMS, Population, random_population, written

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "compile"))
from measure import LOAD, Recorder, best

SPEEDS, EXPONENTS = (1.0, 10.0, 50.0, 100.0, 500.0), (1.0, 1.5, 2.0)  # rad/s of the motor
LANES, PLAIN_LANES, SAMPLE = 256, 2048, 24
REPETITIONS = 7
FINE, NEXT_TO_NOTHING = 1e-13, 1e-18  # rad, N m
TIMES = np.linspace(0.1, DURATION, 20)
SHARED = [term for term in TERMS if term.name in ("M4", "M6")]


def kernels(model: st.PulseServo, lanes: Population) -> float:
    """Return the time of a lane [s]."""
    recorder = Recorder()
    st.simulate_many(model, lanes.commands, duration=DURATION, load=LOAD, parameters=lanes.parameters,
                     output_times=[DURATION], executor=recorder, chunk=len(lanes)).raise_if_failed()

    def run() -> None:
        for job, arguments in recorder.jobs:
            job(*arguments)
    return best(run, REPETITIONS) / len(lanes)


def error(model: st.PulseServo, lanes: Population) -> float:
    """Return by how much the angles of the first lanes are off at most [rad]."""
    def angles(load: st.loads.Load, **more: float) -> np.ndarray:
        some = {name: x[:SAMPLE] for name, x in lanes.parameters.items()}
        return st.simulate_many(model, lanes.commands[:SAMPLE], duration=DURATION, load=load, parameters=some,
                                output_times=TIMES, **more).raise_if_failed()["output_angle"]

    stepped = LOAD + st.loads.Recorded([0.0, 2.0 * DURATION], [0.0, NEXT_TO_NOTHING])
    return float(np.max(np.abs(angles(LOAD) - angles(stepped, accuracy=FINE))))


def main() -> dict[str, float]:
    lanes, many = random_population(LANES), random_population(LANES).times(PLAIN_LANES // LANES)
    rows = {f"v_s = {speed:g} rad/s, exponent {exponent:g}": {
        "friction.stribeck_speed": speed, "friction.stribeck_exponent": exponent}
        for speed in SPEEDS for exponent in EXPONENTS} | {term.name: term.numbers for term in SHARED}
    plain = min(kernels(PLAIN.model(), many) for _ in range(2))
    print(f"{LANES} random HS-755HB, {DURATION:g} s, kernels alone, one thread; plain {1e6 * plain:.2f} us a lane")
    print(f"{'':32} {'lane [us]':>10} {'/plain':>8} {'error [rad]':>12}")
    for name, numbers in rows.items():
        model = st.PulseServo(SERVO.replace(numbers))
        own = kernels(model, lanes)
        print(f"{name:32} {1e6 * own:10.1f} {written(own / plain):>7}x {error(model, lanes):12.1e}", flush=True)
    print(f"plain again {1e6 * kernels(PLAIN.model(), many):.2f} us a lane")
    return {}


if __name__ == "__main__":
    main()
