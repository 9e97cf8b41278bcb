"""`simulate` by the compiled queue of events: of a servo alone on its own supply the same run, much sooner.

Tests that run many random servos use it; their quick neighbours hold it against `simulate` by `is_the_same`.
"""

import warnings

import numpy as np

from servotwin.models import Model
from servotwin.signals import Signal
from servotwin.simulation import Result, bus_run
from servotwin.simulation.bus_rows import events_of, segments_of
from servotwin.simulation.bus_supply import source_of
from servotwin.simulation.simulator import Simulator
from servotwin.simulation.status import Status
from servotwin.simulation.trajectory import Trajectory


def simulate(model: Model, command: Signal, *, duration: float, output_times: np.ndarray, load=None, seed: int = 0,
             initial=None, **accuracy: float) -> Result:
    """Run a servo behind a bridge, its gear without a spring, as `servotwin.simulate` does."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        simulator = Simulator(model, load, seed, **accuracy)
    told = model.framed(command, duration)
    plan = simulator.plan(told)
    rows = bus_run.run_alone(plan, simulator.initial(told, initial), source_of(model.servo.supply), duration)
    status = Status.of_code(rows.status)
    return Result(
        model=model, command=told, load=simulator.load, drive=simulator.drive(told), time=np.asarray(output_times),
        trajectory=Trajectory(segments_of([plan], rows)[0]), events=events_of([plan], rows)[0], status=status,
        ended=rows.ended, cause=status.message)


def is_the_same(compiled: Result, plain: Result) -> None:
    """Assert that two results are of one run: its kind of motion, its events, and samples but for rounding."""
    assert [event.kind for event in compiled.events] == [event.kind for event in plain.events]
    assert compiled.stats.method == plain.stats.method  # a first motion without length may be counted
    for name in plain.names:
        np.testing.assert_allclose(compiled[name], plain[name], rtol=1e-12, atol=1e-12, err_msg=name)
