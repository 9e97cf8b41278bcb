"""`WarpDrive` in MuJoCo Warp itself, beside `ServoDrive` with steps so short that nothing changes any more."""

import mujoco
import numpy as np
import pytest

import servotwin as st
from robots.test_energy import LEGS, quadruped
from servotwin.errors import InputError, UnknownNameError
from servotwin.robots import Mount, ServoDrive, WarpDrive
from servotwin.robots.mjcf_models import JOINTS, so101
from servotwin.robots.servos.mount import joints_of
from servotwin.robots.servos.servo_groups import maps_of, put_into_model
from servotwin.robots.trainers import joint_servos
from servotwin.simulation.compile import threads
from servotwin.simulation.lanes import cuda, lane_threads, vector_gpu
from simulation.test_cuda import built, driver, needs_compilers

mjw = pytest.importorskip("mujoco_warp", reason="mujoco-warp is not installed")
wp = pytest.importorskip("warp")
__all__ = ["built", "driver"]  # fixtures
wp.set_device("cpu")
pytestmark = pytest.mark.slow
SERVO = st.PulseServo(st.load_servo("hitec-hs-755hb"))
BUS = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({"gear.backlash": 0.0}))
PLAY = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
TURNED = Mount(SERVO, zero=1.6, direction=-1, ratio=1.5)
LINK = """<body pos="{at} 0 0"><joint name="{name}" axis="0 -1 0"/>
<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass="{mass}"/>"""
WORLD = """<mujoco><option timestep="{step}"/><worldbody>{floor}<body pos="0 0 .1">{links}</body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""
FLOOR = '<geom type="plane" size="1 1 .1"/>'


def arm(step, masses=(0.2,), floor="", actuators=True):
    """Return a chain of links, each with a joint a, b, ..., as an MjModel."""
    names, links = "abc"[:len(masses)], ""
    for name, mass in reversed(list(zip(names, masses, strict=True))):
        links = LINK.format(at=0 if name == "a" else 0.1, name=name, mass=mass) + links + "</body>"
    own = "".join(f'<position joint="{name}" kp="1"/>' for name in names) if actuators else ""
    return mujoco.MjModel.from_xml_string(WORLD.format(step=step, floor=floor, links=links, actuators=own))


def sines(time, count):
    return [0.6 + 0.3 * np.sin(4 * time), 0.3 * np.cos(5 * time), 0.3 * np.sin(6 * time)][:count]


def by_servo_drive(servo, masses, step, duration, goals=sines, floor=""):
    model = arm(step, masses, floor)
    drive = ServoDrive(model, dict.fromkeys("abc"[:len(masses)], servo))
    data = mujoco.MjData(model)
    data.qpos[:] = 0.3
    drive.reset(data)
    angles = []
    for k in range(round(duration / step)):
        data.ctrl[:] = goals(k * step, len(masses))
        drive.step(data)
        angles.append(data.qpos.copy())
    return np.array(angles)


def by_warp(servo, masses, step, duration, goals=sines, floor=""):
    """Return angles in the second of two worlds, speeds at the end, and the drive."""
    model = arm(step, masses, floor)
    drive = WarpDrive(model, dict.fromkeys("abc"[:len(masses)], servo), worlds=2)
    start = mujoco.MjData(model)
    start.qpos[:] = 0.3
    own, data = mjw.put_model(model), mjw.put_data(model, start, nworld=2)
    drive.attach(own)
    angles = []
    for k in range(round(duration / step)):
        data.ctrl.assign(np.tile(np.float32(goals(k * step, len(masses))), (2, 1)))
        mjw.step(own, data)
        angles.append(data.qpos.numpy()[1].copy())
    return np.array(angles), data.qvel.numpy()[1], drive


def off(servo, masses, step, fine=2.5e-4):
    """Return how far joints are off [rad rms]."""
    true = by_servo_drive(servo, masses, fine, 0.5)
    found, _, _ = by_warp(servo, masses, step, 0.5)
    each = round(step / fine)
    return np.sqrt(np.mean((found - true[each - 1::each]) ** 2, axis=0))


@pytest.mark.parametrize(("servo", "masses"), [
    (SERVO, (0.2,)), (BUS, (0.2,)), (PLAY, (0.2,)), (TURNED, (0.2,)), (SERVO, (0.1, 0.08, 0.05)),
    (BUS, (0.1, 0.08, 0.05))],
    ids=["pulses", "bus", "play", "by a gear, the other way round", "three joints", "three joints on a bus"])
def test_joints_are_those_of_servo_drive_by_steps_of_first_order(servo, masses):
    at_two, at_four = off(servo, masses, 2e-3), off(servo, masses, 4e-3)
    assert at_two.max() <= 2e-3
    assert at_four.max() >= 1.4 * at_two.max()


def test_an_arm_that_presses_on_the_floor_rests_where_servo_drive_has_it():
    def into_the_floor(time, count):
        return [-0.9, 0.0][:count]

    masses = (0.1, 0.08)
    true = by_servo_drive(BUS, masses, 2e-3, 1.0, into_the_floor, FLOOR)
    found, speeds, drive = by_warp(BUS, masses, 2e-3, 1.0, into_the_floor, FLOOR)
    assert found[-1, 0] > -0.6  # the floor holds it
    assert np.abs(found - true).max() <= 8e-3
    assert np.abs(speeds).max() <= 1e-3
    assert (drive.torque.numpy() < -2.0).all()  # N m


def test_an_so101_is_that_of_servo_drive():
    def at(step):
        model = mujoco.MjModel.from_xml_string(so101())
        model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        return model, mujoco.MjData(model)

    def places(k, step):
        return 0.4 * np.sin(np.arange(2.0, 8.0) * k * step)

    servos, (model, data), true = dict.fromkeys(JOINTS, BUS), at(2.5e-4), []
    drive = ServoDrive(model, servos, joint_friction="clear")
    drive.reset(data)
    for k in range(2400):
        drive.command(data, dict(zip(JOINTS, places(k, 2.5e-4), strict=True)))
        drive.step(data)
        true.append(data.qpos[:6].copy())
    model, start = at(2e-3)
    drive = WarpDrive(model, servos, joint_friction="clear")
    own, data = mjw.put_model(model), mjw.put_data(model, start, nworld=1)
    drive.attach(own)
    found = []
    for k in range(300):
        drive.command(dict(zip(JOINTS, places(k, 2e-3), strict=True)))
        mjw.step(own, data)
        found.append(data.qpos.numpy()[0, :6].copy())
    assert np.sqrt(np.mean((np.array(found) - true[7::8]) ** 2, axis=0)).max() <= 5e-3


def test_legs_with_play_that_fall_stand_and_rest():
    model = mujoco.MjModel.from_xml_string(quadruped(2e-3, "implicitfast", 1))
    drive, start = WarpDrive(model, dict.fromkeys(LEGS, PLAY)), mujoco.MjData(model)
    start.qpos[2] += 0.05
    start.qpos[7:] = [0.5, -1.0] * 4
    own, data = mjw.put_model(model), mjw.put_data(model, start, nworld=1)
    drive.attach(own)
    for _ in range(500):
        mjw.step(own, data)
    place = data.qpos.numpy()[0]
    assert 2.0 * (place[4]**2 + place[5]**2) <= 1e-4  # upright
    assert 0.15 <= place[2] <= 0.153
    assert np.abs(data.qvel.numpy()).max() <= 1e-3


@pytest.mark.parametrize("vary", [
    {"friction.coulomb_torque_forward": "uniform:30%", "electronics.deadband": "uniform:4us..16us"},
    {"output_inertia": "uniform:40%", "stops.upper_angle": "uniform:0.3..0.5"}])
def test_a_servo_that_varies_is_that_of_its_own_numbers_from_reset_to_reset(vary):
    def last(servo, worlds, resets=0, **more):
        model = arm(2e-3)
        drive = WarpDrive(model, {"a": servo}, worlds, **more)
        own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=worlds)
        drive.attach(own)
        for _ in range(resets):
            mjw.step(own, data)
            mjw.reset_data(own, data, wp.array(np.arange(worlds) != 1, dtype=bool))
            drive.reset(np.arange(worlds) != 1)
        data.ctrl.assign(np.full((worlds, 1), 0.6, np.float32))
        for _ in range(60):
            mjw.step(own, data)
        return data.qpos.numpy()[:, 0], drive.parameters()

    first, drawn = last(SERVO, 3, vary=vary, seed=5)
    found, others = last(SERVO, 3, resets=2, vary=vary, seed=5)
    assert np.ptp(first) > 1e-3
    assert last(SERVO, 1)[1] == {}
    for name, values in others["a"].items():
        assert (values == drawn["a"][name]).tolist() == [False, True, False]
    for angles, numbers in ((first, drawn), (found, others)):
        for world in (0, 1, 2) if angles is first else (0, 2):
            servo = SERVO.servo.replace({name: float(values[world]) for name, values in numbers["a"].items()})
            assert angles[world] == pytest.approx(last(st.PulseServo(servo), 1)[0][0], abs=2e-5)
    assert np.array_equal(last(SERVO, 3, resets=2, vary={"a": vary}, seed=5)[0], found)


def test_worlds_are_reset_by_a_mask_and_do_not_touch_each_other():
    model = arm(2e-3)
    drive = WarpDrive(model, {"a": SERVO}, worlds=3)
    own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=3)
    drive.attach(own)
    rng = np.random.default_rng(0)
    data.ctrl.assign(np.full((3, 1), 0.8, np.float32))
    for k in range(60):
        mjw.step(own, data)
        if k % 7 == 3:
            mask = rng.random(3) < 0.5
            mask[0] = False
            before = data.qpos.numpy().copy()
            mjw.reset_data(own, data, wp.array(mask, dtype=bool))
            drive.reset(mask if k % 2 else wp.array(mask, dtype=bool))
            data.ctrl.assign(np.full((3, 1), 0.8, np.float32))
            assert np.array_equal(data.qpos.numpy()[~mask], before[~mask])
            assert not drive.torque.numpy()[mask].any()
    model = arm(2e-3)
    alone = WarpDrive(model, {"a": SERVO})
    own, one = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=1)
    alone.attach(own)
    one.ctrl.assign(np.full((1, 1), 0.8, np.float32))
    for _ in range(60):
        mjw.step(own, one)
    assert data.qpos.numpy()[0, 0] == pytest.approx(one.qpos.numpy()[0, 0], abs=1e-6)


def test_joints_without_an_actuator_are_told_by_name():
    model = arm(2e-3, actuators=False)
    drive = WarpDrive(model, {"a": SERVO}, worlds=2)
    own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=2)
    drive.attach(own)
    for wrong, words in (([0.3, 0.7, 0.1], "an array of shape"), (np.nan, "got nan")):
        with pytest.raises(InputError, match=f"^command of joint a.*{words}"):
            drive.command({"a": wrong})
    with pytest.raises(InputError, match=r"^worlds of a WarpDrive: got 'an array of shape \(3,\)', allowed: a"):
        drive.reset(np.ones(3, bool))
    with pytest.raises(InputError, match=r"^command of joint a: got 'an array of float64, shape \(2,\)'"):
        drive.command({"a": wp.zeros(2, dtype=wp.float64)})
    drive.command({"a": [0.3, 0.7]})
    for _ in range(300):
        mjw.step(own, data)
    assert data.qpos.numpy()[:, 0] == pytest.approx([0.3, 0.7], abs=0.03)
    drive.command({"a": wp.array(np.float32([0.7, 9.0]))})
    for _ in range(300):
        mjw.step(own, data)
    assert data.qpos.numpy()[:, 0] == pytest.approx([0.7, SERVO.value("stops.upper_angle")], abs=0.05)


def test_a_model_that_was_there_before_gets_rotors_and_no_other_force():
    def run(late):
        model = arm(2e-3, (0.2, 0.1))
        own = mjw.put_model(model) if late else None
        drive = WarpDrive(model, {"a": BUS, "b": BUS})
        own = own or mjw.put_model(model)
        drive.attach(own)
        data = mjw.put_data(model, mujoco.MjData(model), nworld=1)
        data.ctrl.assign(np.full((1, 2), 0.5, np.float32))
        for _ in range(100):
            mjw.step(own, data)
        return data.qpos.numpy()

    assert np.array_equal(run(late=True), run(late=False))


def test_what_looks_at_a_state_lets_no_time_pass():
    def run(looks):
        model = arm(2e-3)
        drive = WarpDrive(model, {"a": BUS}, worlds=2)
        own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=2)
        drive.attach(own)
        for k in range(150):
            data.ctrl.assign(np.full((2, 1), 0.8 if k < 90 else 0.2, np.float32))
            if k == 40:
                mask = wp.array(np.array([False, True]), dtype=bool)
                mjw.reset_data(own, data, mask)
                drive.reset(mask)
            for _ in range(looks * (k % 3)):
                mjw.forward(own, data)
            mjw.step(own, data)
        return data.qpos.numpy()

    assert run(looks=1) == pytest.approx(run(looks=0), abs=2e-5)


@pytest.mark.parametrize("servo", [SERVO, BUS], ids=["pulses", "bus"])
def test_servos_meet_what_numbers_of_64_bits_say(servo):
    """MuJoCo on the processor has joints, inertias and accelerations for 10 s, and NumPy the law that servos meet.

    Angles are those that a step adds, beyond the rounding of a joint's own angle to 32 bits, 3e-8 rad.
    """
    model, step, count = arm(2e-3, (0.2, 0.1, 0.05)), 2e-3, 3
    own = joints_of(model, dict.fromkeys("abc", servo))
    maps = maps_of(model, own, None)
    servos = joint_servos.JointServos(own, maps, 1, wp.get_device("cpu"), 7, "an arm")
    put_into_model(mujoco, model, own, np.median(servos.armature, axis=0))
    lanes = st.VectorSimulator(servo, count, seed=7)
    behind = lanes._numbers.own_inertia()
    data, torque, whole = mujoco.MjData(model), np.zeros(count), np.zeros((count, count))
    angle, speed, control, free, into = (wp.zeros((1, count), dtype=float) for _ in range(5))
    block = wp.zeros((1, count, count), dtype=float)
    data.qpos[:] = 0.3
    off, forces = [], []
    for k in range(5000):
        data.qfrc_applied[:] = 0.0
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, whole)
        inverse, goals = np.linalg.inv(whole), [0.3 + 0.5 * goal for goal in sines(k * step, count)]
        for array, values in ((angle, data.qpos), (speed, data.qvel), (control, goals), (free, data.qacc)):
            array.assign(np.float32([values]))
        block.assign(np.float32([inverse]))
        if k == 0:
            lanes.reset(command_angle=data.qpos, output_angle=data.qpos)
        servos.begin(angle)
        servos.advance(step, angle, speed, control, free, block, into)
        a = data.qacc + inverse @ torque - np.diag(inverse) * torque
        J = 1.0 / np.diag(inverse)
        lanes.set(output_angle=data.qpos, output_speed=data.qvel, load_inertia=J - behind)
        lanes.advance(step, command_angle=goals, external_torque=-J * a)
        gained = (lanes["output_speed"] - data.qvel) / step
        torque = (gained - a) * J
        turned = servos._crews[0].sims["output_angle"] - np.float32(data.qpos)
        off.append(np.abs(turned - (lanes["output_angle"] - data.qpos)).max())
        data.qfrc_applied[:] = np.linalg.solve(inverse, gained - data.qacc)
        forces.append(np.abs(into.numpy()[0] - data.qfrc_applied).max())
        mujoco.mj_step(model, data)
    assert np.quantile(off, 0.99) <= 1e-9  # 6e-10 and 8e-11; all of pulses 1.2e-9
    assert max(off) <= 1e-6  # where rounding decides on a count of the encoder
    assert np.quantile(forces, 0.999) <= 1e-5


def test_what_lanes_remembered_is_put_back_on_a_gpu_by_columns_and_by_rings():
    from servotwin.robots.trainers import warp_kernels as kernels

    again, servos, lanes = wp.array(np.array([False, True]), dtype=wp.bool), 3, 6
    for shape, each, lane_of in (((4, lanes), 0, lambda at: at[1]), ((lanes, 2, 5), 10, lambda at: at[0])):
        for dtype in (np.float32, np.int32):
            before, now = (np.arange(np.prod(shape)).astype(dtype) + shift for shift in (0, 1000))
            given = wp.array(now)
            wp.launch(kernels.take_back, dim=now.size, inputs=[again, servos, lanes, each, wp.array(before), given])
            back = np.array([lane_of(at) >= servos for at in np.ndindex(shape)])
            assert np.array_equal(given.numpy(), np.where(back, before, now))


@needs_compilers
@pytest.mark.parametrize("servo", [SERVO, BUS], ids=["pulses", "bus"])
def test_servos_on_a_gpu_are_those_of_the_processor(servo, driver, monkeypatch):
    """The driver is the stand-in: memory of the device is that of the processor, and Warp takes it for such."""
    class There(joint_servos._Crew):
        def __init__(self, model, which, worlds, device, seed, vary):
            numbers = st.VectorSimulator(model, worlds * len(which))._numbers
            for text in lane_threads.ThreadedLanes(numbers, "float32")._texts:
                driver.library.stand_in_library(threads.library(text)._name.encode())
            super().__init__(model, which, worlds, "cuda", seed, vary)
            assert isinstance(self.sims, vector_gpu.VectorSimulatorOnGpu)

    def run():
        model = arm(2e-3)
        drive = WarpDrive(model, {"a": servo}, worlds=3, seed=2, vary={
            "output_inertia": "uniform:40%", "friction.coulomb_torque_forward": "uniform:30%"})
        own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=3)
        drive.attach(own)
        for k in range(120):
            data.ctrl.assign(np.full((3, 1), 0.6, np.float32))
            if k == 50:
                mask = wp.array(np.array([False, True, False]))
                mjw.reset_data(own, data, mask)
                drive.reset(mask)
            for _ in range(k % 2):
                mjw.forward(own, data)
            mjw.step(own, data)
        return data.qpos.numpy()[:, 0], drive.parameters()["a"], own.dof_armature.numpy()[:, 0]

    here, numbers, armature = run()
    monkeypatch.setattr(cuda, "KDL_CUDA", 1)
    for module in (lane_threads, vector_gpu):
        monkeypatch.setattr(module, "is_guest", lambda values: isinstance(values, wp.array))
    monkeypatch.setattr(wp.array, "__dlpack__", lambda self, stream=None: wp.to_dlpack(self))
    monkeypatch.setattr(joint_servos, "_Crew", There)
    found, drawn, own_armature = run()
    assert found == pytest.approx(here, abs=2e-6)
    assert own_armature == pytest.approx(armature, rel=1e-6)
    assert len(set(armature)) == 3
    assert all(np.array_equal(drawn[name], values) for name, values in numbers.items())
    assert abs(here[1] - here[0]) > 1e-3


def test_data_of_other_worlds_are_refused():
    model = arm(2e-3)
    drive = WarpDrive(model, {"a": SERVO}, worlds=2)
    own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=3)
    drive.attach(own)
    with pytest.raises(InputError, match=r"^data of a WarpDrive: got '3 worlds of 1 degrees of freedom', allowed: 2"):
        mjw.step(own, data)


@pytest.mark.parametrize(("call", "error", "words"), [
    (lambda model: WarpDrive("arm.xml", {"a": SERVO}), InputError, "^model of a WarpDrive: got 'str'"),
    (lambda model: WarpDrive(model, {}), InputError, "^servos of a WarpDrive"),
    (lambda model: WarpDrive(model, {"z": SERVO}), (InputError, UnknownNameError), "z"),
    (lambda model: WarpDrive(model, {"a": SERVO}, worlds=0), InputError, "^worlds: got 0"),
    (lambda model: WarpDrive(model, {"a": SERVO}, timestep=0.0), InputError, "^timestep: got 0.0"),
    (lambda model: WarpDrive(model, {"a": SERVO}, timestep=np.nan), InputError, "^timestep: got nan"),
    (lambda model: WarpDrive(model, {"a": SERVO}, vary=3), InputError, "^vary: got 'int'"),
    (lambda model: WarpDrive(model, {"a": SERVO}, vary={"z": {}}), UnknownNameError, "^unknown joint with a servo"),
    (lambda model: WarpDrive(model, {"a": SERVO}).command({"a": 0.3}), InputError, "^command of joint a")])
def test_mistakes_are_said_in_a_line(call, error, words):
    with pytest.raises(error, match=words) as caught:
        call(arm(2e-3))
    assert "\n" not in str(caught.value)
