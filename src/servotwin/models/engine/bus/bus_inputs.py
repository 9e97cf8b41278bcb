"""What servos on a bus are told: in plain Python a list of inputs, compiled the arrays of all lanes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import lanes as columns
from servotwin.models.engine.memory import Inputs

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes

PLAIN = True  # the compiler takes it for False


class Tables(NamedTuple):
    """What lanes have besides their columns: rows of torque over time, and tables of their potentiometers."""

    torques: Floats
    torque_first: Indices
    torque_count: Indices
    curves: Floats
    curve_first: Indices
    curve_count: Indices


class Told(NamedTuple):
    """What all lanes are told, and what hangs on their shafts."""

    lanes: Lanes
    tables: Tables


def inputs_at(told: Any, seat: Any) -> Inputs:
    """Return what the servo in a seat is told, and what hangs on its shaft."""
    if PLAIN:
        inputs: Inputs = told[seat.place]
        return inputs
    return inputs_of(told.lanes, told.tables, seat.lane)


def inputs_of(lanes: Lanes, tables: Tables, lane: int) -> Inputs:
    """Return what a lane is told, and what hangs on its shaft."""
    first, start = tables.curve_first[lane], tables.torque_first[lane]
    return columns.inputs_of(lanes, tables.curves[first:first + tables.curve_count[lane]],
                          tables.torques[start:start + tables.torque_count[lane]], lane)
