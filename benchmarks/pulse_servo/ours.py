"""servotwin on the fleet: whole calls of `simulate_many`, and its kernels alone."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from fleet import SERVO, Fleet

import servotwin as st

MODEL = st.PulseServo(SERVO)
LOAD = st.loads.Inertia(0.0) + st.loads.Constant(0.0)  # the parts that the fleet's numbers belong to


class Recorder:
    """An executor that keeps what it is given: so the kernels can be timed without the call around them."""

    def __init__(self) -> None:
        self.jobs: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []

    def submit(self, run: Callable[..., Any], /, *arguments: Any) -> Future[Any]:
        self.jobs.append((run, arguments))
        done: Future[Any] = Future()
        done.set_result(run(*arguments))
        return done


def call(fleet: Fleet, commands: list[st.signals.Signal], duration: float, dtype: str, **more: Any) -> np.ndarray:
    """Return the angles at the end [rad]."""
    batch = st.simulate_many(MODEL, commands, duration=duration, load=LOAD, parameters=fleet.parameters,
                             output_times=[duration], initial={"output_angle": fleet.angle}, dtype=dtype, **more)
    batch.raise_if_failed()
    return batch["output_angle"][:, 0]


def prepare(fleet: Fleet, duration: float, dtype: str) -> Callable[[], np.ndarray]:
    """Return the whole call as a user makes it; compiled by the time this returns."""
    commands = fleet.signals()
    call(fleet, commands, duration, dtype)
    return lambda: call(fleet, commands, duration, dtype)


def kernels(fleet: Fleet, duration: float, dtype: str, threads: int) -> Callable[[], None]:
    """Return the kernels of that call alone, on so many threads."""
    recorder = Recorder()
    call(fleet, fleet.signals(), duration, dtype, executor=recorder, chunk=max(1, len(fleet) // (2 * threads)))
    pool = ThreadPoolExecutor(threads)

    def run() -> None:
        for done in [pool.submit(job, *arguments) for job, arguments in recorder.jobs]:
            done.result()

    return run
