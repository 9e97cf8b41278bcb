"""What a user should know of how a run ended: of its last pulses, of end stops, and of the load.

All of it follows from what the servo was told and where it stands at the end, so it costs one look at each run.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.lanes import chip_of, numbers_of
from servotwin.models.terms import elastic, frame, heat
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers, at_temperature
from servotwin.physics.electronics import control_voltage_from_pulse
from servotwin.physics.motor import electromagnetic_torque
from servotwin.physics.pieces import Piece, piece_value
from servotwin.physics.potentiometer import angle_from_voltage
from servotwin.physics.shaft import pendulum_torque

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from servotwin.models.engine.lanes import Floats, Indices, Lanes, Smalls

ON_STOP, CANNOT_HOLD = 1, 2  # added up

_AT_STOP = 1e-6  # rad, relative beyond 1 rad: single precision
_ROUNDING = 1e-9  # rad


def last_frame(period: float, edges: Sequence[float] | NDArray[np.float64], duration: float) -> int:
    """Return the number of the last frame that starts before the end of a run; −1 where none does."""
    if period > 0.0:
        k = int(duration / period) + 1
    else:
        k = len(edges) - 1
    while k >= 0 and frame.edge_time(period, edges, k) >= duration:
        k -= 1
    return k


def piece_before(table: NDArray[np.float64], time: float, included: bool) -> Piece:
    """Return the piece of a table in force at `time` [s], or just before it; the first one before all."""
    low, high = 0, table.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        start = table[middle, 0]
        if start < time or (included and start == time):
            low = middle
        else:
            high = middle
    return Piece(table[low, 0], table[low, 1], table[low, 2], table[low, 3], table[low, 4], table[low, 5],
                 table[low, 6])


def width_at(command: NDArray[np.float64], time: float) -> float:
    """Return the width [s] of a pulse that starts at `time` [s]."""
    return piece_value(piece_before(command, time, True), time)


def refused_from(chip: Chip, command: NDArray[np.float64], period: float,
                 edges: Sequence[float] | NDArray[np.float64], duration: float) -> float:
    """Return when the first pulse came [s] from which on the chip refuses all; nan where it takes the last one."""
    first = math.nan
    k = last_frame(period, edges, duration)
    while k >= 0:
        t = frame.edge_time(period, edges, k)
        if frame.accepted(chip, width_at(command, t)):
            break
        first = t
        k -= 1
    return first


def told(pulsed: bool, numbers: Numbers, chip: Chip, command: NDArray[np.float64], period: float,
         edges: Sequence[float] | NDArray[np.float64], duration: float) -> tuple[float, float]:
    """Return the angle [rad] that the servo was told last, and how far from it nothing is done."""
    p, b_o = numbers.sensor.p, numbers.sensor.b_o
    if not pulsed:
        voltage = piece_value(piece_before(command, duration, False), duration)
        return angle_from_voltage(voltage, p, b_o), angle_from_voltage(numbers.follower.half_deadband, p)
    k = last_frame(period, edges, duration)
    width = width_at(command, frame.edge_time(period, edges, k) if k >= 0 else duration)
    voltage, slack = (control_voltage_from_pulse(width, chip.slope, chip.T_0),
                      control_voltage_from_pulse(chip.half_deadband, chip.slope))
    return angle_from_voltage(voltage, p, b_o), angle_from_voltage(slack, p)


def starts(numbers: Numbers, forward: bool, torque: float, tau: float, q: float) -> bool:
    """Tell whether a motor's torque [N m] turns a shaft that stands at q, against friction and load."""
    against = external_torque(numbers.load, tau, q)
    if elastic.behind(numbers.elastic):
        against += pendulum_torque(q, numbers.elastic.gravity, numbers.elastic.hanging_angle)
    if forward:
        return torque - against > contacts.holding_bounds(numbers, torque, -against)[1]
    return -torque - against < -contacts.holding_bounds(numbers, -torque, -against)[0]


def marks(pulsed: bool, numbers: Numbers, chip: Chip, command: NDArray[np.float64], tau: float, period: float,
          edges: Sequence[float] | NDArray[np.float64], duration: float, source: float, refused: bool,
          final: Sequence[float] | NDArray[np.float64]) -> int:
    """Return what is so at the end of a run, as a sum of `ON_STOP` and `CANNOT_HOLD`.

    `tau` is the part of the load's torque that depends on time alone [N m], `source` the voltage of the supply, other
    servos' currents apart [V], `final` the last angle and speed, and temperatures of winding and housing.
    """
    if numbers.sensor.p == 0.0:  # neither a motor nor a servo that turns without end is told an angle
        return 0
    q, w, T_w, T_h = final[0], final[1], final[2], final[3]
    target, slack = told(pulsed, numbers, chip, command, period, edges, duration)
    if abs(target - q) <= slack + _ROUNDING:
        return 0
    found = 0
    above = q >= numbers.stops.upper - _AT_STOP * max(abs(numbers.stops.upper), 1.0)
    if w == 0.0 and (above or q <= numbers.stops.lower + _AT_STOP * max(abs(numbers.stops.lower), 1.0)):
        found += ON_STOP
    if heat.present(numbers.heat):
        numbers = at_temperature(numbers, T_w, T_h)
    torque = electromagnetic_torque(currents.stall_current(numbers, source), numbers.motor.K)
    if refused or not torque < math.inf:
        return found
    forward = target > q
    sent = min(max(target, numbers.stops.lower), numbers.stops.upper)
    if not (starts(numbers, forward, torque, tau, q) and starts(numbers, forward, torque, tau, sent)):
        found += CANNOT_HOLD
    return found


def look_at_lanes(pulsed: bool, lanes: Lanes, torques: Floats, torque_first: Indices, torque_count: Indices,
                  duration: float, final: Floats, refused: Floats, found: Smalls) -> None:
    """Look at the end of every lane: fill `refused` with `refused_from`, and `found` with `marks`."""
    for lane in range(lanes.torque.size):
        command = lanes.pieces[lanes.piece_first[lane]:lanes.piece_first[lane] + lanes.piece_count[lane]]
        own = lanes.edge_count[lane]
        edges = lanes.edges[lanes.edge_first[lane]:lanes.edge_first[lane] + max(own, 0)]
        numbers, chip = numbers_of(lanes, lane), chip_of(lanes, lane)
        period = 0.0 if own >= 0 else chip.frame_period
        tau = lanes.torque[lane]
        if torque_count[lane] > 0:
            own_torque = torques[torque_first[lane]:torque_first[lane] + torque_count[lane]]
            tau += piece_value(piece_before(own_torque, duration, False), duration)
        refused[lane] = refused_from(chip, command, period, edges, duration) if pulsed else math.nan
        found[lane] = marks(pulsed, numbers, chip, command, tau, period, edges, duration, numbers.source.V,
                            not math.isnan(refused[lane]), final[lane])
