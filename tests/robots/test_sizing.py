"""Is the servo big enough: margins in closed form, and what is said of them."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import servotwin as st
from robots.robots_cases import links, servo
from servotwin.datasheet import FullDrive
from servotwin.datasheet.warming import masses_by_mass
from servotwin.errors import InputError
from servotwin.physics import winding_resistance
from servotwin.robots import Motion, Mount, run_motion, sizing_of
from servotwin.robots.servos.mount import supplied
from servotwin.robots.sizing import heating

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
SERVO, BUS_SERVO = servo(st.PulseServo), servo(st.DigitalServo)
DRIVES = {model: FullDrive(model) for model in (SERVO, BUS_SERVO)}
G, LENGTH = 9.81, 0.1


def lever(mass, joint='axis="0 -1 0"', gravity=f"0 0 {-G}"):
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" gravity="{gravity}"/><worldbody><body><joint name="a" {joint}/>
        <inertial pos="{LENGTH} 0 0" mass="{mass}" diaginertia="1e-6 1e-6 1e-6"/></body></worldbody></mujoco>""")


def sized(model, mount, values, duration=0.2, **options):
    motion = Motion(time=np.linspace(0.0, duration, len(values)), angles={"a": values}, source="test")
    options = {"settle": 0.05, **options}
    return sizing_of(run_motion(model, {"a": mount}, motion, **options))["a"]


@pytest.mark.long
@pytest.mark.parametrize("share", [0.2, 0.8, 1.3])
@pytest.mark.parametrize(("model", "direction", "ratio"), [(SERVO, 1, 1.0), (SERVO, -1, 0.5), (BUS_SERVO, -1, 2.0)])
def test_margin_of_a_weight_that_is_held(share, model, direction, ratio):
    """The shaft of the servo has the ratio times the torque of the joint."""
    stall = DRIVES[model].stall_torque
    mass = share * stall / (G * LENGTH * ratio)
    found = sized(lever(mass), Mount(model, -direction * ratio * 0.5, direction, ratio), [0.0, 0.0])
    assert found.margin == pytest.approx(1.0 / share, rel=1e-6)
    assert found.rms_torque == pytest.approx(share * stall)
    assert found.worst.torque == pytest.approx(share * stall)
    assert found.worst.available == pytest.approx(stall)
    assert ("too weak" in found.verdict) == (share > 1.0)
    assert found.verdict.startswith("big enough: ") == found.big_enough


@pytest.mark.long
def test_a_rotor_behind_the_play_of_its_gear_has_to_be_turned_too():
    found = sized(lever(0.01, gravity="0 0 0"), Mount(BUS_SERVO), 0.2 * (1.0 - np.cos(np.linspace(0.0, 6.0, 61))), 0.6)
    rotor = BUS_SERVO.value("gear.gear_reduction") ** 2 * BUS_SERVO.value("motor.rotor_inertia")
    J = 0.01 * LENGTH**2 + 1e-6 + rotor
    fastest = 0.2 * (6.0 / 0.6) ** 2  # rad/s²
    assert np.abs(found.needed.torque[100:200]).max() == pytest.approx(J * fastest, rel=0.1)


@pytest.mark.long
def test_margin_of_a_rack():
    radius, mass = 0.01, 2.0
    found = sized(lever(mass, 'type="slide" axis="0 0 1"'), Mount(SERVO, zero=-radius, ratio=radius), [0.0, 0.0])
    assert found.margin == pytest.approx(DRIVES[SERVO].stall_torque / (mass * G * radius), rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("share", [0.5, 0.9, 1.1])
@pytest.mark.parametrize(("model", "ratio"), [(SERVO, 1.0), (SERVO, 0.25), (BUS_SERVO, 1.0)])
def test_a_motion_faster_than_the_servo_without_load_is_too_fast(share, model, ratio):
    top = min(DRIVES[model].no_load_speed, model.servo.firmware.speed_limit or math.inf)
    angles = ratio * np.array([0.5, 0.5 + 0.2 * share * top])
    found = sized(lever(1e-4, gravity="0 0 0"), Mount(model, ratio=ratio), angles)
    assert found.top_speed == pytest.approx(top)
    assert (found.margin == 0.0) == (share > 1.0)
    assert found.verdict.startswith("too slow" if share > 1.0 else ("big enough", "too weak"))
    if share > 1.0:
        assert f"needs {math.degrees(share * top):.0f} deg/s" in found.verdict
        corner = 0.1 * (1.0 / share - 0.5)  # until which a window of 0.1 s is below that speed
        least = 0.2 - 2.0 * corner
        if model is BUS_SERVO:  # its rotor takes so much to speed up that it is short of torque before
            assert least < found.short < 0.2
        else:
            assert found.short == pytest.approx(least, abs=0.01)


@pytest.mark.long
def test_in_motion_the_curve_counts_at_its_speed():
    """Lifting at half the speed without load, once the motion is under way."""
    drive = DRIVES[SERVO]
    speed, duration = 0.5 * drive.no_load_speed, 0.3
    mass = 0.9 * drive.torque(speed) / (G * LENGTH)
    way = speed * duration / 2.0
    found = sized(lever(mass), Mount(SERVO, zero=-1.0), [-way, way], duration, window=0.02)
    level = int(np.argmin(np.abs(found.needed.speed - speed) + (found.needed.torque < 0.0)))
    steady = np.abs(found.needed.speed - speed) < 1e-9
    torque = found.needed.torque[steady]
    assert steady[level]
    assert torque.max() == pytest.approx(mass * G * LENGTH, rel=1e-3)
    assert drive.torque(speed) / torque.max() == pytest.approx(1.0 / 0.9, rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize(("goals", "driving"), [([-0.4, 0.4], True), ([0.4, -0.4], False)])
def test_lowering_holds_back(goals, driving):
    found = sized(lever(0.3), Mount(SERVO, zero=-1.0), goals, 0.6)
    steady = np.abs(found.needed.speed - 0.8 / 0.6) < 1e-9
    assert np.all((found.needed.torque[steady] > 0.0) == driving)


def test_what_the_others_leave_of_the_supply_counts():
    motion = Motion(time=[0.0, 0.2, 0.4], angles={"shoulder": [0.4, 0.4, 0.4], "elbow": [0.4, 1.0, 0.4]}, source="test")
    xml = links(dt=2e-3)
    found = {}
    for R in (0.0, 0.6):
        bus = st.Supply(open_circuit_voltage=6.0, internal_resistance=R)
        run = run_motion(mujoco.MjModel.from_xml_string(xml), {"shoulder": SERVO, "elbow": SERVO}, motion, bus=bus,
                         settle=0.05)
        found[R] = sizing_of(run)["shoulder"]
    assert found[0.0].sagged is None
    assert found[0.6].left_voltage == pytest.approx(
        (6.0 - 0.6 * run.record["elbow"]["supply_current"][run.time >= 0.0]).min())
    assert found[0.6].sagged.stall_torque < found[0.6].curve.stall_torque < found[0.0].curve.stall_torque
    assert found[0.6].margin < found[0.0].margin


@pytest.mark.long
def test_a_program_that_limits_duty_limits_the_speed():
    half = st.DigitalServo(st.feetech_sts({"Max_Torque_Limit": 500}, servo="feetech-sts3215-12v"))
    found = sized(lever(1e-3, gravity="0 0 0"), Mount(half), [0.0, 0.5], 0.2)
    assert found.verdict.startswith("too slow")
    assert found.top_speed < 0.6 * DRIVES[BUS_SERVO].no_load_speed


@pytest.mark.long
def test_a_servo_that_trips_is_not_big_enough():
    weak = st.DigitalServo(BUS_SERVO.servo.replace(
        {"firmware.overload_time": 0.1, "firmware.overload_duty": 0.05, "firmware.overload_output": 0.02}))
    found = sized(lever(2.5), Mount(weak), [0.0, 0.0], 0.4, settle=0.3)
    assert found.trips
    assert "tripped by overload at" in found.verdict
    assert not found.big_enough


@pytest.mark.long
def test_what_holds_too_much_gets_too_hot():
    mass = 0.9 * DRIVES[SERVO].stall_torque / (G * LENGTH)
    found = sized(lever(mass), Mount(SERVO, zero=-1.0), [0.0, 0.0], 0.3)
    assert found.margin > 1.0
    assert found.rms_torque > found.lasting_torque
    assert "gets too hot: its winding passes 130 deg C after" in found.verdict


def test_without_a_mass_nothing_is_said_of_heat():
    unknown = st.PulseServo(st.servo_from_values("mine", {
        group: {name.partition(".")[2]: SERVO.servo.get(name) for name in SERVO.servo.names() if name.startswith(group)}
        for group in ("motor", "gear", "friction", "electronics", "potentiometer", "supply", "stops")}))
    found = sized(lever(0.1), Mount(unknown), [0.3, 0.3])
    assert found.heating is None
    assert math.isnan(found.lasting_torque)
    assert found.big_enough


@pytest.mark.long
def test_a_motion_that_takes_nothing_has_no_margin():
    found = sized(lever(0.1, gravity="0 0 0"), Mount(SERVO), [0.3, 0.3])
    assert math.isinf(found.margin)
    assert found.verdict == "big enough: more than 100 times what is needed"


def test_a_shared_supply_replaces_the_servos_own():
    bus = st.Supply(open_circuit_voltage=4.8, internal_resistance=0.3)
    own = supplied(SERVO, bus).servo.supply
    assert (own.open_circuit_voltage, own.internal_resistance) == (4.8, 0.3)
    assert supplied(SERVO, None) is SERVO
    with pytest.raises(InputError, match="open_circuit_voltage"):
        supplied(SERVO, st.Supply(internal_resistance=0.3))


def test_ten_minutes_of_a_motion_are_those_of_its_two_masses():
    """Beside the same two masses integrated, with copper whose resistance grows."""
    masses = masses_by_mass(0.05)

    def rates(_, now):
        heat = 1.5 * float(winding_resistance(now[0], 1.0))
        passed = (now[0] - now[1]) / masses.winding_to_housing
        return [(heat - passed) / masses.winding_capacity,
                (passed - (now[1] - masses.ambient) / masses.housing_to_ambient) / masses.housing_capacity]

    expected = solve_ivp(rates, (0.0, 600.0), [masses.ambient] * 2, rtol=1e-9, atol=1e-9).y[:, -1]
    assert tuple(heating(1.5, masses.ambient, masses).soon) == pytest.approx(tuple(expected), abs=0.3)
