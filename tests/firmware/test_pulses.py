"""Pulses of the firmware in simavr, in CPU cycles (1/16 us), while converter, wire and display are busy."""

import os
import struct
from itertools import pairwise
from pathlib import Path

import pytest

from board_talk import (
    CYCLES,
    CYCLES_PER_TICK,
    EDGE,
    EVENT,
    LIMP,
    PLAY,
    SAMPLES,
    Script,
    frame,
    points,
    pulse,
    run_board,
    status,
    stream,
)

FRAMES = int(os.environ.get("SERVOTWIN_FRAMES", "500"))  # the full test takes 10000
STARTED, ENDED, STARVED, SILENT, RESET = range(1, 6)
SILENCE = 1.0  # s


def busy(width, period, seconds):
    """All channels at 1 kHz, and a computer that asks every 5 ms."""
    script = Script().wire(0.02, stream(15, 2)).wire(0.03, pulse(width, period)).asking(0.05, seconds, every=0.005)
    for channel, millivolt in enumerate((1000, 200, 1500, 1425)):
        script.adc(0.0, channel, millivolt)
    return script


def play(total):
    return frame(PLAY, struct.pack("<I", total))


def events(log):
    return [(one.payload[0], one.time) for one in log.of(EVENT) if one.payload[0] != RESET]


def gaps(log):
    """Places where the board's own count of frames jumps."""
    return [(a.sequence, b.sequence) for a, b in zip(log.frames, log.frames[1:], strict=False)
            if (b.sequence - a.sequence) % 256 != 1]


def check_exact(log, width, period, frames):
    pulses = log.pulses[:frames]
    assert len(pulses) == frames
    assert max(abs(wide - width * CYCLES_PER_TICK) for _, wide in pulses) <= 1
    assert max(abs(b - a - period * CYCLES_PER_TICK)
               for (a, _), (b, _) in pairwise(pulses)) <= 1


@pytest.mark.long(but="2000-6006")
@pytest.mark.parametrize(("width", "period"), [(3001, 40000), (2000, 6006), (200, 6007), (6000, 50000)])
def test_width_and_period_are_exact_under_full_load(board, width, period):
    seconds = 0.1 + FRAMES * period / 2e6
    log = board(busy(width, period, seconds), seconds)
    check_exact(log, width, period, FRAMES)
    assert len(log.display) > 100 * seconds  # 34 characters four times a second, two halves each
    assert not gaps(log)
    assert status(log)["late"] == status(log)["dropped"] == status(log)["bad"] == 0
    # No scan is missing, and the times told are those of the pin
    told = log.of(SAMPLES)
    assert {b.time - a.time for a, b in pairwise(told)} == {8 * 2000}
    origin = log.pulses[0][0] - log.of(EDGE)[0].time * CYCLES_PER_TICK
    assert all(up == origin + edge.time * CYCLES_PER_TICK
               for (up, _), edge in zip(log.pulses, log.of(EDGE), strict=False))


def test_frame_rate_sweep_and_missing_frames_come_as_they_are_queued(board):
    rows = [(3, 3000, 6006), (2, 2000, 40000), (1, 0, 20000), (4, 2500, 10000), (3, 0, 6006), (2, 200, 6006),
            (1, 6000, 50000), (2, 3333, 33333)]
    frames = [row[1:] for row in rows for _ in range(row[0])]
    script = Script().wire(0.02, stream(1, 1)).wire(0.03, points(0, *rows)).wire(0.04, play(len(rows)))
    log = board(script.asking(0.05, 0.6), 0.5)
    told = [(edge.time, *struct.unpack("<HHB", edge.payload[:5])) for edge in log.of(EDGE)]
    assert [(width, period) for _, width, period, _ in told[:len(frames)]] == frames
    assert {mask for *_, mask in told} == {1}
    assert all(b[0] - a[0] == a[2] for a, b in pairwise(told))
    # After the last point its pulse goes on, and the pin did what was told
    assert {edge[1:3] for edge in told[len(frames):]} == {(3333, 33333)}
    origin = log.pulses[0][0] - told[0][0] * CYCLES_PER_TICK
    wanted = [(origin + time * CYCLES_PER_TICK, width * CYCLES_PER_TICK) for time, width, *_ in told if width]
    assert log.pulses == wanted[:len(log.pulses)]
    assert len(wanted) - len(log.pulses) <= 1
    assert events(log) == [(STARTED, told[0][0]), (ENDED, told[len(frames)][0])]
    # The light is on while it plays, a common instant for a camera: within 20 us
    (on, _), (off, _) = log.light[:2]
    assert 0 <= on - log.pulses[0][0] < 20 * 16
    assert 0 <= off - (origin + told[len(frames)][0] * CYCLES_PER_TICK) < 20 * 16


def test_a_queue_that_runs_dry_says_so_and_its_last_pulse_goes_on(board):
    script = Script().wire(0.02, points(0, (2, 3000, 20000), (2, 2000, 20000))).wire(0.03, play(5)).asking(0.05, 0.4)
    log = board(script, 0.3)
    assert [what for what, _ in events(log)] == [STARTED, STARVED]
    assert [wide // CYCLES_PER_TICK for _, wide in log.pulses[:6]] == [3000, 3000, 2000, 2000, 2000, 2000]
    assert status(log)["pulsing"] == 1
    assert status(log)["played"] == 2


def test_a_long_queue_is_fed_while_it_plays(board):
    script = Script()
    rows = [(1, 2000 + k, 6006) for k in range(300)]
    for k in range(0, 300, 10):
        script.wire(0.02 + max(k - 80, 0) * 0.003 + k * 2e-4, points(k, *rows[k:k + 10]))
    log = board(script.wire(0.05, play(300)).asking(0.06, 2.0), 1.1)
    assert [wide // CYCLES_PER_TICK for _, wide in log.pulses[:300]] == [row[1] for row in rows]
    assert [what for what, _ in events(log)] == [STARTED, ENDED]


@pytest.mark.parametrize("order", [frame(LIMP), pulse(0, 40000)])
def test_a_pulse_is_never_cut_and_none_follows_torque_off(board, order):
    # On and off again in ever other phases of frame, pulse, and arming of the next edge
    script, offs = Script(), []
    for k in range(60):
        script.wire(0.05 * k + 0.01, pulse(3000, 6006))
        offs.append(0.05 * k + 0.03 + k * 5.17e-5)
        script.wire(offs[-1], order)
    log = board(script, 3.1)
    assert {wide for _, wide in log.pulses} == {3000 * CYCLES_PER_TICK}
    heard = 13 * 320 / CYCLES + 2e-4  # s: the order on the wire, and its reading
    starts = [up / CYCLES for up, _ in log.pulses]
    after = [start - off for off in offs for start in starts if off + heard < start < off + 0.025 - 5.17e-5 * 60]
    # An order to send another pulse holds from the next frame on that is not decided yet
    late = 2e-4 if order == frame(LIMP) else 6.2e-3
    assert all(gap < heard + late for gap in after)
    assert len(log.pulses) > 60 * 2


@pytest.mark.parametrize("queued", [False, True])
def test_pulses_stop_when_nothing_is_heard(board, queued):
    script = Script().wire(0.02, points(0, (9999, 3000, 40000), (1, 3000, 40000)))
    script.wire(0.1, play(2) if queued else pulse(3000, 40000))
    last = 0.5
    script.wire(last, frame(8))
    log = board(script, 2.5)
    end = max(cycle for cycle, _ in log.edges) / CYCLES
    assert last + SILENCE - 0.02 - 0.003 < end < last + SILENCE + 0.02 + 0.003
    assert log.edges[-1][1] == 0
    assert {wide for _, wide in log.pulses} == {3000 * CYCLES_PER_TICK}
    assert [what for what, _ in events(log)][-1] == SILENT


def test_the_pin_is_low_after_a_reset_until_a_pulse_is_ordered(board):
    log = board(Script().asking(0.01, 0.5), 0.5)
    assert log.edges == []
    assert status(log)["pulsing"] == status(log)["frames"] == 0
    assert log.of(EVENT)[0].payload == bytes([RESET, 0, 0, 0, 0])


@pytest.mark.long
def test_time_wraps(make, board):
    """A board whose time starts half a second before it wraps at 32 bits."""
    firmware, _ = make("-DSTART=65520")
    log = board(busy(3000, 40000, 1.2), 1.2, firmware)
    check_exact(log, 3000, 40000, 55)
    assert not gaps(log)
    assert min(one.time for one in log.frames) < 1_000_000 < 2**31 < max(one.time for one in log.frames)
    for kind, step in ((EDGE, 40000), (SAMPLES, 16000)):
        told = log.of(kind)
        assert {(b.time - a.time) % 2**32 for a, b in pairwise(told)} == {step}


@pytest.mark.long
@pytest.mark.parametrize(("width", "period"), [(3001, 40000), (2000, 6006)])
def test_avr8js_agrees(avr8js, shipped, tmp_path, width, period):
    seconds = 0.1 + 300 * period / 2e6
    log = run_board(avr8js, Path(shipped), busy(width, period, seconds), seconds, tmp_path)
    check_exact(log, width, period, 300)
    assert not gaps(log)
    assert status(log)["late"] == status(log)["dropped"] == status(log)["bad"] == 0
