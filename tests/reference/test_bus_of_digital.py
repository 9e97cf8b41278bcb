"""The reference of digital servos on one supply against the one of a single servo, its other way to go on, and sums."""

import math

import numpy as np
import pytest

from leg_cases import SERVOS, goals_of, values_of
from reference import digital, digital_bus, digital_bus_flow
from reference.digital_bus import One
from reference.drivetrain_circuit import Source

TIMES = np.arange(100) * 1e-3 + 3.7e-4
END = float(TIMES[-1])
FREE = {"firmware.speed_limit": None, "firmware.acceleration_limit": None}
SERVO = SERVOS["12 V"].replace(FREE)
WARM = {"thermal.winding_capacity": 4.0, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 8.0,
        "thermal.housing_to_ambient": 20.0, "thermal.magnet_coefficient": -0.0015, "thermal.ambient": 298.15}


def told(seed, servo=SERVO, **more):
    at, goals = goals_of("new every 20 ms", seed, 0.15)
    return One(values_of(servo), list(zip(at.tolist(), goals.tolist(), strict=True)), 1e-3 * (1 + seed),
               ((0.0, 0.1 * seed),), 0.1, **more)


def off(one, other):
    return max(np.abs(getattr(a, name) - getattr(b, name)).max() for a, b in zip(one.servos, other.servos, strict=True)
               for name in ("output_angle", "motor_angle", "current"))


@pytest.mark.long(but="changes0-1.0")
@pytest.mark.parametrize("limit", [None, 1.0])
@pytest.mark.parametrize("changes", [{}, {"motor.brush_drop_voltage": 0.2, "supply.bridge_drop_resistance": 0.3,
                                          "firmware.off_state": "diode", "firmware.control_phase": 4e-4}])
def test_one_servo_on_a_bus_is_the_servo_alone(limit, changes):
    own = {"supply.internal_resistance": 0.6, "supply.current_limit": limit}
    one = told(1, SERVO.replace(own | changes))
    alone = digital.run(one.values, {"kind": "goal", "pieces": [(*goal, 0.0) for goal in one.goals]},
                        {"inertia": one.inertia, "torque": one.torques[0][1]}, END, TIMES, initial_angle=0.1)
    bus = digital_bus.run([one], Source(12.0, 0.6, *([limit] if limit else [])), END, TIMES)
    trace = bus.servos[0]
    assert np.abs(trace.output_angle - alone.output_angle).max() < 1e-12
    assert np.abs(trace.current - alone.current).max() < 1e-10
    assert np.abs(bus.bus_voltage - alone.bus_voltage).max() < 1e-10
    for name, energy in trace.energy.items():
        assert energy == pytest.approx(alone.energy[name], abs=1e-12)


@pytest.mark.long
def test_the_series_and_steps_of_an_integrator_go_the_same_way(monkeypatch):
    ones = [told(seed) for seed in range(3)]
    series = digital_bus.run(ones, Source(12.0, 0.8), END, TIMES)
    monkeypatch.setattr(digital_bus, "straight", lambda P: False)
    steps = digital_bus.run(ones, Source(12.0, 0.8), END, TIMES)
    assert off(series, steps) < 1e-10
    assert not digital_bus_flow.straight(digital_bus.make_plant(
        {"electronics.off_state": "brake", **{f"{g}.{n}": x for g, rows in values_of(SERVO.replace(WARM)).items()
                                              for n, x in rows.items()}}, {"inertia": 1e-3}))


@pytest.mark.long
def test_servos_with_masses_that_hardly_get_warm_are_cold_ones():
    large = {name: 1e9 if name.endswith("capacity") else value for name, value in WARM.items()}
    cold = digital_bus.run([told(0), told(1)], Source(12.0, 0.8), END, TIMES)
    warm = digital_bus.run([told(k, SERVO.replace(large)) for k in range(2)], Source(12.0, 0.8), END, TIMES)
    assert off(cold, warm) < 1e-8
    warm = digital_bus.run([told(k, SERVO.replace(WARM)) for k in range(2)], Source(12.0, 0.8), END, TIMES)
    for trace in warm.servos:  # heat that the copper took, as far as it has not gone on
        rise = trace.winding_temperature[-1] - 298.15
        kept = 4.0 * rise + 30.0 * (trace.housing_temperature[-1] - 298.15)
        assert rise > 0.1
        assert kept == pytest.approx(trace.energy["winding"], rel=1e-3)


@pytest.mark.parametrize("source", [Source(12.0, 1.2), Source(12.0, 0.3, 1.5)])
def test_sums_close_whoever_is_unplugged(source):
    ones = [told(0), told(1), told(2, off=((0.04, math.inf),))]
    traces = digital_bus.run(ones, source, END, TIMES)
    drawn = np.sum([trace.supply_current for trace in traces.servos], axis=0)
    if math.isinf(source.I_max):
        np.testing.assert_allclose(traces.bus_voltage, 12.0 - 1.2 * drawn, rtol=0.0, atol=1e-12)
    assert drawn.max() <= source.I_max + 1e-12
    for trace in traces.servos:
        spent = sum(energy for name, energy in trace.energy.items() if name != "supply")
        assert spent == pytest.approx(trace.energy["supply"], abs=1e-11)
    assert math.isnan(traces.servos[2].ticks[-1].duty)
