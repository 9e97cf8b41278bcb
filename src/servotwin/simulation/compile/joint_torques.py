"""What joints would do without their servos, and the torques of all servos that follow from it."""

from __future__ import annotations

import math

from servotwin.simulation.compile import joint_places as place
from servotwin.simulation.compile.addresses import Numbers, Rows, Words, numbers, told, words
from servotwin.simulation.compile.joint_memory import engine_numbers, word_at


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
