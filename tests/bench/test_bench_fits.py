"""From the emulated bench to a fitted servo: two fixed servos; twenty are in benchmarks/bench/intervals.py."""

import math

import pytest

from bench_fits import FREE, judged
from servotwin.bench.emulator.process import harness
from servotwin.errors import BenchError

pytestmark = pytest.mark.long


@pytest.mark.parametrize(("seed", "rate"), [(3, "frame"), (4, "fast")])
def test_what_was_emulated_is_found_again(seed, rate):
    try:
        harness()
    except BenchError as error:
        pytest.skip(str(error))
    found = judged(seed, rate=rate, duration=3.0)
    ends = {name: off for name, off in found.off.items() if math.isfinite(off)}
    assert len(ends) == len(FREE)
    assert {name: off for name, off in ends.items() if abs(off) > 2.0} == {}
