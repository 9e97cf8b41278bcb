"""What compiled kernels take, in seconds of CPU of one thread: `measure.py PART` prints it as JSON.

It runs with the package that it finds, of this checkout or of another, and so uses what every one of them has.
"""

import json
import math
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np

import servotwin as st

sys.path.insert(1, str(Path(__file__).resolve().parents[1] / "terms"))
sys.path.insert(1, str(Path(__file__).resolve().parents[1] / "digital_servo"))
sys.path.insert(1, str(Path(__file__).resolve().parents[1] / "robots"))
import arms
import digital_fleet
import servos

LOAD = st.loads.Inertia(0.0) + st.loads.Constant(0.0)  # the parts that the lanes' numbers belong to
TERMS = {term.name: term for term in (servos.PLAIN, *servos.TERMS)}
EVERYTHING, DIGITAL = "all together", "digital"
LANES = {  # of each set, and how often it is run: about a second in all
    "plain": (2048, 30), "plain, float32": (2048, 30), "inductance": (256, 30), "regulator": (256, 30), "M3": (256, 30),
    "M4": (64, 20), "backlash": (128, 30), "heat": (128, 20), DIGITAL: (512, 12)}
FIRST = {"plain": 128, EVERYTHING: 4, DIGITAL: 128}  # lanes
CHAIN, STEPS = 12, 300  # joints, and steps between two goals


class Recorder:
    """An executor that keeps what it is given: so the kernels can be timed without the call around them."""

    def __init__(self) -> None:
        self.jobs: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []

    def submit(self, run: Callable[..., Any], /, *arguments: Any) -> Future[Any]:
        self.jobs.append((run, arguments))
        done: Future[Any] = Future()
        done.set_result(run(*arguments))
        return done


def spent() -> float:
    """Return the CPU time of this process and of those that it has waited for [s]."""
    others = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + others.ru_utime + others.ru_stime


def best(run: Callable[[], object], repetitions: int) -> float:
    """Return the least CPU time of this thread for a run, of several [s]."""
    least = math.inf
    for _ in range(repetitions):
        start = time.thread_time()
        run()
        least = min(least, time.thread_time() - start)
    return least


def call_of(name: str, lanes: int) -> Callable[..., st.Batch]:
    """Return a call of `simulate_many` of one of the sets."""
    dtype = "float32" if name.endswith("float32") else "float64"
    if name == DIGITAL:
        model, told, numbers = digital_fleet.model_of_fleet(), digital_fleet.commands(lanes), digital_fleet.fleet(lanes)
        load = None
    else:
        drawn = servos.random_population(lanes)
        model, told, numbers, load = TERMS[name.partition(",")[0]].model(), drawn.commands, drawn.parameters, LOAD
    return lambda **more: st.simulate_many(model, told, duration=servos.DURATION, load=load, parameters=numbers,
                                           output_times=[servos.DURATION], dtype=dtype, **more).raise_if_failed()


def kernels(name: str, lanes: int, repetitions: int) -> float:
    """Return the time of a lane, without the call around the kernels [s]."""
    recorder = Recorder()
    call_of(name, lanes)(executor=recorder, chunk=lanes)

    def run() -> None:
        for job, arguments in recorder.jobs:
            job(*arguments)
    return best(run, repetitions) / lanes


# --- parts ------------------------------------------------------------------------------------------------------------


def first(name: str) -> dict[str, float]:
    """The first call of a process, and by how much the second is shorter."""
    call = call_of(name, FIRST[name])
    times = []
    for _ in range(2):
        start = spent()
        call()
        times.append(spent() - start)
    return {"first": times[0], "first without second": times[0] - times[1]}


def lanes(*names: str) -> dict[str, float]:
    """A lane of each set."""
    return {name: kernels(name, *LANES[name]) for name in names or LANES}


def alone() -> dict[str, float]:
    """A lane with all terms, which runs one by one."""
    return {EVERYTHING: kernels(EVERYTHING, 4, 5)}


def ticks() -> dict[str, float]:
    """A tick of 1 ms of one lane, of some and of many."""
    found = {}
    for lanes, count in ((1, 2000), (128, 1000), (4096, 100)):
        sims = st.VectorSimulator(servos.PLAIN.model(), lanes, threads=1)
        widths, place = np.random.default_rng(0).uniform(1.1e-3, 1.9e-3, (2, lanes)), [0]

        def run(sims: st.VectorSimulator = sims, widths: np.ndarray = widths, place: list[int] = place,
                count: int = count) -> None:
            for _ in range(count):
                place[0] += 1
                sims.advance(1e-3, pulse_width=widths[place[0] // 200 % 2])
        run()
        found[f"{lanes} lanes"] = best(run, 12) / count
    return found


def joints() -> dict[str, float]:
    """What a servo adds to a step of MuJoCo, one alone and one of a chain of twelve; nothing without MuJoCo."""
    try:
        import mujoco
    except ImportError:
        return {}
    found = {}
    for count in (1, CHAIN):
        plain = mujoco.MjModel.from_xml_string(arms.chains(count))
        drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(arms.chains(count)), {
            f"j{k}": servos.PLAIN.model() for k in range(count)}, assume_heat=False)
        data, idle, goal = mujoco.MjData(drive.model), mujoco.MjData(plain), [0]

        def served(drive: st.robots.ServoDrive = drive, data: Any = data, goal: list[int] = goal,
                   count: int = count) -> None:
            goal[0] += 1
            drive.command(data, {f"j{k}": 0.3 + 0.5 * ((goal[0] + k) % 2) for k in range(count)})
            for _ in range(STEPS):
                drive.step(data)

        def bare(plain: Any = plain, idle: Any = idle) -> None:
            for _ in range(STEPS):
                mujoco.mj_step(plain, idle)
        served()
        with_servos, without = (best(run, 20) / STEPS for run in (served, bare))
        found[f"joint of {count}"] = (with_servos - without) / count
        found[f"step of {count}, with servos over MuJoCo's own [1]"] = with_servos / without
    return found


PARTS: dict[str, Callable[..., dict[str, float]]] = {
    "first": first, "lanes": lanes, "alone": alone, "ticks": ticks, "joints": joints}

if __name__ == "__main__":
    print(json.dumps(PARTS[sys.argv[1]](*sys.argv[2:])))
