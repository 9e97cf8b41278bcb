"""The program of a digital servo among the events: when its ticks come, what it hears, when its duties are applied.

Ticks come at t_phi + n T_c whatever the frames of pulses. A duty is applied T_d after its tick, and holds until the
next; at one instant it comes first, then the command, then the tick.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.memory import SAME, Inputs, Memory, in_force, next_frame, origin_of
from servotwin.models.state.modes import Vector
from servotwin.models.state.noise import gaussian
from servotwin.models.terms import bridge, control, duty
from servotwin.models.terms.control import NOTHING_SENSED, NOWHERE, WAITING, Sensed
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import Sensor, sensed_voltage
from servotwin.physics.firmware import counted, resolved_pulse
from servotwin.physics.motor import back_emf
from servotwin.physics.pieces import piece_value


def of(memory: Memory) -> Any:
    """Return what the program of a servo remembers, to be changed in place."""
    return memory.firm[0]


def next_due(firmware: Firmware, firm: Any, frames: int) -> float:
    """Return when a tick or a duty comes next, by the times of a memory [s]."""
    tick: float = firmware.t_phi + (firm.tick - frames) * firmware.T_c
    change: float = tick - firm.waiting * firmware.T_c + firmware.T_d if firm.waiting > 0 else tick
    return min(tick, change)


def serve(numbers: Numbers, inputs: Inputs, firm: Any, frames: int, time: float, y: Vector, wiper: float,
          origin: float) -> None:
    """Do all that is due at a time [s] after so many frames, which began at `origin` [s since the start].

    The memory of the program changes in place.
    """
    firmware = inputs.firmware[0]
    latest = time + SAME * firmware.T_c
    apply(firmware, firm, frames, latest)
    if not is_due(firmware, firm, frames, latest):
        return
    sensed = sensed_by(numbers, firm, y) if control.senses(firmware) else NOTHING_SENSED
    work(inputs, numbers.sensor, firm, y.q, wiper, sensed, origin + time)
    apply(firmware, firm, frames, latest)


def work(inputs: Inputs, sensor: Sensor, firm: Any, q: float, wiper: float, sensed: Sensed, now: float) -> None:
    """Do what a tick does: hear, measure where the shaft is [rad], decide; `now` counts since the start [s]."""
    firmware, angle = inputs.firmware[0], q
    if has_news(firmware, firm, now):
        listen(inputs, firm, now)
    if firmware.per_volt != 0.0:
        angle = angle_of(firmware, firm, sensed_voltage(sensor, inputs.curve, wiper), inputs.seed)
    decide(firmware, firm, angle, sensed, now)


def is_due(firmware: Firmware, firm: Any, frames: int, latest: float) -> bool:
    """Tell whether a tick comes by a time after so many frames [s]."""
    return bool(firmware.t_phi + (firm.tick - frames) * firmware.T_c <= latest)


def has_news(firmware: Firmware, firm: Any, now: float) -> bool:
    """Tell whether a command may have come by now."""
    return bool(now >= firm.hears - SAME * firmware.T_c)


def decide(firmware: Firmware, firm: Any, angle: float, sensed: Sensed, now: float) -> None:
    """Let a tick decide on a duty, which then waits to be applied."""
    firm.duties[firm.head] = control.tick(firmware, firm, angle, sensed, now - firm.heard)
    firm.head = (firm.head + 1) % WAITING
    firm.waiting += 1
    firm.tick += 1


def angle_of(firmware: Firmware, firm: Any, voltage: float, seed: int) -> float:
    """Return the angle [rad] that a potentiometer shows by its voltage, before it is counted."""
    noise = firmware.noise * gaussian(seed, firm.draws) if firmware.noise > 0.0 else 0.0
    firm.draws += 1
    return (voltage - firmware.b_o + noise) * firmware.per_volt


def apply(firmware: Firmware, firm: Any, frames: int, latest: float) -> None:
    """Put the duties whose time has come on the bridge."""
    while firm.waiting > 0 and (firmware.t_phi + (firm.tick - firm.waiting - frames) * firmware.T_c
                                + firmware.T_d <= latest):
        firm.duty = firm.duties[(firm.head - firm.waiting) % WAITING]
        firm.waiting -= 1


def sensed_by(numbers: Numbers, firm: Any, y: Vector) -> Sensed:
    """Return what the program measures besides, under the duty of now."""
    numbers = warm(numbers, y)
    V_bus, i = on_supply(duty.at_duty(numbers, firm.duty), firm.duty, y)
    return sensed_of(numbers, i, V_bus, y)


def sensed_of(numbers: Numbers, i: float, V_bus: float, y: Vector) -> Sensed:
    """Return what a program measures at a current [A] and a voltage of the bus [V]."""
    cold = numbers.bridge.R_drive - numbers.source.R_b
    return Sensed(i, V_bus, back_emf(turning(numbers.elastic, y), numbers.motor.K_b), cold, y.T_h)


def on_supply(numbers: Numbers, now: float, y: Vector) -> tuple[float, float]:
    """Return the voltage of the bus [V], and the current while it flows [A], of numbers at the duty of `now`."""
    u, w = duty.voltage(numbers.source, now), turning(numbers.elastic, y)
    return in_zone(numbers, currents.zone_of(numbers, u, 0.0, y.q, w, y.i), u, now, y)


def in_zone(numbers: Numbers, zone: int, u: float, now: float, y: Vector) -> tuple[float, float]:
    """Return the same where the zone of the current and the voltage [V] behind the bridge are known."""
    w = turning(numbers.elastic, y)
    i = currents.flowing(numbers, zone, u, y.q, w, y.i)
    V = bridge.bus_voltage(numbers.bridge, numbers.source, numbers.motor, zone, u, w, i)
    return V / duty.share_of(numbers.bridge, now), i / duty.on_share_of(numbers.bridge, now)


def listen(inputs: Inputs, firm: Any, time: float) -> None:
    """Take the commands that have come by a time since the start [s]."""
    firmware = inputs.firmware[0]
    if firmware.goals > 0.0:
        _read_bus(inputs, firm, time)
        return
    slack = SAME * firmware.T_c
    while True:
        edge = _edge(inputs, firm.frame)
        if firm.falls <= time + slack:
            _take_pulse(firmware, firm)
        elif edge <= time + slack:
            rise(inputs, firm)
        else:
            firm.hears = min(firm.falls, edge)
            return


def _read_bus(inputs: Inputs, firm: Any, time: float) -> None:
    """Take the goal that stands on the bus, where it is another than the one before."""
    firmware = inputs.firmware[0]
    written = time - firmware.latency
    if firm.known > 0:
        goal = firm.coming[firm.first]
        firm.first = (firm.first + 1) % WAITING
        firm.known -= 1
    else:
        goal = _goal(inputs, written)
        firm.hears = _stays(inputs, written) + firmware.latency
    if goal != NOWHERE and goal != firm.written:
        firm.written, firm.heard, firm.tripped = goal, _since(inputs, firm, written) + firmware.latency, 0
        control.aim(firmware, firm, goal)


def _goal(inputs: Inputs, time: float) -> float:
    """Return the goal [rad] that is written at a time [s]; `NOWHERE` before the first."""
    firmware = inputs.firmware[0]
    if time < inputs.command[0][0] - SAME * firmware.T_c:
        return NOWHERE
    piece, _ = in_force(inputs.command, 0.0, time + SAME * firmware.T_c, 0.0)
    return counted(piece_value(piece, time), firmware.quantum)


def _stays(inputs: Inputs, time: float) -> float:
    """Return until when what is written at a time stays what it is [s]: not at all where it moves."""
    piece, end = in_force(inputs.command, 0.0, time + SAME * inputs.firmware[0].T_c, 0.0)
    return end if piece.slope == 0.0 and piece.amplitude == 0.0 and piece.start <= time else time


def _since(inputs: Inputs, firm: Any, time: float) -> float:
    """Return when what stands on the bus at a time [s] was written: once, or over and over where it changes."""
    piece, _ = in_force(inputs.command, 0.0, time + SAME * inputs.firmware[0].T_c, 0.0)
    still = piece.slope == 0.0 and piece.amplitude == 0.0
    return min(max(piece.start, firm.since), time) if still else time


def take_up(inputs: Inputs, firm: Any, now: float) -> None:
    """Let a call begin, at a time [s], with a goal that may be another one than the calls before had."""
    firm.hears = -math.inf
    start, goal = inputs.command[0][0], inputs.command[0][1]
    if start <= 0.0 and goal != firm.given:
        firm.given, firm.since = goal, now


def rise(inputs: Inputs, firm: Any) -> None:
    """Let the next pulse rise: it has the width that is commanded now."""
    edge = _edge(inputs, firm.frame)
    piece, _ = in_force(inputs.command, 0.0, edge + SAME * inputs.firmware[0].T_c, 0.0)
    firm.width = piece_value(piece, edge)
    firm.falls = edge + firm.width
    firm.frame += 1


def resume(inputs: Inputs, memory: Memory) -> None:
    """Find the next tick and pulse of a program that continues, under commands that may be others than before."""
    firmware, firm = inputs.firmware[0], of(memory)
    time = origin_of(memory) + memory.point.time
    take_up(inputs, firm, time)
    firm.tick = max(0, math.ceil((time - firmware.t_phi) / firmware.T_c - SAME))
    if firmware.goals > 0.0:
        return
    if inputs.period > 0.0:
        firm.frame = math.ceil((time - SAME * firmware.T_c) / inputs.period)
    else:
        firm.frame = next_frame(inputs, memory, memory.point.time - SAME * firmware.T_c)


def pause(inputs: Inputs, firm: Any, time: float) -> None:
    """Let what is on its way stay what it is, whatever is commanded from now on: risen pulses, written goals."""
    firmware = inputs.firmware[0]
    slack = SAME * firmware.T_c
    if firmware.goals > 0.0:
        first = firmware.t_phi + firm.tick * firmware.T_c - firmware.latency
        while first + firm.known * firmware.T_c < time - slack:
            firm.coming[(firm.first + firm.known) % WAITING] = _goal(inputs, first + firm.known * firmware.T_c)
            firm.known += 1
        return
    while _edge(inputs, firm.frame) < time - slack:
        if firm.falls < math.inf:
            _take_pulse(firmware, firm)
        rise(inputs, firm)


def _edge(inputs: Inputs, frame: int) -> float:
    """Return when a pulse rises [s since the start]; inf after the last."""
    if inputs.period > 0.0:
        return frame * inputs.period
    return inputs.edges[frame] if frame < len(inputs.edges) else math.inf


def _take_pulse(firmware: Firmware, firm: Any) -> None:
    """Take the pulse that has fallen as a goal, where it is neither too short nor too long."""
    if firmware.shortest <= firm.width <= firmware.longest:
        firm.heard, firm.tripped = firm.falls, 0
        t = resolved_pulse(firm.width, firmware.resolution)
        control.aim(firmware, firm, firmware.at_nothing + firmware.per_second * t)
    firm.falls = math.inf
