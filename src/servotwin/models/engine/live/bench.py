"""Servos at a bench advance together under one transmitter: the kernel that a page calls."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.bus.bus_records import Tape
from servotwin.models.engine.lanes import Lanes, Tables
from servotwin.models.engine.live import posts as those
from servotwin.models.engine.live import stretch, together
from servotwin.models.engine.live.posts import Told
from servotwin.models.engine.live.screen import NEXT, NO_LOW, USED, Looks, Screen, first_look
from servotwin.models.engine.log import Log
from servotwin.models.engine.memory import Memories, memory_at, put_memory
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.noise import drawn
from servotwin.physics.converter import counted

PAUSED = -1  # as a status: the room for what shows is half full
_LONGEST = 0.1  # s, of a part of the way
_FRAMES = 48  # of a part
_REST = 1e-9  # s, of the way: no part of its own


def make(posts: Any, programs: Any, k: int, family: int, givens: Any, weights: Any) -> int:
    """Make a servo of what is given of it and of what hangs on it; return `posts.MADE`, or what forbids it."""
    post = posts[k]
    return those.make(post, programs[k], family, those.given_in(givens[k]), those.weights_in(weights[k]))


def begin(posts: Any, k: int, told: Told, memories: Memories) -> None:
    """Let a servo stand, without drive, where its first command asks for."""
    those.begin(posts, k, told, memories)


def begin_at(posts: Any, k: int, told: Told, memories: Memories, angle: float) -> None:
    """Let a servo stand, without drive, at an angle [rad]."""
    those.begin_at(posts, k, told, memories, angle)


def heed(posts: Any, k: int, told: Told, circuits: Any, time: float, sag: float) -> float:
    """Let a control circuit read the command of a servo; return the width of the pulses that follow [s]."""
    return those.heed(posts[k], told, circuits[0], time, sag)


def change(posts: Any, k: int, memories: Memories) -> None:
    """Let a servo continue with the numbers that its record has by now."""
    those.change(posts, k, memories)


def take(posts: Any, k: int, unit: int, shape: int, given: Any, time: Any, value: Any, start: float, table: Any,
         ends: Any) -> int:
    """Put a command from a time on [s] into a table as a servo follows it; return how many pieces there are."""
    return those.take(posts[k], unit, shape, given, time, value, start, table, ends)


def count(gain: float, offset: float, highest: int, voltage: float) -> int:
    """Return the count of a converter for a voltage [V]."""
    return counted(gain, offset, highest, voltage)


def draw(seed: int, number: int, low: float, high: float) -> float:
    """Return a draw from low to high, both positive, evenly over their logarithm."""
    return drawn(seed, number, low, high)


def look(posts: Any, k: int, told: Told, programs: Any, memories: Memories, rows: Any, used: Any) -> None:
    """Write a row of a servo as it stands, before anything happens at its time."""
    post = posts[k]
    inputs, screen = those.inputs_of(post, k, len(posts), told, programs), Screen(rows[k], rows[k], used[:USED])
    used[0] = 0
    stretch.look(those.numbers_of(post.numbers), those.chip_of(post.chip), inputs, memory_at(memories, k),
                 those.lines_of(post.lines), screen)


def tune(sender: Any, rate: float) -> None:
    """Take another rate of frames [Hz] from the next edge on."""
    those.tune(sender[0], rate)


def snapped(sender: Any, time: float) -> float:
    """Return a time, or that of the edge right next to it [s]."""
    return those.snapped(sender[0], time)


def next_edge(sender: Any) -> float:
    """Return when the next frame begins [s]."""
    return those.next_edge(sender[0])


def advance(posts: Any, told: Told, programs: Any, memories: Memories, sender: Any, log: Log, until: float, rate: float,
            switches: int, rows: Any, events: Any, pulses: Any, used: Any) -> int:
    """Advance to a time [s], each servo on its own supply; return a status.

    The log has room for `stretch.AT_ONCE` motions and a few events more.
    Each servo has tables `rows`, `events` and `pulses` for what shows; how much of these is `used` stands as in
    `Screen`. The sender's time is how far the bench has come.
    """
    now, status = sender[0], COMPLETED
    _begin_looks(posts, first_look(now.time, rate), used)
    while status == COMPLETED and those.snapped(now, until) > now.time:
        if _is_full(rows, events, pulses, used):
            return PAUSED
        end = _end_of_part(now, until, rate, len(rows[0]))
        those.hear(now, posts, told, pulses, used, end)
        last = 1 if end == those.snapped(now, until) else 0
        for n in range(len(posts)):
            looks = Looks(used[USED * n + NEXT], rate, end, last, switches)
            how = _advance_one(posts[n], n, len(posts), told, programs, memories, looks, log,
                               Screen(rows[n], events[n], used[USED * n:USED * n + USED]))
            status = how if how != COMPLETED else status
        if status == COMPLETED:
            now.time = end
    return status


def advance_together(posts: Any, told: Told, programs: Any, memories: Memories, sender: Any, lanes: Lanes,
                     tables: Tables, shared: Any, seats: Any, mates: Any, tape: Tape, until: float, rate: float,
                     switches: int, rows: Any, events: Any, pulses: Any, used: Any) -> int:
    """Advance to a time [s], all servos on one supply; return a status.

    Pieces and edges of the lanes are those of `told`; there are twice as many mates as servos.
    """
    now, status = sender[0], COMPLETED
    _begin_looks(posts, first_look(now.time, rate), used)
    while status == COMPLETED and those.snapped(now, until) > now.time:
        if _is_full(rows, events, pulses, used):
            return PAUSED
        end = _end_of_part(now, until, rate, len(rows[0]))
        those.hear(now, posts, told, pulses, used, end)
        looks = Looks(used[NEXT], rate, end, 1 if end == those.snapped(now, until) else 0, switches)
        _tell(posts, told, lanes)
        status = together.advance(posts, memories, lanes, tables, shared, seats, mates, looks, tape, rows, events, used)
        if status == COMPLETED:
            now.time = end
    return status


def _begin_looks(posts: Any, k: int, used: Any) -> None:
    for n in range(len(posts)):
        used[USED * n], used[USED * n + 1], used[USED * n + 2], used[USED * n + NEXT] = 0, 0, 0, k
        those.put_low(posts[n].low, NO_LOW)


def _is_full(rows: Any, events: Any, pulses: Any, used: Any) -> bool:
    """Tell whether the room for what shows is half full."""
    for n in range(len(rows)):
        if used[USED * n] * 2 > len(rows[n]) or used[USED * n + 1] * 2 > len(events[n]) or (
                used[USED * n + 2] * 2 > len(pulses[n])):
            return True
    return False


def _end_of_part(now: Any, until: float, rate: float, room: int) -> float:
    """Return how far to go at once: so that pulses and looks have room [s]."""
    whole = those.snapped(now, until)
    end = min(whole, now.base + (now.passed + _FRAMES) / now.rate, now.time + _LONGEST, now.time + room / (4.0 * rate))
    return whole if until - end <= _REST else end


def _tell(posts: Any, told: Told, lanes: Lanes) -> None:
    """Put the present commands, loads and seeds of all servos into lanes."""
    for n in range(len(posts)):
        post = posts[n]
        lanes.piece_first[n], lanes.piece_count[n] = those.pieces_of(post, n, len(posts), told)
        lanes.edge_first[n] = those.train_of(told, len(posts), n)[0]
        lanes.edge_count[n] = post.heard if post.pulsed == 1 else -1
        lanes.torque[n], lanes.seeds[n] = post.torque + post.push, post.seed


def _advance_one(post: Any, k: int, servos: int, told: Told, programs: Any, memories: Memories, looks: Looks,
                 log: Log, screen: Screen) -> int:
    """Advance one servo by itself; return a status."""
    memory, was, low, status = stretch.go_on(
        those.numbers_of(post.numbers), those.chip_of(post.chip), those.inputs_of(post, k, servos, told, programs),
        memory_at(memories, k), post.changed == 1, those.was_of(post.was), those.low_of(post.low), looks,
        those.lines_of(post.lines), screen, log)
    if status == COMPLETED:
        put_memory(memories.rows[k], memory)
        those.put_was(post.was, was)
        those.put_low(post.low, low)
        post.changed = 0
    return status
