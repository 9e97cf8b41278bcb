"""A run that is only looked at, at times that are known before: compiled where it can be, and no motion is kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servotwin.errors import SimulationError
from servotwin.loads import as_load
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.elastic import present
from servotwin.simulation import bus_run
from servotwin.simulation.bus_rows import driven_in, events_of
from servotwin.simulation.bus_supply import source_of
from servotwin.simulation.compile import is_plain
from servotwin.simulation.lanes.many import simulate_many
from servotwin.simulation.rest import driven_of, looks_of, rest_seen
from servotwin.simulation.servo_run import simulate
from servotwin.simulation.simulator import Simulator
from servotwin.simulation.status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.signals import Signal
    from servotwin.simulation.engine import Event
    from servotwin.simulation.rest import Driven, Rest

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WatchedRun:
    """What a run was looked at for: signals at some times, how its bridge was driven, and what happened.

    Parameters
    ----------
    model, command, load
        Of the run.
    ended : float
        [s]
    driven : Driven, optional
        None of a mean voltage.
    events : tuple of Event
    """

    model: Model
    command: Signal
    load: Load
    ended: float
    driven: Driven | None
    events: tuple[Event, ...]
    time: Array
    signals: Mapping[str, Array]
    status: Status = Status.COMPLETED

    def at(self, name: str, time: Array) -> Array:
        """Return a signal (SI) at times [s] of those at which it was looked at."""
        return self.signals[name][np.searchsorted(self.time, time)]

    @property
    def rest(self) -> Rest | None:
        """What the servo does where command and load stand still at the end, without its current."""
        return rest_seen(self, self.driven)


def watched(model: Model, command: Signal, *, duration: float, outputs: Sequence[str], times: Array,
            load: Load | Part | None = None, seed: int = 0, initial: Mapping[str, float] | None = None) -> WatchedRun:
    """Simulate a servo behind a bridge as `simulate` does, and return what shows at some times.

    Parameters
    ----------
    model, command, duration, load, seed, initial
        As in `simulate`.
    outputs : sequence of str
        Names of signals, the output angle among them.
    times : ndarray
        Within the run [s]; those of `looks_of`, and the end, are looked at beside them.

    Raises
    ------
    SimulationError
        If the run ends before its time.
    """
    simulator = Simulator(model, load, seed)
    none = WatchedRun(model, command, as_load(load), duration, None, (), np.zeros(0), {})
    looks = looks_of(none)
    every = np.unique(np.concatenate([times, () if looks is None else looks, [duration]]))
    switched = isinstance(model, SwitchedServo)
    if is_plain() or (switched and present(model.plant(simulator.load).elastic)):
        run = simulate(model, command, duration=duration, load=load, seed=seed, initial=initial,
                       output_times=every).raise_if_failed()
        return WatchedRun(model, command, run.load, duration, driven_of(run), run.events, every,
                          {name: run[name] for name in outputs})
    batch = simulate_many(model, command, duration=duration, load=load, seeds=seed, initial=initial,
                          output_times=every, outputs=outputs)
    if batch.failures:
        _, time, cause = batch.failures[0]
        raise SimulationError(Status.of_code(int(batch.status[0])).name, time, cause)
    driven, events = _driven(simulator, command, duration, initial) if switched else (None, ())
    return WatchedRun(model, command, simulator.load, duration, driven, events, every,
                      {name: batch[name][0] for name in outputs})


def _driven(simulator: Simulator, command: Signal, duration: float,
            initial: Mapping[str, float] | None) -> tuple[Driven, tuple[Event, ...]]:
    """Return how the bridge of a servo is driven, and what happens: alone on a bus it moves as on its own supply."""
    told = simulator.model.framed(command, duration)
    plan, state = simulator.plan(told), simulator.initial(command, initial)
    rows = bus_run.run_alone(plan, state, source_of(simulator.model.servo.supply), duration)
    return driven_in(rows, digital=plan.digital), events_of([plan], rows)[0]
