"""Two thermal masses behind the pulses: a stalled motor in closed form, steady state, cooling, what heat changes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import servotwin as st
from reference.drivetrain_cases import random_case
from validation.test_drivetrain_armature import LOCKED, SIMPLE, N, driven, undriven
from validation.test_drivetrain_reference import simulate

C_w, C_h, R_wh, R_ha, AMBIENT = 0.02, 0.06, 2.0, 3.0, 293.15
MASSES = {"winding_capacity": C_w, "housing_capacity": C_h, "winding_to_housing": R_wh, "housing_to_ambient": R_ha}
HEAT = {"thermal.ambient": AMBIENT} | {f"thermal.{name}": value for name, value in MASSES.items()}
COPPER, REFERENCE = 0.00385, 298.15  # 1/K, K
CURRENT, R_a = 0.9, SIMPLE["motor.armature_resistance"]  # what a regulator gives at most
LIMITED = LOCKED | HEAT | {"supply.current_limit": CURRENT}


def stalled_temperatures(age, start=(AMBIENT, AMBIENT)):
    """Exact: the current is constant, its heat i² R_a(T_w) linear in T_w, and so the system linear."""
    P = CURRENT**2 * R_a
    A = np.array([[(P * COPPER - 1.0 / R_wh) / C_w, 1.0 / R_wh / C_w],
                  [1.0 / R_wh / C_h, -(1.0 / R_wh + 1.0 / R_ha) / C_h]])
    b = np.array([P * (1.0 - COPPER * REFERENCE) / C_w, AMBIENT / R_ha / C_h])
    end = -np.linalg.solve(A, b)
    return np.array([end + expm(A * t) @ (np.array(start) - end) for t in np.atleast_1d(age)]).T


def test_a_stalled_motor_warms_as_two_masses_do():
    times = np.array([0.01, 0.05, 0.2, 0.6])
    result = simulate(driven(LIMITED, duration=0.6), times)
    assert np.all(result["armature_current"] == CURRENT)
    want = stalled_temperatures(times - drive_begin(LIMITED))
    np.testing.assert_allclose([result["winding_temperature"], result["housing_temperature"]], want, rtol=1e-12)
    assert want[0][-1] > AMBIENT + 9.0
    # The bus has to give what the warm winding takes.
    hot = R_a * (1.0 + COPPER * (result["winding_temperature"] - REFERENCE))
    np.testing.assert_allclose(result["bus_voltage"], hot * CURRENT, rtol=1e-13)


def drive_begin(values):
    result = simulate(driven(values, duration=0.005), np.array([0.005]))
    return next(event.time for event in result.events if event.kind == "drive forward")


@pytest.mark.long
def test_current_that_has_to_rise_first_warms_as_much():
    """With inductance the same, but for the rise: L/R_a of 0.1 ms in some 100 ms of each mass."""
    times = np.array([0.05, 0.2, 0.6])
    plain = simulate(driven(LIMITED, duration=0.6), times)
    slow = simulate(driven(LIMITED | {"motor.armature_inductance": 3e-4}, duration=0.6), times)
    gap = plain["winding_temperature"] - slow["winding_temperature"]
    assert np.all((gap > 0.0) & (gap < CURRENT**2 * R_a * 1e-4 / C_w))


def test_a_stalled_motor_ends_at_the_steady_temperatures():
    """Where all heat that comes in goes out: T_h = T_amb + R_ha P and T_w = T_h + R_wh P, P at that temperature."""
    end = 4.0  # s, more than ten of the slowest time constants
    assert st.physics.thermal_time_constants(**MASSES).slow < 0.35
    result = simulate(driven(LIMITED, duration=end), np.array([end]))
    T_w, T_h = result["winding_temperature"][0], result["housing_temperature"][0]
    power = CURRENT**2 * R_a * (1.0 + COPPER * (T_w - REFERENCE))
    want = st.physics.steady_temperatures(power, winding_to_housing=R_wh, housing_to_ambient=R_ha, ambient=AMBIENT)
    assert T_w == pytest.approx(want.winding, rel=1e-5)
    assert T_h == pytest.approx(want.housing, rel=1e-5)


@pytest.mark.long(but="None")
@pytest.mark.parametrize("inductance", [None, 3e-4])
def test_it_cools_by_two_exponentials_when_the_drive_ends(inductance):
    """One pulse's drive of 100 ms; from the last of the current on, the closed form without power."""
    error = 1.3e-3 * 0.44 * 0.2 - 0.5 * 8e-6
    values = LIMITED | {"electronics.stretcher_gain": 0.1 / error, "electronics.off_state": "coast"}
    times = np.array([0.11, 0.15, 0.3, 0.6])
    result = simulate(driven(values, duration=0.6).replace(motor__armature_inductance=inductance), times)
    assert result["armature_current"].tolist() == [0.0] * 4
    T_w, T_h = result["winding_temperature"], result["housing_temperature"]
    assert T_w[0] > AMBIENT + 4.0
    want = st.physics.two_mass_temperatures(times - times[0], 0.0, T_w[0], T_h[0], ambient=AMBIENT, **MASSES)
    np.testing.assert_allclose(T_w, want.winding, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(T_h, want.housing, rtol=0.0, atol=1e-8)


@pytest.mark.long(but="heat")
@pytest.mark.parametrize("terms", [{"heat"}, {"heat", "coast", "inductance"}, {"heat", "backlash", "limit"}],
                         ids=lambda terms: "+".join(sorted(terms)))
def test_what_the_copper_loses_is_what_warms(terms):
    """Insulated to the outside: C_w ΔT_w + C_h ΔT_h is the winding's loss, that of all pulses and not of their mean."""
    for seed in range(2):
        case = random_case(seed, frozenset(terms)).replace(thermal__housing_to_ambient=1e12)
        case = replace(case, duration=0.1)
        v, result = case.values, simulate(case, np.array([0.0, case.duration]))
        stored = (v["thermal.winding_capacity"] * np.ptp(result["winding_temperature"])
                  + v["thermal.housing_capacity"] * np.ptp(result["housing_temperature"]))
        assert stored == pytest.approx(result.energy.winding, rel=1e-9)
        assert np.ptp(result["winding_temperature"]) > 1.0


def test_a_hot_winding_takes_less_current():
    hot = driven(LOCKED | HEAT | {"thermal.winding_capacity": 1e9, "thermal.housing_capacity": 1e9},
                 initial={"winding_temperature": REFERENCE + 100.0})
    assert simulate(hot, np.array([0.1]))["armature_current"][0] == pytest.approx(2.0 / 1.385, rel=1e-9)


def test_warm_magnets_turn_faster_and_pull_less():
    """k_a and k_b both fall with the housing's temperature: no-load speed up, stall torque down, each by 10 %."""
    warm = {"thermal.winding_capacity": 1e9, "thermal.housing_capacity": 1e9, "thermal.magnet_coefficient": -2e-3}
    start = {"winding_temperature": REFERENCE, "housing_temperature": REFERENCE + 50.0}
    free = driven(HEAT | warm, initial=start, duration=0.6)
    free.initial["output_angle"] = -9.0
    assert simulate(free, np.array([0.6]))["output_speed"][0] == pytest.approx(6.0 / 0.9, rel=1e-9)
    held = driven(LOCKED | HEAT | warm, initial=start)
    assert simulate(held, np.array([0.1]))["motor_torque"][0] == pytest.approx(0.9 * 2.0 / N, rel=1e-9)


def test_a_servo_without_heat_has_no_temperatures():
    result = simulate(undriven(), np.array([0.1]))
    with pytest.raises(KeyError, match="winding_temperature"):
        result["winding_temperature"]
