"""Digital servos from tick to tick, leg by leg, without a motion being kept.

Between two ticks the duty is constant. A leg that surely lasts until the next one is arithmetic: what its exponentials
are over a whole tick is kept as long as its laws have the same rates. Any other tick goes from event to event. The
motion of a servo at rest whose duty stays costs a comparison.

A spring or a pendulum bends the motion, and so does friction that fades. Where that may be neglected within a tick the
load counts with its torque in the middle of it, and friction as it is at its start (`nearly`): for the searches of a
fit, never for a simulation.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import controller
from servotwin.models.engine.dynamics import contacts, currents
from servotwin.models.engine.dynamics.coefficients import Apart
from servotwin.models.engine.legs import legs, spring_legs
from servotwin.models.engine.legs.spring_legs import Law
from servotwin.models.engine.memory import FRAMES, SAME, Inputs, Memory, Point, origin_of
from servotwin.models.engine.motions import two_mass_series
from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.engine.motions.elementary import decay, fma
from servotwin.models.state.modes import CONDUCTING, INSIDE, Mode, Vector, at_rest
from servotwin.models.terms import control, duty, elastic, friction, load, play, sensor, source
from servotwin.models.terms.control import NOTHING_SENSED, NOWHERE
from servotwin.models.terms.dependence import BY_SHARE, CURVED_Q, FADING, ON_Q, TWO_BODIES
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import with_motor
from servotwin.models.terms.sensor import sensed_voltage
from servotwin.physics.load_friction import torque_on_gear
from servotwin.physics.motor import back_emf
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats

# Seldom: with copies, or what goes by its address here would go through memory everywhere
CALLED = ("gone_on", "show", "with_laws")
# From tick to tick: in this loop, or by power series (`coupled_ticks`); or from event to event
LEGS, SPRING_LEGS, POWER_SERIES, STEPS = range(4)
_NO_LAWS = Apart(0.0, 0.0, 0.0, 0.0)
_GIVEN = Piece()  # what a servo follows that a program drives


class Fade(NamedTuple):
    """∫ e^-λs ds and ∫∫ e^-λs ds² over a time, and for which rate and time."""

    rate: float
    time: float
    once: float
    twice: float


class Way(NamedTuple):
    """How a servo continues at a duty: its numbers at that, the voltage behind the bridge, its mode and its laws."""

    duty: float
    numbers: Numbers
    u: float
    mode: Mode
    laws: Apart  # of motor and output without a spring between them
    law: Law  # with one


class Gone(NamedTuple):
    """Until when a servo has gone [s], its state and mesh there, how many outputs are done.

    And whether what moves it may be another than its memory has: it advanced, or its program worked.
    """

    time: float
    y: Vector
    mesh: int
    done: int
    anew: bool


def possible(numbers: Numbers, inputs: Inputs, nearly: bool) -> bool:
    """Tell whether a servo always moves by legs, if what bends its load `nearly` does."""
    if source.regulated(numbers.source) or sensor.slack(numbers.sensor) or len(inputs.torque) > 0:
        return False
    on = may_depend(numbers, _GIVEN)
    if elastic.present(numbers.elastic):
        return two_mass_series.linear(numbers, on, _GIVEN, _GIVEN)
    return on & ~(TWO_BODIES | BY_SHARE | (ON_Q | CURVED_Q | FADING if nearly else 0)) == 0


def way_of(numbers: Numbers, inputs: Inputs, left: float, nearly: bool) -> int:
    """Return which way a servo goes for the time that is left [s]: from tick to tick if that is one at least."""
    if left < inputs.firmware[0].T_c * (1.0 - SAME) or not possible(numbers, inputs, nearly):
        return STEPS
    return SPRING_LEGS if elastic.present(numbers.elastic) else LEGS


def go_stiff(numbers: Numbers, inputs: Inputs, memory: Memory, until: float, times: Floats, done: int,
             outputs: Floats) -> Gone:
    """Advance as `go` does without a spring between motor and output: compiled, without what only those need."""
    return go(numbers, inputs, memory, until, times, done, outputs)


def go(numbers: Numbers, inputs: Inputs, memory: Memory, until: float, times: Floats, done: int,
       outputs: Floats) -> Gone:
    """Advance from tick to tick, as far as this way leads and at most to `until` [s].

    The arguments are those of `runs.run`.
    """
    firmware, firm, frames, origin = inputs.firmware[0], controller.of(memory), memory.frames, origin_of(memory)
    point, slack, tau = memory.point, SAME * inputs.firmware[0].T_c, inputs.constant_torque
    t, y, T_c = point.time, point.y, inputs.firmware[0].T_c
    sprung = elastic.present(numbers.elastic)  # then what bends is in its law
    hangs, bends = numbers.load, not sprung and load.bends(numbers.load)
    if bends:
        numbers = level(numbers)
    fades, speed = not sprung and friction.fades(numbers.friction), math.nan
    last, anew = min(until, FRAMES * memory.beat), False
    way = Way(math.nan, numbers, 0.0, Mode(0, 0, point.mode.mesh, 0, 0), _NO_LAWS, spring_legs.NO_LAW)
    output = motor = Fade(math.nan, 0.0, 0.0, 0.0)
    while t < last:
        if controller.next_due(firmware, firm, frames) > t + slack:
            break  # in the middle of a motion
        anew = True
        controller.apply(firmware, firm, frames, t + slack)
        if firm.duty != way.duty:
            way = at_duty(numbers, firm.duty, tau, y, way)
        if controller.is_due(firmware, firm, frames, t + slack):
            tick(numbers, way, inputs, firm, y, origin + t)
            controller.apply(firmware, firm, frames, t + slack)
        end = controller.next_due(firmware, firm, frames)
        if end > until + slack:
            break
        end = min(end, until)
        time = T_c if abs(end - t - T_c) <= slack else end - t
        before = tau
        if bends:
            tau = load.external_torque(hangs, inputs.constant_torque, y.q + 0.5 * y.w * time)
        if fades:
            if firm.duty != way.duty or tau != before or y.w_m != speed:
                way, speed = at_duty(frozen(numbers, firm.duty, tau, y), firm.duty, tau, y, way), y.w_m
        elif firm.duty != way.duty or tau != before:
            way = at_duty(numbers, firm.duty, tau, y, way)
        if done < times.size and (times[done] - origin < end - slack or end >= until):
            done = show(copied(way), tau, inputs.accuracy, y, times, done, t, end, until, origin, outputs, firm)
        if elastic.present(numbers.elastic) or not legs.stands(way.mode):
            certain = False
            if not elastic.present(numbers.elastic):
                output = faded(output, way.laws.output_rate, time)
                motor = faded(motor, way.laws.motor_rate, time) if way.mode.mesh == INSIDE else motor
                after = over(way, output, motor, y)
                certain = lasts(way, tau, y, after, time)
                y = after if certain else y
            if not certain:
                leg = gone_on(copied(way), tau, inputs.accuracy, y, time)
                if leg.done == 0.0:
                    break
                way, y = in_mode(way, leg.mode, tau), leg.y
        t = end
    return Gone(t, y, way.mode.mesh, done, anew)


def as_gone(memory: Memory, gone: Gone) -> Memory:
    """Return the memory of a servo that has advanced so."""
    if not gone.anew:
        return memory
    point = Point(gone.time, gone.y, Mode(0, 0, gone.mesh, 0, 0), math.inf, gone.y, memory.point.step, gone.y.q)
    return memory._replace(point=point)


def level(numbers: Numbers) -> Numbers:
    """Return the numbers of a servo without what bends its load."""
    return numbers._replace(load=load.Load(numbers.load.coulomb, 0.0, 0.0, 0.0, 0.0))


def frozen(numbers: Numbers, now: float, tau: float, y: Vector) -> Numbers:
    """Return the numbers of a servo whose friction fades no more, with what is left of it in a state at a duty."""
    at = duty.at_duty(numbers, now)
    u = duty.voltage(at.source, now)
    torque = currents.drive_torque(at, currents.zone_of(at, u, 0.0, y.q, y.w_m, 0.0), u, y)
    own = friction.frozen(numbers.friction, y.w_m, torque, torque_on_gear(tau, y.w, numbers.shaft.b_out))
    return numbers._replace(friction=own)


def at_duty(numbers: Numbers, now: float, tau: float, y: Vector, before: Way) -> Way:
    """Return how a servo continues from a state at another duty than before, under an external torque [N m]."""
    at = duty.at_duty(numbers, now)
    u, mesh = duty.voltage(at.source, now), before.mode.mesh
    if elastic.present(numbers.elastic):
        mode = spring_legs.mode_from(at, tau, u, y, mesh)
    else:
        mode = legs.mode_from(at, tau, u, y, mesh)
    return with_laws(Way(now, at, u, mode, before.laws, before.law), tau)


def in_mode(way: Way, mode: Mode, tau: float) -> Way:
    """Return how a servo continues at the same duty in a mode that it may have been in."""
    if mode == way.mode:
        return way
    return with_laws(Way(way.duty, way.numbers, way.u, mode, way.laws, way.law), tau)


def with_laws(way: Way, tau: float) -> Way:
    """Return the same with the laws of its mode, in the place of those before."""
    if elastic.present(way.numbers.elastic):
        law = spring_legs.law_of(way.law, way.numbers, way.mode, way.u, tau)
        return Way(way.duty, way.numbers, way.u, way.mode, way.laws, law)
    laws = legs.laws_of(way.numbers, way.mode, way.u, tau)
    return Way(way.duty, way.numbers, way.u, way.mode, laws, way.law)


def copied(way: Way) -> Way:
    """Return the same again, as something of its own."""
    own = way.numbers
    numbers = Numbers(own.motor, own.bridge, own.source, own.follower, own.shaft, own.friction, own.load, own.stops,
                      own.play, own.sensor, own.heat, own.elastic)
    return Way(way.duty, numbers, way.u, way.mode, way.laws, way.law)


def gone_on(way: Way, tau: float, accuracy: float, y: Vector, time: float) -> legs.Gone:
    """Return where a servo goes from a state within a time [s], from event to event."""
    if elastic.present(way.numbers.elastic):
        return spring_legs.go(way.numbers, way.law, tau, way.u, y, way.mode, time, accuracy)
    return legs.go(way.numbers, tau, way.u, y, way.mode, y.q, time)


def tick(numbers: Numbers, way: Way, inputs: Inputs, firm: Any, y: Vector, time: float) -> None:
    """Do what a tick does, at a time since the start [s]."""
    firmware = inputs.firmware[0]
    if controller.has_news(firmware, firm, time):
        controller.listen(inputs, firm, time)
    angle = y.q
    if firmware.per_volt != 0.0:
        v = sensed_voltage(numbers.sensor, inputs.curve, y.q)
        angle = controller.angle_of(firmware, firm, v, inputs.seed)
    sensed = NOTHING_SENSED
    if control.senses(firmware):
        V_bus, i = controller.in_zone(way.numbers, way.mode.zone, way.u, way.duty, y)
        sensed = controller.sensed_of(numbers, i, V_bus, y)
    controller.decide(firmware, firm, angle, sensed, time)


def faded(known: Fade, rate: float, time: float) -> Fade:
    """Return how a speed fades at a rate [1/s] within a time [s], as known where these are the same."""
    if rate == known.rate and time == known.time:
        return known
    once, twice = decay(rate, 1.0 / rate if rate > 0.0 else 0.0, time)
    return Fade(rate, time, once, twice)


def over(way: Way, output: Fade, motor: Fade, y: Vector) -> Vector:
    """Return the state after a time."""
    laws, mesh = way.laws, way.mode.mesh
    q, w, i, T_w, T_h, q_m, w_m = y
    there = fma(-laws.output_rate, w, laws.output_pull)
    q, w = fma(there, output.twice, fma(w, output.time, q)), fma(there, output.once, w)
    if mesh != INSIDE:
        return with_motor(way.numbers.play, mesh, Vector(q, w, i, T_w, T_h, q, w))
    there = fma(-laws.motor_rate, w_m, laws.motor_pull)
    return Vector(q, w, i, T_w, T_h, fma(there, motor.twice, fma(w_m, motor.time, q_m)), fma(there, motor.once, w_m))


def lasts(way: Way, tau: float, y: Vector, after: Vector, time: float) -> bool:
    """Tell whether a mode surely lasts on the way from a state to the one after a time [s]; speeds are monotone."""
    numbers, mode, u = way.numbers, way.mode, way.u
    q, w, w_m = after.q, after.w, after.w_m
    low, high = currents.zone_limits(numbers, mode.zone, u)
    if not low < u - back_emf(w_m, numbers.motor.K_b) < high:
        return False
    if not (at_rest(mode.contact) or (y.w * w >= 0.0 and w != 0.0 and numbers.stops.lower < q < numbers.stops.upper)):
        return False
    if mode.mesh == INSIDE:
        if not at_rest(mode.motor) and (y.w_m * w_m < 0.0 or w_m == 0.0):
            return False
        ahead, half = y.q_m - y.q, numbers.play.half
        most = time * max(max(y.w_m, w_m) - min(y.w, w), 0.0)
        least = time * min(min(y.w_m, w_m) - max(y.w, w), 0.0)
        if not (ahead + most < half and ahead + least > -half):
            return False
    if mode.share == 0 and not play.present(numbers.play):
        return True
    torque = currents.drive_torque(numbers, mode.zone, u, after)
    if mode.share != 0 and not mode.share * contacts.through_gear(numbers, mode.mesh, torque, tau, after) > 0.0:
        return False
    if mode.mesh == INSIDE or not play.present(numbers.play):
        return True
    if mode.zone == CONDUCTING and friction.varying(numbers.friction) and (
            torque * currents.drive_torque(numbers, mode.zone, u, y) <= 0.0):
        return False  # there is a bend in how they press
    return contacts.pressing(numbers, mode, u, tau, after) > 0.0


def show(way: Way, tau: float, accuracy: float, y: Vector, times: Floats, done: int, t: float, end: float,
         until: float, origin: float, outputs: Floats, firm: Any) -> int:
    """Write the outputs within a tick; return how many are done."""
    slack = SAME * (end - t)
    while done < times.size and (times[done] - origin < end - slack or end >= until):
        here = gone_on(way, tau, accuracy, y, min(max(times[done] - origin - t, 0.0), end - t))
        show_one(outputs, done, here.y, here.mode, firm)
        done += 1
    return done


def show_one(outputs: Floats, done: int, y: Vector, mode: Mode, firm: Any) -> None:
    """Put what shows of a servo into a column of the outputs, in the order of `runs.run`."""
    outputs[0, done], outputs[1, done], outputs[2, done] = y.q, y.w, mode.contact
    outputs[3, done] = math.copysign(1.0, firm.duty) if duty.drives(firm.duty) else 0.0
    outputs[4, done], outputs[5, done] = 0.0, y.q
    outputs[6, done], outputs[7, done], outputs[8, done], outputs[9, done], outputs[10, done] = (
        y.i, y.T_w, y.T_h, y.q_m, y.w_m)
    outputs[11, done], outputs[12, done], outputs[13, done] = mode.mesh, mode.motor, 1
    outputs[14, done], outputs[16, done], outputs[17, done] = firm.duty, firm.r, firm.trip
    outputs[15, done] = firm.r if firm.goal == NOWHERE else firm.goal
