"""A bench that goes as fast as it can goes on when a servo that has rested long begins to move."""

import pytest

from servotwin.web.lessons import lessons as taught
from servotwin.web.live import LiveBench
from servotwin.web.server import stint


@pytest.mark.parametrize("name", ["deadband", "droop", "frames"])
def test_rest_does_not_make_it_leap_into_motion(name, monkeypatch):
    monkeypatch.setattr(stint, "PATIENCE", 0.5)
    bench = LiveBench(taught.lesson(name).scene)
    going = stint.Stint(bench)
    pushes = 0
    while bench.time < 12.0 and going.broken is None:
        before = bench.time
        going.until(1e3, 120.0)
        pushes += 1
        assert bench.time > before
    assert going.broken is None
    assert pushes < 2000
