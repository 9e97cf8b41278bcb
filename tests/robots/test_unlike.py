"""Unlike servos on one supply: each moves by its own numbers."""

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import Motion, Mount, run_motion
from servotwin.robots.servos.servo_groups import differing, of_one_form

pytest.importorskip("mujoco")
VOLTS = 7.4
ARM = """<mujoco><option timestep="0.002"/><compiler angle="radian"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0"/>
<inertial pos="0.05 0 0" mass="0.06" diaginertia="1e-5 4e-5 4e-5"/>
<body name="lower" pos="0.1 0 0"><joint name="elbow" axis="0 1 0"/>
<inertial pos="0.03 0 0" mass="0.03" diaginertia="1e-5 2e-5 2e-5"/></body></body></worldbody></mujoco>"""


def model(name, **changes):
    return st.DigitalServo(st.load_servo(name).replace({"supply.open_circuit_voltage": VOLTS, **changes}))


def moved(servos, bus):
    import mujoco

    time = np.arange(0.0, 1.2, 0.02)
    angles = {"shoulder": 0.4 * np.sin(4.0 * time), "elbow": np.where(time > 0.3, 0.5, 0.0)}
    run = run_motion(mujoco.MjModel.from_xml_string(ARM), {joint: Mount(one) for joint, one in servos.items()},
                     Motion(time=time, angles=angles, source="a wave"), bus=bus, assume_heat=False)
    return np.array([run.record[joint]["joint_angle"] for joint in servos])


@pytest.mark.long
@pytest.mark.parametrize("servos", [
    {"shoulder": ("dynamixel-xl430-w250", {}), "elbow": ("dynamixel-xl330-m288", {})},
    {"shoulder": ("dynamixel-xl330-m288", {}), "elbow": ("dynamixel-xl430-w250", {})},
    {"shoulder": ("dynamixel-xl330-m288", {"supply.bridge_drop_resistance": None}),
     "elbow": ("dynamixel-xl330-m288", {})},
], ids=["XL430 and XL330", "XL330 and XL430", "drops of their own"])
def test_servos_on_a_stiff_supply_move_as_on_their_own(servos):
    """A robot of XL430 and XL330 was refused, and every servo had the bridge of the first one."""
    made = {joint: model(name, **changes) for joint, (name, changes) in servos.items()}
    own, shared = moved(made, None), moved(made, st.Supply(open_circuit_voltage=VOLTS))
    assert np.ptp(own, axis=1).min() > 0.2
    np.testing.assert_allclose(shared, own, atol=1e-6)


def test_numbers_that_only_some_have_are_told():
    some = of_one_form([model("dynamixel-xl430-w250"), model("dynamixel-xl330-m288")])
    found = differing(some, ["shoulder", "elbow"])
    assert found["friction.load_friction_motor"][1] == st.load_servo("dynamixel-xl330-m288").friction.load_friction
    assert found["supply.bridge_drop_resistance"][0] == 0.0
    with pytest.raises(InputError, match="elbow"):
        differing([model("dynamixel-xl330-m288", **{"gear.backlash": 0.01, "gear.output_inertia": 1e-6}),
                   model("dynamixel-xl330-m288")], ["shoulder", "elbow"])


# ------------------------------------------------------------------------------------------------- other numbers later

BATTERY = st.Supply(open_circuit_voltage=VOLTS, internal_resistance=0.2)
FLAT = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5)
OTHERS = {"motor.torque_constant": [1.1, 0.9], "motor.rotor_inertia": [2.0, 0.6], "gear.backlash": [0.5, 1.5],
          "firmware.proportional_gain": [1.2, 0.7]}  # times what they are, shoulder and elbow


def other(servo, factors=OTHERS):
    """Return numbers of both servos."""
    return {name: servo.get(name) * np.array(times) for name, times in factors.items()}


def driven(drive, data, steps=300):
    """Return where the joints are under goals that change, from the beginning on."""
    import mujoco

    mujoco.mj_resetData(drive.model, data)
    drive.reset(data)
    found = []
    for k in range(steps):
        drive.command(data, {"shoulder": 0.4 * np.sin(0.02 * k), "elbow": 0.5 if k > 100 else 0.0})
        drive.step(data)
        found.append(data.qpos.copy())
    return np.array(found)


@pytest.mark.long(but="bus0-after0")
@pytest.mark.parametrize(("bus", "after"), [(BATTERY, FLAT), (None, None)])
def test_servos_given_other_numbers_are_those_of_a_drive_made_with_them(bus, after):
    import mujoco

    one = model("feetech-sts3215-7v4")
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(ARM), {"shoulder": one, "elbow": one}, bus=bus)
    data, numbers = mujoco.MjData(drive.model), other(one.servo)
    first = driven(drive, data)
    drive.set(parameters=numbers, bus=after)
    changed = driven(drive, data)
    anew = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(ARM), {
        joint: model("feetech-sts3215-7v4", **{name: float(column[k]) for name, column in numbers.items()})
        for k, joint in enumerate(("shoulder", "elbow"))}, bus=after)
    expected = driven(anew, mujoco.MjData(anew.model))
    assert np.abs(first - expected).max() > 5e-3
    np.testing.assert_allclose(changed, expected, atol=1e-10)
    np.testing.assert_allclose(driven(drive, mujoco.MjData(drive.model)), expected, atol=1e-10)  # in data that is new
    np.testing.assert_allclose(drive.model.dof_armature, anew.model.dof_armature, rtol=1e-12)
    drive.set(parameters={name: one.servo.get(name) for name in numbers}, bus=bus)
    np.testing.assert_allclose(driven(drive, data), first, atol=1e-10)


def test_a_number_may_be_given_to_some_joints_alone():
    import mujoco

    one = model("feetech-sts3215-7v4")
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(ARM), {"shoulder": one, "elbow": one}, bus=BATTERY)
    before = drive.model.dof_armature.copy()
    drive.set(parameters={"gear.output_inertia": 1e-4}, joints=["elbow"])
    gained = drive.model.dof_armature - before
    assert gained == pytest.approx([0.0, 1e-4 - one.servo.gear.output_inertia], abs=1e-12)


@pytest.mark.parametrize(("more", "words"), [
    ({"parameters": {"motor.rotor_inertia": -1.0}}, "motor.rotor_inertia"),
    ({"parameters": {"motor.rotor_inertia": [1e-7] * 3}}, "shape"),
    ({"parameters": {"motor.spin": 1.0}}, "motor.spin"),
    ({"joints": ["wrist"], "parameters": {"gear.backlash": 0.0}}, "wrist"),
    ({"parameters": [1.0]}, "^parameters: got"),
    ({"bus": [(FLAT, ["elbow"])]}, "on the buses that they are on"),
    ({"parameters": {"supply.open_circuit_voltage": 5.0}}, "that of its bus")])
def test_what_cannot_be_set_is_said_and_changes_nothing(more, words):
    import mujoco

    one = model("feetech-sts3215-7v4")
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(ARM), {"shoulder": one, "elbow": one}, bus=BATTERY)
    data = mujoco.MjData(drive.model)
    first = driven(drive, data, 20)
    with pytest.raises(InputError, match=words):
        drive.set(**more)
    assert np.array_equal(driven(drive, data, 20), first)


def test_a_supply_of_servos_that_share_none_is_refused():
    import mujoco

    one = model("feetech-sts3215-7v4")
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(ARM), {"shoulder": one, "elbow": one})
    with pytest.raises(InputError, match=r"^set\(bus=\.\.\.\): got 'servos that share none'"):
        drive.set(bus=FLAT)


def test_noise_begins_anew_with_other_numbers():
    import mujoco

    one = st.PulseServo(st.load_servo("hitec-hs-755hb").replace({"potentiometer.noise": 2e-3}))
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(ARM), {"shoulder": one, "elbow": one})
    data = mujoco.MjData(drive.model)
    first = driven(drive, data)
    drive.set(parameters={"motor.torque_constant": one.servo.motor.torque_constant})
    assert np.array_equal(driven(drive, data), first)
