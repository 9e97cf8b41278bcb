"""Digital servos one after the other, from tick to tick by legs; what is left of a call is for `runs`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from servotwin.models.engine import controller
from servotwin.models.engine.lanes import ARRIVED, UNDERWAY, inputs_of, numbers_of
from servotwin.models.engine.legs import tick_legs
from servotwin.models.engine.legs.tick_legs import LEGS
from servotwin.models.engine.memory import (
    Inputs,
    Memory,
    counted_anew,
    due,
    instant,
    memory_at,
    origin_of,
    put_memory,
    resumed,
)

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes
    from servotwin.models.engine.memory import Memories


def go_on(lanes: Lanes, curve: Floats, torques: Floats, torque_first: Indices, torque_count: Indices,
          which: Indices, durations: Floats, times: Floats, first_output: Indices, outputs: Floats, memories: Memories,
          status: Indices) -> None:
    """Let the lanes named in `which` go on as far as legs lead; `runs.go_on` finishes those that do not arrive.

    The arguments are those of `runs.go_on`. Durations [s] and outputs that are left to do, and the status of lanes that
    have gone on, are noted for it. A spring or a pendulum counts with its torque in the middle of a tick.
    """
    for k in range(which.size):
        if status[k] == ARRIVED:
            continue
        lane = which[k]
        numbers = numbers_of(lanes, lane)
        inputs = inputs_of(lanes, curve, torques[torque_first[lane]:torque_first[lane] + torque_count[lane]], lane)
        if tick_legs.way_of(numbers, inputs, durations[k], True) != LEGS:
            continue
        memory = memory_at(memories, k)
        if status[k] != UNDERWAY:
            memory = resumed(False, inputs, memory, False)
            controller.resume(inputs, memory)
        until, done, goes = instant(False, inputs, memory, memory.point.time + durations[k]), first_output[k], True
        while goes:
            memory, until = counted(inputs, memory, until)
            gone = tick_legs.go(numbers, inputs, memory, until, times, done, outputs[k])
            memory, done = tick_legs.as_gone(memory, gone), gone.done
            goes = gone.anew and gone.time < until and due(memory)
        durations[k], first_output[k] = max(until - memory.point.time, 0.0), done
        status[k] = ARRIVED if laid_down(inputs, memory, until, memories, k) else UNDERWAY


def counted(inputs: Inputs, memory: Memory, until: float) -> tuple[Memory, float]:
    """Return a memory and a time to which it shall go [s], which count from later on where that is due."""
    if not due(memory):
        return memory, until
    later = counted_anew(memory)
    return later, instant(False, inputs, later, until - (origin_of(later) - origin_of(memory)))


def laid_down(inputs: Inputs, memory: Memory, until: float, memories: Memories, k: int) -> bool:
    """Keep what a servo remembers that has gone on by legs; return whether it has come to a time [s]."""
    arrives = memory.point.time >= until
    if arrives:
        controller.pause(inputs, memory)
    put_memory(memories.rows[k], memory)
    return bool(arrives)
