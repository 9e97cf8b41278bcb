"""Mode "paper": the bench of the paper without a computer, and what its display shows."""

import struct
from itertools import pairwise

import pytest

from board_talk import (
    CYCLES_PER_TICK,
    DONE,
    EDGE,
    LIMP,
    MODE,
    STATUS,
    Script,
    frame,
    millivolt_of,
    points,
    pulse,
    screens,
    stream,
)

TABLE_II = {250: 646, 411: 1078, 582: 1526, 748: 1974, 920: 2438}  # ADC_i -> t_a us
PERIOD = 32768
MODE_RESULT, OK = 6, 0


def width_us(count):
    return 16 * max((count - 1) // 6 - 1, 0) + 6


def text_in_paper(command, tap):
    """The formulas of firmware/README.md."""
    v_i = (100000 * command + 152480) // 40960
    v_o = (100000 * tap + 4431632) // 43265
    q = (1000 * v_o - 587800 + 3662) // 7324
    return (f"{v_i // 1000}.{v_i % 1000:03d}{command:4d} {width_us(command):4d}us"
            f"{v_o // 1000}.{v_o % 1000:03d}{tap:4d} 61{q:4d}")


def test_widths_and_readings_are_the_papers(board):
    script, taps = Script(jumper=True), (212, 350, 497, 636, 782)
    for k, (command, tap) in enumerate(zip(TABLE_II, taps, strict=True)):
        script.adc(0.6 * k, 3, millivolt_of(command)).adc(0.6 * k, 0, millivolt_of(tap))
    log = board(script, 3.0)
    assert len(log.pulses) > 170
    assert {b[0] - a[0] for a, b in zip(log.pulses, log.pulses[1:], strict=False)} == {PERIOD * CYCLES_PER_TICK}
    widths = list(dict.fromkeys(wide for _, wide in log.pulses))
    assert widths == [16 * us for us in TABLE_II.values()]
    shown = [text for _, text in screens(log.display)]
    assert len(shown) >= 10  # four times a second
    for command, tap in zip(TABLE_II, taps, strict=True):
        assert text_in_paper(command, tap) in shown
    assert "1.424 582 1526us1.251 497 61  91" in shown
    assert 3 <= len(shown) / 2.9 <= 4.2


@pytest.mark.parametrize("first", [13, 512, 1011])
def test_each_step_of_the_generator(board, first):
    counts = range(first, first + 13)
    script = Script(jumper=True)
    for k, count in enumerate(counts):
        script.adc(0.05 * k, 3, millivolt_of(min(count, 1023)))
    log = board(script, 0.05 * 13 + 0.05)
    assert {wide // 16 for _, wide in log.pulses} == {width_us(min(count, 1023)) for count in counts}
    assert {wide % 16 for _, wide in log.pulses} == {0}


@pytest.mark.long
def test_the_shortest_pulses_become_at_most_a_little_longer(board):
    """Below 13 counts a pulse has 6 us, less than an interrupt may wait: firmware/README.md says how much is added."""
    script = Script(jumper=True).adc(0, 3, millivolt_of(5)).wire(0.1, stream(15, 2)).asking(0.15, 8.0, every=0.005)
    widths = [wide / 16 for _, wide in board(script, 8.0).pulses]
    assert min(widths) >= 6.0
    assert max(widths) <= 40.0
    print(f"6 us became {min(widths)} to {max(widths)} us")


def test_it_needs_no_computer_and_obeys_only_torque_off_and_a_change_of_mode(board):
    script = Script(jumper=True).adc(0, 3, millivolt_of(582)).wire(0.2, stream(1, 1))
    orders = [pulse(3000, 40000), points(0, (1, 3000, 40000)), frame(4), frame(5, struct.pack("<I", 1))]
    for k, order in enumerate(orders):
        script.wire(0.3 + 0.01 * k, order)
    script.wire(2.5, frame(8)).wire(2.6, frame(LIMP)).wire(2.9, frame(8)).wire(3.0, pulse(3000, 40000))
    script.wire(3.3, frame(MODE, bytes([1]))).wire(3.5, frame(MODE, bytes([2]))).wire(3.6, frame(MODE, bytes([0])))
    log = board(script, 4.0)
    assert [one.payload[1] for one in log.of(DONE)] == [OK, *[MODE_RESULT] * 4, OK, OK, OK, 3, OK]
    assert [tuple(one.payload[1:3]) for one in log.of(STATUS)] == [(1, 1), (0, 0)]
    ups = [up / 16e6 for up, _ in log.pulses]
    assert max(b - a for a, b in pairwise(ups) if b < 2.6) < 0.0164  # 1 s of silence is none here
    assert not [up for up in ups if 2.62 < up < 3.0 or 3.64 < up]
    assert {wide // CYCLES_PER_TICK for up, wide in log.pulses if 3.01 * 16e6 < up < 3.29 * 16e6} == {3000}
    assert {wide // CYCLES_PER_TICK for up, wide in log.pulses if 3.35 * 16e6 < up} == {3052}
    # Channels asked for are told in it, and only those
    told = [edge for edge in log.of(EDGE) if edge.payload[4]]
    assert told
    assert {len(edge.payload) for edge in told} == {7}


@pytest.mark.parametrize(("mask", "expected"), [
    (0, "-.--- --- 1500us-.--- --- 50 ---"),
    (8, "1.422 583 1500us-.--- --- 50 ---"),
    (9, "1.422 583 1500us0.999 409 50  56"),
])
def test_readings_in_mode_computer(board, mask, expected):
    script = Script().adc(0, 3, millivolt_of(583)).adc(0, 0, 1000)
    log = board(script.wire(0.02, stream(mask, 1)).wire(0.03, pulse(3000, 40000)).asking(0.05, 1.0), 0.9)
    command = round(583 * 2500 / 1024)
    assert f"1.{command % 1000:03d}" == "1.423"
    assert screens(log.display)[-1][1] == expected.replace("1.422", "1.423")
