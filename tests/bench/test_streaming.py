"""Emulated minutes of streaming four channels at 1 kHz: nothing is lost, and time goes on where it wraps."""

import numpy as np
import pytest

from servotwin.bench.backends import EmulatedBackend
from servotwin.bench.backends.emulated import StillPins
from servotwin.bench.emulator.process import harness
from servotwin.bench.wire import Board, protocol
from servotwin.errors import BenchError

pytestmark = pytest.mark.long


class Clock(StillPins):
    """A tap that tells the time, and a command that stays."""

    def voltage(self, channel, time):
        return (time % 1.0) * 2.5 if channel == "tap" else 1.0


def streamed(seconds):
    """Return starts and counts of all scans, and what was lost."""
    try:
        harness()
    except BenchError as error:
        pytest.skip(str(error))
    starts, taps = [], []

    def listen(message):
        if message.name == "samples":
            starts.append((message.time, len(message.values["counts"]) // 4))
            taps.extend(message.values["counts"][::4])

    board = Board(EmulatedBackend(Clock()), listen)
    board.open()
    words = protocol().words
    board.order("pulse", width=3000, period=40000)
    board.order("stream", mask=15, rate=words["rate"]["fast"], reference=words["reference"]["external"])
    start = board.time
    while board.time - start < seconds:
        board.wait(min(10.0, seconds))
    status = dict(board.order("ask"))
    lost = (board.splitter.bad, board.splitter.lost, status["dropped"], status["bad"], status["late"])
    board.close()
    return starts, np.array(taps), lost


@pytest.mark.parametrize("minutes", [1, pytest.param(10, marks=pytest.mark.slow)])
def test_a_stream_has_no_gap(minutes):
    starts, taps, lost = streamed(60.0 * minutes)
    assert lost == (0, 0, 0, 0, 0)
    times = np.array([time for time, _ in starts])
    counts = np.array([count for _, count in starts])
    np.testing.assert_allclose(np.diff(times), counts[:-1] * 1e-3, atol=1e-9)
    assert counts.sum() >= 59_900 * minutes
    steps = np.diff(taps.astype(int)) % 1024
    assert set(np.unique(steps)) <= {1, 2}  # 1.024 counts a scan
