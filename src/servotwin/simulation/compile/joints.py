"""Servos at the joints of a rigid-body engine: what happens at its control callback, and its step with them.

It runs as derived text, compiled or not. Words are those of `joints_layout`.

A servo sees the inertia 1/(M⁻¹)ᵢᵢ and the acceleration aᵢ that its joint would have without it. It goes on for a tick
and ends at another speed; the joint gets the mean torque τᵢ = (Δω/Δt − aᵢ)/(M⁻¹)ᵢᵢ. The torques of the other servos,
which aᵢ needs too, are predicted: each is what it was, less its share of what another aᵢ asks of it; one at rest takes
up all. Where that was wrong by more than a speed that does not count, all go through the tick again.

The engine turns a joint by its speeds at the ends of ticks, and the servo is put where the joint has come to with all
that is behind its gear: else a shaft that comes to rest on a tooth within a tick would be off the tooth again, and fall
onto it for ever.
"""

from __future__ import annotations

import math

from servotwin.simulation.compile import joint_places as place
from servotwin.simulation.compile.addresses import (
    Numbers,
    Rows,
    Words,
    activate,
    active,
    halves,
    numbers,
    rows,
    told,
    words,
)
from servotwin.simulation.compile.joint_memory import (
    complain,
    engine_numbers,
    instance_at,
    is_own,
    memories,
    moved,
    number_at,
    word_at,
)
from servotwin.simulation.compile.joint_record import account, keep, note_forces
from servotwin.simulation.compile.joint_servos import go_on, listen, stand, stay
from servotwin.simulation.compile.joint_torques import accelerations, learn, predict
from servotwin.simulation.compile.joints_layout import (
    ASK_RESET,
    FAILED,
    FOREIGN,
    NOT_FINITE,
    RESTARTED,
    TOO_LONG,
    WELL,
)


def _tick(m: int, d: int, drive: Words, instance: Words, block: Numbers, room: Rows, before: int, dt: float, rk4: bool,
          again: bool) -> None:
    """Let the servos go on from the beginning of the tick, and find the torques that the joints get meanwhile."""
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
    """Go through the tick until the torques of all servos are those predicted; return who cannot go on, or −1."""
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

    Time that goes on by a tick goes on from what the servos remember at its end; the same instant once more begins the
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
    """Let the engine go on with the servos, under this callback alone; return `WELL` or what is wrong."""
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
