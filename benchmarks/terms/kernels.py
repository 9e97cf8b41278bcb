"""Part 6: kernels alone, one thread, beside a plain servo, and how far off they are.

Of each row: time of a lane by the CPU, over that of a plain one; the largest error of an angle at ends of frames and
its median over lanes, beside a run of the same lanes at the finest accuracy; motions that `simulate` makes a frame.
"""

import sys
from pathlib import Path

import numpy as np
from servos import DURATION, PLAIN, TERMS, Population, Term, random_population, written

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "compile"))
from measure import Recorder, best

LOAD = st.loads.Inertia(0.0) + st.loads.Constant(0.0)
FINEST = 1e-13  # rad
FRAME = 0.02  # s
FEW, SOME, LANES = 4, 16, 2048  # lanes: for a first guess, for errors, of the plain row
SECONDS = 0.15  # of a run, about


def call(term: Term, lanes: Population, times: list[float], **options: object) -> st.Batch:
    """Simulate lanes."""
    return st.simulate_many(term.model(), lanes.commands, duration=DURATION, load=LOAD, parameters=lanes.parameters,
                            output_times=times, **options).raise_if_failed()


def seconds(term: Term, lanes: int, repetitions: int) -> float:
    """Return the time of a lane [s]."""
    recorder = Recorder()
    call(term, random_population(lanes), [DURATION], executor=recorder, chunk=lanes)

    def run() -> None:
        for job, arguments in recorder.jobs:
            job(*arguments)
    return best(run, repetitions) / lanes


def errors(term: Term) -> np.ndarray:
    """Return the largest error of each lane [rad]."""
    lanes, times = random_population(SOME), list(np.arange(1, round(DURATION / FRAME) + 1) * FRAME)
    found, finest = (call(term, lanes, times, accuracy=accuracy)["output_angle"] for accuracy in (1e-9, FINEST))
    return np.max(np.abs(found - finest), axis=1)


def motions(term: Term) -> float:
    """Return how many motions one servo makes a frame."""
    lanes = random_population(FEW)
    own = {name: float(values[0]) for name, values in lanes.parameters.items()}
    load = st.loads.Inertia(own.pop("load.inertia")) + st.loads.Constant(own.pop("load.torque"))
    model = term.model()
    result = st.simulate(type(model)(model.servo.replace(own)), lanes.commands[0], duration=DURATION, load=load,
                         output_times=[DURATION])
    return result.stats.motions * FRAME / DURATION


def main() -> None:
    plain = seconds(PLAIN, LANES, 30)
    print(f"{'kernels alone, one thread':26} {'lane [us]':>10} {'cost':>8} {'error, most':>12} {'median':>8} "
          f"{'motions a frame':>16}")
    for term in (PLAIN, *TERMS):
        own = plain
        if term is not PLAIN:
            lanes = min(max(SECONDS / seconds(term, FEW, 1), FEW), LANES)
            own = seconds(term, int(lanes // 128 * 128 if lanes > 128 else lanes // 4 * 4), 7)
        off = errors(term)
        print(f"{term.name:26} {1e6 * own:10.2f} {written(own / plain):>7}x {off.max():12.1e} {np.median(off):8.1e} "
              f"{motions(term):16.1f}", flush=True)


if __name__ == "__main__":
    main()
