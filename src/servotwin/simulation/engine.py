"""The engine: from event to event, exactly where the mode is linear, with error control where it is not.

It keeps the state at the *anchor*, where the present motion began, and evaluates from there. So the result depends
neither on the output step nor on how a run is split into calls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from servotwin.errors import SimulationError
from servotwin.models.kernels import hybrid
from servotwin.models.kernels.hybrid import Mode, Plant
from servotwin.models.kernels.rodas import Vector
from servotwin.physics.pieces import Pieces, piece_rate, piece_value
from servotwin.simulation.events import first_event
from servotwin.simulation.motion import Inputs, Motion, Step, closed_motion, integrated_step
from servotwin.simulation.status import Status

_TOLERANCE = 3e-10  # error of one integrator step, relative to 1 + |state|
_FIRST_STEP = 1e-4  # s
_CHATTER = 200  # events without time going on
_MOST_OSCILLATIONS = 1e7  # within one motion


class Event(NamedTuple):
    """Something that happened: time [s], kind, and the output angle [rad] there."""

    time: float
    kind: str
    value: float


@dataclass(frozen=True)
class State:
    """Everything that a servo remembers; picklable, comparable, and enough to go on from.

    Parameters
    ----------
    time : float
        [s]
    names : tuple of str
        Signal names of `values`.
    values : tuple of float
        Angle [rad], speed [rad/s] and, with inductance, current [A].
    mode : Mode
        Zone of the voltage law and contact of the shaft.
    anchor_time, anchor : float, tuple of float
        Where the present motion began, and the state there.
    inputs : Inputs
        The pieces of command and external torque in force since then.
    plant : Plant
        The numbers of servo and load by which it moves since then.
    step : float
        Length that the integrator would try next [s].
    """

    time: float
    names: tuple[str, ...]
    values: Vector
    mode: Mode | None = None
    anchor_time: float = 0.0
    anchor: Vector = (0.0, 0.0, 0.0)
    inputs: Inputs | None = None
    plant: Plant | None = None
    step: float = _FIRST_STEP

    def __getitem__(self, name: str) -> float:
        """Return one value by its signal name."""
        if name not in self.names:
            raise KeyError(f"{name!r} is no state; there are: {', '.join(self.names)}")
        return self.values[self.names.index(name)]


@dataclass(frozen=True)
class Segment:
    """A stretch of one motion between two times [s]; its anchor may lie before its start."""

    start: float
    end: float
    anchor: float
    mode: Mode
    motion: Motion
    inputs: Inputs


@dataclass
class Record:
    """What a run leaves behind: segments in order, and events."""

    segments: list[Segment]
    events: list[Event]


def run(plant: Plant, command: Pieces, torque: Pieces, state: State, until: float,
        record: Record | None = None) -> State:
    """Return the state at `until` [s], and add what happened to `record`.

    Raises
    ------
    SimulationError
        If the run cannot go on; it carries status, time and cause.
    """
    idle = 0
    while state.time < until:
        before = state.time
        try:
            state, piece_end = _anchored(plant, command, torque, state)
            motion, next_step = _motion(plant, state, piece_end)
            state, segment, event = _advanced(plant, state, motion, next_step, min(until, piece_end))
        except ArithmeticError:  # numbers beyond what a float holds
            raise _failure(Status.DIVERGED, before) from None
        if not all(map(math.isfinite, state.values)):
            raise _failure(Status.DIVERGED, before)
        idle = idle + 1 if state.time == before else 0
        if idle > _CHATTER:
            raise _failure(Status.CHATTER, before)
        if record is not None:
            if segment.end > segment.start or not record.segments:
                record.segments.append(segment)
            if event is not None:
                record.events.append(event)
    return state


def _failure(status: Status, time: float) -> SimulationError:
    return SimulationError(status.name, time, status.message)


def _anchored(plant: Plant, command: Pieces, torque: Pieces, state: State) -> tuple[State, float]:
    """Return the state with its motion anchored under the inputs of now, and when these change [s]."""
    u, u_end = command.at(state.time)
    tau, tau_end = torque.at(state.time)
    inputs = Inputs(u, tau)
    if state.mode is None or inputs != state.inputs or plant != state.plant:
        t = state.time
        q, w, i = state.values
        v, dv, load = piece_value(u, t), piece_rate(u, t), piece_value(tau, t)
        zone = hybrid.zone_of(plant, v - plant.p * q - plant.b_o, dv - plant.p * w)
        contact = hybrid.contact_of(plant, zone, v, load, q, w, i, _in_one_piece(plant, inputs))
        state = replace(state, mode=Mode(zone, contact), anchor_time=t, anchor=state.values, inputs=inputs,
                        plant=plant)
    return state, min(u_end, tau_end)


def _in_one_piece(plant: Plant, inputs: Inputs) -> bool:
    """Whether a smoothed friction is integrated throughout: where no part of it would be linear."""
    return plant.kappa > 0.0 and (plant.L > 0.0 or plant.gravity != 0.0 or inputs.u.sweep != 0.0)


def _motion(plant: Plant, state: State, piece_end: float) -> tuple[Motion, float]:
    mode, inputs = state.mode, state.inputs
    if mode is None or inputs is None:  # pragma: no cover - _anchored sets both
        raise _failure(Status.DIVERGED, state.time)
    motion = closed_motion(plant, mode, state.anchor, inputs, state.anchor_time)
    if motion is not None:
        return motion, state.step
    step, next_step = integrated_step(plant, mode, state.anchor, inputs, state.anchor_time, state.step,
                                      piece_end - state.anchor_time, _TOLERANCE)
    if step is None:
        raise _failure(Status.STEP_TOO_SMALL, state.time)
    return step, next_step


def _advanced(plant: Plant, state: State, motion: Motion, next_step: float,
              horizon: float) -> tuple[State, Segment, Event | None]:
    """Follow a motion to its first event, its end or the horizon [s], whichever comes first."""
    mode, inputs, t0 = state.mode, state.inputs, state.anchor_time
    if mode is None or inputs is None:  # pragma: no cover - _anchored sets both
        raise _failure(Status.DIVERGED, state.time)
    step_end = t0 + motion.length
    if abs(step_end - horizon) <= 4e-16 * abs(horizon):
        step_end = horizon
    end = min(horizon, step_end)
    fine, settled = motion.scales()
    if min(end - t0, settled) > _MOST_OSCILLATIONS * fine:
        raise _failure(Status.TOO_FAST, state.time)
    kinds = hybrid.guards(plant, mode, _in_one_piece(plant, inputs))
    s, kind = first_event(plant, mode, motion, inputs, kinds, t0, state.time - t0, end - t0)
    if kind < 0:
        y = motion.state(end - t0)
        segment = Segment(state.time, end, t0, mode, motion, inputs)
        if isinstance(motion, Step) and end == step_end:
            return replace(state, time=end, values=y, anchor_time=end, anchor=y, step=next_step), segment, None
        return replace(state, time=end, values=y), segment, None
    t = min(max(t0 + s, state.time), end)
    q, w, i = motion.state(s)
    after, q_after, w_after = hybrid.cross(plant, mode, kind, piece_value(inputs.u, t), piece_value(inputs.tau, t),
                                           q, w, i)
    segment = Segment(state.time, t, t0, mode, motion, inputs)
    y = (q_after, w_after, i)
    moved = replace(state, time=t, values=y, mode=after, anchor_time=t, anchor=y)
    return moved, segment, Event(t, _event_name(kind, after), q_after)


def _event_name(kind: int, after: Mode) -> str:
    if kind == hybrid.SPEED and hybrid.at_rest(after.contact):
        return "stick"
    if kind == hybrid.SPEED and after.contact != hybrid.CORE:
        return "reversal"
    return hybrid.EVENT_NAMES[kind]
