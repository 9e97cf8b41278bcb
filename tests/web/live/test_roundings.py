"""Regression: a scene with a time a rounding behind the edge of a frame went on for ever."""

import pytest

from servotwin.web.live import LiveBench, read_scene, replay

TEXT = """format = 1
end = {end!r}
actions = [[0.0, "command", {{shape = "hold", value = 60.0, unit = "deg"}}],
           [{when!r}, "command", {{shape = "hold", value = 90.0, unit = "deg"}}]]
servo = [{{id = "hitec-hs-755hb"}}]
"""
ROUNDED = 0.1 + 0.2  # not 0.3, the edge of the 15th frame


@pytest.mark.parametrize("end", [ROUNDED, 0.5])
@pytest.mark.parametrize("when", [0.1, ROUNDED, 0.3 - 1e-14])
def test_times_right_beside_an_edge_are_the_edge(when, end):
    run = replay(TEXT.format(when=when, end=end), output_step=0.01)
    assert run[0]["time"][-1] == pytest.approx(end, abs=1e-12)
    exact = replay(TEXT.format(when=round(when, 6), end=round(end, 6)), output_step=0.01)
    assert run[0]["output_angle"][-1] == pytest.approx(exact[0]["output_angle"][-1], abs=1e-9)
    assert len(run.pulses[0]) == len(exact.pulses[0])


def test_a_bench_that_has_come_there_is_there():
    bench = LiveBench(read_scene(TEXT.format(when=0.1, end=0.0)))
    assert bench.advance(ROUNDED, 100.0).time == 0.3
    assert bench.reached(ROUNDED)
    assert not bench.reached(0.3 + 1e-9)
