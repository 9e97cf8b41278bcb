"""`st.curves` and `st.servos_that_lift`: contracts, and what they say of known servos."""

import itertools
import math

import numpy as np
import pytest

import servotwin as st
from servotwin.datasheet.holding import at_temperatures, at_voltage
from servotwin.datasheet.sheet import bandwidths
from servotwin.errors import InputError
from servotwin.physics.thermal import Temperatures, winding_resistance


@pytest.fixture(scope="module")
def sheet():
    with pytest.warns(UserWarning, match="contradicts itself"):
        return st.curves(st.PulseServo(st.load_servo("towerpro-mg995")), voltage=[4.8, 6.0], bandwidth=False)


@pytest.mark.long
def test_curves_run_from_standing_to_turning_freely(sheet):
    for part in sheet.voltages:
        for curve in (part.cold, part.hot):
            assert curve.speed[0] == 0.0
            assert curve.torque[-1] == 0.0
            assert curve.torque[0] == curve.stall_torque
            assert np.all(np.diff(curve.torque) < 0.0)
            np.testing.assert_allclose(curve.power, curve.torque * curve.speed, rtol=1e-12)
            assert 0.0 < curve.best_efficiency.efficiency < 1.0
            point = curve.at(curve.torque[40])
            assert point.speed == pytest.approx(curve.speed[40], rel=1e-9)
            assert point.efficiency == pytest.approx(curve.efficiency[40], rel=1e-9)


@pytest.mark.long
def test_what_is_hot_is_weaker_and_draws_less(sheet):
    for part in sheet.voltages:
        assert part.hot.stall_torque < part.cold.stall_torque
        assert part.hot.stall_current == pytest.approx(part.cold.stall_current / 1.28875, rel=1e-9)
        assert part.hot.temperatures.winding == 373.15
        assert 298.15 < part.hot.temperatures.housing < 373.15


def test_what_the_sheet_prints_stands_beside(sheet):
    assert [point.stall_torque for point in sheet.at(6.0).printed] == [1.079, 1.471]
    assert [point.stall_current for point in sheet.at(4.8).printed] == [None, None]
    servo = st.load_servo("towerpro-mg995")  # whose sheet contradicts itself: of 1.079 N m its motor has 74 %
    motor, gear, friction = servo.motor, servo.gear, servo.friction
    stall = motor.torque_constant * (6.0 - servo.supply.bridge_drop_voltage) / motor.armature_resistance
    torque = gear.gear_reduction * (stall - friction.coulomb_torque_forward)  # N (k_a i_a - F), at the output
    assert sheet.at(6.0).cold.stall_torque == pytest.approx(torque, rel=1e-9)
    assert torque == pytest.approx(0.739 * 1.079, rel=1e-3)
    with pytest.raises(InputError, match=r"4.8, 6 V, which were computed"):
        sheet.at(5.0)


def test_holding_errors_grow_with_the_load(sheet):
    for part in sheet.voltages:
        errors = [held.error for held in part.holding]
        assert len(errors) == 5
        assert all(a <= b for a, b in itertools.pairwise(errors))
        assert errors[0] < errors[-1]


def test_without_deadband_and_friction_small_sines_have_the_bandwidth_of_the_loop(servo):
    model = st.BoundedServo(servo.replace({
        "friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0,
        "electronics.voltage_deadband": 0.0}))
    found = bandwidths(model, (0.03, 0.8), tuple(np.geomspace(20.0, 120.0, 6)))
    loop = st.linear.transfer_function(model, input="command_angle")
    assert found[0].amplitude == 0.03
    assert abs(loop(2j * math.pi * found[0].frequency)) == pytest.approx(math.sqrt(0.5), rel=0.03)
    assert found[-1].frequency < found[0].frequency  # the supply ends


def test_another_voltage_scales_the_mean_bridge(servo):
    model = at_voltage(st.BoundedServo(servo), 4.8)
    assert model.servo.electronics.bridge_gain == pytest.approx(servo.electronics.bridge_gain * 4.4 / 5.6, rel=1e-12)
    pulses = at_voltage(st.PulseServo(servo), 4.8).averaged()
    assert model.servo.electronics.bridge_gain == pytest.approx(pulses.servo.electronics.bridge_gain, rel=2e-3)


def test_temperatures_change_copper_and_magnets_once(servo):
    heated = st.PulseServo(servo.replace({
        "thermal.winding_capacity": 2.0, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 10.0,
        "thermal.housing_to_ambient": 16.0}))
    warm = at_temperatures(heated, Temperatures(373.15, 323.15), -0.002)
    assert warm.servo.motor.armature_resistance == winding_resistance(373.15, servo.motor.armature_resistance)
    assert warm.servo.motor.torque_constant == pytest.approx(0.95 * servo.motor.torque_constant, rel=1e-12)
    assert not warm.heats


@pytest.mark.long(but="options1-voltage: got nan")
@pytest.mark.parametrize(("options", "said"), [
    ({"voltage": 0.0}, "got 0.0, allowed: a positive number"),
    ({"voltage": math.nan}, "voltage: got nan"),
    ({"voltage": []}, "voltage: got 'none'"),
    ({"voltage": "6"}, "voltage: got '6'"),
    ({"voltage": 12.1}, "up to 12, twice the highest of the sheet"),
    ({"voltage": 0.3}, "does not turn at 0.3 V"),
    ({"lift": (-1.0, 0.1)}, "lift mass: got -1.0"),
    ({"lift": (1.0, 0.0)}, "lift arm: got 0.0"),
    ({"lift": (1.0, math.inf)}, "lift arm: got inf"),
    ({"lift": (1e300, 1e300)}, "a torque that a number holds"),
    ({"hot": 200.0}, "at least 298.15 K"),
])
def test_bad_input_is_named(servo, options, said):
    with pytest.raises(InputError, match=said):
        st.curves(st.PulseServo(servo), **options, bandwidth=False)


def test_only_models_have_curves(servo):
    with pytest.raises(InputError, match="a model of a servo"):
        st.curves(servo)
    with pytest.raises(InputError, match="a model with a supply"):
        st.curves(st.AveragedServo(servo), bandwidth=False)


@pytest.mark.long
def test_which_servos_lift_is_what_each_of_them_says():
    found = st.servos_that_lift(0.3, 0.1, voltage=6.0, time=0.5)
    assert len(found.found) + len(found.refused) == len(st.catalog_names())
    weights = [each.mass for each in found.found]
    known = [mass for mass in weights if not math.isnan(mass)]
    assert known == sorted(known) == weights[:len(known)]  # unknown ones last
    assert all(each.margin > 1.0 and each.time <= 0.5 for each in found.found)
    assert {each.kind for each in found.refused} == {"torque", "time", "voltage"}
    best = found.found[0]
    drive = st.datasheet.FullDrive(at_voltage(st.models.default_model(best.servo), 6.0))
    assert best.most_torque == min(drive.stall_torque, drive.starting_torque)
    for kind in ("digital", "bus"):
        those = [each for each in found.found if each.servo.kind == kind]
        assert those
        assert all(kind in each.notes for each in those)


def test_which_knows_voltages_and_unknown_masses():
    light = [st.load_servo(name) for name in ("hitec-hs-425bb", "hitec-hs-422", "emax-es08a", "dsservo-rds3115")]
    found = st.servos_that_lift(0.05, 0.05, voltage=6.5, servos=light)
    assert [each.servo.name for each in found.found] == ["emax-es08a", "dsservo-rds3115", "hitec-hs-425bb"]
    assert [(each.servo.name, each.reason) for each in found.refused] == [("hitec-hs-422", "its sheet ends at 6 V")]
    assert "its sheet ends at 6 V" in found.found[0].notes
    assert "impossible sheet" in found.found[1].notes
    assert math.isnan(found.found[-1].mass)
    high = st.servos_that_lift(0.05, 0.05, voltage=13.0, servos=light)
    assert [each.kind for each in high.refused] == ["voltage"] * 4
    with pytest.raises(InputError, match="time: got -1"):
        st.servos_that_lift(0.05, 0.05, voltage=6.0, time=-1.0)
