"""Wheels on servos that turn endlessly: their maps of speed, odometry, and the commands of `ServoDrive`."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import Mount, Odometry, Pose, ServoDrive, SpeedMap, wheel_servo, wheel_speed_of, worn

mujoco = pytest.importorskip("mujoco")

NEW = wheel_servo()
ON_BUS = {"firmware.control_period": 1e-3, "firmware.proportional_gain": 1.0, "firmware.command_kind": "goal",
          "firmware.deadband_angle": 0.0}
DISC = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody>
  <body><joint name="a" axis="0 1 0"/><geom type="box" size=".02 .02 .02" mass=".05"/></body>
  <body pos="0 1 0"><joint name="b" axis="0 1 0"/><geom type="box" size=".02 .02 .02" mass=".05"/></body>
</worldbody>{}</mujoco>"""


@pytest.fixture(scope="module")
def speeds():
    return wheel_speed_of(NEW)


def test_the_ends_of_a_map_are_the_free_motor_at_full_drive(speeds):
    servo = NEW.servo
    K = servo.gear.gear_reduction * servo.motor.torque_constant
    friction = servo.gear.gear_reduction * servo.friction.coulomb_torque_forward
    V = servo.supply.open_circuit_voltage - servo.supply.bridge_drop_voltage
    assert speeds.most == pytest.approx((V - servo.motor.armature_resistance * friction / K) / K, rel=1e-9)
    np.testing.assert_allclose(speeds.speeds, -speeds.speeds[::-1], rtol=1e-6, atol=1e-9)
    inside = np.abs(speeds.pulses - speeds.neutral) <= 0.5 * servo.electronics.deadband
    assert inside.sum() > 2
    assert (speeds.speeds[inside] == 0.0).all()


def test_between_its_points_a_map_is_right_within_a_few_per_cent(speeds):
    for error in (-9e-5, -3.3e-5, 2.7e-5, 1.1e-4):
        result = st.simulate(NEW, st.signals.constant(1e6 * (speeds.neutral + error), unit="us"), duration=1.0)
        assert result.mean("output_speed", 0.6) == pytest.approx(float(speeds.speed(speeds.neutral + error)), rel=0.03)


@pytest.mark.parametrize("speed", [-4.6, -1.0, -1e-3, 1e-3, 0.3, 4.6])
def test_pulses_are_found_back(speeds, speed):
    assert float(speeds.speed(speeds.pulse(speed))) == pytest.approx(speed, rel=1e-9)


def test_a_wheel_that_is_to_stand_or_to_do_what_it_cannot(speeds):
    assert speeds.pulse(0.0) == speeds.neutral == NEW.neutral_pulse
    for most in (speeds.most, 99.0):
        assert float(speeds.speed(speeds.pulse(most))) == pytest.approx(speeds.most, rel=1e-12)


@pytest.mark.long
def test_worn_servos_are_off_and_weak_as_said(speeds):
    off = wheel_speed_of(worn(NEW, neutral=8e-6))
    assert off.neutral - speeds.neutral == pytest.approx(8e-6, abs=1e-15)
    np.testing.assert_allclose(off.speed(speeds.pulses + 8e-6), speeds.speeds, rtol=1e-6, atol=1e-3)
    curve, weak = (st.curves(model).voltages[0].cold for model in (NEW, worn(NEW, torque=0.9)))
    assert weak.stall_torque < 0.9 * curve.stall_torque
    with pytest.raises(InputError, match="turns endlessly"):
        worn(st.PulseServo(st.load_servo("hitec-hs-755hb")), torque=0.9)


def test_what_is_no_map_is_refused():
    with pytest.raises(InputError, match="at least 3"):
        SpeedMap(np.zeros(2), np.zeros(2), 0.0)
    with pytest.raises(InputError, match="do not fall"):
        SpeedMap(np.arange(3.0), np.array([-1.0, 1.0, 0.5]), 1.0)
    with pytest.raises(InputError, match="by pulses"):
        wheel_speed_of(st.DigitalServo(NEW.servo.replace(ON_BUS)))


# --- odometry -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("left", "right"), [(2.0, 5.0), (5.0, 2.0), (-3.0, 4.0), (4.0, -3.0)])
def test_constant_unequal_speeds_lead_around_a_circle(left, right):
    # radius b/2 (w_r + w_l)/(w_r - w_l) about a point to the left
    wheels, pose = Odometry(radius=0.03, track=0.16), Pose(0.3, -0.2, 0.7)
    around = 0.5 * 0.16 * (right + left) / (right - left)
    centre = pose.x - around * math.sin(pose.heading), pose.y + around * math.cos(pose.heading)
    for parts in (1, 7, 1000):
        now = pose
        for _ in range(parts):
            now = wheels.step(now, left / parts, right / parts)
        assert now.heading - pose.heading == pytest.approx(0.03 * (right - left) / 0.16, rel=1e-12)
        assert math.hypot(now.x - centre[0], now.y - centre[1]) == pytest.approx(abs(around), rel=1e-9)
        assert now.x == pytest.approx(centre[0] + around * math.sin(now.heading), abs=1e-12)


def test_equal_speeds_lead_straight_on():
    pose = Odometry(radius=0.03, track=0.16).step(Pose(0.0, 0.0, math.pi / 6.0), 2.0, 2.0)
    assert pose == pytest.approx((0.06 * math.cos(math.pi / 6.0), 0.03, math.pi / 6.0))


def test_wheel_speeds_and_odometry_are_inverse():
    wheels = Odometry(radius=0.03, track=0.16)
    left, right = wheels.wheel_speeds(0.1, 0.5)
    end = wheels.step(Pose(), 1e-6 * left, 1e-6 * right)
    assert (end.x, end.heading) == pytest.approx((1e-7, 5e-7))
    with pytest.raises(InputError, match="track of an odometry: got 0"):
        Odometry(radius=0.03, track=0.0)


# --- at the joints of a model -------------------------------------------------------------------------------------


def placed(servos, actuators="", **more):
    drive = ServoDrive(mujoco.MjModel.from_xml_string(DISC.format(actuators)), servos, **more)
    return drive, mujoco.MjData(drive.model)


@pytest.mark.long
def test_a_joint_is_told_pulses_and_turns_as_the_servo_alone():
    drive, data = placed({"a": Mount(NEW, direction=-1), "b": st.PulseServo(st.load_servo("hitec-hs-755hb"))})
    drive.record(data)
    drive.step(data, 100)
    assert data.qpos[0] == 0.0  # until it is told anything it gets the neutral pulse
    drive.command(data, {"a": 1600e-6, "b": 0.5})
    drive.step(data, 500)
    command = st.signals.step(1e6 * NEW.neutral_pulse, 1600.0, at=0.1, unit="us")
    inertia = 0.05 * (2.0 * 0.02**2 * 4.0) / 12.0
    alone = st.simulate(NEW, command, duration=0.6, load=st.loads.Inertia(inertia))
    assert data.qpos[0] == pytest.approx(-alone["output_angle"][-1], rel=2e-3)
    assert data.qpos[1] == pytest.approx(0.5, abs=0.05)
    record = drive.result(data)
    assert "command_angle" not in record["a"].names
    for name in ("pulse_width", "joint_command"):
        np.testing.assert_allclose(record["a"][name][[0, -1]], [NEW.neutral_pulse, 1600e-6], rtol=1e-12)
        assert record["a"].unit(name) == "s"
    assert record["b"]["joint_command"][-1] == pytest.approx(0.5)


@pytest.mark.long
def test_an_actuator_gives_the_pulse():
    told, data = placed({"a": NEW}, '<actuator><motor joint="a"/></actuator>')
    bare, other = placed({"a": NEW})
    data.ctrl[0] = 1550e-6
    bare.command(other, {"a": 1550e-6})
    for drive, one in ((told, data), (bare, other)):
        drive.step(one, 200)
    assert data.qpos[0] == other.qpos[0] != 0.0


def test_on_a_shared_supply_and_across_save_and_restore():
    drive, data = placed({"a": NEW, "b": worn(NEW, neutral=1e-5)}, bus=st.Supply(open_circuit_voltage=6.0,
                                                                                internal_resistance=0.2))
    drive.command(data, {"a": 1600e-6, "b": 1400e-6})
    drive.step(data, 150)
    state = drive.save(data)
    drive.step(data, 150)
    end = data.qpos.copy()
    drive.restore(data, state)
    drive.step(data, 150)
    np.testing.assert_array_equal(data.qpos, end)
    assert end[0] > 0.1 > -0.1 > end[1]


@pytest.mark.long
def test_a_servo_in_pwm_mode_is_told_its_duty():
    servo = st.DigitalServo(NEW.servo.replace({**ON_BUS, "potentiometer.fixed_angle": 0.0}))
    drive, data = placed({"a": Mount(servo, zero=0.7, direction=-1)})
    drive.command(data, {"a": 0.5})
    drive.step(data, 400)
    free = st.simulate(servo, st.signals.constant(0.5, unit="rad"), duration=1.0)["output_speed"][-1]
    assert data.qvel[0] == pytest.approx(-free, rel=1e-3)
    assert drive.look(data, "duty")[0] == 0.5


@pytest.mark.long
@pytest.mark.parametrize("pulse", [0.5, 0.0, -1e-3, math.nan])
def test_angles_are_no_pulses(pulse):
    drive, data = placed({"a": NEW})
    with pytest.raises(InputError, match=r"pulse of joint a.*turns endlessly"):
        drive.command(data, {"a": pulse})


def test_what_needs_an_angle_refuses_them():
    nod = st.robots.Motion(time=[0.0, 0.2], angles={"wrist_flex": [0.0, 0.2]}, source="a nod")
    with pytest.raises(InputError, match="one that turns endlessly"):
        st.robots.run_motion("so101", {"wrist_flex": NEW}, nod)
    with pytest.raises(InputError, match="turns endlessly"):
        st.robots.recipe_of(NEW)
