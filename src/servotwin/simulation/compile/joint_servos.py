"""Servos at joints: where they stand, what they are told, and how they go on for a tick."""

from __future__ import annotations

import math

from servotwin.simulation.compile import joint_places as place
from servotwin.simulation.compile.addresses import Numbers, Rows, Words, bytes_at, called, numbers, words
from servotwin.simulation.compile.joint_memory import number_at, word_at


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
    """Let all servos go on for a tick; return who cannot, or −1."""
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
