"""Signals at any times, of the rows that a run has left behind: its continuous solution."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.log import ALONE, SERIES, Row, row_of
from servotwin.models.engine.motions import choice, motion, rodas, two_mass_series
from servotwin.models.engine.motions.motion import (
    CREEP,
    FINE,
    LONG_STEP,
    PAIR,
    STEP,
    Motion,
)
from servotwin.models.engine.run.run import plant_of
from servotwin.models.engine.step import at_pulses
from servotwin.models.state.modes import Vector
from servotwin.models.terms import duty
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import wiper_at

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices

PLAIN = True  # the compiler takes it for False
SHOWN = 20
"""Numbers at a time: state (7), wiper, mode (5), drive, error, silence, duty, goal, reference, trip."""
_DENSE = 7  # vectors of a dense output
_SHORTEST = 1e-307  # s: what is over in less has no time of its own


def at(plants: Any, accuracy: float, rows: Any, shared: Floats, which: Indices, ages: Floats, ends: bool,
       shown: Floats) -> None:
    """Put into `shown`, shape (SHOWN, n), what holds at some times.

    Parameters
    ----------
    plants
        A record of `Plant`: of the servo whose rows they are.
    accuracy : float
        Of what is integrated [rad].
    rows
        Records of `Row`.
    shared : ndarray
        Numbers of common motions.
    which : ndarray of int, shape (n,)
        Row of each time.
    ages : ndarray, shape (n,)
        Since the beginning of its motion [s].
    ends : bool
        Whether motions end there: what is only interpolated is followed anew.
    """
    if which.size == 0:
        return
    numbers = numbers_at(plants)
    row = row_at(rows, which[0])
    m = motion.prepared(motion_of(numbers, row, shared, accuracy))
    for k in range(which.size):
        if k > 0 and which[k] != which[k - 1]:
            row = row_at(rows, which[k])
            m = motion.prepared(motion_of(numbers, row, shared, accuracy))
        y = motion.ended(m, ages[k]) if ends and row.how == ALONE else state_of(row, m, shared, ages[k])
        mode = row.mode
        values = (y.q, y.w, y.i, y.T_w, y.T_h, y.q_m, y.w_m, wiper_at(numbers.sensor, row.wiper, y.q),
                  1.0 * mode.zone, 1.0 * mode.contact, 1.0 * mode.mesh, 1.0 * mode.motor, 1.0 * mode.share,
                  row.drive, row.error, 1.0 * row.silent, row.duty, row.goal, row.reference, 1.0 * row.trip)
        for n in range(SHOWN):
            shown[n, k] = values[n]


def resolution(plants: Any, accuracy: float, rows: Any, shared: Floats, found: Floats) -> None:
    """Put into `found`, shape (3, n), in which times all signals of each motion are smooth and gentle [s].

    These are the time in which it changes, that after which it has settled, and the longest within an input's period.
    """
    numbers = numbers_at(plants)
    for k in range(len(rows)):
        row = row_at(rows, k)
        if row.how == ALONE:
            m = motion_of(numbers, row, shared, accuracy)
            fine, settled = motion.fine_scales(m)
        else:
            fine, settled = row.length, math.inf
        found[0, k], found[1, k] = max(fine, _SHORTEST), settled
        found[2, k] = motion.period(row.u, row.tau, row.start, row.end) / 4.0


def numbers_at(plants: Any) -> Numbers:
    """Return the numbers of a servo."""
    if PLAIN:
        numbers: Numbers = plants[0].numbers
        return numbers
    return plant_of(plants[0]).numbers


def row_at(rows: Any, k: int) -> Row:
    """Return a row."""
    if PLAIN:
        row: Row = rows[k]
        return row
    return row_of(rows[k])


def motion_of(numbers: Numbers, row: Row, shared: Floats, accuracy: float) -> Motion:
    """Return the motion of a row, from which its states follow; of a series they do by `state_of` alone."""
    if duty.present(numbers.bridge):
        numbers = duty.at_duty(numbers, row.duty)
    else:
        numbers = at_pulses(numbers, row.silent)
    none = motion.nothing(numbers, row.u, row.tau)
    if row.how == SERIES:
        return _known(none, LONG_STEP, row, True)
    if row.how != ALONE:
        m = _known(none, LONG_STEP, row, True)
        return m._replace(next_step=0.0, long_dense=_dense_at(shared, row.first))
    m = _known(none, row.kind, row, False)
    if not motion.is_step(m):
        return choice.begin(numbers, row.mode, row.u, row.tau, row.t0, row.y, row.next_step, math.inf, accuracy)
    if m.kind == STEP:
        jac = motion.jacobian_at(numbers, row.mode, row.u, row.tau, row.t0, row.y)
        _, _, stages = rodas.step(numbers, row.mode, row.u, row.tau, jac, row.t0, row.y, row.length)
        return m._replace(stages=stages)
    if m.kind == PAIR:
        law = two_mass_series.law(numbers, row.mode, row.u.value, row.tau.value)
        return m._replace(has_dense=True, long_dense=law)
    if m.kind == CREEP:
        tolerance = (FINE * accuracy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return m._replace(has_dense=True, coefficients=tolerance)
    return m


def state_of(row: Row, m: Motion, shared: Floats, s: float) -> Vector:
    """Return the state of a row at s after the beginning of its motion."""
    if row.how != SERIES:
        return motion.state(m, s)
    q = w = i = 0.0
    for n in range(row.kind - 1, -1, -1):
        speed = shared[row.first + n]
        w = w * s + speed
        q = q * s + speed / (n + 1)
    for n in range(row.kind - 1, -1, -1):
        i = i * s + shared[row.first + row.kind + n]
    return motion.moved(m, row.y.q + q * s, w, i)


def _known(none: Motion, kind: int, row: Row, dense: bool) -> Motion:
    """Return a motion whose length and end are known, without what lies between."""
    return none._replace(kind=kind, mode=row.mode, t0=row.t0, start=row.y, length=row.length, end=row.last,
                         next_step=row.next_step, has_dense=dense)


def _dense_at(shared: Floats, first: int) -> tuple[Vector, ...]:
    """Return the dense output that begins at a place."""
    return (_vector_at(shared, first), _vector_at(shared, first + _DENSE), _vector_at(shared, first + 2 * _DENSE),
            _vector_at(shared, first + 3 * _DENSE), _vector_at(shared, first + 4 * _DENSE),
            _vector_at(shared, first + 5 * _DENSE), _vector_at(shared, first + 6 * _DENSE))


def _vector_at(shared: Floats, n: int) -> Vector:
    return Vector(shared[n], shared[n + 1], shared[n + 2], shared[n + 3], shared[n + 4], shared[n + 5], shared[n + 6])
