"""Run a model under a command and a load, from event to event; many of them compiled, which loads when it is used."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from servotwin.simulation.engine import Event, State
from servotwin.simulation.metrics import Energy, StepMetrics
from servotwin.simulation.rest import Rest
from servotwin.simulation.result import Result, Stats
from servotwin.simulation.simulator import Simulator, simulate
from servotwin.simulation.start import Status

if TYPE_CHECKING:
    from servotwin.simulation.bus import Fleet, simulate_bus
    from servotwin.simulation.lanes.batch import Batch, Failure
    from servotwin.simulation.lanes.c_entry import CEntry, CTick
    from servotwin.simulation.lanes.many import grid, simulate_many
    from servotwin.simulation.lanes.vector import VectorSimulator
    from servotwin.simulation.lanes.whole_runs import VectorMemory

_LAZY = {"Batch": "lanes.batch", "CEntry": "lanes.c_entry", "CTick": "lanes.c_entry", "Failure": "lanes.batch",
         "Fleet": "bus", "grid": "lanes.many", "simulate_bus": "bus", "simulate_many": "lanes.many",
         "VectorMemory": "lanes.whole_runs", "VectorSimulator": "lanes.vector"}

__all__ = ["Batch", "CEntry", "CTick", "Energy", "Event", "Failure", "Fleet", "Rest", "Result", "Simulator", "State",
           "Stats", "Status", "StepMetrics", "VectorMemory", "VectorSimulator", "grid", "simulate", "simulate_bus",
           "simulate_many"]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(f"servotwin.simulation.{_LAZY[name]}"), name)
    raise AttributeError(f"module 'servotwin.simulation' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
