"""Digital servos one after the other, from tick to tick by power series, each as the only one on its supply.

So go those whose windings get warm, or whose supply may be at its limit; what is left of a call is for `runs`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.models.engine import controller
from servotwin.models.engine.bus import coupled_legs, coupled_ticks
from servotwin.models.engine.bus.bus_inputs import Tables, Told
from servotwin.models.engine.bus.coupled_legs import LEFT
from servotwin.models.engine.bus.coupled_units import put_unit_numbers, unit_mode, unit_state
from servotwin.models.engine.lanes import ARRIVED, UNDERWAY, inputs_of, numbers_of
from servotwin.models.engine.legs.leg_runs import counted, laid_down
from servotwin.models.engine.legs.tick_legs import Gone, as_gone, show_one
from servotwin.models.engine.memory import (
    SAME,
    Inputs,
    Memory,
    due,
    instant,
    memory_at,
    resumed,
)

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories


def go_on(lanes: Lanes, curve: Floats, torques: Floats, torque_first: Indices, torque_count: Indices,
          which: Indices, durations: Floats, times: Floats, first_output: Indices, outputs: Floats, memories: Memories,
          status: Indices, units: Any, common: Any) -> None:
    """Let the lanes named in `which` go on as far as this way leads; `runs.go_on` finishes those that do not arrive.

    The arguments are those of `leg_runs.go_on`, with room for two servos. No lane has a table of its potentiometer.
    """
    told = Told(lanes, Tables(torques, torque_first, torque_count, curve, torque_first, torque_count))
    for k in range(which.size):
        if status[k] == ARRIVED:
            continue
        lane = which[k]
        numbers = numbers_of(lanes, lane)
        inputs = inputs_of(lanes, curve, torques[torque_first[lane]:torque_first[lane] + torque_count[lane]],
                                lane)
        if durations[k] < inputs.firmware[0].T_c * (1.0 - SAME) or not coupled_ticks.possible(numbers, inputs):
            continue
        memory = memory_at(memories, k)
        if status[k] != UNDERWAY:
            memory = resumed(False, inputs, memory, False)
            controller.resume(inputs, memory)
        until, done, goes = instant(False, inputs, memory, memory.point.time + durations[k]), first_output[k], True
        units[0].place, units[0].lane = k, lane
        put_unit_numbers(units[0].given, numbers)
        coupled_ticks.put_source(common[0], numbers.source)
        while goes:
            memory, until = counted(inputs, memory, until)
            gone = _go(told, inputs, memory, memories.firms, until, times, done, outputs[k], units, common)
            memory, done = as_gone(memory, gone), gone.done
            goes = gone.anew and gone.time < until and due(memory)
        durations[k], first_output[k] = max(until - memory.point.time, 0.0), done
        status[k] = ARRIVED if laid_down(inputs, memory, until, memories, k) else UNDERWAY


def _go(told: Told, inputs: Inputs, memory: Memory, firms: Any, until: float, times: Floats, done: int,
        outputs: Floats, units: Any, common: Any) -> Gone:
    """Go on from tick to tick as far as this way leads, and at most to `until` [s]."""
    unit, serves = units[0], False
    coupled_ticks.sit(unit, inputs, memory, until)
    coupled_ticks.begin(told, firms, 1, units)
    while coupled_ticks.is_underway(units, 1):
        serves = True
        if coupled_ticks.serve(told, firms, 1, units, common[0]) == LEFT:
            break
        time = coupled_ticks.to_next(units, 1)
        if done < times.size:
            done = _show(units, common, unit.time + time, until, times, done, outputs, firms)
        if coupled_ticks.move(units, 1, common[0], time) == LEFT:
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
