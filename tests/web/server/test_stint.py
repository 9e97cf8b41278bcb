"""A bench that goes as fast as it can takes no leap from rest into the motion that follows, which costs far more."""

import pytest

from servotwin.web.lessons import lessons as taught
from servotwin.web.live import LiveBench
from servotwin.web.server.session import Stint


@pytest.mark.parametrize("name", ["deadband", "droop", "frames"])
def test_rest_makes_stretches_no_longer_than_motion_bears(name, monkeypatch):
    bench = LiveBench(taught.lesson(name).scene)
    going, stretches, advance = Stint(bench), [], bench.advance

    def watched(until, points):
        stretches.append(until - bench.time)
        return advance(until, points)

    monkeypatch.setattr(bench, "advance", watched)
    while bench.time < 12.0 and going.broken is None:
        going.until(1e3, 120.0)
    assert going.broken is None
    assert max(stretches) < 0.11


def test_a_target_right_behind_an_edge_is_not_tried_again_and_again(monkeypatch):
    bench = LiveBench(taught.lesson("droop").scene)
    bench.advance(0.2, 100.0)
    going, tries, advance = Stint(bench), [], bench.advance

    def watched(until, points):
        tries.append(until)
        return advance(until, points)

    monkeypatch.setattr(bench, "advance", watched)
    going.until(0.2 + 1e-13, 100.0)
    assert not tries
