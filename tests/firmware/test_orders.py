"""Every order, right and wrong, and its answer."""

import struct

import pytest

from board_talk import (
    ASK,
    CLEAR,
    DONE,
    EDGE,
    HELLO,
    IDENTITY,
    LIMP,
    MODE,
    PLAY,
    POINTS,
    PULSE,
    SAMPLES,
    STATUS,
    STREAM,
    Script,
    frame,
    millivolt_of,
    points,
    pulse,
    stream,
)

OK, UNKNOWN, LENGTH, RANGE, FULL, ORDER = range(6)
ROW = (1, 3000, 40000)


@pytest.mark.parametrize(("order", "result"), [
    (pulse(3000, 40000), OK), (pulse(0, 6006), OK), (pulse(200, 6006), OK), (pulse(5606, 6006), OK),
    (pulse(6000, 50000), OK), (pulse(199, 6006), RANGE), (pulse(5607, 6006), RANGE), (pulse(6001, 50000), RANGE),
    (pulse(3000, 6005), RANGE), (pulse(3000, 50001), RANGE), (pulse(0, 0), RANGE),
    (frame(PULSE, b"123"), LENGTH), (frame(PULSE), LENGTH), (frame(LIMP, b"1"), LENGTH),
    (frame(HELLO, b"1"), LENGTH), (frame(ASK, b"1"), LENGTH), (frame(CLEAR, b"1"), LENGTH),
    (frame(PLAY, b"123"), LENGTH), (frame(STREAM, b"12"), LENGTH), (frame(MODE), LENGTH),
    (frame(POINTS, b"\0\0"), LENGTH), (frame(POINTS, b"\0\0" + bytes(5)), LENGTH), (frame(POINTS), LENGTH),
    (points(0, *[ROW] * 10), OK), (points(0, *[ROW] * 11), LENGTH), (points(1, ROW), ORDER),
    (points(0, (0, 3000, 40000)), RANGE), (points(0, ROW, (1, 100, 40000)), RANGE), (points(1, (1, 1, 1)), RANGE),
    (frame(PLAY, struct.pack("<I", 1)), RANGE), (frame(CLEAR), OK), (frame(LIMP), OK),
    (stream(15, 2, 2), OK), (stream(16, 0), RANGE), (stream(0, 3), RANGE), (stream(0, 0, 3), RANGE),
    (frame(MODE, b"\1"), OK), (frame(MODE, b"\2"), RANGE), (frame(0), UNKNOWN), (frame(10), UNKNOWN),
    (frame(0x81), UNKNOWN), (frame(0xFF, bytes(72)), UNKNOWN),
])
def test_result_of_an_order(board, order, result):
    log = board(Script().wire(0.01, order), 0.02)
    answer, = log.of(DONE)
    assert answer.payload[1] == result


def test_who_it_is_and_how_it_does(board):
    log = board(Script().wire(0.01, frame(HELLO, sequence=7)).wire(0.02, frame(ASK, sequence=250)), 0.03)
    assert log.of(IDENTITY)[0].payload[:9] == b"\x07servotwn"
    assert log.of(STATUS)[0].payload[:4] == bytes([250, 0, 0, 96])
    assert [one.sequence for one in log.frames] == [0, 1, 2]


def test_the_queue_takes_all_points_or_none(board):
    script = Script()
    for k in range(10):
        script.wire(0.01 + 0.005 * k, points(10 * k, *[ROW] * 10))
    script.wire(0.07, points(90, *[ROW] * 6)).wire(0.08, points(96, ROW)).wire(0.09, points(0, ROW))
    script.wire(0.10, frame(CLEAR)).wire(0.11, points(0, ROW))
    results = [struct.unpack("<BHB", one.payload[1:]) for one in board(script, 0.13).of(DONE)]
    assert results[:9] == [(OK, 10 * k, 96 - 10 * k) for k in range(1, 10)]
    assert results[9:] == [(FULL, 90, 6), (OK, 96, 0), (FULL, 96, 0), (ORDER, 96, 0), (OK, 0, 96), (OK, 1, 95)]


@pytest.mark.parametrize("mask", [1, 2, 4, 8, 5, 10, 15])
def test_channels_are_those_asked_for_in_their_order(board, mask):
    counts = [100, 300, 500, 700]
    script = Script().wire(0.02, stream(mask, 1)).wire(0.03, pulse(3000, 20000))
    for channel, count in enumerate(counts):
        script.adc(0, channel, millivolt_of(count))
    log = board(script.wire(0.2, stream(mask, 2)).asking(0.21, 0.4), 0.4)
    wanted = [count for channel, count in enumerate(counts) if mask >> channel & 1]
    slow = [edge for edge in log.of(EDGE) if edge.payload[4]]
    assert len(slow) > 10
    assert {edge.payload[4:] for edge in slow} == {bytes([mask]) + struct.pack(f"<{len(wanted)}H", *wanted)}
    for one in log.of(SAMPLES):
        assert one.payload[0] == mask
        told = struct.unpack(f"<{len(one.payload) // 2}H", one.payload[1:])
        assert told == tuple(wanted) * (71 // (2 * len(wanted)))
    assert len(log.of(SAMPLES)) > 3


def test_a_change_of_what_is_streamed_leaves_nothing_behind(board):
    """Each of many changes, at any phase, is followed by frames of the new kind only."""
    script = Script().wire(0.02, pulse(3000, 6006))
    for channel in range(4):
        script.adc(0, channel, millivolt_of(100 * (channel + 1)))
    settings = [((k * 7) % 15 + 1, k % 3) for k in range(60)]
    for k, (mask, rate) in enumerate(settings):
        script.wire(0.05 + 0.03137 * k, stream(mask, rate))
    log, current = board(script, 2.0), None
    changes = iter(settings)
    for one in log.frames:
        if one.kind == DONE and one.payload[2:4] == b"\0\0" and one.time > 90000:
            current = next(changes)
        elif current and one.kind == EDGE:
            assert current[1] in (1, 2)
            assert one.payload[4] in ((0,) if current[1] == 2 else (0, current[0]))
        elif current and one.kind == SAMPLES:
            assert (one.payload[0], current[1]) == (current[0], 2)
        if one.kind in (EDGE, SAMPLES) and (mask := one.payload[4 if one.kind == EDGE else 0]):
            wanted = [100 * (channel + 1) for channel in range(4) if mask >> channel & 1]
            body = one.payload[5 if one.kind == EDGE else 1:]
            assert struct.unpack(f"<{len(body) // 2}H", body) == tuple(wanted) * (len(body) // 2 // len(wanted))
    assert next(changes, None) is None
