"""Servos that a page puts on the bench: of the catalog, or kept as they are."""

import pytest

from servotwin.errors import InputError
from servotwin.web.live import LiveBench, Scene, SceneServo
from servotwin.web.live.scene import with_servos

SCENE = Scene(servos=(SceneServo(mystery=7, model="PulseServo"),), load={"inertia": 1e-3}, frame_rate=100.0)


def test_servos_change_and_the_bench_around_them_stays():
    bench = LiveBench(SCENE)
    bench.advance(0.5, 10.0)
    new = LiveBench(with_servos(bench.scene(), [{"keep": 0, "model": "BoundedServo"},
                                                {"id": "towerpro-mg996r", "model": "DigitalServo"}]))
    assert [type(model).__name__ for model in new.models] == ["BoundedServo", "DigitalServo"]
    assert [model.servo.name for model in new.models] == ["mystery", "towerpro-mg996r"]
    assert (new.time, new.frame_rate, new.scene().load) == (0.0, 100.0, {"inertia": 1e-3})


def test_six_share_a_weak_battery():
    new = LiveBench(with_servos(SCENE, [{"keep": 0, "model": "PulseServo"}] * 6,
                                {"open_circuit_voltage": 6.0, "internal_resistance": 0.4}))
    new.do("command", {"shape": "hold", "unit": "us", "value": 1900.0})
    new.advance(0.1, 100.0)
    volts = [row[names.index("bus_voltage")] for row, names in zip(new.rows, new.columns, strict=True)]
    assert max(volts) < 5.0
    assert volts == pytest.approx([volts[0]] * 6, abs=1e-12)


@pytest.mark.parametrize(("asked", "supply"), [
    ([], None), ("all", None), ([{"keep": 1, "model": ""}], None), ([{"keep": True}], None), ([{"id": "nobody"}], None),
    ([{"keep": 0, "model": "FastServo"}], None), ([{"keep": 0}] * 7, None), ([{"keep": 0}], {"volts": 6.0}),
    ([{"keep": 0}], [6.0]), ([{"keep": 0}], {"open_circuit_voltage": "six"}), ([3], None)])
def test_what_cannot_be_is_told(asked, supply):
    with pytest.raises(InputError):
        LiveBench(with_servos(SCENE, asked, supply))
