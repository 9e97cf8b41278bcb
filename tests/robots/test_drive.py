"""Servos at joints of MuJoCo: the same as on their own, whatever the step; coupled, sharing a supply, at rest."""

import math

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import LENGTH, MASS, SPREAD, WEIGHT, hinge, interpolated, links, servo

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
BATTERY = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.3)


def driven(xml, servos, **more):
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(xml), servos, **more)
    return drive, mujoco.MjData(drive.model)


def followed(xml, servos, goals, duration, every=1e-3, start=(), **more):
    """Return times, angles and speeds of all joints, and places of the tool, under goals (time -> by joint)."""
    drive, data = driven(xml, servos, **more)
    data.qpos[:] = start or [goals(0.0)[name] for name in drive.joints]
    dt = drive.model.opt.timestep
    steps = round(every / dt)
    rows = []
    for k in range(round(duration / every)):
        for n in range(steps):
            drive.command(data, goals((k * steps + n) * dt + 1e-9))
            drive.step(data)
        mujoco.mj_kinematics(drive.model, data)
        tool = data.site_xpos[0] if drive.model.nsite else np.zeros(3)
        rows.append([data.time, *data.qpos, *data.qvel, *tool])
    columns, n = np.array(rows).T, drive.model.nq
    return columns[0], columns[1:1 + n], columns[1 + n:1 + 2 * n], columns[1 + 2 * n:]


def stepped(t):
    return {"elbow": 0.3 if t < 0.1 else 1.5}


@pytest.fixture(scope="module")
def alone():
    """What each kind of servo does with the weight, by `simulate`."""
    command = st.signals.step(0.3, 1.5, at=0.1, unit="rad")
    return {kind: st.simulate(servo(kind), command, duration=1.2, load=WEIGHT, output_step=1e-4)
            for kind in (st.PulseServo, st.BoundedServo, st.DigitalServo)}


@pytest.mark.long(but="implicitfast-BoundedServo")
@pytest.mark.parametrize("kind", [st.PulseServo, st.BoundedServo, st.DigitalServo])
@pytest.mark.parametrize("integrator", ["RK4", "implicitfast", "Euler"])
def test_a_hinge_is_the_servo_alone(alone, kind, integrator):
    """At 1 ms within 0.8 mrad by RK4; else half a step behind on the way, and within 0.7 mrad at rest."""
    time, (angle,), _, _ = followed(hinge(integrator), {"elbow": servo(kind)}, stepped, 1.2)
    error = np.abs(angle - interpolated(alone[kind], "output_angle", time))
    fastest = np.abs(alone[kind]["output_speed"]).max()
    assert error.max() < (0.8e-3 if integrator == "RK4" else 0.55 * 1e-3 * fastest)
    assert error[-200:].max() < 0.7e-3


TERMS = {  # what a servo may have besides
    "stops": (st.BoundedServo, {"stops.upper_angle": 1.0, "stops.lower_angle": 0.0, "stops.restitution": 0.4,
                                "electronics.voltage_deadband": 100.0, "gear.gear_reduction": 60.0}),
    "driven into a stop": (st.PulseServo, {"stops.upper_angle": 1.2, "stops.restitution": 0.4}),
    "inductance": (st.PulseServoInductive, {"motor.armature_inductance": 5e-4}),
    "load friction": (st.PulseServo, {"friction.load_friction_motor": 0.06, "friction.load_friction_external": 0.1}),
    "play": (st.PulseServo, {"gear.backlash": 0.02, "gear.output_inertia": 1e-3}),
    "elastic gear": (st.PulseServo, {"gear.stiffness": 40.0, "gear.output_inertia": 1e-3, "gear.damping": 0.02}),
    "worn potentiometer": (st.PulseServo, {"potentiometer.backlash": 0.02}),
    "friction that fades": (st.PulseServo, {"friction.breakaway_ratio": 1.3, "friction.stribeck_speed": 10.0,
                                            "friction.stribeck_exponent": 1.5})}


@pytest.mark.slow
@pytest.mark.parametrize("name", TERMS)
def test_every_term_is_the_servo_alone(name):
    kind, changes = TERMS[name]
    model = kind(st.load_servo("hitec-hs-755hb").replace(changes))
    end = min(1.2, changes.get("stops.upper_angle", 2.0))
    alone = st.simulate(model, st.signals.step(0.3, end, at=0.1, unit="rad"), duration=1.0, load=WEIGHT,
                        output_step=1e-3)
    for integrator in ("RK4", "implicitfast"):
        time, (angle,), _, _ = followed(hinge(integrator), {"elbow": model},
                                        lambda t: {"elbow": 0.3 if t < 0.1 else end}, 1.0)
        error = np.abs(angle - interpolated(alone, "output_angle", time))
        assert error.max() < (0.8e-3 if integrator == "RK4" else 0.55e-3 * np.abs(alone["output_speed"]).max())
        assert error[-50:].max() < 0.7e-3


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_it_is_of_first_order_in_the_step_or_better(alone, integrator):
    steps = np.array([2e-3, 1e-3, 5e-4])
    worst = []
    for dt in steps.tolist():
        time, (angle,), _, _ = followed(hinge(integrator, dt), {"elbow": servo(st.BoundedServo)}, stepped, 0.5, 2e-3)
        worst.append(np.abs(angle - interpolated(alone[st.BoundedServo], "output_angle", time)).max())
    order = np.diff(np.log(worst)) / np.diff(np.log(steps))
    assert np.all(order > 0.85)
    if integrator == "implicitfast":
        assert np.all(order < 1.15)


def arm_goals(t):
    return {"shoulder": 0.3 if t < 0.05 else 1.2, "elbow": 0.5 if t < 0.15 else 1.4 if t < 0.6 else 0.7}


@pytest.mark.long(but="0 1 0-BoundedServo")
@pytest.mark.parametrize("kind", [st.PulseServo, st.BoundedServo])
@pytest.mark.parametrize("axis", ["0 1 0", "0 0 1"])
def test_an_arm_does_not_depend_on_the_step(kind, axis):
    """At 1 and 0.25 ms: joints within 0.7 mrad by RK4, the tool within 1 mm by implicitfast."""
    for integrator in ("RK4", "implicitfast"):
        (_, q, _, tool), (_, fine, _, finer) = (
            followed(links(integrator, dt, axis), {"shoulder": servo(kind), "elbow": servo(kind)}, arm_goals, 0.9)
            for dt in (1e-3, 2.5e-4))
        if integrator == "RK4":
            assert np.abs(q - fine).max() < 0.7e-3
        assert np.linalg.norm(tool - finer, axis=0).max() < 1e-3
        assert np.abs(q - fine)[:, -1].max() < 0.5e-3


@pytest.mark.long
@pytest.mark.parametrize("axis", ["0 1 0", "0 0 1"])
def test_an_arm_with_play_depends_little_on_the_step(axis):
    """Teeth meet at other instants: joints that play may be off meanwhile, the tool by less than 1 mm."""
    (_, q, _, tool), (_, fine, _, finer) = (
        followed(links("implicitfast", dt, axis), dict.fromkeys(("shoulder", "elbow"), servo(st.DigitalServo)),
                 arm_goals, 1.2) for dt in (1e-3, 2.5e-4))
    assert np.linalg.norm(tool - finer, axis=0).max() < 1e-3
    # Flat, an arm comes to rest anywhere in the play: a seventh of its 8.7 mrad with the rotor of this servo's sheet
    assert np.abs(q - fine)[:, -1].max() < 1.5e-3


@pytest.mark.long(but="implicitfast-BoundedServo")
@pytest.mark.parametrize("kind", [st.PulseServo, st.BoundedServo, st.DigitalServo])
@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_a_held_arm_does_not_creep(kind, integrator):
    """In 100 s of a real servo of plain gears, in 10 s of the one with play."""
    drive, data = driven(links(integrator), dict.fromkeys(("shoulder", "elbow"), servo(kind)))
    data.qpos[:] = [0.3, 0.5]
    drive.command(data, {"shoulder": 0.3, "elbow": 0.5})
    drive.step(data, 3000)
    held = data.qpos.copy()
    drive.step(data, 10_000 if kind is st.DigitalServo else 97_000)
    np.testing.assert_allclose(data.qpos, held, atol=1e-12)
    assert np.abs(data.qvel).max() < 1e-9


@pytest.mark.long
@pytest.mark.parametrize("goals", [[0.2] * 6, [0.1, -0.59, -0.14, -0.01, -0.23, 0.52]])
def test_an_arm_whose_gears_play_falls_onto_its_teeth_and_rests(goals):
    """Links of an SO-101 are light beside rotors: teeth that met within a tick were apart again, and the arm crept."""
    drives = st.DigitalServo(st.feetech_sts("lerobot", servo="feetech-sts3215-12v"))
    ends, steps = [], (5e-4, 1e-3, 1.9e-3, 2e-3, 2.1e-3)
    for step in steps:
        model = st.robots.robot_model("so101")
        model.opt.timestep = step
        drive = st.robots.ServoDrive(model, dict.fromkeys(st.robots.joint_names(model), drives))
        data = mujoco.MjData(drive.model)
        data.qpos[:] = goals
        drive.command(data, dict(zip(drive.joints, goals, strict=True)))
        drive.step(data, round(1.0 / step))
        assert np.abs(data.qvel).max() < 1e-9
        ends.append(data.qpos.copy())
    for end, step in zip(ends[1:], steps[1:], strict=True):
        assert np.abs(end - ends[0]).max() < 4.0 * step  # [rad]; friction holds them in a play of 15 mrad


FOUR = """<mujoco><option timestep="0.001" integrator="{}" gravity="0 0 0"/><worldbody>{}</worldbody></mujoco>"""
WHEEL = ('<body><joint name="{}" axis="0 0 1"/>'
         '<inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body>')
NAMES = ("one", "two", "three", "four")


@pytest.mark.long
@pytest.mark.parametrize("kind", [st.PulseServo, st.DigitalServo])
def test_servos_on_one_supply_are_those_of_simulate_bus(kind):
    """Four wheels that start one after the other: the bus within 10 mV, angles as those of a hinge alone."""
    supply = BATTERY if kind is st.PulseServo else st.Supply(open_circuit_voltage=12.0, internal_resistance=0.3)
    stiff = servo(kind).servo.replace({"gear.backlash": None})  # a wheel that nothing holds floats in the play
    model = kind(stiff)
    ends = dict(zip(NAMES, (1.2, 0.9, 0.3, 1.4), strict=True))
    begin = {name: 0.1 + 0.037 * k for k, name in enumerate(NAMES)}
    fleet = st.simulate_bus({name: (model, st.signals.step(0.5, ends[name], at=begin[name], unit="rad"),
                                    st.loads.Inertia(1e-3)) for name in NAMES},
                            supply=supply, duration=0.6, output_step=1e-3)
    for integrator in ("RK4", "implicitfast"):
        drive, data = driven(FOUR.format(integrator, "".join(map(WHEEL.format, NAMES))),
                             dict.fromkeys(NAMES, model), bus=supply)
        data.qpos[:] = 0.5
        drive.record(data)
        for k in range(600):
            drive.command(data, {name: ends[name] if 1e-3 * k + 1e-9 > begin[name] else 0.5 for name in NAMES})
            drive.step(data)
        record = drive.result(data)
        assert fleet.bus_voltage.min() < supply.open_circuit_voltage - 0.1
        before = fleet.bus(record.time - 1e-8)  # what begins with an instant, a tick does when time next goes on
        assert np.abs(record["one"]["bus_voltage"] - before).max() < 0.01
        for k, name in enumerate(NAMES):
            expected, speed = fleet[name]["output_angle"], fleet[name]["output_speed"]
            assert abs(data.qpos[k] - expected[-1]) < 0.7e-3 + 0.55e-3 * abs(speed[-1])
            off = np.abs(record[name]["joint_angle"] - expected[1:]).max()
            assert off < (0.8e-3 if integrator == "RK4" else 0.55e-3 * np.abs(speed).max())


@pytest.mark.long
def test_a_slide_by_a_rack_is_a_hinge():
    """A mass on a rack is an inertia m r² at the pinion, and gravity a constant torque m g r."""
    radius, mass = 0.012, 0.4
    rack = f"""<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body><joint name="elbow" type="slide"
      axis="0 0 -1"/><inertial pos="0 0 0" mass="{mass}" diaginertia="1e-5 1e-5 1e-5"/></body></worldbody></mujoco>"""
    wheel = f"""<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body><joint name="elbow" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1e-4 1e-4 {mass * radius**2}"/></body></worldbody></mujoco>"""
    model = servo(st.PulseServo)
    one, data = driven(rack, {"elbow": st.robots.Mount(model, zero=0.02, direction=-1, ratio=radius)})
    other, turned = driven(wheel, {"elbow": model})
    data.qpos[0] = 0.02 - 0.4 * radius
    turned.qpos[0] = 0.4
    turned.qfrc_applied[0] = -mass * 9.81 * radius  # the rack goes down where the servo turns back
    for k in range(500):
        goal = 0.4 if k < 100 else 1.3
        one.command(data, {"elbow": 0.02 - goal * radius})
        other.command(turned, {"elbow": goal})
        one.step(data)
        other.step(turned)
        assert data.qpos[0] == pytest.approx(0.02 - turned.qpos[0] * radius, abs=1e-9)
    assert abs(turned.qpos[0] - 1.3) < 0.05


@pytest.mark.long
def test_the_rotor_is_the_armature():
    model = servo(st.BoundedServo)
    drive, _ = driven(hinge(), {"elbow": st.robots.Mount(model, ratio=0.5)})
    value = model.servo.get
    J = value("motor.rotor_inertia") * value("gear.gear_reduction") ** 2
    assert drive.model.dof_armature[0] == pytest.approx(J / 0.25, rel=1e-12)
    played, _ = driven(hinge(), {"elbow": servo(st.DigitalServo)})
    wheel = servo(st.DigitalServo).servo.get("gear.output_inertia")
    assert played.model.dof_armature[0] == wheel  # the motor turns on its own inside the play


def test_direction_mirrors_the_joint():
    model = servo(st.BoundedServo)
    plain, data = driven(links(axis="0 0 1"), {"shoulder": model, "elbow": model})
    mirrored, other = driven(links(axis="0 0 -1"), {
        name: st.robots.Mount(model, direction=-1) for name in ("shoulder", "elbow")})
    data.qpos[:], other.qpos[:] = [0.4, 0.6], [-0.4, -0.6]
    plain.command(data, {"shoulder": 0.9, "elbow": 0.2})
    mirrored.command(other, {"shoulder": -0.9, "elbow": -0.2})
    plain.step(data, 400)
    mirrored.step(other, 400)
    np.testing.assert_allclose(other.qpos, -data.qpos, atol=1e-9)


def test_an_actuator_gives_its_control_as_command_and_no_force():
    actuators = '<actuator><position joint="elbow" kp="50" ctrlrange="0 1" ctrllimited="true"/></actuator>'
    drive, data = driven(links(actuators=actuators), dict.fromkeys(
        ("elbow", "shoulder"), servo(st.BoundedServo)))
    drive.command(data, {"shoulder": 0.5})
    data.qpos[:], data.ctrl[0] = [0.5, 0.5], 3.0
    drive.step(data, 600)
    assert data.qpos[1] == pytest.approx(1.0, abs=0.06)  # the end of its range
    assert data.qfrc_actuator[1] == 0.0


@pytest.mark.long
def test_a_push_is_felt():
    """A force at the joint, one at the body, and gravity count alike."""
    model = servo(st.PulseServo)
    held = []
    for push in ("gravity", "joint", "body"):
        drive, data = driven(hinge("RK4", joint='axis="0 1 0"'), {"elbow": model})
        drive.model.opt.gravity[:] = [0.0, 0.0, -9.81 if push == "gravity" else 0.0]
        if push == "body":
            data.xfrc_applied[1, :3] = [0.0, 0.0, -MASS * 9.81]
        data.qpos[0] = 0.0
        drive.command(data, {"elbow": 0.0})
        for _ in range(300):
            if push == "joint":
                data.qfrc_applied[0] = MASS * 9.81 * LENGTH * math.cos(data.qpos[0])
            drive.step(data)
        held.append((data.qpos[0], drive.torque(data)[0]))
    np.testing.assert_allclose(held, [held[0]] * 3, atol=1e-6)
    assert held[0][1] == pytest.approx(-MASS * 9.81 * LENGTH * math.cos(held[0][0]), rel=1e-6)


@pytest.mark.long
def test_signals_are_those_of_simulate(alone):
    drive, data = driven(hinge("RK4"), {"elbow": servo(st.DigitalServo)})
    data.qpos[0] = 0.3
    drive.record(data)
    for k in range(1200):
        drive.command(data, stepped(1e-3 * k + 1e-9))
        drive.step(data)
    record, expected = drive.result(data)["elbow"], alone[st.DigitalServo]
    np.testing.assert_allclose(record.time, 1e-3 * np.arange(1, 1201), atol=1e-12)
    for name, allowed in (("armature_current", 0.02), ("bus_voltage", 0.02), ("duty", 0.02), ("motor_speed", 8.0)):
        off = np.abs(record[name] - interpolated(expected, name, record.time))
        assert np.median(off) < allowed, name
        assert np.sort(off)[:-40].max() < 20.0 * allowed, name  # at a tick the two look before and after it
    assert SPREAD < record.peak("joint_torque") < 3.0
    assert {"joint_angle", "joint_command", "winding_temperature"} - set(record.names) <= {"winding_temperature"}


@pytest.mark.long
def test_a_servo_that_trips_is_told():
    sts = st.feetech_sts({"P_Coefficient": 32, "Protection_Time": 20}, servo="feetech-sts3215-12v")
    blocked = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body>
      <joint name="elbow" axis="0 1 0" limited="true" range="-0.1 0.05" solreflimit="0.004 1"/>
      <inertial pos="0.05 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/></body></worldbody></mujoco>"""
    drive, data = driven(blocked, {"elbow": st.DigitalServo(sts)})
    drive.record(data)
    drive.command(data, {"elbow": 1.0})
    drive.step(data, 1500)
    assert [remark.kind for remark in drive.result(data)["elbow"].remarks] == ["tripped by overload"]


@pytest.mark.long
@pytest.mark.parametrize(("friction", "kinds"), [(0.0, ["does not come to rest"]), (None, [])])
def test_a_joint_that_does_not_come_to_rest_is_told(friction, kinds):
    """The bus servo of shared/cases/digital-servo-never-rests, at P 32: about 0.7 deg at 2 Hz at a light hinge."""
    sts = st.feetech_sts({"P_Coefficient": 32, "D_Coefficient": 32, "Maximum_Acceleration": 254, "Acceleration": 254},
                         servo="feetech-sts3215-7v4")
    if friction is not None:
        sts = sts.replace({"friction.bearing_coulomb_torque": friction})
    light = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body>
      <joint name="elbow" axis="0 0 1"/><inertial pos="0 0 0" mass="0.01" diaginertia="1e-4 1e-4 1e-4"/>
      </body></worldbody></mujoco>"""
    drive, data = driven(light, {"elbow": st.DigitalServo(sts)})
    drive.record(data)
    drive.command(data, {"elbow": 0.3})
    drive.step(data, 4000)
    record = drive.result(data)["elbow"]
    assert [remark.kind for remark in record.remarks] == kinds
    assert record.trips == ()
    if kinds:
        (remark,) = record.remarks
        assert remark.numbers["swing"] == pytest.approx(np.ptp(record["output_angle"][-2000:]), rel=0.1)
