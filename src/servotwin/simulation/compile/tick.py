"""The one function that C calls at a tick, over the programs of a simulator.

It runs as derived text, compiled or not. Words are those of `layout`.
"""

from __future__ import annotations

import math

from servotwin.models.engine.observe import Observed
from servotwin.simulation.compile.addresses import Bytes, Numbers, Words, bytes_at, called, numbers, rows, words
from servotwin.simulation.compile.layout import (
    DONE,
    GIVEN,
    HANDLE,
    NOT_RENEWED,
    NOTHING_GIVEN,
    OTHER_LANES,
    OTHER_VERSION,
    SHOWN,
    TICK,
    VERSION,
)

# --- The one function that C calls at a tick, over the programs of a simulator ----------------------------------------

_TICK_WORDS, _HANDLE_WORDS, _INPUTS, _SIGNALS = len(TICK), len(HANDLE), len(GIVEN), len(Observed._fields)
_LANES, _DURATION, _SIMULATOR = TICK.index("lanes"), TICK.index("duration"), TICK.index("simulator")
_FIRST_GIVEN, _FIRST_SHOWN, _STATUS = TICK.index(GIVEN[0]), TICK.index(SHOWN[0]), TICK.index("status")
_ANGLE, _SPEED = GIVEN.index("set_output_angle"), GIVEN.index("set_output_speed")
_INERTIA, _VOLTAGE = GIVEN.index("set_load_inertia"), GIVEN.index("set_bus_voltage")
_H_GIVEN, _H_HAS, _H_NOW, _H_STATUS = (HANDLE.index(name) for name in ("given", "has", "now", "status"))
_H_SHAFT, _H_SEEN, _H_FRESH, _H_RENEW = (HANDLE.index(name) for name in ("shaft", "seen", "fresh", "renew"))
_CLOCK, _ACCEPT, _CHANGE, _REFIT = (HANDLE.index(name) for name in ("clock", "accept", "change", "refit"))
_IMPOSE, _FOLLOW, _ADVANCE = (HANDLE.index(name) for name in ("impose", "follow", "advance"))
_SHOW, _LOOK = HANDLE.index("show"), HANDLE.index("look")
_OF_SHAFT = 2  # of what is shown; the rest stands in these columns of what is seen
_COLUMNS = (Observed._fields.index(SHOWN[2]), Observed._fields.index(SHOWN[3]), Observed._fields.index(SHOWN[4]),
            Observed._fields.index(SHOWN[5]))
_OTHERS = len(_COLUMNS)


def _run(program: int) -> int:
    """Run a program, each chain until one of its calls returns 0; return the last number."""
    count = words(program, 1)[0]
    at, found = program + 8, 0
    for _ in range(count):
        size = words(at, 1)[0]
        calls = words(at + 8, 2 * size)
        for k in range(size):
            found = called(calls[2 * k], calls[2 * k + 1])
            if found == 0:
                break
        at += 8 * (1 + 2 * size)
    return found


def _take(t: Words, h: Words, lanes: int) -> Words:
    """Copy what is given to where the programs read it."""
    given, has = rows(h[_H_GIVEN], _INPUTS, lanes), words(h[_H_HAS], _INPUTS)
    for row in range(_INPUTS):
        address = t[_FIRST_GIVEN + row]
        has[row] = 1 if address != 0 else 0
        if address != 0:
            source = numbers(address, lanes)
            for k in range(lanes):
                given[row, k] = source[k]
    return has


def _impose(has: Words, h: Words) -> bool:
    """Impose what another simulator decides; return whether that could be done."""
    if has[_INERTIA] + has[_VOLTAGE] != 0:
        if _run(h[_CHANGE]) == 0:
            _run(h[_REFIT])
        elif called(h[_H_RENEW], 0) == 0:
            return False
    if has[_ANGLE] + has[_SPEED] != 0:
        _run(h[_IMPOSE])
    return True


def _put(values: Numbers, stride: int, first: int, address: int, lanes: int, status: Bytes) -> None:
    """Copy a signal to where it is wanted; lanes that have failed are nan."""
    out = numbers(address, lanes)
    for k in range(lanes):
        out[k] = values[first + stride * k] if status[k] == 0 else math.nan


def _show(t: Words, h: Words, lanes: int) -> None:
    """Copy to C what it wants to see."""
    status = bytes_at(h[_H_STATUS], lanes)
    wanted = 0
    for row in range(_OF_SHAFT):
        wanted += 1 if t[_FIRST_SHOWN + row] != 0 else 0
    if wanted > 0:
        _run(h[_SHOW])
        shaft = numbers(h[_H_SHAFT], _OF_SHAFT * lanes)
        for row in range(_OF_SHAFT):
            if t[_FIRST_SHOWN + row] != 0:
                _put(shaft, 1, row * lanes, t[_FIRST_SHOWN + row], lanes, status)
    wanted = 0
    for row in range(_OTHERS):
        wanted += 1 if t[_FIRST_SHOWN + _OF_SHAFT + row] != 0 else 0
    if wanted > 0:
        _run(h[_LOOK])
        seen = numbers(h[_H_SEEN], _SIGNALS * lanes)
        for row in range(_OTHERS):
            if t[_FIRST_SHOWN + _OF_SHAFT + row] != 0:
                _put(seen, _SIGNALS, _COLUMNS[row], t[_FIRST_SHOWN + _OF_SHAFT + row], lanes, status)
    if t[_STATUS] != 0:
        out = bytes_at(t[_STATUS], lanes)
        for k in range(lanes):
            out[k] = status[k]


def advance(tick: int) -> int:
    """Advance by one tick, and return `DONE` or what is wrong; then nothing has changed."""
    if tick == 0:
        return NOTHING_GIVEN
    if words(tick, 1)[0] != VERSION:
        return OTHER_VERSION
    t = words(tick, _TICK_WORDS)
    if t[_SIMULATOR] == 0:
        return NOTHING_GIVEN
    h = words(t[_SIMULATOR], _HANDLE_WORDS)
    lanes = h[0]
    if t[_LANES] != lanes:
        return OTHER_LANES
    has, now = _take(t, h, lanes), numbers(h[_H_NOW], 2)
    now[0] = numbers(tick, _TICK_WORDS)[_DURATION]
    _run(h[_CLOCK])
    code = _run(h[_ACCEPT])
    if code != DONE:
        return code
    words(h[_H_FRESH], 1)[0] = 0
    if not _impose(has, h):
        return NOT_RENEWED
    _run(h[_FOLLOW])
    if now[0] > 0.0:
        _run(h[_ADVANCE])
        now[1] = 0.0
    _show(t, h, lanes)
    return DONE


# --- Bring the words of a call up to date, in compiled code -----------------------------------------------------------

def renew(at: int) -> int:
    """Put what has changed into words, and return 1.

    At the address stand how many words are copied, how many tell whether a float is not 0, and for each of these, the
    former first, the address of the word and that of its source.
    """
    copied, told = words(at, 2)[0], words(at, 2)[1]
    pairs = words(at + 16, 2 * (copied + told))
    for k in range(copied):
        words(pairs[2 * k], 1)[0] = words(pairs[2 * k + 1], 1)[0]
    for k in range(copied, copied + told):
        words(pairs[2 * k], 1)[0] = 1 if numbers(pairs[2 * k + 1], 1)[0] != 0.0 else 0
    return 1
