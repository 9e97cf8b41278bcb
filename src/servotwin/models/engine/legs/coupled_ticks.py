"""Digital servos on one supply, from tick to tick of all of them: programs decide, and legs lead to the next instant.

A tick at which neither a duty nor a mode changes costs its program and, of a servo at rest, a comparison. A servo that
is the only one on its supply goes so where its winding gets warm, or the supply may be at its limit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine import controller
from servotwin.models.engine.lanes import inputs_at
from servotwin.models.engine.legs import coupled_legs
from servotwin.models.engine.legs.coupled_legs import DONE, LEFT, current_of, is_plain, put_duty, settle
from servotwin.models.engine.legs.coupled_units import put_unit_state, unit_mode, unit_numbers, unit_state
from servotwin.models.engine.legs.tick_legs import POWER_SERIES, STEPS, Gone, show_one
from servotwin.models.engine.memory import FRAMES, SAME, Inputs, Memory, origin_of
from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.terms import control, duty, elastic, firmware, sensor
from servotwin.models.terms.control import NOTHING_SENSED, Sensed
from servotwin.models.terms.dependence import BY_SHARE, ON_HEAT, TWO_BODIES
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats
    from servotwin.models.terms.source import Source

_FOLLOWED = TWO_BODIES | BY_SHARE | ON_HEAT
_GIVEN = Piece()  # what a servo follows that a program drives


def possible(numbers: Numbers, inputs: Inputs) -> bool:
    """Tell whether a servo always moves by such legs."""
    if not firmware.present(inputs.firmware[0]) or elastic.present(numbers.elastic):
        return False
    if sensor.slack(numbers.sensor) or len(inputs.torque) > 0:
        return False
    return may_depend(numbers, _GIVEN) & ~_FOLLOWED == 0


def way_of(numbers: Numbers, inputs: Inputs, left: float) -> int:
    """Return which way a servo that is alone goes for the time that is left [s], where its tick has no closed form."""
    if left < inputs.firmware[0].T_c * (1.0 - SAME) or len(inputs.curve) > 0 or not possible(numbers, inputs):
        return STEPS
    return POWER_SERIES


def alone(told: Any, inputs: Inputs, memory: Memory, firms: Any, until: float, times: Floats, done: int,
          outputs: Floats, units: Any, common: Any) -> Gone:
    """Advance the one servo of `units` as far as this way leads, and at most to `until` [s]; write its outputs.

    Both `units` and `common` have room for a second one.
    """
    unit, serves = units[0], False
    sit(unit, inputs, memory, until)
    begin(told, firms, 1, units)
    while is_underway(units, 1):
        serves = True
        if serve(told, firms, 1, units, common[0]) == LEFT:
            break
        time = to_next(units, 1)
        if done < times.size:
            done = _show(units, common, unit.time + time, until, times, done, outputs, firms)
        if move(units, 1, common[0], time) == LEFT:
            break
    return Gone(unit.time, unit_state(unit.y), unit.mesh, done, serves)


def _show(units: Any, common: Any, end: float, until: float, times: Floats, done: int, outputs: Floats,
          firms: Any) -> int:
    """Write the outputs on the way to `end` [s], found by going there in the second room; return how many are done."""
    t, slack, origin = units[0].time, units[0].slack, units[0].origin
    while done < times.size and (times[done] - origin < end - slack or end >= until - slack):
        units[1], common[1] = units[0], common[0]
        wanted = min(max(times[done] - origin - t, 0.0), end - t)
        if coupled_legs.go(units[1:2], 1, common[1], wanted) < wanted:
            return done
        show_one(outputs, done, unit_state(units[1].y), unit_mode(units[1].mode), firms[units[0].place])
        done += 1
    return done


def put_source(common: Any, source: Source) -> None:
    """Let servos share a source, of which no current has been found out yet."""
    common.V, common.R_b, common.I_max, common.now, common.then = (
        source.V, source.R_b, source.I_max, source.V, source.V)
    common.bend, common.jumped = 0.0, 0


def sit(unit: Any, inputs: Inputs, memory: Memory, until: float) -> None:
    """Put a servo where its memory says, to continue to `until` by its own clock [s], or to where times count anew."""
    program, mode = inputs.firmware[0], unit.mode
    unit.frames, unit.origin, unit.time = memory.frames, origin_of(memory), memory.point.time
    unit.last = min(until, FRAMES * memory.beat)
    unit.tick, unit.slack, unit.torque = program.T_c, SAME * program.T_c, inputs.constant_torque
    put_unit_state(unit.y, memory.point.y)
    mode.zone, mode.contact, mode.mesh, mode.motor, mode.share = 0, 0, memory.point.mode.mesh, 0, 0
    unit.mesh, unit.short, unit.active = mode.mesh, 0, 0


def go(told: Any, firms: Any, count: int, units: Any, common: Any) -> None:
    """Advance servos as far as this way leads; where they are, and when, is in their records."""
    begin(told, firms, count, units)
    while is_underway(units, count):
        if serve(told, firms, count, units, common) == LEFT:
            return
        if move(units, count, common, to_next(units, count)) == LEFT:
            return


def begin(told: Any, firms: Any, count: int, units: Any) -> None:
    """Give servos the duties of their programs, and the time at which these do something next."""
    for k in range(count):
        unit = units[k]
        unit.due = controller.next_due(inputs_at(told, unit).firmware[0], firms[unit.place], unit.frames)
        put_duty(unit, firms[unit.place].duty)


def move(units: Any, count: int, common: Any, time: float) -> int:
    """Let servos move for a time [s] as far as legs lead; return `LEFT` where that is less."""
    gone = coupled_legs.go(units, count, common, time)
    for k in range(count):
        unit = units[k]
        end = min(unit.due, unit.last)
        unit.time = end if gone == time and end <= unit.time + time + unit.slack else unit.time + gone
    return DONE if gone == time else LEFT


def is_underway(units: Any, count: int) -> bool:
    """Tell whether all have to continue."""
    for k in range(count):
        if units[k].time >= units[k].last:
            return False
    return True


def to_next(units: Any, count: int) -> float:
    """Return how long it takes to the next instant of any servo [s]."""
    time = math.inf
    for k in range(count):
        unit = units[k]
        own = min(unit.due, unit.last) - unit.time
        time = min(time, unit.tick if abs(own - unit.tick) <= unit.slack else own)
    return max(time, 0.0)


def serve(told: Any, firms: Any, count: int, units: Any, common: Any) -> int:
    """Do what programs do now: put duties on bridges, measure, decide; return `LEFT` or not."""
    due = False
    for k in range(count):
        unit = units[k]
        if unit.due <= unit.time + unit.slack:
            due = True
            if firms[unit.place].waiting > 0:
                _apply(inputs_at(told, unit), firms[unit.place], unit)
    if settle(units, count, common) == LEFT or not is_plain(units, count, common, common.now, False):
        return LEFT  # before anything is measured
    if not due:
        return DONE
    for k in range(count):
        unit = units[k]
        if unit.due <= unit.time + unit.slack:  # what it measures is of before, whatever others put on their bridges
            inputs = inputs_at(told, unit)
            _tick(inputs, firms[unit.place], unit, common.now)
            _apply(inputs, firms[unit.place], unit)
            unit.due = controller.next_due(inputs.firmware[0], firms[unit.place], unit.frames)
    return settle(units, count, common)


def _apply(inputs: Inputs, firm: Any, unit: Any) -> None:
    """Put the duties of a program on its bridge whose time has come."""
    controller.apply(inputs.firmware[0], firm, unit.frames, unit.time + unit.slack)
    if firm.duty != unit.duty:
        put_duty(unit, firm.duty)


def _tick(inputs: Inputs, firm: Any, unit: Any, V: float) -> None:
    """Let a servo's program decide where a tick is due, at a voltage of the bus [V]."""
    program, y = inputs.firmware[0], unit_state(unit.y)
    if not controller.is_due(program, firm, unit.frames, unit.time + unit.slack):
        return
    sensed = NOTHING_SENSED
    if control.senses(program):
        sensed = _sensed(unit, V)
    controller.work(inputs, unit_numbers(unit.given).sensor, firm, y.q, y.q, sensed, unit.origin + unit.time)


def _sensed(unit: Any, V: float) -> Sensed:
    """Return what a program measures besides its angle."""
    y = unit_state(unit.y)
    numbers = warm(unit_numbers(unit.given), y)
    i = current_of(unit, V, y)
    return controller.sensed_of(numbers, i / duty.on_share_of(numbers.bridge, unit.duty), V, y)
