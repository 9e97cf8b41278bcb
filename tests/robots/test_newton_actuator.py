"""Servos as drives of Newton, in Newton itself, beside `ServoDrive` with steps that are short enough."""

import mujoco
import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, UnknownNameError
from servotwin.robots import Mount, ServoDrive

newton = pytest.importorskip("newton", reason="newton is not installed: it needs an environment of its own")
import warp as wp  # noqa: E402

from servotwin.robots.trainers.newton import DriveServo, add_servos, servos_in  # noqa: E402

wp.set_device("cpu")
pytestmark = pytest.mark.slow
SERVO = st.PulseServo(st.load_servo("hitec-hs-755hb"))
BUS = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({"gear.backlash": 0.0}))
PLAY = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
TURNED = Mount(SERVO, zero=0.3, direction=-1, ratio=1.5)
ARM = """<mujoco><compiler angle="radian"/><option timestep="{step}"/><worldbody>{floor}<body name="base">
<body name="upper" pos="0 0 .1"><joint name="shoulder" axis="0 -1 0"{own}/>
<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".1"/><body name="lower" pos=".1 0 0">
<joint name="elbow" axis="0 -1 0"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".08"/>
</body></body></body></worldbody>{actuators}</mujoco>"""
ACTUATORS = '<actuator><position joint="shoulder"/><position joint="elbow"/></actuator>'
FLOOR = '<geom type="plane" size="1 1 .1"/>'


def arm(step=2e-3, floor="", actuators="", own=""):
    return ARM.format(step=step, floor=floor, actuators=actuators, own=own)


def goals(time):
    return [0.4 + 0.3 * np.sin(4 * time), 0.3 * np.cos(5 * time)]


def by_servo_drive(servos, step, duration, goals=goals, floor=""):
    model = mujoco.MjModel.from_xml_string(arm(step, floor, ACTUATORS))
    drive, data = ServoDrive(model, servos), mujoco.MjData(model)
    drive.reset(data)
    angles = []
    for k in range(round(duration / step)):
        data.ctrl[:] = goals(k * step)
        drive.step(data)
        angles.append(data.qpos.copy())
    return np.array(angles)


class Run:
    """Arms in worlds of Newton, by a solver of it."""

    def __init__(self, servos, worlds=2, solver="SolverMuJoCo", floor="", **more):
        robot, scene = newton.ModelBuilder(), newton.ModelBuilder()
        for builder in (robot, scene):
            newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        robot.add_mjcf(arm(floor=floor))
        add_servos(robot, servos, **more)
        scene.replicate(robot, worlds)
        self.model, self.worlds = scene.finalize(device="cpu"), worlds
        self.solver = getattr(newton.solvers, solver)(self.model)
        self.state, self.next, self.control = self.model.state(), self.model.state(), self.model.control()
        newton.eval_fk(self.model, self.model.joint_q, self.model.joint_qd, self.state)
        self.actuator = self.model.actuators[0]
        self.own, self.own_next = self.actuator.state(), self.actuator.state()

    def step(self, step, goal):
        self.control.joint_target_q.assign(np.tile(np.float32(goal), self.worlds))
        self.control.joint_f.zero_()
        own = self.solver if isinstance(self.solver, newton.solvers.SolverMuJoCo) else None
        self.actuator.drive.meet(self.model, self.actuator, self.state, solver=own)
        self.actuator.step(self.state, self.control, self.own, self.own_next, dt=step)
        self.solver.step(self.state, self.next, self.control, None, step)
        self.state, self.next = self.next, self.state
        self.own, self.own_next = self.own_next, self.own
        return self.state.joint_q.numpy().reshape(self.worlds, -1).copy()

    def run(self, step, duration, goals=goals):
        """Return the angles of the last world."""
        return np.array([self.step(step, goals(k * step))[-1] for k in range(round(duration / step))])


def off(found, true, each):
    return np.sqrt(np.mean((found - true[each - 1::each]) ** 2, axis=0)).max()


@pytest.mark.parametrize(("servos", "solver"), [
    ({"shoulder": SERVO, "elbow": SERVO}, "SolverMuJoCo"), ({"shoulder": BUS, "elbow": BUS}, "SolverMuJoCo"),
    ({"elbow": BUS, "upper/shoulder": SERVO}, "SolverMuJoCo"),
    ({"shoulder": TURNED, "elbow": BUS}, "SolverFeatherstone")],
    ids=["pulses", "bus", "two kinds, in another order", "by a gear, by Featherstone"])
def test_joints_are_those_of_servo_drive_by_steps_of_first_order(servos, solver):
    labels = {"worldbody/base/upper/shoulder" if "/" in name else name: servo for name, servo in servos.items()}
    by_name = {name.rsplit("/", 1)[-1]: servo for name, servo in servos.items()}
    true = by_servo_drive(by_name, 2.5e-4, 0.8)
    at_two, at_four = (off(Run(labels, solver=solver).run(step, 0.8), true, round(step / 2.5e-4))
                       for step in (2e-3, 4e-3))
    assert at_two <= 2e-3
    assert at_four >= 1.4 * at_two


@pytest.mark.parametrize("servo", [SERVO, BUS], ids=["pulses", "bus"])
def test_accelerations_of_the_last_step_less_the_servos_are_those_of_inverse_dynamics(servo):
    found, other = (Run({"shoulder": servo, "elbow": servo}, solver=solver).run(2e-3, 0.5)
                    for solver in ("SolverMuJoCo", "SolverFeatherstone"))
    assert np.abs(found - other).max() <= 3e-4


def test_an_arm_that_presses_on_the_floor_rests_where_servo_drive_has_it():
    def into_the_floor(time):
        return [-0.9, 0.0]

    servos = {"shoulder": BUS, "elbow": BUS}
    true = by_servo_drive(servos, 2e-3, 1.0, into_the_floor, FLOOR)
    run = Run(servos, floor=FLOOR)
    found = run.run(2e-3, 1.0, into_the_floor)
    assert true[-1, 0] > -0.6  # the floor holds it
    assert np.abs(found - true).max() <= 2e-2
    assert np.abs(run.state.joint_qd.numpy()).max() <= 1e-3
    assert np.abs(run.actuator.drive.torque.numpy()).min() > 1.0  # N m


@pytest.mark.parametrize("servo", [BUS, PLAY], ids=["rigid", "play"])
def test_servos_within_the_solver_have_contacts_and_play(servo):
    def run(step, duration, goals, floor=""):
        robot, scene = newton.ModelBuilder(), newton.ModelBuilder()
        for builder in (robot, scene):
            newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        robot.add_mjcf(arm(floor=floor))
        scene.replicate(robot, 2)
        model = scene.finalize(device="cpu")
        solver = newton.solvers.SolverMuJoCo(model)
        drive = servos_in(solver, {"shoulder": servo, "elbow": servo}, timestep=step)
        state, after, control, angles = model.state(), model.state(), model.control(), []
        for k in range(round(duration / step)):
            places = zip(drive.joints, goals(k * step), strict=True)
            drive.command({name: wp.array(np.full(2, goal, np.float32)) for name, goal in places})
            solver.step(state, after, control, None, step)
            state, after = after, state
            angles.append(state.joint_q.numpy()[-2:].copy())
        return np.array(angles)

    servos = {"shoulder": servo, "elbow": servo}
    true = by_servo_drive(servos, 2.5e-4, 0.8)
    assert off(run(2e-3, 0.8, goals), true, 8) <= 2e-3
    if servo is BUS:
        pressed = by_servo_drive(servos, 2e-3, 1.0, lambda time: [-0.9, 0.0], FLOOR)
        assert np.abs(run(2e-3, 1.0, lambda time: [-0.9, 0.0], FLOOR) - pressed).max() <= 8e-3


def test_worlds_begin_anew_by_a_mask_and_do_not_touch_each_other():
    run, draw = Run({"shoulder": SERVO, "elbow": SERVO}, worlds=3), np.random.default_rng(0)
    latest = 0  # step at which the second world began
    for k in range(66):
        angles = run.step(2e-3, [0.8, 0.2])
        if k % 7 == 3:
            mask = draw.random(3) < 0.5
            mask[0] = False
            latest = k + 1 if mask[1] else latest
            run.own.reset(wp.array(np.repeat(mask, 2), dtype=wp.bool))
            for state in (run.state, run.next):
                for name in ("joint_q", "joint_qd"):
                    values = getattr(state, name).numpy().reshape(3, -1)
                    values[mask] = 0.0
                    getattr(state, name).assign(values.ravel())
    alone = Run({"shoulder": SERVO, "elbow": SERVO}, worlds=1)
    for _ in range(66):
        expected = alone.step(2e-3, [0.8, 0.2])
    assert angles[0] == pytest.approx(expected[0], abs=1e-4)
    late = Run({"shoulder": SERVO, "elbow": SERVO}, worlds=1)
    for _ in range(66 - latest):
        expected = late.step(2e-3, [0.8, 0.2])
    assert angles[1] == pytest.approx(expected[0], abs=1e-4)


def test_servos_vary_from_world_to_world_and_from_reset_to_reset():
    run = Run({"shoulder": SERVO, "elbow": SERVO}, vary={"elbow": {"motor.torque_constant": "uniform:20%"}})
    for _ in range(40):
        angles = run.step(2e-3, [0.5, 0.5])
    assert abs(angles[0, 1] - angles[1, 1]) > 1e-3
    (elbow, before), = run.actuator.drive.parameters().items()
    run.own.reset(wp.array(np.repeat([False, True], 2), dtype=wp.bool))
    run.step(2e-3, [0.5, 0.5])
    after = run.actuator.drive.parameters()[elbow]
    assert (after["motor.torque_constant"] == before["motor.torque_constant"]).tolist() == [True, False]
    with pytest.raises(InputError, match=r"^vary of a robot's servos: got 'the inertia of rotors'"):
        Run({"shoulder": SERVO, "elbow": SERVO}, vary={"output_inertia": "uniform:20%"})


@pytest.mark.parametrize(("own", "servos", "options", "error", "words"), [
    ("", {"knee": SERVO}, {}, UnknownNameError, "^unknown joint"), ("", {}, {}, InputError, "^servos of a robot"),
    (' damping="0.1"', {"shoulder": SERVO}, {}, InputError, "^damping of joint shoulder: got 0.1"),
    (' frictionloss="0.1"', {"shoulder": SERVO}, {}, InputError, "^friction loss of joint shoulder"),
    ("", {"shoulder": SERVO}, {"joint_friction": "none"}, InputError, "^joint_friction"),
    ("", {"base_joint": SERVO}, {}, InputError, "^joint base_joint: got 'fixed'"),
    ("", {"shoulder": "sts3215"}, {}, InputError, "^servo")])
def test_mistakes_are_said_in_a_line(own, servos, options, error, words):
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_mjcf(arm(own=own))
    with pytest.raises(error, match=words):
        add_servos(builder, servos, **options)


def test_what_is_missing_is_said_in_a_line():
    with pytest.raises(InputError, match=r"^solver of servos: got 'int'"):
        servos_in(3, {"shoulder": SERVO}, timestep=2e-3)
    builder = newton.ModelBuilder()
    with pytest.raises(InputError, match=r"^DriveServo: got 'add_actuator\(DriveServo\)'"):
        builder.add_actuator(DriveServo, 0)
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_mjcf(arm())
    add_servos(builder, {"shoulder": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))})
    with pytest.raises(InputError, match=r"^servos of a robot: got 'a second time'"):
        add_servos(builder, {"elbow": SERVO})
    with pytest.raises(InputError, match=r"^servo of joint shoulder of a robot: got 'play'"):
        builder.finalize(device="cpu")
    run = Run({"shoulder": SERVO, "elbow": SERVO})
    with pytest.raises(InputError, match=r"^inertias of joints with servos"):
        run.actuator.step(run.state, run.control, run.own, run.own_next, dt=2e-3)
