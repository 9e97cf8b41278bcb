"""What a bench says of a shaft that does not come to rest: once, and not while something is done."""

import pytest

from servotwin.simulation.remarks import NOT_AT_REST
from servotwin.web.live import LiveBench, Scene, SceneServo

REGISTERS = {"P_Coefficient": 32, "D_Coefficient": 32, "Maximum_Acceleration": 254, "Acceleration": 254}
HOLD = {"shape": "hold", "unit": "deg", "value": 3.0}


def bench(friction: float) -> LiveBench:
    return LiveBench(Scene(servos=(SceneServo(id="feetech-sts3215-7v4", registers=REGISTERS,
                                              parameters={"friction.bearing_coulomb_torque": friction}),)))


def said(bench: LiveBench, until: float) -> list[tuple[float, str]]:
    found = []
    while bench.time < until:
        push = bench.advance(min(bench.time + 1.0 / 60.0, until), 120.0)
        found += [(time, kind) for time, kind, _ in push.events if kind.startswith(NOT_AT_REST)]
    return found


@pytest.mark.long
def test_a_bus_servo_without_friction_behind_its_play_is_told_once_and_again_after_an_action():
    """shared/cases/digital-servo-never-rests: about 0.7 deg at P 32."""
    swinging = bench(0.0)
    swinging.do("command", HOLD)
    first = said(swinging, 4.0)
    assert len(first) == 1
    assert first[0][1].startswith("does not come to rest: swings 0.7")
    swinging.do("command", HOLD | {"value": -3.0})
    assert len(said(swinging, 8.0)) == 1


@pytest.mark.parametrize("command", [HOLD, {"shape": "sine", "unit": "deg", "mean": 0.0, "amplitude": 5.0,
                                            "frequency": 2.0}], ids=["rests", "its command moves"])
def test_a_shaft_that_rests_or_is_told_to_move_is_not(command):
    resting = bench(3e-3)
    resting.do("command", command)
    assert said(resting, 4.0) == []
