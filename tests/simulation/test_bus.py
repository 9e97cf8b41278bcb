"""`simulate_bus`: what servos on one supply do to each other, and what the call refuses."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, UnknownNameError

BATTERY = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.4)


@pytest.fixture(scope="module")
def model():
    return st.PulseServo(st.load_servo("hitec-hs-755hb"))


def step(angle=60.0):
    return st.signals.step(0.0, angle, at=0.05, unit="deg")


def test_twins_on_one_bus_are_one_servo_on_twice_the_resistance(model):
    twins = st.simulate_bus({"a": (model, step()), "b": (model, step())}, supply=BATTERY, duration=0.6)
    servo = model.servo.replace({"supply.open_circuit_voltage": 6.0, "supply.internal_resistance": 0.8})
    one = st.simulate(st.PulseServo(servo), step(), duration=0.6)
    for result in twins.values():
        np.testing.assert_allclose(result["output_angle"], one["output_angle"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(twins.supply_current, 2.0 * one["supply_current"], rtol=0.0, atol=1e-9)


def test_on_a_stiff_source_nobody_notices_the_others(model):
    fleet = st.simulate_bus({"a": (model, step(60.0)), "b": (model, step(20.0), st.loads.Constant(0.2))},
                            supply=st.Supply(open_circuit_voltage=6.0), duration=0.5)
    servo = model.servo.replace({"supply.open_circuit_voltage": 6.0, "supply.internal_resistance": 0.0})
    alone = st.simulate(st.PulseServo(servo), step(60.0), duration=0.5)
    np.testing.assert_allclose(fleet["a"]["output_angle"], alone["output_angle"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(fleet.bus_voltage, 6.0, rtol=1e-14)


def test_the_bus_sags_by_the_current_of_all(model):
    fleet = st.simulate_bus({name: (model, step()) for name in "abcd"}, supply=BATTERY, duration=0.3)
    np.testing.assert_allclose(fleet.bus_voltage, 6.0 - 0.4 * fleet.supply_current, rtol=0.0, atol=1e-9)
    assert fleet.bus_voltage.min() < 4.5


def test_a_regulator_gives_no_more_than_its_most(model):
    regulator = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.1, current_limit=1.5)
    fleet = st.simulate_bus({name: (model, step()) for name in "ab"}, supply=regulator, duration=0.3)
    assert fleet.supply_current.max() == pytest.approx(1.5, abs=1e-9)
    assert fleet.bus_voltage.min() >= 0.0


def test_a_neighbour_disturbs_the_measure_through_the_supply(model):
    coupled = st.PulseServo(model.servo.replace({"electronics.supply_coupling": 0.05}))
    hold = st.signals.constant(30.0, unit="deg")
    # The neighbour drives fully while the other measures: its frames begin in the middle of the other's
    busy = st.signals.pulse_train([0.01 + 0.02 * k for k in range(20)], [2200.0] * 20)
    fleet = st.simulate_bus({"holds": (coupled, hold), "busy": (model, busy)}, supply=BATTERY, duration=0.4,
                            initial={"busy": {"output_angle": 0.2}})
    assert np.ptp(fleet["holds"]["output_angle"]) > math.radians(0.2)
    quiet = st.simulate_bus({"holds": (model, hold), "busy": (model, busy)}, supply=BATTERY, duration=0.4,
                            initial={"busy": {"output_angle": 0.2}})
    assert np.ptp(quiet["holds"]["output_angle"]) == 0.0


def test_a_fleet_is_a_mapping_of_results(model):
    fleet = st.simulate_bus({"a": (model, step()), "b": (model, step(), st.loads.Inertia(1e-3))}, supply=BATTERY,
                            duration=0.1)
    assert list(fleet) == ["a", "b"]
    assert len(fleet) == 2
    assert "a" in fleet
    assert fleet["b"].load.total_inertia == 1e-3
    with pytest.raises(KeyError, match="a, b"):
        fleet["c"]


@pytest.mark.parametrize(("servos", "more", "message"), [
    ({}, {}, "a mapping of names"),
    ([], {}, "a mapping of names"),
    ({"a": 3}, {}, "servo 'a'"),
    ({"a": ("model", "command")}, {}, "model of servo 'a'"),
    ({"a": "bounded"}, {}, "PulseServoInductive or DigitalServo"),
    ({"a": "pulse"}, {"supply": None}, "supply"),
    ({"a": "pulse"}, {"supply": st.Supply(internal_resistance=1.0)}, "open_circuit_voltage"),
    ({"a": "pulse"}, {"supply": st.Supply(open_circuit_voltage=6.0, bridge_drop_voltage=0.2)}, "each servo"),
    ({"a": "pulse"}, {"duration": math.nan}, "duration"),
    ({"a": "pulse"}, {"initial": {"b": {}}}, "servo of initial"),
])
def test_bad_input(model, servos, more, message):
    known = {"pulse": (model, step()), "bounded": (st.BoundedServo(model.servo), step())}
    if isinstance(servos, dict):
        servos = {name: known.get(parts, parts) if isinstance(parts, str) else parts for name, parts in servos.items()}
    with pytest.raises((InputError, UnknownNameError), match=message):
        st.simulate_bus(servos, **{"supply": BATTERY, "duration": 0.1} | more)
