"""Part 5: digital and bus servos with what theirs have, kernels alone, beside a plain digital servo; ticks and calls.

A row is one kind of servo, one kind of goals and one inertia; half of the lanes are pushed either way. Times are of the
CPU and of one thread, but for the last rows, which are of the wall.
"""

import sys
import time
from pathlib import Path

import digital_servos as kinds
import numpy as np

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "compile"))
from common import best as best_on_wall
from measure import Recorder, best

FEW, LANES = 16, 256
SECONDS = 0.25  # of a run, about, and no longer than that with FEW lanes
REPETITIONS = 5
ENVIRONMENTS, STEP, THREADS = 4096, 0.02, 2
STILL = 1e-6  # rad/s at the output: a spring rings on for ever


def kernels(model: st.DigitalServo, goals: str, inertia: float, lanes: int, repetitions: int) -> float:
    """Return the time of a millisecond of a lane [s]."""
    recorder = Recorder()
    st.simulate_many(model, kinds.told(goals, lanes), duration=kinds.DURATION, load=kinds.load(inertia),
                     parameters=kinds.parameters(lanes), output_times=[kinds.DURATION], executor=recorder,
                     chunk=lanes).raise_if_failed()

    def run() -> None:
        for job, arguments in recorder.jobs:
            job(*arguments)
    return best(run, repetitions) / (lanes * 1e3 * kinds.DURATION)


def cost(model: st.DigitalServo, goals: str, inertia: float) -> float:
    """Return the same, of as many lanes as take `SECONDS`."""
    first = kernels(model, goals, inertia, FEW, 1)
    lanes = int(min(max(SECONDS / (first * 1e3 * kinds.DURATION), FEW), LANES))
    return kernels(model, goals, inertia, 4 * (lanes // 4), REPETITIONS)


def moving(model: st.DigitalServo, goals: str, inertia: float) -> float:
    """Return the share of ticks at which motor or output move."""
    times = np.arange(0.5e-3, kinds.DURATION, 1e-3)
    batch = st.simulate_many(model, kinds.told(goals, FEW), duration=kinds.DURATION, load=kinds.load(inertia),
                             parameters=kinds.parameters(FEW), output_times=times,
                             outputs=("output_speed", "motor_speed"))
    fast = np.maximum(np.abs(batch["output_speed"]), np.abs(batch["motor_speed"]) / model.value("gear.gear_reduction"))
    return float(np.mean(fast > STILL))


def table() -> None:
    """Print what a millisecond of a lane costs."""
    servos = {name: st.DigitalServo(servo) for name, servo in kinds.servos().items()}
    print(f"{'kernels alone, one thread':30} {'goals':16} {'J':>6} {'us/lane-ms':>10} {'/plain':>8} {'moving':>7}")
    for goals in kinds.GOALS:
        for inertia in kinds.INERTIAS:
            peer = cost(kinds.plain(), goals, inertia)
            for name, model in {"plain digital": kinds.plain(), **servos}.items():
                own = peer if name == "plain digital" else cost(model, goals, inertia)
                print(f"{name:30} {goals:16} {inertia:6g} {1e6 * own:10.3f} {own / peer:7.1f}x "
                      f"{moving(model, goals, inertia):7.2f}", flush=True)


def environments() -> None:
    """Print what a step of many costs a learner: new goals, 1 % reset, one signal read; and in ticks of 1 ms."""
    model, rng = st.DigitalServo(kinds.servos()["STS3215 12 V"]), np.random.default_rng(6)
    seconds = {}
    for calls in (1, 20):
        sims = st.VectorSimulator(model, ENVIRONMENTS, load=kinds.load(kinds.INERTIAS[0]), threads=THREADS,
                                  parameters=kinds.parameters(ENVIRONMENTS))
        sims.reset(command_angle=0.0)

        def step(sims: st.VectorSimulator = sims, calls: int = calls) -> None:
            goals = rng.uniform(-1.0, 1.0, ENVIRONMENTS)
            some = rng.choice(ENVIRONMENTS, ENVIRONMENTS // 100, replace=False)
            sims.reset(command_angle=goals[some], output_angle=0.0, lanes=some)
            for _ in range(calls):
                sims.advance(STEP / calls, command_angle=goals)
            sims["output_angle"]
        for _ in range(5):
            step()
        seconds[calls] = best_on_wall(step, 8)
    print(f"{ENVIRONMENTS} lanes, STS3215 12 V, {1e3 * STEP:g} ms a step, {THREADS} threads: "
          f"{ENVIRONMENTS / seconds[1]:.3g} steps/s; in calls of 1 ms {seconds[20] / seconds[1]:.2f} times as long")


def alone() -> None:
    """Print what one costs by `simulate`, in plain Python."""
    for name in ("STS3215 12 V", "STS3215 12 V, LeRobot"):
        model, told = st.DigitalServo(kinds.servos()[name]), kinds.told("new every 0.3 s", 1)[0]

        def run(model: st.DigitalServo = model, told: st.signals.Signal = told) -> st.Result:
            return st.simulate(model, told, duration=kinds.DURATION, load=kinds.load(kinds.INERTIAS[0]),
                               output_times=[kinds.DURATION])
        print(f"{name}, alone in plain Python: {1e3 * best_on_wall(run, 4) / kinds.DURATION:.0f} ms a second")


def main() -> dict[str, float]:
    start = time.perf_counter()
    for part in (alone, environments, table):
        part()
    print(f"({time.perf_counter() - start:.0f} s)")
    return {}


if __name__ == "__main__":
    main()
