"""Servos at the joints of a rigid-body engine: what happens at its control callback, and its step with them.

Kept and compiled as a derived module, and not imported from here. Words are those of `joints_layout`.

A servo sees the inertia 1/(M⁻¹)ᵢᵢ and the acceleration aᵢ that its joint would have without it. It goes on for a tick
and ends at another speed; the joint gets the mean torque τᵢ = (Δω/Δt − aᵢ)/(M⁻¹)ᵢᵢ. The torques of the other servos,
which aᵢ needs too, are predicted: each is what it was, less its share of what another aᵢ asks of it; one at rest takes
up all. Where that was wrong by more than a speed that does not count, all go through the tick again.

The servo keeps the angle that it has reached, plus what the engine's differs from the one that its way of integrating
leads to with these speeds: else a shaft that comes to rest on a tooth within a tick would float before it for ever.
"""

# numba's own types are not annotated
# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc, import-untyped, call-arg, unreachable, var-annotated"

from __future__ import annotations

import math

from numba import cfunc, njit, types  # noqa: F401 - the last lines of the derived module need them

from servotwin.models.engine.observe import Observed
from servotwin.simulation.compile.intrinsics import activate, active, array_maker, called, copied, told
from servotwin.simulation.compile.joints_layout import (
    ASK_NEW,
    ASK_RESET,
    ASK_ROOM,
    BLOCK,
    BOOKS,
    DRIVE,
    FAILED,
    FOREIGN,
    GROUP,
    INSTANCE,
    KEPT,
    NOT_FINITE,
    OF_EACH,
    PIECE,
    RECORD,
    RESTARTED,
    ROOM,
    ROW,
    TOO_LONG,
    WELL,
)

_words, _numbers = array_maker("<i8", 1, True), array_maker("<f8", 1, True)
_WORD = 8  # bytes
_rows, _bytes, _halves = array_maker("<f8", 2, True), array_maker("|i1", 1, True), array_maker("<i4", 1, True)

_SIGNALS, _OWN_SIGNALS, _IN_FRONT = len(Observed._fields), len(KEPT), len(ROW)
_PASSES = 6  # through a tick, at most
_MISSED = 1e-3  # rad/s of a servo: what a prediction may be off by
_LEAK = 0.01  # of the way that a servo goes: how fast its angle returns to the engine's
_APART = 1e-4  # rad: how far it may be from where it should be beside it
_RESTS = 1e-9  # rad/s: what a shaft at rest may turn with in the engine, by rounding
_SLIGHT = 1e-9  # rad/s: what tells nothing of a share
_RK4 = 1  # MuJoCo's number of it
_SAME = 1e-6  # of a tick: within it one instant is another
_HEAD, _EACH = len(BLOCK), len(OF_EACH)
(_SERVOS, _DOFS, _COORDINATES, _WIDE, _BODIES, _TIMESTEP, _INTEGRATOR, _TIME, _QPOS, _QVEL, _CTRL, _APPLIED, _XFRC,
 _USERDATA, _XIPOS, _PASSIVE, _BIAS, _ACTUATOR, _CONSTRAINT, _SPRING, _ENERGY, _SOLVE, _ACTUATE, _ACCELERATE,
 _CONSTRAIN, _PUSH, _POTENTIAL, _KINETIC, _STEP, _SLOT, _OWN, _OTHERS, _ANGLE_AT, _SPEED_AT, _COMMAND_AT, _GAIN,
 _ZERO, _ARMATURE, _LOWER, _UPPER, _LOW, _HIGH, _SCALE, _OFFSET, _CONTROL_LOW, _CONTROL_HIGH, _TOLD_GAIN, _TOLD_ZERO,
 _REST, _LONGEST, _KEPT_AT, _MEMORY, _INSTANCES, _ASK) = range(len(DRIVE))
(_DATA, _KEPT, _ROOM, _RECORD, _GROUPS, _COUNT, _CODE, _CULPRIT, _SERIAL_NOW, _NEW, _ANGLES,
 _ANGLE_COUNT, _BOOKS) = range(len(INSTANCE))
(_ADVANCE, _TICK, _DURATION, _LOOK, _LANES, _WHICH, _G_ANGLE, _G_SPEED, _G_GOAL, _G_LOAD, _G_INERTIA, _G_REACHED,
 _G_AFTER, _G_STATUS, _G_SEEN, _PIECES, _PIECE_COUNT) = range(len(GROUP))
_ROW, _CAPACITY, _USED, _KEPT_ROWS = range(len(RECORD))
_KEEPS, _LAST_TICK, _TOTAL, _FIRST, _WORK, _NOWHERE = range(len(BOOKS))
_START, _END, _CALLS, _FRESH, _SERIAL, _RESTORED, _HALF = range(len(BLOCK))
(_R_ANGLE, _R_SPEED, _R_GOAL, _R_LOAD, _R_INERTIA, _R_AFTER, _R_FREE, _R_ACCELERATION, _R_PREDICTED, _R_FOUND,
 _R_ACTUAL, _R_FINAL, _R_FINAL_ACCELERATION, _R_FINAL_SHARE, _R_ASKED, _R_PASSIVE, _R_PUSHED) = range(len(ROOM))


@njit(error_model="numpy")
def _word(base, offset):
    """Return the word that stands so many bytes behind an address."""
    return _words(base + offset, (1,))[0]


@njit(error_model="numpy")
def _number(base, offset):
    """Return the number that stands so many bytes behind an address."""
    return _numbers(base + offset, (1,))[0]


# --- memory -----------------------------------------------------------------------------------------------------------


@njit(error_model="numpy")
def _moved(own, kept, size, back):
    """Copy so many bytes from one address to another, or `back`; return how many they take there."""
    to, of = (own, kept) if back else (kept, own)
    if size == _WORD:  # of a lane in a tile, one of many
        _words(to, (1,))[0] = _words(of, (1,))[0]
    else:
        copied(to, of, size)
    return _WORD * ((size + _WORD - 1) // _WORD)


@njit(error_model="numpy")
def _memories(instance, kept, back):
    """Copy what all servos remember to an address, or `back`."""
    groups = _words(instance[_GROUPS], (instance[_COUNT],))
    for k in range(instance[_COUNT]):
        group = _words(groups[k], (len(GROUP),))
        pieces = _words(group[_PIECES], (len(PIECE) * group[_PIECE_COUNT],))
        for n in range(group[_PIECE_COUNT]):
            address, rows, stride, size = pieces[4 * n], pieces[4 * n + 1], pieces[4 * n + 2], pieces[4 * n + 3]
            for row in range(rows):
                kept += _moved(address + row * stride, kept, size, back)


# --- the load ---------------------------------------------------------------------------------------------------------


@njit(error_model="numpy")
def _forces(m, d, drive, constraint, total):
    """Put the forces at all degrees of freedom into `total`, without those of servos and inertia."""
    dofs = drive[_DOFS]
    passive, bias = _numbers(_word(d, drive[_PASSIVE]), (dofs,)), _numbers(_word(d, drive[_BIAS]), (dofs,))
    applied = _numbers(_word(d, drive[_APPLIED]), (dofs,))
    for k in range(dofs):
        total[k] = passive[k] - bias[k] + applied[k] + constraint[k]
    if drive[_OTHERS] != 0:
        told(drive[_ACTUATE], (m, d))
        actuator = _numbers(_word(d, drive[_ACTUATOR]), (dofs,))
        for k in range(dofs):
            total[k] += actuator[k]
    at = _word(d, drive[_XFRC])
    pushes = _numbers(at, (6 * drive[_BODIES],))
    for body in range(1, drive[_BODIES]):
        pushed = 0.0
        for k in range(6):
            pushed += abs(pushes[6 * body + k])
        if pushed != 0.0:
            told(drive[_PUSH], (m, d, at + 48 * body, at + 48 * body + 24, _word(d, drive[_XIPOS]) + 24 * body, body,
                                total.ctypes.data))


@njit(error_model="numpy")
def _predict(speed_at, inverse, known, room, square):
    """Predict all torques, and the acceleration of each joint without its servo.

    `known` has torque, acceleration and share of each servo: τ = τ₀ − share/(M⁻¹)ᵢᵢ · (a − a₀). With the torques of the
    others in a, those with a share are the solution of linear equations, which are symmetric and positive.
    """
    n = len(speed_at)
    free, a, torque = room[_R_FREE], room[_R_ACCELERATION], room[_R_PREDICTED]
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


@njit(error_model="numpy")
def _solve(square, x):
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


@njit(error_model="numpy")
def _learn(speed_at, gain, inverse, known, room, dt, turn):
    """Take torques that were found as what the next prediction starts from; return the largest speed missed [rad/s]."""
    n = len(speed_at)
    a, predicted, found = room[_R_ACCELERATION], room[_R_PREDICTED], room[_R_FOUND]
    missed = 0.0
    for i in range(n):
        off = 0.0
        for j in range(n):
            if j != i:
                off += inverse[i, speed_at[j]] * (found[j] - predicted[j])
        missed = max(missed, abs(off / gain[i]) * dt)
        other = a[i] - known[n + i]
        if turn > 0 and abs(other / gain[i]) * dt > _SLIGHT:
            known[2 * n + i] = min(max((known[i] - found[i]) / other * inverse[i, speed_at[i]], 0.0), 1.0)
        known[i], known[n + i] = found[i], a[i]
    return missed


@njit(error_model="numpy")
def _supported(m, d, drive, speed_at, torque):
    """Let MuJoCo find the forces of contacts and limits under these torques, where no step has found them."""
    passive = _numbers(_word(d, drive[_PASSIVE]), (drive[_DOFS],))
    for i in range(len(speed_at)):
        passive[speed_at[i]] += torque[i]
    told(drive[_ACTUATE], (m, d))
    told(drive[_ACCELERATE], (m, d))
    told(drive[_CONSTRAIN], (m, d))
    for i in range(len(speed_at)):
        passive[speed_at[i]] -= torque[i]


@njit(error_model="numpy")
def _stand(d, drive, room):
    """Put angles and speeds, as the servos see them, into their room; return who has none, or −1."""
    n = drive[_SERVOS]
    angle_at, speed_at = _words(drive[_ANGLE_AT], (n,)), _words(drive[_SPEED_AT], (n,))
    gain, zero = _numbers(drive[_GAIN], (n,)), _numbers(drive[_ZERO], (n,))
    qpos, qvel = _word(d, drive[_QPOS]), _word(d, drive[_QVEL])
    for i in range(n):
        q, w = _number(qpos, 8 * angle_at[i]), _number(qvel, 8 * speed_at[i])
        if not (math.isfinite(q) and math.isfinite(w)):
            return i
        room[_R_ANGLE, i] = (q - zero[i]) / gain[i]
        room[_R_ACTUAL, i] = w / gain[i]
        room[_R_SPEED, i] = room[_R_ACTUAL, i] if abs(room[_R_ACTUAL, i]) > _RESTS else 0.0
    return -1


@njit(error_model="numpy")
def _listen(d, drive, block, room):
    """Put the servos' commands into their room; return whose is not a number, or −1."""
    n = drive[_SERVOS]
    command_at, goals = _words(drive[_COMMAND_AT], (n,)), block[_HEAD + 12 * n:_HEAD + 14 * n]
    gain, zero = _numbers(drive[_TOLD_GAIN], (n,)), _numbers(drive[_TOLD_ZERO], (n,))
    low, high = _numbers(drive[_LOW], (n,)), _numbers(drive[_HIGH], (n,))
    scale, offset = _numbers(drive[_SCALE], (n,)), _numbers(drive[_OFFSET], (n,))
    least, most = _numbers(drive[_CONTROL_LOW], (n,)), _numbers(drive[_CONTROL_HIGH], (n,))
    ctrl, held = _word(d, drive[_CTRL]), block[_HEAD + 11 * n:_HEAD + 12 * n]
    for i in range(n):
        if command_at[i] >= 0:
            control = _number(ctrl, 8 * command_at[i])
            if not math.isfinite(control):
                return i
            goal = (offset[i] + scale[i] * min(max(control, least[i]), most[i]) - zero[i]) / gain[i]
            room[_R_ASKED, i] = (offset[i] + scale[i] * control - zero[i]) / gain[i]
        else:
            if goals[n + i] != 0.0:
                goal = (goals[i] - zero[i]) / gain[i]
                if not math.isfinite(goal):
                    return i
            else:  # nobody has said where to go
                goal = min(max(held[i], low[i]), high[i])
            room[_R_ASKED, i] = goal
        room[_R_GOAL, i] = min(max(goal, low[i]), high[i])
    return -1


@njit(error_model="numpy")
def _place(drive, block, room, dt, rk4):
    """Let the servos be where they have come to, as far as the engine has done what was expected of it."""
    n = drive[_SERVOS]
    reached, expected = block[_HEAD + 4 * n:_HEAD + 5 * n], block[_HEAD + 5 * n:_HEAD + 6 * n]
    lower, upper = _numbers(drive[_LOWER], (n,)), _numbers(drive[_UPPER], (n,))
    for i in range(n):
        q, way = room[_R_ANGLE, i], abs(room[_R_SPEED, i]) * dt
        if block[_FRESH] == 0.0:
            usual = 0.0 if rk4 else -0.5 * dt * room[_R_SPEED, i]  # semi-implicit steps take the speed at their end
            apart = reached[i] - expected[i] - usual
            apart -= min(max(apart, -_LEAK * way), _LEAK * way)
            room[_R_ANGLE, i] = q + usual + min(max(apart, -_APART), _APART)
        room[_R_ANGLE, i] = min(max(room[_R_ANGLE, i], lower[i]), upper[i])
        expected[i] = q


@njit(error_model="numpy")
def _expect(drive, instance, block, room, dt, rk4):
    """Note the angles that servos have reached, and those that the engine's way of integrating leads to."""
    n = drive[_SERVOS]
    reached, expected = block[_HEAD + 4 * n:_HEAD + 5 * n], block[_HEAD + 5 * n:_HEAD + 6 * n]
    groups = _words(instance[_GROUPS], (instance[_COUNT],))
    for k in range(instance[_COUNT]):
        group = _words(groups[k], (len(GROUP),))
        which, angle = _words(group[_WHICH], (group[_LANES],)), _numbers(group[_G_REACHED], (group[_LANES],))
        for lane in range(group[_LANES]):
            reached[which[lane]] = angle[lane]
    for i in range(n):
        w, after = room[_R_SPEED, i], room[_R_AFTER, i]
        expected[i] += dt * (0.5 * (w + after) if rk4 else after)


# --- the servos -------------------------------------------------------------------------------------------------------


@njit(error_model="numpy")
def _go_on(instance, room, dt, watched):
    """Let all servos go on for a tick; return who cannot, or −1."""
    groups = _words(instance[_GROUPS], (instance[_COUNT],))
    lost = -1
    for k in range(instance[_COUNT]):
        group = _words(groups[k], (len(GROUP),))
        lanes = group[_LANES]
        which, ends = _words(group[_WHICH], (lanes,)), _numbers(group[_G_AFTER], (lanes,))
        for row in range(_R_INERTIA + 1):  # in the order that a group has them in too
            values = _numbers(group[_G_ANGLE + row], (lanes,))
            for n in range(lanes):
                values[n] = room[row, which[n]]
        _numbers(group[_DURATION], (1,))[0] = dt
        _words(group[_LOOK], (1,))[0] = group[_G_LOAD] if watched else 0
        if called(group[_ADVANCE], group[_TICK]) != 0:
            return which[0]
        status = _bytes(group[_G_STATUS], (lanes,))
        for n in range(lanes):
            room[_R_AFTER, which[n]] = ends[n]
            if status[n] != 0:
                lost = which[n]
    return lost


@njit(error_model="numpy")
def _keep(drive, instance, room, torque, time, again):
    """Write what shows of all servos into a row of the record; `again` over the last one."""
    record = _words(instance[_RECORD], (len(RECORD),))
    if again and record[_USED] > 0:
        record[_USED] -= 1
    if record[_USED] == record[_CAPACITY] and told(drive[_ASK], (ASK_ROOM, instance[_DATA], 0)) == 0:
        return
    row = _numbers(record[_KEPT_ROWS] + 8 * record[_ROW] * record[_USED], (record[_ROW],))
    record[_USED] += 1
    row[0], row[1], row[2] = time, math.nan, math.nan
    groups = _words(instance[_GROUPS], (instance[_COUNT],))
    for k in range(instance[_COUNT]):
        group = _words(groups[k], (len(GROUP),))
        lanes = group[_LANES]
        which, seen = _words(group[_WHICH], (lanes,)), _rows(group[_G_SEEN], (lanes, _SIGNALS))
        reached = _numbers(group[_G_REACHED], (lanes,))
        for n in range(lanes):
            i = which[n]
            at = _IN_FRONT + (_OWN_SIGNALS + _SIGNALS) * i
            row[at], row[at + 1], row[at + 2], row[at + 3] = reached[n], room[_R_AFTER, i], room[_R_GOAL, i], torque[i]
            row[at + 4], row[at + 5] = room[_R_ASKED, i], math.nan  # the work is known at the end of the tick
            for s in range(_SIGNALS):
                row[at + _OWN_SIGNALS + s] = seen[n, s]


@njit(error_model="numpy")
def _books(drive, instance):
    """Return the numbers of `BOOKS`, work of each servo, and speed and force of each degree of freedom."""
    n, dofs = drive[_SERVOS], drive[_DOFS]
    every = _numbers(instance[_BOOKS], (len(BOOKS) + n + 2 * dofs,))
    at = len(BOOKS) + n
    return every[:len(BOOKS)], every[len(BOOKS):at], every[at:at + dofs], every[at + dofs:]


@njit(error_model="numpy")
def _account(m, d, drive, instance, block, dt, rk4, onward):
    """Bring the books up to the beginning of this tick; `onward` is whether it is the end of the row kept last.

    A semi-implicit step moves with the speed at its end, so that on the way the energy is off by ½ Δt F·w, where F are
    the forces of gravity and springs; that comes back, and is left out of the balance.
    """
    n, dofs = drive[_SERVOS], drive[_DOFS]
    record = _words(instance[_RECORD], (len(RECORD),))
    sums, work, speed, force = _books(drive, instance)
    told(drive[_POTENTIAL], (m, d))
    told(drive[_KINETIC], (m, d))
    energy = _number(d, drive[_ENERGY]) + _number(d, drive[_ENERGY] + _WORD)
    now = _numbers(_word(d, drive[_QVEL]), (dofs,))
    balanced = energy
    if not rk4:
        bias, spring = _numbers(_word(d, drive[_BIAS]), (dofs,)), _numbers(_word(d, drive[_SPRING]), (dofs,))
        for k in range(dofs):
            balanced += 0.5 * dt * (spring[k] - bias[k]) * now[k]
    if record[_USED] == 0 or sums[_KEEPS] == 0.0:
        sums[:], work[:] = 0.0, 0.0
        sums[_FIRST], sums[_KEEPS] = balanced, 1.0
    elif not onward:  # the state was changed from outside, and its energy with it
        sums[_FIRST] += balanced - sums[_TOTAL]
    else:
        passed = sums[_LAST_TICK]
        for k in range(dofs):
            sums[_WORK] += force[k] * 0.5 * (speed[k] + now[k]) * passed
        speed_at = _words(drive[_SPEED_AT], (n,))
        row = _numbers(record[_KEPT_ROWS] + _WORD * record[_ROW] * (record[_USED] - 1), (record[_ROW],))
        for i in range(n):
            k = speed_at[i]
            work[i] += block[_HEAD + i] * 0.5 * (speed[k] + now[k]) * passed
            row[_IN_FRONT + (_OWN_SIGNALS + _SIGNALS) * i + _OWN_SIGNALS - 1] = work[i]
        sums[_NOWHERE] = max(sums[_NOWHERE], balanced - sums[_FIRST] - sums[_WORK])
        row[1], row[2] = energy, sums[_NOWHERE]
    sums[_TOTAL], sums[_LAST_TICK] = balanced, dt
    for k in range(dofs):
        speed[k] = now[k]


@njit(error_model="numpy")
def _note_forces(d, drive, instance, block, total):
    """Note the forces that do work in this tick: all but those of gravity, springs and constraints."""
    n, dofs = drive[_SERVOS], drive[_DOFS]
    _, _, _, force = _books(drive, instance)
    bias, spring = _numbers(_word(d, drive[_BIAS]), (dofs,)), _numbers(_word(d, drive[_SPRING]), (dofs,))
    constraint, speed_at = block[_HEAD + _EACH * n:_HEAD + _EACH * n + dofs], _words(drive[_SPEED_AT], (n,))
    for k in range(dofs):
        force[k] = total[k] + bias[k] - spring[k] - constraint[k]
    for i in range(n):
        force[speed_at[i]] += block[_HEAD + i]


@njit(error_model="numpy")
def _complain(instance, code, culprit):
    """Keep what went wrong first."""
    if instance[_CODE] == WELL:
        instance[_CODE], instance[_CULPRIT] = code, culprit


@njit(error_model="numpy")
def _free(m, d, drive, block, inverse, room, square, known, again):
    """Find the accelerations that the joints have without any servo; `known` is whether constraint forces are."""
    n, dofs = drive[_SERVOS], drive[_DOFS]
    first = _HEAD + _EACH * n
    constraint, speed_at = block[first:first + dofs], _words(drive[_SPEED_AT], (n,))
    found, total = _numbers(_word(d, drive[_CONSTRAINT]), (dofs,)), inverse[n]
    if not again:
        for k in range(dofs):
            constraint[k] = found[k] if known else 0.0
    for turn in range(1 if known or again else 2):
        if turn > 0:  # contacts and limits answer what the servos do
            _predict(speed_at, inverse, block[_HEAD + n:_HEAD + 4 * n], room, square)
            _supported(m, d, drive, speed_at, room[_R_PREDICTED])
            for k in range(dofs):
                constraint[k] = found[k]
        _forces(m, d, drive, constraint, total)
        for i in range(n):
            free = 0.0
            for k in range(dofs):
                free += inverse[i, k] * total[k]
            room[_R_FREE, i] = free


@njit(error_model="numpy")
def _tick(m, d, drive, instance, block, room, before, dt, rk4, again):
    """Let the servos go on from the beginning of the tick, and find the torques that the joints get meanwhile."""
    n, dofs = drive[_SERVOS], drive[_DOFS]
    at = instance[_ROOM]
    torque, known = block[_HEAD:_HEAD + n], block[_HEAD + n:_HEAD + 4 * n]
    last, restored = block[_SERIAL] == instance[_SERIAL_NOW], block[_RESTORED] != 0.0
    settled = block[_FRESH] == 0.0 and (restored or last)
    block[_RESTORED] = 0.0
    inverse = _rows(at + 8 * n * dofs, (n + 1, dofs))  # and a row for the forces
    square = _rows(at + 8 * dofs * (2 * n + 1), (n, n))
    _place(drive, block, room, dt, rk4)
    told(drive[_SOLVE], (m, d, at + 8 * n * dofs, at, n))
    _free(m, d, drive, block, inverse, room, square, settled, again)
    record, speed_at = _words(instance[_RECORD], (len(RECORD),)), _words(drive[_SPEED_AT], (n,))
    if record[_ROW] > 0:
        _account(m, d, drive, instance, block, dt, rk4, last and not restored and not again)
    gain, armature = _numbers(drive[_GAIN], (n,)), _numbers(drive[_ARMATURE], (n,))
    for turn in range(_PASSES):
        if turn > 0:
            _memories(instance, before, True)
        _predict(speed_at, inverse, known, room, square)
        for i in range(n):
            J = 1.0 / inverse[i, speed_at[i]]
            room[_R_LOAD, i] = -room[_R_ACCELERATION, i] * J * gain[i]
            room[_R_INERTIA, i] = max(J - armature[i], 0.0) * gain[i] * gain[i]
        culprit = _go_on(instance, room, dt, record[_ROW] > 0)
        if culprit >= 0:
            torque[:] = 0.0
            _complain(instance, FAILED, culprit)
            return
        for i in range(n):
            change = (room[_R_AFTER, i] - room[_R_ACTUAL, i]) * gain[i]
            room[_R_FOUND, i] = (change / dt - room[_R_ACCELERATION, i]) / inverse[i, speed_at[i]]
        if _learn(speed_at, gain, inverse, known, room, dt, turn) <= _MISSED:
            break
    final = _numbers(at + 8 * (dofs * (2 * n + 1) + n * n + _R_FINAL * n), (3 * n,))
    for i in range(n):
        rests = room[_R_AFTER, i] == 0.0
        final[i], final[n + i], final[2 * n + i] = room[_R_FOUND, i], 0.0, 0.0
        if rests:  # it holds against whatever the others have turned out to do, now and in the next tick
            final[i] = -room[_R_ACTUAL, i] * gain[i] / (dt * inverse[i, speed_at[i]])
            final[2 * n + i] = 1.0
            known[i], known[n + i], known[2 * n + i] = 0.0, 0.0, 1.0
    _predict(speed_at, inverse, final, room, square)
    torque[:] = room[_R_PREDICTED]
    _expect(drive, instance, block, room, dt, rk4)
    if record[_ROW] > 0:
        _note_forces(d, drive, instance, block, inverse[n])
        _keep(drive, instance, room, torque, block[_END], again)


@njit(error_model="numpy")
def _is_stage(block, t, dt):
    """Tell whether this call is one of those of RK4 after the first in a step."""
    calls = int(block[_CALLS])
    if calls < 1 or calls > 3:
        return False
    return abs(t - block[_START] - (0.5 * dt if calls < 3 else dt)) <= _SAME * dt


@njit(error_model="numpy")
def _start_anew(drive, instance, block, room, half):
    """Put the servos at rest where their joints are, and what they remember then into a half of a block."""
    _words(instance[_RECORD], (len(RECORD),))[_USED] = 0
    n = drive[_SERVOS]
    lower, upper = _numbers(drive[_LOWER], (n,)), _numbers(drive[_UPPER], (n,))
    rest = _numbers(drive[_REST], (n,))
    for i in range(n):
        room[_R_ANGLE, i] = min(max(room[_R_ANGLE, i], lower[i]), upper[i])
        block[_HEAD + 11 * n + i] = room[_R_GOAL, i] = rest[i] if math.isfinite(rest[i]) else room[_R_ANGLE, i]
    if instance[_NEW] == 0:
        told(drive[_ASK], (ASK_RESET, instance[_DATA], 0))
        _memories(instance, half, False)
        return
    _moved(instance[_NEW], half, 8 * drive[_MEMORY], False)
    angles, found = _words(instance[_ANGLES], (2 * instance[_ANGLE_COUNT],)), _numbers(half, (drive[_MEMORY],))
    for k in range(instance[_ANGLE_COUNT]):
        found[angles[2 * k]] = room[_R_ANGLE, angles[2 * k + 1]]
    _memories(instance, half, True)


@njit(error_model="numpy")
def _begin(drive, instance, block, room, halves, t, dt):
    """Find out where in time this call stands, and let the servos stand there; return whether this tick was met before.

    Time that goes on by a tick goes on from what the servos remember at its end; the same instant once more begins the
    tick anew; any other instant is a new beginning for the servos too, at rest.
    """
    n, size = drive[_SERVOS], drive[_MEMORY]
    met = block[_CALLS] > 0.0
    again = met and block[_FRESH] == 0.0 and abs(t - block[_START]) <= _SAME * dt
    onward = met and not again and abs(t - block[_END]) <= _SAME * dt
    if onward:
        block[_HALF], block[_FRESH] = 1.0 - block[_HALF], 0.0
    half = halves + 8 * size * int(block[_HALF])
    if again or (onward and block[_SERIAL] != instance[_SERIAL_NOW]):
        _memories(instance, half, True)
    now, before = block[_HEAD + n:_HEAD + 6 * n], block[_HEAD + 6 * n:_HEAD + 11 * n]
    if again:
        now[:] = before
    else:
        if not onward:
            _start_anew(drive, instance, block, room, half)
            block[_FRESH] = 1.0
            for i in range(n):
                now[i], now[n + i] = 0.0, 0.0
                now[2 * n + i] = 1.0 if room[_R_SPEED, i] == 0.0 else 0.0
        before[:] = now
    block[_START], block[_END], block[_CALLS] = t, t + dt, 1.0
    return again


@njit(error_model="numpy")
def _instance_at(m, d, drive):
    """Return the address of the servos in this data, which Python makes where it is new; 0: it could not."""
    count = _words(drive[_INSTANCES], (1,))[0]
    known = _words(drive[_INSTANCES] + 8, (2 * count,))
    for k in range(count):
        if known[2 * k] == d:
            return known[2 * k + 1]
    return told(drive[_ASK], (ASK_NEW, m, d))


@njit(error_model="numpy")
def _is_own(m, drive):
    """Tell whether a model is one of those that the servos are for, by its numbers of coordinates."""
    if drive[_WIDE] != 0:
        return _word(m, 0) == drive[_COORDINATES] and _word(m, 8) == drive[_DOFS]
    sizes = _halves(m, (2,))
    return sizes[0] == drive[_COORDINATES] and sizes[1] == drive[_DOFS]


@njit(error_model="numpy")
def _control(m, d, drive_at):
    """Give the servos' torques to the joints, at the control callback of the engine's step."""
    drive = _words(drive_at, (len(DRIVE),))
    n, dofs, size = drive[_SERVOS], drive[_DOFS], drive[_MEMORY]
    at = _instance_at(m, d, drive) if _is_own(m, drive) else 0
    if at == 0:
        return
    instance = _words(at, (len(INSTANCE),))
    kept = instance[_KEPT] if drive[_KEPT_AT] < 0 else _word(d, drive[_USERDATA]) + 8 * drive[_KEPT_AT]
    head = _HEAD + _EACH * n + dofs
    block, halves = _numbers(kept, (head,)), kept + 8 * head
    room = _rows(instance[_ROOM] + 8 * (dofs * (2 * n + 1) + n * n), (len(ROOM), n))
    passive, speed_at = _numbers(_word(d, drive[_PASSIVE]), (dofs,)), _words(drive[_SPEED_AT], (n,))
    for i in range(n):
        if passive[speed_at[i]] == room[_R_PUSHED, i]:  # not worked out anew since the last call
            passive[speed_at[i]] = room[_R_PASSIVE, i]
        room[_R_PASSIVE, i] = passive[speed_at[i]]
    t, dt = _number(d, drive[_TIME]), _number(m, drive[_TIMESTEP])
    rk4 = _halves(m + drive[_INTEGRATOR], (1,))[0] == _RK4
    if rk4 and _is_stage(block, t, dt):
        block[_CALLS] += 1.0
    else:
        culprit = _stand(d, drive, room)
        if culprit >= 0 or dt > _number(drive_at, 8 * _LONGEST) * (1.0 + _SAME):
            _complain(instance, NOT_FINITE if culprit >= 0 else TOO_LONG, max(culprit, 0))
            return
        again = _begin(drive, instance, block, room, halves, t, dt)
        culprit = _listen(d, drive, block, room)
        if culprit >= 0:
            _complain(instance, NOT_FINITE, culprit)
            block[_CALLS] = 0.0
            return
        _tick(m, d, drive, instance, block, room, halves + 8 * size * int(block[_HALF]), dt, rk4, again)
        instance[_SERIAL_NOW] += 1
        block[_SERIAL] = instance[_SERIAL_NOW]
        _memories(instance, halves + 8 * size * (1 - int(block[_HALF])), False)
    for i in range(n):
        passive[speed_at[i]] += block[_HEAD + i]
        room[_R_PUSHED, i] = passive[speed_at[i]]


def control(m, d):
    """Be MuJoCo's control callback; without a model `d` is the address of the drive whose servos are meant."""
    if m == 0:
        activate(d)
        return
    drive = active()
    if drive != 0:
        _control(m, d, drive)


def step(drive_at, m, d, steps):
    """Let the engine go on with the servos, under this callback alone; return `WELL` or what is wrong."""
    drive = _words(drive_at, (len(DRIVE),))
    slot = _words(drive[_SLOT], (1,))
    before = slot[0]
    if before != 0 and before != drive[_OWN]:
        return FOREIGN
    slot[0] = drive[_OWN]
    code = WELL
    for _ in range(steps):
        t = _number(d, drive[_TIME])
        told(drive[_STEP], (m, d))
        if not _number(d, drive[_TIME]) > t:
            code = RESTARTED
            break
    slot[0] = before
    return code
