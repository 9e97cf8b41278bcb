"""What shows of a servo along the segments of a run, all signals at once and in plain numbers: for what is shown live.

`Result` computes one signal at many times over arrays; this computes all signals at a few times, by the same laws.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise
from operator import attrgetter, itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.loads import as_load
from servotwin.models.base import KINDS
from servotwin.models.engine.motions import motion
from servotwin.models.engine.observe import Observed, observed, on_bus, told_by
from servotwin.models.engine.step import at_pulses
from servotwin.models.terms import duty
from servotwin.models.terms.numbers import warm
from servotwin.models.terms.sensor import wiper_at
from servotwin.physics.pieces import piece_value

if TYPE_CHECKING:
    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.models.engine.motions.motion import Motion
    from servotwin.models.state.modes import Vector
    from servotwin.models.terms.numbers import Numbers
    from servotwin.simulation.engine import Plan, Segment

Row = tuple[float, ...]
_COMMANDS = tuple(KINDS)
_FOUND = (*Observed._fields, "output_angle", "output_speed", *_COMMANDS)
_LATE = 1e-12  # of an instant: so much before a tick it is the tick, as in `Trajectory`
_ANGLE, _SPEED, _TORQUE = map(Observed._fields.index, ("motor_angle", "motor_speed", "motor_torque"))
_start_of = attrgetter("start")


class _Told(NamedTuple):
    """What a program tells in a segment, by the names of its memory."""

    duty: float
    goal: float
    r: float
    trip: int


class Sight:
    """What shows of a servo: all output signals of a model under a load.

    Parameters
    ----------
    model : Model
    load : Load, optional

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.simulation.engine import Record
    >>> sim, record = st.Simulator(st.PulseServo(st.load_servo("hitec-hs-755hb"))), Record([], [])
    >>> command = st.signals.step(0.0, 60.0, unit="deg")
    >>> state = sim.recorded(sim.initial(command), 0.2, command, record)
    >>> sight = Sight(sim.model, sim.load)
    >>> time, *values = sight.points(sim.plan(command), record.segments, [0.2])[0]
    >>> values[sight.names.index("output_angle")] == state["output_angle"]
    True
    """

    def __init__(self, model: Model, load: Load | Part | None = None) -> None:
        self.names = names_of(model, as_load(load))
        """Names of the signals, in the order of the values."""
        self._model = model
        self._reduction = model.value("gear.gear_reduction") if "gear.gear_reduction" in model.requires else 1.0
        self._pick: Callable[[Any], Row] = itemgetter(*map(_FOUND.index, self.names))
        self._commands = tuple(name if name in self.names else None for name in _COMMANDS)
        self._commanded: tuple[float, Row] = (math.nan, ())
        self._observed: tuple[Any, list[float]] = ((), [])  # at rest nothing changes from one time to the next
        self._prepared: tuple[Motion | None, Motion | None] = (None, None)

    def seen(self, plan: Plan, segment: Segment, time: float, bus_voltage: float | None = None) -> Row:
        """Return all signals (SI) by the motion of one segment, in the order of `names`.

        Parameters
        ----------
        plan : Plan
            Of the run.
        segment : Segment
        time : float
            From the segment's start to its end, both included [s].
        bus_voltage : float, optional
            Of a supply that several servos share [V]; the servo's own supply unless given.
        """
        time = min(max(time, segment.start), segment.end)
        y, m = self.state(segment, time), segment.motion
        local = time - segment.origin
        u, tau = piece_value(m.u, local), piece_value(m.tau, local)
        try:
            numbers = m.numbers
            if bus_voltage is not None:
                numbers, u = _on_bus(plan, segment, y, bus_voltage)
            else:
                numbers = warm(numbers, y)
            wiper = wiper_at(numbers.sensor, segment.wiper, y.q)
            shown = self._shown(numbers, (plan.curve, m.mode, u, tau, y, wiper, segment.drive, segment.error), segment)
        except (ArithmeticError, ValueError):  # numbers beyond what a float holds
            shown = [math.nan] * len(Observed._fields)
        return self._pick((*shown, y.q, y.w, *self._command(plan, time)))

    def points(self, plan: Plan, segments: Sequence[Segment], times: Sequence[float],
               bus_voltages: Sequence[float] | None = None) -> list[Row]:
        """Return time [s] and all signals (SI) at some times: a tuple for each, time first.

        Parameters
        ----------
        plan : Plan
        segments : sequence of Segment
            In order, without gaps.
        times : sequence of float
            Not decreasing [s]. At an event it is just after it; of a time that comes twice the first is just before.
        bus_voltages : sequence of float, optional
            Of a shared supply at these times [V].
        """
        places = places_of(segments, times)
        volts = bus_voltages or (None,) * len(times)
        return [(t, *self.seen(plan, segments[k], t, V)) for t, k, V in zip(times, places, volts, strict=True)]

    def _shown(self, numbers: Numbers, instant: tuple[Any, ...], segment: Segment) -> list[float]:
        """Return all signals, those of the motor at its own shaft; once where nothing differs from the time before."""
        told = _Told(segment.duty, segment.goal, segment.reference, segment.trip)
        key = (numbers, instant, told)
        if key != self._observed[0]:
            shown, N = observed(numbers, *instant), self._reduction
            if duty.present(numbers.bridge):
                shown = told_by(numbers.bridge, told, shown)
            found = list(shown)
            found[_ANGLE], found[_SPEED], found[_TORQUE] = N * found[_ANGLE], N * found[_SPEED], found[_TORQUE] / N
            self._observed = (key, found)
        return self._observed[1]

    def state(self, segment: Segment, time: float) -> Vector:
        """Return where a servo stands in a segment at a time [s]; a motion is prepared once, and only where needed."""
        m = segment.motion
        age = min(max(time, segment.start), segment.end) - segment.anchor
        if motion.is_step(m) and not m.has_dense and age != 0.0 and m.t0 + age < m.t0 + m.length:
            if self._prepared[0] is not m:
                self._prepared = (m, motion.prepared(m))
            return motion.state(self._prepared[1], age)  # type: ignore[arg-type]
        return motion.state(m, age)

    def _command(self, plan: Plan, time: float) -> Row:
        """Return what stands for the command, as long as it stays the same."""
        value = piece_value(plan.command.at(time)[0], time)
        if value != self._commanded[0]:
            drive: Any = np.float64(value)
            self._commanded = (value, tuple(0.0 if name is None else float(self._model.command_signal(name, drive))
                                            for name in self._commands))
        return self._commanded[1]


def names_of(model: Model, load: Load) -> tuple[str, ...]:
    """Return the names of all signals that are seen of a model under a load.

    Examples
    --------
    >>> import servotwin as st
    >>> names_of(st.DCMotor(st.load_servo("hitec-hs-755hb")), st.loads.Load())[:2]
    ('armature_voltage', 'armature_current')
    """
    return tuple(name for name in model.signals_with(load) if name in _FOUND)


def _on_bus(plan: Plan, segment: Segment, y: Vector, V_bus: float) -> tuple[Any, float]:
    """Return numbers of a servo on a bus of this voltage [V], and the voltage behind its bridge [V]."""
    plain = warm(plan.numbers, y)
    own = duty.at_duty(plain, segment.duty) if plan.digital else at_pulses(plain, segment.silent)
    share = duty.share_of(own.bridge, segment.duty) if plan.digital else 1.0
    own = on_bus(own, V_bus * share)
    return own, segment.drive * own.source.V


def places_of(segments: Sequence[Segment], times: Sequence[float]) -> list[int]:
    """Return the number of the segment in which each time [s] is; of a time that comes twice, first just before it.

    Parameters
    ----------
    segments : sequence of Segment
        In order, without gaps.
    times : sequence of float
        Not decreasing.
    """
    starts = list(map(_start_of, segments))
    late = 1.0 + _LATE if duty.present(segments[0].motion.numbers.bridge) else 1.0
    places = [max(bisect_right(starts, t * late) - 1, 0) for t in times]
    for n, (before, after) in enumerate(pairwise(times)):
        if before == after:
            k = places[n]
            while k > 0 and starts[k] * late >= before:
                k -= 1
            places[n] = k
    return places


def switches(segments: Sequence[Segment]) -> list[float]:
    """Return the times at which a bridge switches [s]: it drives, ends to, turns, opens, brakes; or pulses stay away.

    The duty of a digital servo also steps at each tick; that counts only where its sign changes.

    Parameters
    ----------
    segments : sequence of Segment
        In order; one before the first tells whether the bridge switches where that begins.
    """
    return [after.start for before, after in pairwise(segments) if _bridge_of(before) != _bridge_of(after)]


def _bridge_of(segment: Segment) -> tuple[float, float, int]:
    """Return how a bridge drives, whether its torque is off, and whether pulses stay away."""
    return segment.drive, segment.duty if abs(segment.duty) > 1.0 else 0.0, segment.silent


def eased(segments: Sequence[Segment], times: Sequence[float]) -> list[float]:
    """Return times [s] that cost less to look at: those within integrated steps go to the nearest end of one.

    What a motion is in the middle of an integrated step costs as much as the step; at its ends it is known. No time is
    moved past the middle to its neighbours, and those that meet stay one.

    Parameters
    ----------
    segments : sequence of Segment
    times : sequence of float
        Increasing.
    """
    found: list[float] = []
    for n, k in enumerate(places_of(segments, times)):
        t, (start, end, m, *_) = times[n], segments[k]
        if motion.is_step(m) and not m.has_dense:
            low = 0.5 * (t + times[n - 1]) if n else t
            high = 0.5 * (t + times[n + 1]) if n + 1 < len(times) else t
            near = start if t - start < end - t else end
            t = near if low <= near <= high else t
        if not found or t > found[-1]:
            found.append(t)
    return found
