"""The least voltage of a supply, followed through every motion of the servo that is on it."""

from __future__ import annotations

import math

from servotwin.models.engine.memory import FLAT, Lowest
from servotwin.models.engine.motions import motion
from servotwin.models.engine.motions.motion import APART, CREEP, FIRST_ORDER, HELD, REST, Motion
from servotwin.models.engine.observe import bus_voltage
from servotwin.models.terms.elastic import turning
from servotwin.models.terms.numbers import warm
from servotwin.physics.pieces import piece_value

_PER_SCALE, _LEAST, _MOST = 2.0, 8, 256  # looks in a time of a motion's own, and in all of it
ROUNDS = 40  # of a search by thirds: a voltage is flat where it is least, so half of all digits of the time do


def asked(lowest: Lowest) -> bool:
    """Tell whether anybody asks for the least voltage."""
    return lowest.voltage > -math.inf


def lower(lowest: Lowest, voltage: float, time: float) -> Lowest:
    """Return the least voltage so far where there is another one [V] at a later time [s]."""
    if voltage < lowest.level - FLAT:
        return Lowest(voltage, voltage, time)
    return lowest._replace(voltage=voltage) if voltage < lowest.voltage else lowest


def followed(lowest: Lowest, m: Motion, share: float, origin: float, start: float, end: float) -> Lowest:
    """Return the least voltage after a servo alone on its supply has followed a motion.

    Parameters
    ----------
    lowest : Lowest
    m : Motion
    share : float
        Of the supply's voltage at the bridge: its numbers are those at a duty.
    origin, start, end : float
        Times of the motion count from the first [s]; from when until when it has gone.
    """
    m = motion.prepared(m)
    least, at = lowest_on(m, share, start - m.t0, end - m.t0, lowest.voltage)
    if not least < lowest.level - FLAT:
        return lower(lowest, least, origin + m.t0 + at)
    return Lowest(least, least, origin + m.t0 + _reached(m, share, start - m.t0, at, least + FLAT))


def lowest_on(m: Motion, share: float, a: float, b: float, below: float) -> tuple[float, float]:
    """Return the least voltage [V] on a motion that is prepared, from a to b [s] after it began, and where.

    It is looked for closely where it may be below another one [V].
    """
    least, last, at = voltage_at(m, share, a), voltage_at(m, share, b), a
    if m.kind != REST and m.kind != FIRST_ORDER and m.kind != APART and m.kind != HELD and m.kind != CREEP:
        fine, settled = motion.fine_scales(m)  # else speed or current is monotone, and so is what they take
        span = min(b - a, settled)
        looks = _LEAST + int(min(_PER_SCALE * span / fine, 1.0 * _MOST)) if fine > 0.0 else _MOST
        step, before, here, slack = span / looks, least, least, 0.0
        for n in range(1, looks):
            before, here = here, voltage_at(m, share, a + n * step)
            slack = max(slack, abs(here - before))
            if here < least:
                least, at = here, a + n * step
        if min(least, last) - max(slack, abs(last - here)) < below:
            at = _where(m, share, max(at - step, a), min(at + step, b))
            least = voltage_at(m, share, at)
    return (last, b) if last < least else (least, at)


def voltage_at(m: Motion, share: float, s: float) -> float:
    """Return the voltage of the supply [V] at s [s] after a motion began."""
    y = motion.state(m, s)
    numbers, u = warm(m.numbers, y), piece_value(m.u, m.t0 + s)
    return bus_voltage(numbers, u, y.q, turning(numbers.elastic, y), y.i) / share


def _where(m: Motion, share: float, low: float, high: float) -> float:
    """Return where the voltage is least between two instants of a motion, near one that is low [s]."""
    for _ in range(ROUNDS):
        third = (high - low) / 3.0
        if voltage_at(m, share, low + third) < voltage_at(m, share, high - third):
            high -= third
        else:
            low += third
    return 0.5 * (low + high)


def _reached(m: Motion, share: float, low: float, high: float, level: float) -> float:
    """Return when the voltage has fallen to a level [V], between two instants of a motion [s]."""
    if voltage_at(m, share, low) <= level:
        return low
    for _ in range(ROUNDS):
        middle = 0.5 * (low + high)
        if voltage_at(m, share, middle) <= level:
            high = middle
        else:
            low = middle
    return high
