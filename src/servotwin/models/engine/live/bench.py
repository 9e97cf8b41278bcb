"""Servos at a bench go on together under one transmitter: the kernel that a page calls."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.live import making, stretch
from servotwin.models.engine.live import posts as those
from servotwin.models.engine.live import sender as transmitter
from servotwin.models.engine.live.posts import Told
from servotwin.models.engine.live.screen import NEXT, USED, Looks, Screen, first_look
from servotwin.models.engine.memory import Memories, memory_at, put_memory
from servotwin.models.engine.step import COMPLETED
from servotwin.physics.converter import counted

PAUSED = -1  # as a status: the room for what shows is half full
_LONGEST = 0.1  # s, of a part of the way
_FRAMES = 48  # of a part
_REST = 1e-9  # s, of the way: no part of its own


def make(posts: Any, programs: Any, k: int, family: int, givens: Any, weights: Any) -> int:
    """Make a servo of what is given of it and of what hangs on it; return `making.MADE`, or what forbids it."""
    post = posts[k]
    return making.make(post, programs[k], family, making.given_in(givens[k]), making.weights_in(weights[k]))


def begin(posts: Any, k: int, told: Told, memories: Memories) -> None:
    """Let a servo stand, without drive, where its first command asks for."""
    those.begin(posts, k, told, memories)


def change(posts: Any, k: int, memories: Memories) -> None:
    """Let a servo go on with the numbers that its record has by now."""
    those.change(posts, k, memories)


def take(posts: Any, k: int, unit: int, shape: int, given: Any, time: Any, value: Any, start: float, table: Any,
         ends: Any) -> int:
    """Put a command from a time on [s] into a table as a servo follows it; return how many pieces there are."""
    return those.take(posts[k], unit, shape, given, time, value, start, table, ends)


def count(gain: float, offset: float, highest: int, voltage: float) -> int:
    """Return the count of a converter for a voltage [V]."""
    return counted(gain, offset, highest, voltage)


def tune(sender: Any, rate: float) -> None:
    """Take another rate of frames [Hz] from the next edge on."""
    transmitter.tune(sender[0], rate)


def snapped(sender: Any, time: float) -> float:
    """Return a time, or that of the edge right next to it [s]."""
    return transmitter.snapped(sender[0], time)


def next_edge(sender: Any) -> float:
    """Return when the next frame begins [s]."""
    return transmitter.next_edge(sender[0])


def advance(posts: Any, told: Told, programs: Any, memories: Memories, sender: Any, until: float, rate: float,
            switches: int, rows: Any, events: Any, pulses: Any, used: Any) -> int:
    """Go on to a time [s]; return a status.

    Each servo has tables `rows`, `events` and `pulses` for what shows; how much of these is `used` stands as in
    `Screen`. The sender's time is how far the bench has come.
    """
    now = sender[0]
    k = first_look(now.time, rate)
    for n in range(len(posts)):
        used[USED * n], used[USED * n + 1], used[USED * n + 2], used[USED * n + NEXT] = 0, 0, 0, k
    while transmitter.snapped(now, until) > now.time:
        for n in range(len(posts)):
            if used[USED * n] * 2 > len(rows[n]) or used[USED * n + 1] * 2 > len(events[n]) or (
                    used[USED * n + 2] * 2 > len(pulses[n])):
                return PAUSED
        end = min(transmitter.snapped(now, until), now.base + (now.passed + _FRAMES) / now.rate, now.time + _LONGEST,
                  now.time + len(rows[0]) / (4.0 * rate))
        end = transmitter.snapped(now, until) if until - end <= _REST else end
        those.hear(now, posts, told, pulses, used, end)
        last = 1 if end == transmitter.snapped(now, until) else 0
        for n in range(len(posts)):
            looks = Looks(used[USED * n + NEXT], rate, end, last, switches)
            status = _advance_one(posts[n], n, told, programs, memories, looks,
                                  Screen(rows[n], events[n], used[USED * n:USED * n + USED]))
            if status != COMPLETED:
                return status
        now.time = end
    return COMPLETED


def _advance_one(post: Any, k: int, told: Told, programs: Any, memories: Memories, looks: Looks,
                 screen: Screen) -> int:
    """Let one servo go on by itself; return a status."""
    memory, was, status = stretch.go_on(
        those.numbers_of(post.numbers), those.chip_of(post.chip), those.inputs_of(post, k, told, programs),
        memory_at(memories, k), post.changed == 1, those.was_of(post.was), looks, those.lines_of(post.lines), screen)
    if status == COMPLETED:
        put_memory(memories.rows[k], memory)
        those.put_was(post.was, was)
        post.changed = 0
    return status
