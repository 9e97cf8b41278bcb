"""One lane by itself from call to call, by legs: analog servos from pulse to pulse, digital ones from tick to tick.

Between two switches of its bridge a servo moves by legs, or by arcs where it has neither play nor friction by torque.
Where static friction fades, legs below the speed at which none is left are creeps (`legs.fading_legs`); where windings
warm up, legs are power series (`legs.warm_legs`). No motion is kept, so a lane is a handful of numbers. Times count
from the latest edge or tick, and whole ones are counted, so that floats have digits for them however long a servo runs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import controller, cosim
from servotwin.models.engine.batch.segments import linear_segments
from servotwin.models.engine.batch.segments.linear_segments import ArcNumbers
from servotwin.models.engine.lanes import chip_at, numbers_at
from servotwin.models.engine.legs import fading_legs, legs, warm_legs
from servotwin.models.engine.memory import SAME, Inputs, Point
from servotwin.models.engine.motions.elementary import anew
from servotwin.models.engine.observe import Observed, at_motor, observed, told_by
from servotwin.models.engine.step import COMPLETED, CROWDED, DIVERGED, at_pulses, measured
from servotwin.models.state.modes import INSIDE, RIGID, Mode, Vector, one_body
from servotwin.models.state.records import reader, writer
from servotwin.models.terms import bridge, duty, frame, friction, heat, play
from servotwin.models.terms.frame import Frame
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import wiper_at
from servotwin.models.terms.shaft import Shaft
from servotwin.models.terms.wiring import TRAVEL_SLACK, Wiring, followed, possible, rest_angle

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats

BY_ARCS, BY_LEGS, BY_CREEPS, BY_SERIES = range(4)
SLOWEST = BY_CREEPS  # of which a text has nothing where no friction fades: `BY_CREEPS` is nothing there
WARMEST = BY_SERIES  # in the same way, where nothing warms up
FOLLOWED, PULSE_WIDTH, COMMAND_ANGLE = range(3)  # kinds of commands: as the engine follows it, or of the servo
arc_at, put_arcs = reader("arc_at", ArcNumbers), writer("put_arcs", ArcNumbers)
wiring_at = reader("wiring_at", Wiring)
LEFT = -1  # by arcs, which end where a stop is met: the lane is left to legs


class Stand(NamedTuple):
    """Where a servo stands between two calls."""

    y: Vector
    mesh: int
    wiper: float  # angle of the potentiometer, which may lag behind the shaft
    frames: int  # frames of pulses, or ticks, that are over
    time: float  # since the latest edge or tick [s]


class Gone(NamedTuple):
    """Where a servo stands after a call, what its chip remembers, and a status."""

    stand: Stand
    chip: Frame
    status: int


def pulses(by: int, numbers: Any, arcs: Any, chips: Any, j: int, curve: Floats, seed: int, width: float, torque: float,
           stand: Stand, now: Frame, duration: float) -> Gone:
    """Advance an analog servo by a time [s] under pulses of one width [s] and an external torque [N m].

    Its numbers, those of its arcs and its chip are lane `j` of tiles, and are read where they are needed. A servo that
    needs more legs than `legs.MOST_LEGS` has `DIVERGED`.
    """
    y, mesh, wiper, frames, t = stand
    T_f, status = chips.frame_period[j], COMPLETED
    left, rest = whole(t + duration, T_f)
    while status == COMPLETED and (left > 0 or t < rest):
        heeds = by == BY_LEGS and bridge.heeds_silence(numbers_at(anew(numbers), j).bridge)
        if frame.next_switch(now, heeds) <= t:
            now = frame.switched(now, t)
        if now.number <= frames:
            met = numbers_at(anew(numbers), j)
            met = at_pulses(met, now.silent) if heeds else met
            now = measured(met, chip_at(anew(chips), j), curve, seed, now, t, y, wiper, width)
        end = min(frame.next_switch(now, heeds), T_f if left > 0 else rest)
        if by == BY_ARCS:
            arc = linear_segments.under(arc_at(anew(arcs), j), torque)
            q, w, turned, done = linear_segments.slide(arc, now.drive, y.q, y.w, end - t)
            sensor = numbers_at(anew(numbers), j).sensor
            y, wiper = one_body(q, w, y), wiper_at(sensor, wiper_at(sensor, wiper, turned), q)
            status = COMPLETED if done > 0.0 else LEFT
        else:
            own = numbers_at(anew(numbers), j)
            own, u = at_pulses(own, now.silent) if heeds else own, now.drive * own.source.V
            if WARMEST == BY_SERIES and not friction.fades(own.friction):
                gone = warm_legs.go(own, torque, u, y, mesh, wiper, end - t)
            elif SLOWEST == BY_CREEPS:
                gone = fading_legs.go(own, torque, u, y, legs.mode_from(own, torque, u, y, mesh), wiper, end - t)
            else:
                gone = legs.go(own, torque, u, y, legs.mode_from(own, torque, u, y, mesh), wiper, end - t)
            y, mesh, wiper = gone.y, gone.mode.mesh, gone.wiper
            status = COMPLETED if gone.done > 0.0 else DIVERGED
        if now.number == frame.CROWDED:
            status = CROWDED
        t = end
        if left > 0 and t >= T_f:
            left, frames, t, now = left - 1, frames + 1, 0.0, frame.shifted(now, T_f)
    return Gone(Stand(y, mesh, wiper, frames, t), now, status)


def prepare(numbers: Any, arcs: Any, j: int) -> None:
    """Put the numbers of a lane's arcs into their tile."""
    put_arcs(arcs, j, linear_segments.arc_numbers(numbers_at(numbers, j), 0.0))


def ticks(numbers: Any, j: int, inputs: Inputs, firm: Any, stand: Stand, duration: float) -> tuple[Stand, int]:
    """Advance a digital servo by a time [s]; what its program remembers changes in place.

    Its numbers are lane `j` of a tile. All times of a program that takes goals count from the beginning of the call.
    """
    y, mesh, wiper, before, t = stand
    firmware = inputs.firmware[0]
    T_c, first, torque = firmware.T_c, 0 if firmware.goals > 0.0 else before, inputs.constant_torque
    left, rest = whole(t + duration, T_c)
    frames, status = first, COMPLETED
    controller.take_up(inputs, firm, first * T_c + t)
    while status == COMPLETED and (left > 0 or t < rest):
        own = numbers_at(anew(numbers), j)
        controller.serve(own, inputs, firm, frames, t, y, wiper, frames * T_c)
        end = min(controller.next_due(firmware, firm, frames), T_c if left > 0 else rest)
        own = duty.at_duty(own, firm.duty)
        u = duty.voltage(own.source, firm.duty)
        if WARMEST == BY_SERIES and not friction.fades(own.friction):
            gone = warm_legs.go(own, torque, u, y, mesh, wiper, end - t)
        elif SLOWEST == BY_CREEPS:
            gone = fading_legs.go(own, torque, u, y, legs.mode_from(own, torque, u, y, mesh), wiper, end - t)
        else:
            gone = legs.go(own, torque, u, y, legs.mode_from(own, torque, u, y, mesh), wiper, end - t)
        y, mesh, wiper, t = gone.y, gone.mode.mesh, gone.wiper, end
        status = COMPLETED if gone.done > 0.0 else DIVERGED
        if left > 0 and t >= T_c:
            left, frames, t = left - 1, frames + 1, 0.0
    passed = frames * T_c
    controller.pause(inputs, firm, passed + t)
    if firmware.goals > 0.0:
        firm.tick, firm.heard, firm.since = firm.tick - frames, firm.heard - passed, firm.since - passed
    return Stand(y, mesh, wiper, before + frames - first, t), status


def whole(time: float, period: float) -> tuple[int, float]:
    """Return how many periods end within a time [s] from the beginning of one, and what is left of it after them."""
    left = math.floor(time / period + SAME)
    rest = time - left * period
    return left, rest if rest > SAME * period else 0.0


# --- Beside time: commands, where a lane begins, and what is seen of it -----------------------------------------------

def follow(kind: int, wirings: Any, j: int, command: float) -> float:
    """Return what the engine follows of a command of a kind [s, rad]; nan where the servo does not take it."""
    if kind == FOLLOWED:
        return command
    wiring = wiring_at(anew(wirings), j)
    told = wiring.per_angle * command + wiring.at_zero if kind == COMMAND_ANGLE else command
    return followed(wiring, told) if possible(wiring, told) else math.nan


def begin(numbers: Any, wirings: Any, j: int, curve: Floats, command: float, angle: float) -> Stand:
    """Return a servo at rest at an angle [rad], or where it has no error under what the engine follows if that is nan.

    Its angle is nan where it is beyond a stop.
    """
    wiring, own = wiring_at(wirings, j), numbers_at(numbers, j)
    q = angle if angle == angle else rest_angle(wiring, curve, command)
    q = q if wiring.lower - TRAVEL_SLACK <= q <= wiring.upper + TRAVEL_SLACK else math.nan
    mesh = INSIDE if play.present(own.play) else RIGID
    return Stand(Vector(q, 0.0, 0.0, own.heat.T_amb, own.heat.T_amb, q, 0.0), mesh, q, 0, 0.0)


def impose(numbers: Any, j: int, stand: Stand, angle: float, speed: float) -> Stand:
    """Return a servo whose shaft another simulator puts to an angle [rad] or gives a speed [rad/s]; nan: not."""
    own = numbers_at(numbers, j)
    point = Point(0.0, stand.y, Mode(0, 0, stand.mesh, 0, 0), math.inf, stand.y, 0.0, stand.wiper)
    point = cosim.placed(point, cosim.within_stops(numbers, j, angle), speed, angle == angle, speed == speed,
                         own.play.half, own.sensor.half_slack, False)
    return Stand(point.y, point.mode.mesh, point.wiper, stand.frames, stand.time)


def hang(numbers: Any, j: int, bare: float, behind: float, J_L: float) -> None:
    """Hang an inertia [kg m²] on a shaft; `bare` is that of its output without it, `behind` that of its motor."""
    own, J_out = numbers_at(numbers, j).shaft, J_L + bare
    cosim.put_shaft(numbers.shaft, j, Shaft(J_out + behind, own.b, J_out, own.b_out))


def feed(numbers: Any, j: int, V: float) -> bool:
    """Put a servo on a bus of a voltage [V]; false, and nothing happens, where its bridge drops as much."""
    own = numbers_at(numbers, j)
    if not own.bridge.D_drive < V < math.inf:
        return False
    fed = cosim.on_known_bus(own, V, 0.0, True)
    cosim.put_bridge(numbers.bridge, j, fed.bridge)
    cosim.put_source(numbers.source, j, fed.source)
    return True


def look_at_pulses(numbers: Any, j: int, curve: Floats, torque: float, N: float, stand: Stand, now: Frame) -> Observed:
    """Return the signals of an analog servo as it stands; N is the reduction of its gear."""
    own = at_pulses(numbers_at(numbers, j), now.silent)
    return at_motor(_seen(own, curve, torque, stand, now.drive * own.source.V, now.drive, now.error), N)


def look_at_ticks(numbers: Any, j: int, curve: Floats, torque: float, N: float, stand: Stand, firm: Any) -> Observed:
    """Return the signals of a digital servo as it stands; N is the reduction of its gear."""
    own = duty.at_duty(numbers_at(numbers, j), firm.duty)
    seen = _seen(own, curve, torque, stand, duty.voltage(own.source, firm.duty), 0.0, 0.0)
    return at_motor(told_by(own.bridge, firm, seen), N)


def _seen(own: Numbers, curve: Floats, torque: float, stand: Stand, u: float, drive: float, error: float) -> Observed:
    if heat.present(own.heat):
        own = warm(own, stand.y)
    mode = legs.mode_from(own, torque, u, stand.y, stand.mesh)
    return observed(own, curve, mode, u, torque, stand.y, stand.wiper, drive, error)
