"""What the source gives: a battery's sag, a regulator's limit, and what becomes of returned current."""

import numpy as np
import pytest

from reference.drivetrain_cases import random_case
from validation.test_drivetrain_armature import LOCKED, driven, undriven
from validation.test_drivetrain_reference import simulate

LIMIT = 0.9  # A
DROPS = {"supply.internal_resistance": 0.2, "supply.bridge_drop_voltage": 0.4, "supply.bridge_drop_resistance": 0.1,
         "motor.brush_drop_voltage": 0.3}


@pytest.mark.parametrize("inductance", [None, 3e-4])
@pytest.mark.parametrize("way", [1, -1])
def test_a_regulator_gives_a_stalled_motor_what_it_may(inductance, way):
    values = LOCKED | DROPS | {"supply.current_limit": LIMIT}
    result = simulate(driven(values, way=way, duration=0.05).replace(motor__armature_inductance=inductance),
                      np.linspace(0.02, 0.05, 7))
    assert np.all(result["armature_current"] == way * LIMIT)
    assert np.all(result["supply_current"] == LIMIT)
    np.testing.assert_allclose(result["bus_voltage"], 3.1 * LIMIT + 0.7, rtol=1e-14)
    assert any(event.kind == "current limited" for event in result.events) == (inductance is not None)


@pytest.mark.parametrize("inductance", [None, 3e-4])
def test_a_limit_above_the_stall_current_is_no_limit(inductance):
    case = driven(LOCKED | DROPS, duration=0.05).replace(motor__armature_inductance=inductance)
    times = np.linspace(0.0, 0.05, 101)
    free, limited = simulate(case, times), simulate(case.replace(supply__current_limit=2.0), times)
    np.testing.assert_allclose(limited["armature_current"], free["armature_current"], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(limited["bus_voltage"], free["bus_voltage"], rtol=1e-14)
    assert free["bus_voltage"][-1] == pytest.approx(6.0 - 0.2 * 5.3 / 3.3, rel=1e-12)


@pytest.mark.parametrize("inductance", [None, 1e-4])
def test_a_bus_breaks_down_but_never_below_zero(inductance):
    """Plugged at full speed the back-EMF alone drives more than the limit: the regulator can but let the bus fall."""
    case = driven(DROPS | {"supply.current_limit": LIMIT}, way=-1, initial={"output_speed": 6.0},
                  load={"inertia": 10.0}, duration=0.02).replace(motor__armature_inductance=inductance)
    result = simulate(case, np.array([0.015]))
    w = result["output_speed"][0]
    assert result["bus_voltage"][0] == 0.0
    assert -result["armature_current"][0] == pytest.approx((w - 0.7) / 3.1, rel=1e-4 if inductance else 1e-12)
    assert -result["armature_current"][0] > LIMIT


@pytest.mark.parametrize("inductance", [None, 3e-4])
@pytest.mark.parametrize("limit", [None, LIMIT])
def test_returned_current_lifts_a_battery_and_leaves_a_regulator(inductance, limit):
    """Driven the way that it turns, faster than the supply's voltage makes it: i flows back."""
    case = driven(DROPS, initial={"output_speed": 12.0}, load={"inertia": 10.0}, duration=0.02).replace(
        motor__armature_inductance=inductance, supply__current_limit=limit)
    result = simulate(case, np.array([0.015]))
    i, w = result["armature_current"][0], result["output_speed"][0]
    assert i == pytest.approx((6.0 + 0.7 - w) / (3.3 if limit is None else 3.1), rel=1e-4 if inductance else 1e-12)
    assert result["supply_current"][0] == i < 0.0
    if limit is None:
        assert result["bus_voltage"][0] == pytest.approx(6.0 - 0.2 * i, rel=1e-14)
    else:
        assert result["bus_voltage"][0] == 6.0
    assert result.energy.supply < 0.0


@pytest.mark.parametrize("inductance", [None, 3e-4])
@pytest.mark.parametrize("limit", [None, LIMIT])
def test_diodes_return_as_much(inductance, limit):
    case = undriven(DROPS | {"electronics.off_state": "coast"}, initial={"output_speed": -12.0}, load={"inertia": 10.0},
                    duration=0.02).replace(motor__armature_inductance=inductance, supply__current_limit=limit)
    result = simulate(case, np.array([0.015]))
    i, w = result["armature_current"][0], result["output_speed"][0]
    assert i == pytest.approx((-w - 6.7) / (3.2 if limit is None else 3.0), rel=1e-4 if inductance else 1e-12)
    assert result["supply_current"][0] == -i < 0.0
    assert result["bus_voltage"][0] == pytest.approx(6.0 + (0.2 * i if limit is None else 0.0), rel=1e-14)


@pytest.mark.parametrize("terms", [{"limit"}, {"limit", "coast"}, {"limit", "inductance"},
                                   {"limit", "inductance", "coast"}], ids=lambda terms: "+".join(sorted(terms)))
def test_a_regulator_keeps_its_limits_in_any_run(terms):
    bound = broken = 0
    for seed in range(12):
        case = random_case(seed, frozenset(terms))
        result = simulate(case, np.linspace(0.0, case.duration, 1001))
        limit, V_oc = case.values["supply.current_limit"], case.values["supply.open_circuit_voltage"]
        given, bus = result["supply_current"], result["bus_voltage"]
        assert np.all((bus >= 0.0) & (bus <= V_oc))
        assert np.all(bus[given > limit * (1.0 + 1e-12)] == 0.0)
        assert np.all(bus[given < 0.0] == V_oc)
        bound, broken = bound + int(np.sum(given == limit)), broken + int(np.sum(bus == 0.0))
    assert bound > 1000
    assert (broken > 0) == ("coast" in terms)  # a brake takes the speed that a reversed drive would meet
