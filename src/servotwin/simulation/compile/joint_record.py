"""What is kept of a run of servos at joints: rows of what shows, and books of energy."""

from __future__ import annotations

import math

from servotwin.simulation.compile import joint_places as place
from servotwin.simulation.compile.addresses import Numbers, Rows, Words, numbers, rows, told, words
from servotwin.simulation.compile.joint_memory import engine_numbers, number_at
from servotwin.simulation.compile.joints_layout import ASK_ROOM


def keep(drive: Words, instance: Words, room: Rows, torque: Numbers, time: float, again: bool) -> None:
    """Write what shows of all servos into a row of the record; `again` over the last one."""
    record = words(instance[place.RECORD], place.RECORD_WORDS)
    if again and record[place.USED] > 0:
        record[place.USED] -= 1
    if record[place.USED] == record[place.CAPACITY]:
        if told(drive[place.ASK], ASK_ROOM, instance[place.DATA], 0) == 0:
            return
    row = _row(record, record[place.USED])
    record[place.USED] += 1
    row[0], row[1], row[2] = time, math.nan, math.nan
    groups = words(instance[place.GROUPS], instance[place.COUNT])
    for k in range(instance[place.COUNT]):
        group = words(groups[k], place.GROUP_WORDS)
        lanes = group[place.LANES]
        which, seen = words(group[place.WHICH], lanes), rows(group[place.G_SEEN], lanes, place.SIGNALS)
        reached = numbers(group[place.G_REACHED], lanes)
        for n in range(lanes):
            i = which[n]
            at = _first_of(i)
            row[at], row[at + 1] = reached[n], room[place.R_AFTER, i]
            row[at + 2], row[at + 3] = room[place.R_GOAL, i], torque[i]
            row[at + 4], row[at + 5] = room[place.R_ASKED, i], math.nan  # the work is known at the end of the tick
            for s in range(place.SIGNALS):
                row[at + place.OWN_SIGNALS + s] = seen[n, s]


def _row(record: Words, number: int) -> Numbers:
    """Return a row of the record by its number."""
    wide = record[place.ROW]
    return numbers(record[place.KEPT_ROWS] + place.WORD * wide * number, wide)


def _first_of(servo: int) -> int:
    """Return where the numbers of a servo begin in a row."""
    return place.IN_FRONT + (place.OWN_SIGNALS + place.SIGNALS) * servo


def _motions(drive: Words, instance: Words) -> Rows:
    """Return speed and force of each degree of freedom in the books, two rows."""
    behind = place.BOOK_NUMBERS + drive[place.SERVOS]
    return rows(instance[place.BOOKS] + place.WORD * behind, 2, drive[place.DOFS])


def account(m: int, d: int, drive: Words, instance: Words, block: Numbers, dt: float, rk4: bool,
            onward: bool) -> None:
    """Bring the books up to the beginning of this tick; `onward` is whether it is the end of the row kept last.

    A semi-implicit step moves with the speed at its end, so that on the way the energy is off by ½ Δt F·w, where F are
    the forces of gravity and springs; that comes back, and is left out of the balance.
    """
    n, dofs = drive[place.SERVOS], drive[place.DOFS]
    record = words(instance[place.RECORD], place.RECORD_WORDS)
    sums = numbers(instance[place.BOOKS], place.BOOK_NUMBERS)
    work = numbers(instance[place.BOOKS] + place.WORD * place.BOOK_NUMBERS, n)
    motions = _motions(drive, instance)
    speed, force = motions[0], motions[1]
    told(drive[place.POTENTIAL], m, d)
    told(drive[place.KINETIC], m, d)
    energy = number_at(d, drive[place.ENERGY]) + number_at(d, drive[place.ENERGY] + place.WORD)
    now = engine_numbers(d, drive[place.QVEL], dofs)
    balanced = energy
    if not rk4:
        bias, spring = engine_numbers(d, drive[place.BIAS], dofs), engine_numbers(d, drive[place.SPRING], dofs)
        for k in range(dofs):
            balanced += 0.5 * dt * (spring[k] - bias[k]) * now[k]
    if record[place.USED] == 0 or sums[place.KEEPS] == 0.0:
        sums[:] = 0.0
        work[:] = 0.0
        sums[place.FIRST], sums[place.KEEPS] = balanced, 1.0
    elif not onward:  # the state was changed from outside, and its energy with it
        sums[place.FIRST] += balanced - sums[place.TOTAL]
    else:
        passed = sums[place.LAST_TICK]
        for k in range(dofs):
            sums[place.WORK] += force[k] * 0.5 * (speed[k] + now[k]) * passed
        row = _row(record, record[place.USED] - 1)
        _add_work(drive, block, speed, now, passed, work, row)
        sums[place.NOWHERE] = max(sums[place.NOWHERE], balanced - sums[place.FIRST] - sums[place.WORK])
        row[1], row[2] = energy, sums[place.NOWHERE]
    sums[place.TOTAL], sums[place.LAST_TICK] = balanced, dt
    for k in range(dofs):
        speed[k] = now[k]


def _add_work(drive: Words, block: Numbers, speed: Numbers, now: Numbers, passed: float, work: Numbers,
              row: Numbers) -> None:
    """Add the work of each servo over the last tick [J], and write the sum into its row."""
    speed_at = words(drive[place.SPEED_AT], drive[place.SERVOS])
    for i in range(drive[place.SERVOS]):
        k = speed_at[i]
        work[i] += block[place.HEAD + i] * 0.5 * (speed[k] + now[k]) * passed
        row[_first_of(i) + place.OWN_SIGNALS - 1] = work[i]


def note_forces(d: int, drive: Words, instance: Words, block: Numbers, total: Numbers) -> None:
    """Note the forces that do work in this tick: all but those of gravity, springs and constraints."""
    n, dofs = drive[place.SERVOS], drive[place.DOFS]
    motions = _motions(drive, instance)
    force = motions[1]
    bias, spring = engine_numbers(d, drive[place.BIAS], dofs), engine_numbers(d, drive[place.SPRING], dofs)
    first = place.HEAD + place.EACH * n
    constraint, speed_at = block[first:first + dofs], words(drive[place.SPEED_AT], n)
    for k in range(dofs):
        force[k] = total[k] + bias[k] - spring[k] - constraint[k]
    for i in range(n):
        force[speed_at[i]] += block[place.HEAD + i]
