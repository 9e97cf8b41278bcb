"""Run a model under a command and a load, from event to event."""

from servotwin.simulation.energy import Energy
from servotwin.simulation.engine import Event, State
from servotwin.simulation.metrics import StepMetrics
from servotwin.simulation.result import Result, Stats
from servotwin.simulation.simulator import Simulator, simulate
from servotwin.simulation.status import Status

__all__ = ["Energy", "Event", "Result", "Simulator", "State", "Stats", "Status", "StepMetrics", "simulate"]
