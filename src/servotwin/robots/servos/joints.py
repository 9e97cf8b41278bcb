"""Servos at the joints of a rigid-body engine: what happens at its control callback, and its step with them.

It runs as derived text, compiled or not. Words are those of `joints_layout`.

A servo sees the inertia 1/(M⁻¹)ᵢᵢ and the acceleration aᵢ that its joint would have without it. It advances by a tick
and ends at another speed; the joint gets the mean torque τᵢ = (Δω/Δt − aᵢ)/(M⁻¹)ᵢᵢ. The torques of the other servos,
which aᵢ needs too, are predicted: each is what it was, less its share of what another aᵢ asks of it; one at rest takes
up all. Where that was wrong by more than a speed that does not count, all go through the tick again.

The engine turns a joint by its speeds at the ends of ticks, and the servo is put where the joint has come to with all
that is behind its gear: else a shaft that comes to rest on a tooth within a tick would be off the tooth again, and fall
onto it for ever.
"""

from __future__ import annotations

import math

from servotwin.robots.servos import joint_places as place
from servotwin.robots.servos.joints_layout import (
    ASK_NEW,
    ASK_RESET,
    ASK_ROOM,
    FAILED,
    FOREIGN,
    NOT_FINITE,
    RESTARTED,
    TOO_LONG,
    WELL,
)
from servotwin.simulation.compile.addresses import (
    Numbers,
    Rows,
    Words,
    activate,
    active,
    bytes_at,
    called,
    copied,
    halves,
    numbers,
    rows,
    told,
    words,
)

# --- The memory of servos at joints, and its place in the engine ------------------------------------------------------

def word_at(base: int, offset: int) -> int:
    """Return the word that stands so many bytes behind an address."""
    return int(words(base + offset, 1)[0])


def number_at(base: int, offset: int) -> float:
    """Return the number that stands so many bytes behind an address."""
    return float(numbers(base + offset, 1)[0])


def engine_numbers(d: int, offset: int, count: int) -> Numbers:
    """Return an array of the engine's data whose address stands so many bytes behind its beginning."""
    return numbers(word_at(d, offset), count)


def moved(own: int, kept: int, size: int, back: bool) -> int:
    """Copy so many bytes from one address to another, or `back`; return how many they take there."""
    to, of = own if back else kept, kept if back else own
    if size == place.WORD:  # of a lane in a tile, one of many
        words(to, 1)[0] = words(of, 1)[0]
    else:
        copied(to, of, size)
    return place.WORD * ((size + place.WORD - 1) // place.WORD)


def memories(instance: Words, kept: int, back: bool) -> None:
    """Copy what all servos remember to an address, or `back`."""
    groups = words(instance[place.GROUPS], instance[place.COUNT])
    for k in range(instance[place.COUNT]):
        group = words(groups[k], place.GROUP_WORDS)
        pieces = words(group[place.PIECES], place.PIECE_WORDS * group[place.PIECE_COUNT])
        for n in range(group[place.PIECE_COUNT]):
            address, rows, stride, size = pieces[4 * n], pieces[4 * n + 1], pieces[4 * n + 2], pieces[4 * n + 3]
            for row in range(rows):
                kept += moved(address + row * stride, kept, size, back)


def instance_at(m: int, d: int, drive: Words) -> int:
    """Return the address of the servos in this data, which Python makes where it is new; 0: it could not."""
    count = word_at(drive[place.INSTANCES], 0)
    known = words(drive[place.INSTANCES] + place.WORD, 2 * count)
    for k in range(count):
        if known[2 * k] == d:
            return int(known[2 * k + 1])
    return told(drive[place.ASK], ASK_NEW, m, d)


def is_own(m: int, drive: Words) -> bool:
    """Tell whether a model is one of those that the servos are for, by its numbers of coordinates."""
    if drive[place.WIDE] != 0:
        return bool(word_at(m, 0) == drive[place.COORDINATES] and word_at(m, place.WORD) == drive[place.DOFS])
    sizes = halves(m, 2)
    return bool(sizes[0] == drive[place.COORDINATES] and sizes[1] == drive[place.DOFS])


def complain(instance: Words, code: int, culprit: int) -> None:
    """Keep what went wrong first."""
    if instance[place.CODE] == WELL:
        instance[place.CODE], instance[place.CULPRIT] = code, culprit


# --- The record of a run of servos at joints: rows of what shows, and books of energy ---------------------------------

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


# --- Servos at joints: where they stand, what they are sent, and how they advance by a tick ---------------------------

def stand(d: int, drive: Words, room: Rows) -> int:
    """Put angles and speeds, as the servos see them, into their room; return who has none, or −1."""
    n = drive[place.SERVOS]
    angle_at, speed_at = words(drive[place.ANGLE_AT], n), words(drive[place.SPEED_AT], n)
    gain, zero = numbers(drive[place.GAIN], n), numbers(drive[place.ZERO], n)
    qpos, qvel = word_at(d, drive[place.QPOS]), word_at(d, drive[place.QVEL])
    for i in range(n):
        q, w = number_at(qpos, 8 * angle_at[i]), number_at(qvel, 8 * speed_at[i])
        if not (math.isfinite(q) and math.isfinite(w)):
            return i
        room[place.R_ANGLE, i] = (q - zero[i]) / gain[i]
        room[place.R_ACTUAL, i] = w / gain[i]
        room[place.R_SPEED, i] = room[place.R_ACTUAL, i] if abs(room[place.R_ACTUAL, i]) > place.RESTS else 0.0
    return -1


def listen(d: int, drive: Words, block: Numbers, room: Rows) -> int:
    """Put the servos' commands into their room; return whose is not a number, or −1."""
    n, head = drive[place.SERVOS], place.HEAD
    command_at, goals = words(drive[place.COMMAND_AT], n), block[head + 8 * n:head + 10 * n]
    gain, zero = numbers(drive[place.TOLD_GAIN], n), numbers(drive[place.TOLD_ZERO], n)
    low, high = numbers(drive[place.LOW], n), numbers(drive[place.HIGH], n)
    scale, offset = numbers(drive[place.SCALE], n), numbers(drive[place.OFFSET], n)
    least, most = numbers(drive[place.CONTROL_LOW], n), numbers(drive[place.CONTROL_HIGH], n)
    ctrl, held = word_at(d, drive[place.CTRL]), block[head + 7 * n:head + 8 * n]
    for i in range(n):
        if command_at[i] >= 0:
            control = number_at(ctrl, 8 * command_at[i])
            if not math.isfinite(control):
                return i
            goal = (offset[i] + scale[i] * min(max(control, least[i]), most[i]) - zero[i]) / gain[i]
            room[place.R_ASKED, i] = (offset[i] + scale[i] * control - zero[i]) / gain[i]
        else:
            if goals[n + i] != 0.0:
                goal = (goals[i] - zero[i]) / gain[i]
                if not math.isfinite(goal):
                    return i
            else:  # nobody has said where to go
                goal = min(max(held[i], low[i]), high[i])
            room[place.R_ASKED, i] = goal
        room[place.R_GOAL, i] = min(max(goal, low[i]), high[i])
    return -1


def stay(drive: Words, block: Numbers, room: Rows, dt: float, rk4: bool) -> None:
    """Let the servos be where their joints have come to: semi-implicit steps turn these by the speed at their end."""
    n = drive[place.SERVOS]
    lower, upper = numbers(drive[place.LOWER], n), numbers(drive[place.UPPER], n)
    ahead = 0.0 if rk4 or block[place.FRESH] != 0.0 else 0.5 * dt
    for i in range(n):
        angle = room[place.R_ANGLE, i] - ahead * room[place.R_SPEED, i]
        room[place.R_ANGLE, i] = min(max(angle, lower[i]), upper[i])


def go_on(instance: Words, room: Rows, dt: float, watched: bool) -> int:
    """Advance all servos by a tick; return which cannot, or −1."""
    groups = words(instance[place.GROUPS], instance[place.COUNT])
    lost = -1
    for k in range(instance[place.COUNT]):
        group = words(groups[k], place.GROUP_WORDS)
        lanes = group[place.LANES]
        which, ends = words(group[place.WHICH], lanes), numbers(group[place.G_AFTER], lanes)
        for row in range(place.R_INERTIA + 1):  # in the order that a group has them in too
            values = numbers(group[place.G_ANGLE + row], lanes)
            for n in range(lanes):
                values[n] = room[row, which[n]]
        numbers(group[place.DURATION], 1)[0] = dt
        words(group[place.LOOK], 1)[0] = group[place.G_LOAD] if watched else 0
        if called(group[place.ADVANCE], group[place.TICK]) != 0:
            return int(which[0])
        status = bytes_at(group[place.G_STATUS], lanes)
        for n in range(lanes):
            room[place.R_AFTER, which[n]] = ends[n]
            if status[n] != 0:
                lost = int(which[n])
    return lost


# --- Joints without their servos, and the torques of all servos that follow from it -----------------------------------

def accelerations(m: int, d: int, drive: Words, block: Numbers, at: int, inverse: Rows, room: Rows, square: Rows,
                  known: bool, again: bool) -> None:
    """Find the accelerations that the joints have without any servo; `known` is whether constraint forces are.

    `inverse` has the rows of M⁻¹, and one for all forces, which stands at the address `at`.
    """
    n, dofs = drive[place.SERVOS], drive[place.DOFS]
    first = place.HEAD + place.EACH * n
    constraint, speed_at = block[first:first + dofs], words(drive[place.SPEED_AT], n)
    found, total = engine_numbers(d, drive[place.CONSTRAINT], dofs), numbers(at, dofs)
    if not again:
        for k in range(dofs):
            constraint[k] = found[k] if known else 0.0
    for turn in range(1 if known or again else 2):
        if turn > 0:  # contacts and limits answer what the servos do
            predict(speed_at, inverse, block[place.HEAD + n:place.HEAD + 4 * n], room, square)
            _supported(m, d, drive, speed_at, room[place.R_PREDICTED])
            for k in range(dofs):
                constraint[k] = found[k]
        _forces(m, d, drive, constraint, at)
        for i in range(n):
            free = 0.0
            for k in range(dofs):
                free += inverse[i, k] * total[k]
            room[place.R_FREE, i] = free


def _forces(m: int, d: int, drive: Words, constraint: Numbers, at: int) -> None:
    """Put the forces at all degrees of freedom at an address, without those of servos and inertia."""
    dofs = drive[place.DOFS]
    total = numbers(at, dofs)
    passive, bias = engine_numbers(d, drive[place.PASSIVE], dofs), engine_numbers(d, drive[place.BIAS], dofs)
    applied = engine_numbers(d, drive[place.APPLIED], dofs)
    for k in range(dofs):
        total[k] = passive[k] - bias[k] + applied[k] + constraint[k]
    if drive[place.OTHERS] != 0:
        told(drive[place.ACTUATE], m, d)
        actuator = engine_numbers(d, drive[place.ACTUATOR], dofs)
        for k in range(dofs):
            total[k] += actuator[k]
    pushes_at = word_at(d, drive[place.XFRC])
    pushes = numbers(pushes_at, 6 * drive[place.BODIES])
    for body in range(1, drive[place.BODIES]):
        pushed = 0.0
        for k in range(6):
            pushed += abs(pushes[6 * body + k])
        if pushed != 0.0:
            told(drive[place.PUSH], m, d, pushes_at + 48 * body, pushes_at + 48 * body + 24,
                 word_at(d, drive[place.XIPOS]) + 24 * body, body, at)


def _supported(m: int, d: int, drive: Words, speed_at: Words, torque: Numbers) -> None:
    """Let MuJoCo find the forces of contacts and limits under these torques, where no step has found them."""
    passive = engine_numbers(d, drive[place.PASSIVE], drive[place.DOFS])
    for i in range(len(speed_at)):
        passive[speed_at[i]] += torque[i]
    told(drive[place.ACTUATE], m, d)
    told(drive[place.ACCELERATE], m, d)
    told(drive[place.CONSTRAIN], m, d)
    for i in range(len(speed_at)):
        passive[speed_at[i]] -= torque[i]


def predict(speed_at: Words, inverse: Rows, known: Numbers, room: Rows, square: Rows) -> None:
    """Predict all torques, and the acceleration of each joint without its servo.

    `known` has torque, acceleration and share of each servo: τ = τ₀ − share/(M⁻¹)ᵢᵢ · (a − a₀). With the torques of the
    others in a, those with a share are the solution of linear equations, which are symmetric and positive.
    """
    n = len(speed_at)
    free, a, torque = room[place.R_FREE], room[place.R_ACCELERATION], room[place.R_PREDICTED]
    for i in range(n):
        share, own = known[2 * n + i], inverse[i, speed_at[i]]
        if share > 0.0:
            for j in range(i):
                square[i, j] = inverse[i, speed_at[j]] if known[2 * n + j] > 0.0 else 0.0
            square[i, i] = own / share
            torque[i] = known[i] * own / share + known[n + i] - free[i]
            for j in range(n):
                if known[2 * n + j] == 0.0:
                    torque[i] -= inverse[i, speed_at[j]] * known[j]
        else:
            for j in range(i):
                square[i, j] = 0.0
            square[i, i], torque[i] = 1.0, known[i]
    _solve(square, torque)
    for i in range(n):
        a[i] = free[i]
        for j in range(n):
            if j != i:
                a[i] += inverse[i, speed_at[j]] * torque[j]


def _solve(square: Rows, x: Numbers) -> None:
    """Solve equations with a symmetric positive matrix, whose lower half is given, in place (Cholesky)."""
    n = len(x)
    for i in range(n):
        for j in range(i + 1):
            total = square[i, j]
            for k in range(j):
                total -= square[i, k] * square[j, k]
            square[i, j] = math.sqrt(total) if i == j else total / square[j, j]
    for i in range(n):
        for k in range(i):
            x[i] -= square[i, k] * x[k]
        x[i] /= square[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= square[k, i] * x[k]
        x[i] /= square[i, i]


def learn(speed_at: Words, gain: Numbers, inverse: Rows, known: Numbers, room: Rows, dt: float, turn: int) -> float:
    """Take torques that were found as what the next prediction starts from; return the largest speed missed [rad/s]."""
    n = len(speed_at)
    a, predicted, found = room[place.R_ACCELERATION], room[place.R_PREDICTED], room[place.R_FOUND]
    missed = 0.0
    for i in range(n):
        off = 0.0
        for j in range(n):
            if j != i:
                off += inverse[i, speed_at[j]] * (found[j] - predicted[j])
        missed = max(missed, abs(off / gain[i]) * dt)
        other = a[i] - known[n + i]
        if turn > 0 and abs(other / gain[i]) * dt > place.SLIGHT:
            known[2 * n + i] = min(max((known[i] - found[i]) / other * inverse[i, speed_at[i]], 0.0), 1.0)
        known[i], known[n + i] = found[i], a[i]
    return missed


# --- Servos at the joints of a rigid-body engine ----------------------------------------------------------------------

def _tick(m: int, d: int, drive: Words, instance: Words, block: Numbers, room: Rows, before: int, dt: float, rk4: bool,
          again: bool) -> None:
    """Advance the servos from the beginning of the tick, and find the torques that the joints get meanwhile."""
    n, dofs = drive[place.SERVOS], drive[place.DOFS]
    at = instance[place.ROOM]
    torque = block[place.HEAD:place.HEAD + n]
    last, restored = block[place.SERIAL] == instance[place.SERIAL_NOW], block[place.RESTORED] != 0.0
    settled = block[place.FRESH] == 0.0 and (restored or last)
    block[place.RESTORED] = 0.0
    inverse = rows(at + 8 * n * dofs, n + 1, dofs)  # and a row for the forces
    square = rows(at + 8 * dofs * (2 * n + 1), n, n)
    stay(drive, block, room, dt, rk4)
    told(drive[place.SOLVE], m, d, at + 8 * n * dofs, at, n)
    accelerations(m, d, drive, block, at + 16 * n * dofs, inverse, room, square, settled, again)
    recorded = words(instance[place.RECORD], place.RECORD_WORDS)[place.ROW] > 0
    if recorded:
        account(m, d, drive, instance, block, dt, rk4, last and not restored and not again)
    culprit = _settle(drive, instance, block, inverse, room, square, before, dt, recorded)
    if culprit >= 0:
        torque[:] = 0.0
        complain(instance, FAILED, culprit)
        return
    final = numbers(at + 8 * (dofs * (2 * n + 1) + n * n + place.R_FINAL * n), 3 * n)
    _finish(drive, block, inverse, room, final, dt)
    predict(words(drive[place.SPEED_AT], n), inverse, final, room, square)
    torque[:] = room[place.R_PREDICTED]
    if recorded:
        note_forces(d, drive, instance, block, inverse[n])
        keep(drive, instance, room, torque, block[place.END], again)


def _settle(drive: Words, instance: Words, block: Numbers, inverse: Rows, room: Rows, square: Rows, before: int,
            dt: float, watched: bool) -> int:
    """Go through the tick until the torques of all servos are those predicted; return which cannot continue, or −1."""
    n = drive[place.SERVOS]
    known, speed_at = block[place.HEAD + n:place.HEAD + 4 * n], words(drive[place.SPEED_AT], n)
    gain, armature = numbers(drive[place.GAIN], n), numbers(drive[place.ARMATURE], n)
    for turn in range(place.PASSES):
        if turn > 0:
            memories(instance, before, True)
        predict(speed_at, inverse, known, room, square)
        for i in range(n):
            J = 1.0 / inverse[i, speed_at[i]]
            room[place.R_LOAD, i] = -room[place.R_ACCELERATION, i] * J * gain[i]
            room[place.R_INERTIA, i] = max(J - armature[i], 0.0) * gain[i] * gain[i]
        culprit = go_on(instance, room, dt, watched)
        if culprit >= 0:
            return culprit
        for i in range(n):
            change = (room[place.R_AFTER, i] - room[place.R_ACTUAL, i]) * gain[i]
            room[place.R_FOUND, i] = (change / dt - room[place.R_ACCELERATION, i]) / inverse[i, speed_at[i]]
        if learn(speed_at, gain, inverse, known, room, dt, turn) <= place.MISSED:
            break
    return -1


def _finish(drive: Words, block: Numbers, inverse: Rows, room: Rows, final: Numbers, dt: float) -> None:
    """Let each servo answer with what was found; one at rest holds against whatever the others turn out to do."""
    n = drive[place.SERVOS]
    known, speed_at = block[place.HEAD + n:place.HEAD + 4 * n], words(drive[place.SPEED_AT], n)
    gain = numbers(drive[place.GAIN], n)
    for i in range(n):
        final[i], final[n + i], final[2 * n + i] = room[place.R_FOUND, i], 0.0, 0.0
        if room[place.R_AFTER, i] == 0.0:  # now and in the next tick
            final[i] = -room[place.R_ACTUAL, i] * gain[i] / (dt * inverse[i, speed_at[i]])
            final[2 * n + i] = 1.0
            known[i], known[n + i], known[2 * n + i] = 0.0, 0.0, 1.0


def _is_stage(block: Numbers, t: float, dt: float) -> bool:
    """Tell whether this call is one of those of RK4 after the first in a step."""
    calls = int(block[place.CALLS])
    if calls < 1 or calls > 3:
        return False
    return bool(abs(t - block[place.START] - (0.5 * dt if calls < 3 else dt)) <= place.SAME * dt)


def _start_anew(drive: Words, instance: Words, block: Numbers, room: Rows, half: int) -> None:
    """Put the servos at rest where their joints are, and what they remember then into a half of a block."""
    words(instance[place.RECORD], place.RECORD_WORDS)[place.USED] = 0
    n = drive[place.SERVOS]
    lower, upper = numbers(drive[place.LOWER], n), numbers(drive[place.UPPER], n)
    rest = numbers(drive[place.REST], n)
    for i in range(n):
        room[place.R_ANGLE, i] = min(max(room[place.R_ANGLE, i], lower[i]), upper[i])
        room[place.R_GOAL, i] = rest[i] if math.isfinite(rest[i]) else room[place.R_ANGLE, i]
        block[place.HEAD + 7 * n + i] = room[place.R_GOAL, i]
    if instance[place.NEW] == 0:
        told(drive[place.ASK], ASK_RESET, instance[place.DATA], 0)
        memories(instance, half, False)
        return
    moved(instance[place.NEW], half, 8 * drive[place.MEMORY], False)
    count = instance[place.ANGLE_COUNT]
    angles, found = words(instance[place.ANGLES], 2 * count), numbers(half, drive[place.MEMORY])
    for k in range(count):
        found[angles[2 * k]] = room[place.R_ANGLE, angles[2 * k + 1]]
    memories(instance, half, True)


def _begin(drive: Words, instance: Words, block: Numbers, room: Rows, halves_at: int, t: float, dt: float) -> bool:
    """Find out where in time this call stands, and let the servos stand there; return whether this tick was met before.

    Time that advances by a tick continues from what the servos remember at its end; the same instant again begins the
    tick anew; any other instant is a new beginning for the servos too, at rest.
    """
    n, size, head = drive[place.SERVOS], drive[place.MEMORY], place.HEAD
    met = block[place.CALLS] > 0.0
    again = met and block[place.FRESH] == 0.0 and abs(t - block[place.START]) <= place.SAME * dt
    onward = met and not again and abs(t - block[place.END]) <= place.SAME * dt
    if onward:
        block[place.HALF], block[place.FRESH] = 1.0 - block[place.HALF], 0.0
    half = halves_at + 8 * size * int(block[place.HALF])
    if again or (onward and block[place.SERIAL] != instance[place.SERIAL_NOW]):
        memories(instance, half, True)
    now, before = block[head + n:head + 4 * n], block[head + 4 * n:head + 7 * n]
    if again:
        now[:] = before
    else:
        if not onward:
            _start_anew(drive, instance, block, room, half)
            block[place.FRESH] = 1.0
            for i in range(n):
                now[i], now[n + i] = 0.0, 0.0
                now[2 * n + i] = 1.0 if room[place.R_SPEED, i] == 0.0 else 0.0
        before[:] = now
    block[place.START], block[place.END], block[place.CALLS] = t, t + dt, 1.0
    return bool(again)


def _control(m: int, d: int, drive_at: int) -> None:
    """Give the servos' torques to the joints, at the control callback of the engine's step."""
    drive = words(drive_at, place.DRIVE_WORDS)
    n, dofs = drive[place.SERVOS], drive[place.DOFS]
    at = instance_at(m, d, drive) if is_own(m, drive) else 0
    if at == 0:
        return
    instance = words(at, place.INSTANCE_WORDS)
    kept = instance[place.KEPT]
    if drive[place.KEPT_AT] >= 0:
        kept = word_at(d, drive[place.USERDATA]) + 8 * drive[place.KEPT_AT]
    head = place.HEAD + place.EACH * n + dofs
    block = numbers(kept, head)
    room = rows(instance[place.ROOM] + 8 * (dofs * (2 * n + 1) + n * n), place.ROOM_ROWS, n)
    passive, speed_at = engine_numbers(d, drive[place.PASSIVE], dofs), words(drive[place.SPEED_AT], n)
    for i in range(n):
        if passive[speed_at[i]] == room[place.R_PUSHED, i]:  # not worked out anew since the last call
            passive[speed_at[i]] = room[place.R_PASSIVE, i]
        room[place.R_PASSIVE, i] = passive[speed_at[i]]
    if not _answer(m, d, drive_at, instance, block, room, kept + 8 * head):
        return
    for i in range(n):
        passive[speed_at[i]] += block[place.HEAD + i]
        room[place.R_PUSHED, i] = passive[speed_at[i]]


def _answer(m: int, d: int, drive_at: int, instance: Words, block: Numbers, room: Rows, halves_at: int) -> bool:
    """Bring the torques in a block up to this call of the engine; return whether that could be done."""
    drive = words(drive_at, place.DRIVE_WORDS)
    t, dt, size = number_at(d, drive[place.TIME]), number_at(m, drive[place.TIMESTEP]), drive[place.MEMORY]
    rk4 = bool(halves(m + drive[place.INTEGRATOR], 1)[0] == place.RK4)
    if rk4 and _is_stage(block, t, dt):
        block[place.CALLS] += 1.0
        return True
    culprit = stand(d, drive, room)
    if culprit >= 0 or dt > number_at(drive_at, 8 * place.LONGEST) * (1.0 + place.SAME):
        complain(instance, NOT_FINITE if culprit >= 0 else TOO_LONG, max(culprit, 0))
        return False
    again = _begin(drive, instance, block, room, halves_at, t, dt)
    culprit = listen(d, drive, block, room)
    if culprit >= 0:
        complain(instance, NOT_FINITE, culprit)
        block[place.CALLS] = 0.0
        return False
    _tick(m, d, drive, instance, block, room, halves_at + 8 * size * int(block[place.HALF]), dt, rk4, again)
    instance[place.SERIAL_NOW] += 1
    block[place.SERIAL] = instance[place.SERIAL_NOW]
    memories(instance, halves_at + 8 * size * (1 - int(block[place.HALF])), False)
    return True


def control(m: int, d: int) -> None:
    """Be MuJoCo's control callback; without a model `d` is the address of the drive whose servos are meant."""
    if m == 0:
        activate(d)
        return
    drive = active()
    if drive != 0:
        _control(m, d, drive)


def step(drive_at: int, m: int, d: int, steps: int) -> int:
    """Advance the engine with the servos, under this callback alone; return `WELL` or what is wrong."""
    drive = words(drive_at, place.DRIVE_WORDS)
    slot = words(drive[place.SLOT], 1)
    before = slot[0]
    if before != 0 and before != drive[place.OWN]:
        return FOREIGN
    slot[0] = drive[place.OWN]
    code = WELL
    for _ in range(steps):
        t = number_at(d, drive[place.TIME])
        told(drive[place.STEP], m, d)
        if not number_at(d, drive[place.TIME]) > t:
            code = RESTARTED
            break
    slot[0] = before
    return code
