"""Lanes: numbers and inputs of many servos, a column or an entry of each array for each.

In plain Python servos on a bus have a list of inputs, compiled they have the arrays of all lanes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.models.engine.memory import Inputs
from servotwin.models.state.records import TILE, reader
from servotwin.models.terms import firmware
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.numbers import Numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Indices = NDArray[np.int64]
    Smalls = NDArray[np.int8]

PLAIN = True  # the compiler takes it for False
# Status of a lane that has advanced in this call, side by side with others or by legs: for all of it, or not yet
ARRIVED, UNDERWAY = -2, -1

chip_at = reader("chip_at", Chip)
numbers_at = reader("numbers_at", Numbers)


class Lanes(NamedTuple):
    """Inputs of all lanes of a chunk; each array has a column, an entry or a place in a tile for each lane."""

    numbers: Any  # tiles of Numbers
    chips: Any  # tiles of Chip
    start: Floats  # (7, B), numbers of the state at t = 0
    torque: Floats
    seeds: Indices
    pieces: Floats  # (n, 7)
    piece_first: Indices
    piece_count: Indices
    edges: Floats
    edge_first: Indices
    edge_count: Indices
    accuracy: float  # of what is integrated [rad]
    firmware: Any  # records of Firmware, for each lane, or one for all that have none


class Outputs(NamedTuple):
    """Outputs: (B, T) each, or (0, 0) where it is not wanted."""

    angle: Floats
    speed: Floats
    contact: Smalls
    drive: Smalls
    error: Floats
    wiper: Floats
    current: Floats
    winding: Floats
    housing: Floats
    motor_angle: Floats
    motor_speed: Floats
    mesh: Smalls


class Tables(NamedTuple):
    """Parts of lanes besides their columns: rows of torque over time, and tables of their potentiometers."""

    torques: Floats
    torque_first: Indices
    torque_count: Indices
    curves: Floats
    curve_first: Indices
    curve_count: Indices


class Told(NamedTuple):
    """Commands of all lanes, and the loads on their shafts."""

    lanes: Lanes
    tables: Tables


def numbers_of(lanes: Lanes, lane: int) -> Numbers:
    """Return the numbers of a lane."""
    return numbers_at(lanes.numbers[lane // TILE], lane % TILE)


def chip_of(lanes: Lanes, lane: int) -> Chip:
    """Return the chip of a lane."""
    return chip_at(lanes.chips[lane // TILE], lane % TILE)


def inputs_of(lanes: Lanes, curve: Floats, torque: Floats, lane: int) -> Inputs:
    """Return the inputs of a lane, and what hangs on its shaft with a recorded torque."""
    first, last = lanes.piece_first[lane], lanes.piece_first[lane] + lanes.piece_count[lane]
    own = lanes.edge_count[lane]
    edges = lanes.edges[lanes.edge_first[lane]:lanes.edge_first[lane] + max(own, 0)]
    place = min(lane, len(lanes.firmware) - 1)  # one stands for all where none has a program
    program = lanes.firmware[place:place + 1]
    regular = program[0].T_f if firmware.present(program[0]) else chip_of(lanes, lane).frame_period
    period = 0.0 if own >= 0 else regular
    return Inputs(lanes.pieces[first:last], torque, lanes.torque[lane], period, edges, curve, lanes.seeds[lane],
                  lanes.accuracy, program)


def inputs_at(told: Any, seat: Any) -> Inputs:
    """Return the inputs of the servo in a seat, and what hangs on its shaft."""
    if PLAIN:
        inputs: Inputs = told[seat.place]
        return inputs
    return _by_tables(told.lanes, told.tables, seat.lane)


def _by_tables(lanes: Lanes, tables: Tables, lane: int) -> Inputs:
    first, start = tables.curve_first[lane], tables.torque_first[lane]
    return inputs_of(lanes, tables.curves[first:first + tables.curve_count[lane]],
                     tables.torques[start:start + tables.torque_count[lane]], lane)
