"""The paper's control circuit at the bench: the same pulses and angles as `bench.run_on_one_supply`."""

import random

import numpy as np
import pytest

import servotwin as st
from servotwin import bench
from servotwin.errors import InputError
from servotwin.web.live import LiveBench, read_scene, replay

TEXT = """format = 1
frame_rate = 61.03515625
end = 1.0
actions = [[0.0, "command", {{shape = "hold", value = 0.609, unit = "V"}}],
           [0.1, "command", {{shape = "hold", value = 1.425, unit = "V"}}]]
[[servo]]
id = "hitec-hs-755hb"
model = "PulseServo"
parameters = {{"supply.internal_resistance" = 0.5, "electronics.frame_period" = 0.016384}}
[control]
{control}
"""


@pytest.mark.parametrize("control", [{}, {"command_share": 0.0}, {"sampling_delay": 0.01}, {"reference_share": 1.0}])
def test_pulses_and_angles_are_those_of_the_bench(control):
    servo = bench.bench_servo(st.load_servo("hitec-hs-755hb")).replace({"supply.internal_resistance": 0.5})
    command = st.signals.step(0.609, 1.425, at=0.1, unit="V")
    expected = bench.run_on_one_supply(bench.Bench(st.PulseServo(servo)), command, 1.0, bench.ControlSupply(**control))
    numbers = {"command_share": 1.0} | control
    text = TEXT.format(control="\n".join(f"{key} = {value}" for key, value in numbers.items()))
    run = replay(text, output_step=0.01)
    widths = [bench.PulseGenerator().width(count) for count in expected.counts]
    np.testing.assert_allclose(run.pulses[0][:, 1], widths[:len(run.pulses[0])], atol=1e-12)
    np.testing.assert_allclose(run[0]["output_angle"], expected.result.at("output_angle", run[0]["time"]), atol=1e-9)
    live, pace = LiveBench(read_scene(text)), random.Random(3)
    while live.time < 1.0:
        live.advance(min(1.0, live.time + pace.choice([1e-4, 1 / 60, 0.05])), 100.0)
    assert dict(zip(live.columns[0], live.rows[0], strict=True))["output_angle"] == pytest.approx(
        run[0]["output_angle"][-1], abs=1e-9)


def test_a_command_that_the_circuit_cannot_read_is_refused():
    live = LiveBench(read_scene(TEXT.format(control="command_share = 1.0")))
    with pytest.raises(InputError, match="allowed: V"):
        live.do("command", {"shape": "hold", "unit": "us", "value": 1500.0})
    with pytest.raises(InputError, match="frames that a pulse fits into"):
        live.do("frames", {"rate": 350.0})
    with pytest.raises(InputError, match="command_share"):
        live.do("control", {"command_share": 2.0})
    with pytest.raises(InputError, match="sampling_delay"):
        live.do("control", {"sampling_delay": 0.014})
    with pytest.raises(InputError, match="one of pulses"):
        LiveBench(read_scene(TEXT.format(control="command_share = 1.0").replace("PulseServo", "BoundedServo")))
