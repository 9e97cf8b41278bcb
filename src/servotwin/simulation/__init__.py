"""Run a model under a command and a load, from event to event."""

from servotwin.simulation.batch import Batch, Failure
from servotwin.simulation.energy import Energy
from servotwin.simulation.engine import Event, State
from servotwin.simulation.many import grid, simulate_many
from servotwin.simulation.metrics import StepMetrics
from servotwin.simulation.result import Result, Stats
from servotwin.simulation.simulator import Simulator, simulate
from servotwin.simulation.status import Status

__all__ = ["Batch", "Energy", "Event", "Failure", "Result", "Simulator", "State", "Stats", "Status", "StepMetrics",
           "grid", "simulate", "simulate_many"]
