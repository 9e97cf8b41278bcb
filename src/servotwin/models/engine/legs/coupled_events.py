"""What ends the mode of a servo on a coupled leg, and when: guards along power series, and their roots."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.dynamics import guards
from servotwin.models.engine.legs.coupled_courses import BY_PLACE, first_below
from servotwin.models.engine.legs.coupled_series import state_at, voltage_at
from servotwin.models.engine.legs.coupled_units import unit_mode, unit_numbers
from servotwin.models.state.modes import Vector

_HALVINGS = 200
_INSTANT, _ROUNDING = 1e-16, 1e-16  # s and units of a guard, within which a root is found


class Place(NamedTuple):
    """Where a servo is along a leg: how long after its beginning [s], the voltage in its circuit [V], its state."""

    s: float
    u: float
    y: Vector


def first_end(unit: Any, common: Any, doubtful: int, length: float, last: bool) -> tuple[int, float]:
    """Return which doubtful guard of a servo falls below zero first along a leg (−1: none), and when [s].

    Where it is the `last` instant it counts as well. A guard turns once at most, about where a parabola does.
    """
    found, first, kinds = -1, length, doubtful
    for kind in range(guards.KINDS):
        if (kinds & BY_PLACE) >> kind & 1:
            s = first_below(unit, kind, common.terms, length)
            if s < first or (s == first and found < 0 and last):
                found, first = kind, s
    kinds &= ~BY_PLACE
    if kinds == 0:
        return found, first
    end = first
    at_start = _place(unit, common, 0.0)
    at_end = _place(unit, common, end)
    for kind in range(guards.KINDS):
        if kinds >> kind & 1:
            s = _below(unit, common, kind, at_start, at_end)
            if s < first or (s == first and found < 0 and last):
                found, first = kind, s
    return found, first


def _below(unit: Any, common: Any, kind: int, at_start: Place, at_end: Place) -> float:
    """Return when a guard that looks at torques falls below zero between two places [s]; inf: it does not."""
    f, f_end, length = _guard(unit, kind, at_start), _guard(unit, kind, at_end), at_end.s
    if f < guards.BELOW:  # what another one did has ended this mode too
        return 0.0
    if f_end < guards.BELOW:
        return _crossing(unit, common, kind, 0.0, f, length, f_end)
    lowest = _place(unit, common, 0.5 * length)
    least = _guard(unit, kind, lowest)
    bend = f - 2.0 * least + f_end
    turn = 0.25 * (3.0 * f - 4.0 * least + f_end) / bend * length if bend > 0.0 else -1.0
    if least >= guards.BELOW and 0.0 < turn < length:
        lowest = _place(unit, common, turn)
        least = _guard(unit, kind, lowest)
    if least >= guards.BELOW:
        return math.inf
    return _crossing(unit, common, kind, 0.0, f, lowest.s, least)


def _place(unit: Any, common: Any, s: float) -> Place:
    """Return where a servo is at s [s] after the beginning of a leg."""
    y = state_at(unit, common.terms, s)
    return Place(s, unit.sign * voltage_at(common, s), y)


def _guard(unit: Any, kind: int, place: Place) -> float:
    """Return a guard of a servo somewhere along a leg."""
    return guards.guard(unit_numbers(unit.numbers), unit_mode(unit.mode), kind, place.u, 0.0, unit.torque, 0.0,
                        place.y, place.y)[0]


def _crossing(unit: Any, common: Any, kind: int, a: float, f_a: float, b: float, f_b: float) -> float:
    """Return when a guard falls below zero, between two times [s] at which it is at least zero, to rounding, and below.

    By inverse parabolas where they are sure to lead on, else by halves (Chandrupatla 1997).
    """
    if f_a <= -guards.BELOW:  # it starts at zero, to rounding: look whether it rises before it falls
        start = a
        for _ in range(50):
            a = start + 0.5 * (b - start)
            place = _place(unit, common, a)
            f_a = _guard(unit, kind, place)
            if f_a > -guards.BELOW:
                break
            b, f_b = a, f_a
        if f_a <= -guards.BELOW or f_b > 0.0:
            return start
    new, f_new, old, f_old, part = b, f_b, a, f_a, f_a / (f_a - f_b)
    part = 1.0 - part
    for _ in range(_HALVINGS):
        s = new + part * (old - new)
        place = _place(unit, common, s)
        f = _guard(unit, kind, place)
        if (f > 0.0) == (f_new > 0.0):
            third, f_third = new, f_new
        else:
            third, f_third = old, f_old
            old, f_old = new, f_new
        new, f_new = s, f
        least = _INSTANT / abs(old - new)
        if abs(f) <= _ROUNDING:
            return s
        if least > 0.5:
            break
        xi, phi = (new - old) / (third - old), (f_new - f_old) / (f_third - f_old)
        part = 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            part = (f_new / (f_old - f_new) * f_third / (f_old - f_third)
                    + (third - new) / (old - new) * f_new / (f_third - f_new) * f_old / (f_third - f_old))
        part = min(max(part, least), 1.0 - least)
    return new if f_new <= 0.0 else old
