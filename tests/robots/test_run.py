"""Robots that follow a motion: what is asked of the servos, what is told of them, and what is refused."""

import math

import numpy as np
import pytest

import servotwin as st
from falling_supplies import BIG, SITUATIONS, model_of
from robots.robots_cases import hinge, links, servo
from servotwin.datasheet import thermal_masses
from servotwin.errors import InputError, UnknownNameError
from servotwin.robots import Motion, Mount, run_motion
from servotwin.robots.model_file import joint_names, joint_ranges, robot_model
from servotwin.robots.servos.mount import with_heat
from servotwin.robots.sizing import heating, lasting_torque, mean_heat
from servotwin.robots.tracking import best_delay

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
SERVO, BUS_SERVO = servo(st.PulseServo), servo(st.DigitalServo)


def model(xml):
    return mujoco.MjModel.from_xml_string(xml)


def waves(*joints, duration=0.4, samples=21, rise=0.4):
    time = np.linspace(0.0, duration, samples)
    way = 0.5 * rise * (1.0 - np.cos(2.0 * np.pi * time / duration))
    return Motion(time=time, angles={joint: 0.4 + way for joint in joints}, source="waves.csv")


@pytest.fixture(scope="module")
def run():
    return run_motion(model(links(dt=2e-3)), {"shoulder": SERVO, "elbow": SERVO}, waves("elbow"), settle=0.1)


@pytest.mark.long
def test_it_begins_at_the_first_goals_and_ends_after_the_last(run):
    assert run.time[0] == pytest.approx(-0.098)
    assert run.time[-1] == pytest.approx(0.5)
    assert run.poses.shape == (300, 2)
    np.testing.assert_allclose(run.poses[0], [0.0, 0.4], atol=2e-3)
    np.testing.assert_allclose(run.ideal.poses[0], [0.0, 0.4], atol=1e-12)


@pytest.mark.long
def test_a_joint_without_a_motion_is_told_to_stay(run):
    assert set(run.record["shoulder"]["joint_command"]) == {0.0}
    assert math.isnan(run.tracking["shoulder"].delay)
    np.testing.assert_array_equal(run.goal("shoulder"), 0.0)


def test_tracking_is_that_of_the_record(run):
    found, record = run.tracking["elbow"], run.record["elbow"]
    inside = (run.time >= 0.0) & (run.time <= 0.4)
    error = (run.motion.at("elbow", run.time) - record["joint_angle"])[inside]
    assert found.rms == pytest.approx(math.sqrt(np.mean(error**2)))
    assert (found.largest, found.mean) == pytest.approx((np.abs(error).max(), error.mean()))
    assert found.peak_current == np.abs(record["armature_current"][run.time >= 0.0]).max()
    assert found.lowest_voltage == record["bus_voltage"][run.time >= 0.0].min()
    assert found.winding == record["winding_temperature"].max()
    assert found.rms_delayed < found.rms
    assert 0.0 < found.delay < 0.3


@pytest.mark.long
@pytest.mark.parametrize(("hold", "levels"), [("linear", 200), ("previous", 20)])
def test_what_servos_are_told_between_samples(hold, levels):
    time = np.linspace(0.0, 0.4, 21)
    ramp = Motion(time=time, angles={"elbow": 0.5 + time}, source="ramp")
    found = run_motion(model(links(dt=2e-3)), {"elbow": SERVO}, ramp, settle=0.1, hold=hold)
    inside = (found.time > 1e-9) & (found.time < 0.4 + 1e-9)
    told = found.record["elbow"]["joint_command"][inside]
    assert len(np.unique(told.round(9))) == levels
    assert np.all((ramp.at("elbow", found.time[inside] - 2e-3) - told < 0.02) & (told <= 0.5 + found.time[inside]))


@pytest.mark.long
@pytest.mark.parametrize(("goals", "said"), [
    ([0.2, 3.9], "goals of joint elbow go from 11.5 to 223 deg at the servo, beyond what it takes, -15 to 195 deg"),
    ([0.2, 1.2], "goals of joint elbow go from 11.5 to 68.8 deg, beyond its range in the model, -57.3 to 57.3 deg"),
])
def test_goals_that_cannot_be_reached_are_told(goals, said):
    xml = links(dt=2e-3).replace('name="elbow"', 'name="elbow" range="-57.3 57.3" limited="true"')
    far = Motion(time=[0.0, 0.2], angles={"elbow": goals}, source="far")
    found = run_motion(model(xml), {"elbow": SERVO, "shoulder": SERVO}, far, settle=0.0)
    assert said in found.notes
    assert not run_motion(model(xml), {"elbow": SERVO}, waves("elbow"), settle=0.0).notes


@pytest.mark.long
def test_the_given_model_stays_as_it_is():
    given = model(links())
    run_motion(given, {"elbow": SERVO}, waves("elbow"), settle=0.05)
    assert given.dof_armature.tolist() == [0.0, 0.0]


@pytest.mark.long
def test_more_than_one_run_in_a_process_and_their_progress():
    told = []
    for kind in (SERVO, BUS_SERVO):
        run_motion(model(hinge(dt=2e-3)), {"elbow": kind}, waves("elbow"), settle=0.1,
                   progress=lambda done, total: told.append((done, total)))
    assert {total for _, total in told} == {600}
    assert max(done for done, _ in told) == 600


def test_servos_on_one_supply_make_it_sag():
    bus = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5)
    found = run_motion(model(links(dt=2e-3)), {"shoulder": SERVO, "elbow": SERVO}, waves("elbow"), bus=bus, settle=0.1)
    drawn = sum(found.record[joint]["supply_current"] for joint in found.mounts)
    np.testing.assert_allclose(found.record["shoulder"]["bus_voltage"], 6.0 - 0.5 * drawn, atol=1e-9)
    assert found.tracking["elbow"].lowest_voltage < 5.5


@pytest.mark.parametrize(("name", "supply"), [case[:2] for case in SITUATIONS])
def test_the_least_voltage_of_joints_that_hardly_turn_is_that_of_servos_alone(name, supply):
    """Behind an inertia of 1000 kg m²: two joints that have a supply each, and two on one."""
    own, source, goals = model_of(name, supply), st.Supply.of(supply), ((0.3, 1.1) if name == BIG else (-0.4, 0.4))
    body = """<body><joint name="{}" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1e3 1e3 1e3"/></body>"""
    plant = model(f"""<mujoco><option timestep="2e-3"/><worldbody>{body.format("elbow")}{body.format("wrist")}
      </worldbody></mujoco>""")
    motion = Motion(time=np.array([0.0, 0.05, 0.1]), angles=dict.fromkeys(
        ("elbow", "wrist"), np.array([goals[0], goals[1], goals[1]])), source="a jump")
    load = st.loads.Inertia(1e3)
    command = st.signals.step(*goals, at=0.1501, unit="rad")  # a goal is heard at the tick after it
    run = {"duration": 0.3, "output_step": 0.1}
    alone = st.simulate(own, command, load=load, **run)
    both = st.simulate_bus({joint: (own, command, load) for joint in ("elbow", "wrist")}, supply=source, **run)
    for bus, sag in ((None, alone.sag), (source, both.sag)):
        found = run_motion(plant, dict.fromkeys(("elbow", "wrist"), own), motion, bus=bus, settle=0.1, hold="previous",
                           assume_heat=False)
        assert len(found.sags) == (0 if sag is None else 1 if bus else 2)
        for _, _, other in found.sags:
            assert other.voltage == pytest.approx(sag.voltage, abs=1e-6)
            assert other.time == pytest.approx(sag.time - 0.1, abs=1e-3)


# ------------------------------------------------------------------------------------------------------ heat

@pytest.mark.long(but="BoundedServo")
@pytest.mark.parametrize("kind", [st.BoundedServo, st.DigitalServo])
def test_mean_heat_is_that_of_the_current(kind):
    """Of servos without pulses, whose currents samples tell."""
    own = servo(kind)
    record = run_motion(model(hinge(dt=1e-3)), {"elbow": own}, waves("elbow"), settle=0.1).record["elbow"]
    inside = (record.time >= 0.0) & (record.time <= 0.4)
    heat = mean_heat(record, thermal_masses(own.servo), 0.0, 0.4)
    expected = np.mean(record["armature_current"][inside] ** 2) * own.value("motor.armature_resistance")
    assert heat == pytest.approx(expected, rel=0.03)


MASSES = thermal_masses(st.load_servo("hitec-hs-755hb"))


@pytest.mark.parametrize("heat", [0.1, 1.0, 3.0])
def test_in_the_end_a_servo_gives_off_what_it_makes(heat):
    found = heating(heat, 298.15, MASSES)
    grown = heat * (1.0 + 0.00385 * (found.winding - 298.15))
    assert found.housing - 298.15 == pytest.approx(grown * MASSES.housing_to_ambient)
    assert found.winding - found.housing == pytest.approx(grown * MASSES.winding_to_housing)


def test_the_limit_is_passed_when_the_two_masses_say_so():
    found = heating(20.0, 403.15, MASSES, trip_temperature=313.15)  # a heat that hardly changes up to there
    at = MASSES.after(found.limit_time, 0.85 * 20.0, MASSES.with_winding(298.15))
    assert at.winding == pytest.approx(403.15, abs=8.0)
    assert found.trip_time < math.inf
    assert math.isinf(heating(1e3, 298.15, MASSES).winding)  # more resistance, more heat, and no end
    assert math.isnan(heating(0.1, 298.15, MASSES).limit_time)


def test_what_can_be_lifted_without_end_does_not_depend_on_the_duty():
    half = st.feetech_sts({"Max_Torque_Limit": 500}, servo="feetech-sts3215-12v")
    masses = thermal_masses(half)
    whole = lasting_torque(BUS_SERVO, masses)
    assert lasting_torque(st.DigitalServo(half), masses) == pytest.approx(whole)
    weak = st.DigitalServo(half.replace({"firmware.torque_limit": 0.25}))
    assert lasting_torque(weak, masses) < whole
    assert math.isnan(lasting_torque(servo(st.BoundedServo), masses))


def test_thermal_masses_are_assumed_only_where_they_are_not_given():
    assert with_heat(SERVO).servo.thermal.winding_capacity == MASSES.winding_capacity
    given = with_heat(SERVO)
    assert with_heat(given) is given
    cold = run_motion(model(hinge()), {"elbow": SERVO}, waves("elbow"), settle=0.0, assume_heat=False)
    assert "winding_temperature" not in cold.record["elbow"]
    assert math.isnan(cold.tracking["elbow"].winding)


# ------------------------------------------------------------------------------------------------------ words

def test_best_delay_of_a_ramp_is_exact():
    time = np.linspace(0.0, 2.0, 2001)
    delay, left = best_delay(time, time, np.maximum(time - 0.123, 0.0), time > 0.5)
    assert (delay, left) == pytest.approx((0.123, 0.0), abs=1e-6)


REFUSED = [
    ({"motion": waves("elbow", "wrist")}, UnknownNameError, "'wrist'"),
    ({"motion": waves("shoulder", "elbow")}, InputError, "joint shoulder of waves.csv: got 'no servo at it'"),
    ({"motion": "waves"}, InputError, "motion: got 'waves'"),
    ({"servos": {"elbo": SERVO}}, UnknownNameError, "elbow"),
    ({"servos": {}}, InputError, "mapping of joints"),
    ({"servos": {"elbow": Mount(SERVO, zero=1.0)}}, InputError, "first goal of joint elbow: got '-34.38 deg"),
    ({"settle": -1.0}, InputError, "settle"),
    ({"hold": "spline"}, InputError, "hold"),
    ({"timestep": 0.0}, InputError, "timestep"),
    ({"timestep": 0.05}, InputError, "timestep of the model"),
    ({"timestep": 1e-7}, InputError, "steps of 1e-07 s"),
    ({"window": -1.0}, InputError, "window"),
    ({"bus": st.Supply(open_circuit_voltage=60.0)}, InputError, "supply voltage"),
    ({"bus": st.Supply()}, InputError, "open_circuit_voltage"),
    ({"model": "nowhere.xml"}, InputError, "nowhere.xml is no file"),
    ({"model": "so11"}, UnknownNameError, "did you mean 'so101'"),
    ({"model": 3}, InputError, "model of a robot"),
]


@pytest.mark.long(but="changed12-InputError-supply voltage")
@pytest.mark.parametrize(("changed", "error", "said"), REFUSED)
def test_bad_input_is_refused(changed, error, said):
    given = {"model": model(links()), "servos": {"elbow": SERVO}, "motion": waves("elbow"), "settle": 0.05, **changed}
    with pytest.raises(error) as caught:
        run_motion(**given)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", [
    "<mujoco><worldbody>", "no xml", "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>"])
def test_what_mujoco_cannot_read_is_one_line(tmp_path, text):
    path = tmp_path / "robot.xml"
    path.write_text(text)
    with pytest.raises(InputError, match="is no model that MuJoCo reads") as caught:
        robot_model(path)
    assert "\n" not in str(caught.value)


def test_models_come_from_files_specs_and_the_package(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(links())
    for source in (path, str(path), mujoco.MjSpec.from_string(links()), model(links())):
        assert joint_names(robot_model(source)) == {"shoulder": "angle", "elbow": "angle"}
    assert len(joint_ranges(robot_model("so101"))) == 6
    assert joint_ranges(robot_model(path)) == {}
