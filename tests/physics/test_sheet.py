"""What a data sheet says about the motor: the relations hold both ways, and the HS-755HB's numbers come out."""

import csv
import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin.errors import ParameterError
from servotwin.physics import forward_efficiency
from servotwin.physics.sheet import (
    load_share,
    motor_from_sheet,
    no_load_current_of,
    sheet_efficiency,
    sheet_growth,
    sheet_resistance,
    sheet_stall_torque,
    sheet_torque_constant,
    stall_current_for,
)

HS_755HB = {"supply_voltage": 6.0, "stall_torque": 1.2945, "no_load_speed": math.pi / 3 / 0.23,
            "no_load_current": 0.285}
HS_311 = {"supply_voltage": 6.0, "stall_torque": 0.3432, "no_load_speed": math.pi / 3 / 0.15,
          "no_load_current": 0.18, "stall_current": 0.8}


def test_hs_755hb_without_stall_current():
    motor = motor_from_sheet(**HS_755HB)
    assert motor.resistance == pytest.approx(3.04, abs=0.005)
    assert motor.output_torque_constant == pytest.approx(1.04, abs=0.005)
    assert motor.stall_current == pytest.approx(1.84, abs=0.005)
    assert motor.gear_efficiency == 0.8
    assert motor.feasible


def test_hs_755hb_ranges_over_what_is_assumed():
    motors = [motor_from_sheet(**HS_755HB, gear_efficiency=eta, drop_voltage=drop)
              for eta, drop in itertools.product((0.7, 0.8, 0.9), (0.0, 0.2, 0.4))]
    for name, low, high, within in (("resistance", 2.75, 3.7, 0.03), ("output_torque_constant", 1.02, 1.12, 0.005),
                                    ("stall_current", 1.6, 2.0, 0.04)):
        found = [getattr(motor, name) for motor in motors]
        assert (min(found), max(found)) == pytest.approx((low, high), abs=within), name


def test_with_stall_current_the_efficiency_follows():
    motor = motor_from_sheet(**HS_311)
    assert motor.resistance == pytest.approx(5.6 / 0.8)
    assert motor.stall_current == pytest.approx(0.8)
    assert motor.output_torque_constant == pytest.approx((5.6 - 7.0 * 0.18) / (math.pi / 3 / 0.15))
    assert motor.gear_efficiency == pytest.approx(0.3432 / (motor.output_torque_constant * (0.8 - 0.18)))
    assert motor.feasible


@pytest.mark.parametrize(("change", "efficiency"), [
    # FT-7235 and RDS3115: sheets whose stall torque asks for more than their currents can give
    ({"supply_voltage": 8.4, "stall_torque": 3.3539, "no_load_speed": math.pi / 3 / 0.098, "no_load_current": 0.34,
      "stall_current": 3.6, "drop_voltage": 0.4}, 1.5),
    ({"supply_voltage": 5.0, "stall_torque": 1.3239, "no_load_speed": math.pi / 3 / 0.16, "no_load_current": 0.08,
      "stall_current": 1.3, "drop_voltage": 0.0}, 1.5),
])
def test_impossible_sheets_are_told(change, efficiency):
    motor = motor_from_sheet(**change)
    assert motor.gear_efficiency == pytest.approx(efficiency, abs=0.15)
    assert not motor.feasible


sheets = st.fixed_dictionaries({
    "supply_voltage": st.floats(4.0, 9.0), "stall_torque": st.floats(0.05, 4.0), "no_load_speed": st.floats(2.0, 25.0),
    "no_load_current": st.floats(0.02, 1.0), "drop_voltage": st.floats(0.0, 0.5),
    "gear_efficiency": st.floats(0.5, 1.0),
})


@given(sheets)
def test_the_solution_satisfies_all_three_relations(sheet):
    motor = motor_from_sheet(**sheet)
    U, I_0 = sheet["supply_voltage"] - sheet["drop_voltage"], sheet["no_load_current"]
    R, K_out, I_s = motor.resistance, motor.output_torque_constant, motor.stall_current
    assert R > 0.0
    assert K_out > 0.0
    assert I_s > I_0
    assert I_s == pytest.approx(U / R)
    assert sheet["no_load_speed"] == pytest.approx((U - R * I_0) / K_out)
    assert sheet["stall_torque"] == pytest.approx(motor.gear_efficiency * K_out * (I_s - I_0), rel=1e-6)


@given(sheets)
def test_both_branches_agree(sheet):
    motor = motor_from_sheet(**sheet)
    del sheet["gear_efficiency"]
    again = motor_from_sheet(**sheet, stall_current=motor.stall_current)
    assert again.resistance == pytest.approx(motor.resistance, rel=1e-9)
    assert again.output_torque_constant == pytest.approx(motor.output_torque_constant, rel=1e-6)
    assert again.gear_efficiency == pytest.approx(motor.gear_efficiency, rel=1e-6)
    assert again.coulomb_torque == pytest.approx(motor.coulomb_torque, rel=1e-6)


@given(sheets)
def test_coulomb_torque_and_gear_loss_share_the_no_load_current(sheet):
    motor = motor_from_sheet(**sheet)
    eta = motor.gear_efficiency
    mu = (1.0 - eta) / (1.0 + eta)
    assert eta == pytest.approx((1.0 - mu) / (1.0 + mu))
    assert motor.coulomb_torque == pytest.approx(
        motor.output_torque_constant * sheet["no_load_current"] * (1.0 - mu))


@pytest.mark.parametrize(("model", "low", "high"), [("FT-7235", 1.44, 1.52), ("RDS3115", 1.16, 1.65)])
def test_sheets_of_the_list_that_contradict_themselves(data_folder, model, low, high):
    """At no supply voltage and no drop can their currents make their stall torque."""
    with (data_folder / "servo_specs" / "servo_specs_by_voltage.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if model in row["model"] and row["stall_current_A"]
                and row["noload_running_current_A"]]
    assert rows
    for row, drop in itertools.product(rows, (0.0, 0.4)):
        motor = motor_from_sheet(
            supply_voltage=float(row["V"]), stall_torque=float(row["stall_torque_Nm"]),
            no_load_speed=math.pi / 3.0 / float(row["speed_s_per_60deg"]), drop_voltage=drop,
            no_load_current=float(row["noload_running_current_A"]), stall_current=float(row["stall_current_A"]))
        assert not motor.feasible
        assert low <= motor.gear_efficiency <= high


@pytest.mark.parametrize(("efficiency", "feasible"), [(0.499, False), (0.5, True), (1.0, True), (1.001, False)])
def test_what_is_feasible(efficiency, feasible):
    assert motor_from_sheet(**HS_755HB, gear_efficiency=efficiency).feasible is feasible


@pytest.mark.parametrize("efficiency", [1.0, 1.3])
def test_without_loss_in_the_gear_all_of_the_no_load_current_is_coulomb_friction(efficiency):
    motor = motor_from_sheet(**HS_755HB, gear_efficiency=efficiency)
    assert motor.coulomb_torque == pytest.approx(motor.output_torque_constant * HS_755HB["no_load_current"])


@pytest.mark.parametrize("torque", [1e-200, 1e200])
def test_the_small_root_is_found_without_overflow(torque):
    """A torque of next to nothing: R I_0 takes all the voltage. An absurd one: R is U²/(T_s ω_0/η_g)."""
    motor = motor_from_sheet(**(HS_755HB | {"stall_torque": torque}))
    power = torque * HS_755HB["no_load_speed"] / 0.8
    assert motor.resistance == pytest.approx(min(5.6 / 0.285, 5.6**2 / power), rel=1e-6)


@pytest.mark.parametrize(("change", "named"), [
    ({"supply_voltage": 0.0}, "supply_voltage"), ({"stall_torque": -1.0}, "stall_torque"),
    ({"no_load_speed": math.nan}, "no_load_speed"), ({"no_load_current": math.inf}, "no_load_current"),
    ({"gear_efficiency": 0.0}, "gear_efficiency"), ({"drop_voltage": 6.0}, "drop_voltage"),
    ({"drop_voltage": -0.1}, "drop_voltage"), ({"stall_current": 0.2}, "stall_current"),
    ({"stall_current": 0.0}, "stall_current"), ({"stall_current": 0.285}, "stall_current"),
])
def test_a_bad_sheet_is_refused_in_one_line(change, named):
    with pytest.raises(ParameterError) as caught:
        motor_from_sheet(**(HS_755HB | change))
    assert named in str(caught.value)
    assert caught.value.allowed
    assert "\n" not in str(caught.value)


@given(sheets)
def test_the_efficiency_in_closed_form_is_that_of_the_motor(sheet):
    motor = motor_from_sheet(**sheet)
    assert sheet_efficiency(sheet["supply_voltage"], sheet["stall_torque"], sheet["no_load_speed"],
                            sheet["no_load_current"], motor.stall_current, sheet["drop_voltage"]) == pytest.approx(
                                sheet["gear_efficiency"], rel=1e-5)


@given(sheets)
def test_the_stall_current_for_an_efficiency_is_that_of_the_motor(sheet):
    motor = motor_from_sheet(**sheet)
    found = stall_current_for(sheet["supply_voltage"], sheet["stall_torque"], sheet["no_load_speed"],
                              sheet["no_load_current"], sheet["gear_efficiency"], sheet["drop_voltage"])
    assert found == pytest.approx(motor.stall_current, rel=1e-6)
    assert found > sheet["no_load_current"]


@given(sheets, st.floats(0.0, 1.0))
def test_a_motor_has_the_speed_and_the_torque_of_its_sheet_whatever_is_viscous(sheet, share):
    V, V_d, I_0, eta, T_s, w_0 = (sheet[name] for name in (
        "supply_voltage", "drop_voltage", "no_load_current", "gear_efficiency", "stall_torque", "no_load_speed"))
    I_s = stall_current_for(V, T_s, w_0, I_0, eta, V_d, share)
    R = sheet_resistance(V, I_s, V_d)
    K = sheet_torque_constant(V, w_0, I_0, R, V_d)
    assert I_s > I_0
    if I_0 < 0.99 * I_s:  # else speed and torque are differences of nearly equal numbers
        friction = K * I_0 * (1.0 - load_share(eta))
        assert sheet_stall_torque(K, I_s, I_0, eta, share) == pytest.approx(T_s, rel=1e-6)
        again = no_load_current_of(V, R, K, (1.0 - share) * friction, share * friction / w_0, 1.0 - load_share(eta),
                                   V_d)
        assert again == pytest.approx(I_0, rel=1e-6)
        assert (V - V_d - R * again) / K == pytest.approx(w_0, rel=1e-5)


@given(st.floats(0.05, 1.0))
def test_the_share_of_friction_makes_the_efficiency(eta):
    assert forward_efficiency(load_share(eta), load_share(eta)) == pytest.approx(eta)


@given(sheets, st.floats(1.01, 2.0))
def test_torque_and_speed_of_one_motor_grow_alike(sheet, ratio):
    """The same motor, drop and friction at a higher voltage."""
    motor = motor_from_sheet(**sheet)
    V, V_d, I_0, K = sheet["supply_voltage"], sheet["drop_voltage"], sheet["no_load_current"], \
        motor.output_torque_constant
    U = V * ratio - V_d
    speed, torque = (U - motor.resistance * I_0) / K, sheet["gear_efficiency"] * K * (U / motor.resistance - I_0)
    growth = sheet_growth(V, ratio * V, V_d, I_0 / motor.stall_current)
    if I_0 < 0.99 * motor.stall_current:  # else nothing is left to grow from
        assert speed / sheet["no_load_speed"] == pytest.approx(growth, rel=1e-5)
        assert torque / sheet["stall_torque"] == pytest.approx(growth, rel=1e-3)
    assert growth >= ratio * (1.0 - 1e-12)
