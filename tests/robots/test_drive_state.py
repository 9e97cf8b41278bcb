"""One state whatever steps it: Python, callback, rollouts on threads, MuJoCo's own copies; saved, restored, reset."""

import pickle

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import hinge, links, servo

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
KINDS = (st.PulseServo, st.BoundedServo, st.DigitalServo)
MOTORS = '<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>'
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION


@pytest.fixture(autouse=True)
def no_callback():
    yield
    mujoco.set_mjcb_control(None)


def arm(kind, integrator="implicitfast", spec=False, **more):
    xml = links(integrator, actuators=MOTORS)
    model = mujoco.MjSpec.from_string(xml) if spec else mujoco.MjModel.from_xml_string(xml)
    return st.robots.ServoDrive(model, dict.fromkeys(("shoulder", "elbow"), servo(kind)), **more)


def controls(steps, seed=0):
    """Return goals that jump now and then, shape (steps, 2)."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(0.2, 1.3, (-(-steps // 40), 2)), 40, axis=0)[:steps]


def state_of(drive, data, kind=FULL):
    state = np.empty(mujoco.mj_stateSize(drive.model, kind))
    mujoco.mj_getState(drive.model, data, state, kind)
    return state


def start(drive, seed):
    data = mujoco.MjData(drive.model)
    data.qpos[:] = np.random.default_rng(100 + seed).uniform(0.2, 1.3, 2)
    return data


def by_steps(drive, seed, steps, kind=FULL):
    data, found = start(drive, seed), []
    for ctrl in controls(steps, seed):
        data.ctrl[:] = ctrl
        drive.step(data)
        found.append(state_of(drive, data, kind))
    return np.array(found)


@pytest.mark.long(but="False-implicit-BoundedServo")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("integrator", ["implicitfast", "RK4", "Euler", "implicit"])
@pytest.mark.parametrize("spec", [False, True])
def test_step_callback_and_rollout_are_one(kind, integrator, spec):
    """64 lanes on two threads, each from its own start, are what `step` does from there, bit for bit."""
    from mujoco import rollout

    drive, steps = arm(kind, integrator, spec), 60
    lanes = 64 if kind is st.PulseServo else 8
    expected = np.array([by_steps(drive, k, steps) for k in range(lanes)])
    mujoco.set_mjcb_control(drive.callback())
    data = start(drive, 3)
    for k, ctrl in enumerate(controls(steps, 3)):
        data.ctrl[:] = ctrl
        mujoco.mj_step(drive.model, data)
        np.testing.assert_array_equal(state_of(drive, data), expected[3, k])
    begin = np.array([state_of(drive, start(drive, k)) for k in range(lanes)])
    threads = [mujoco.MjData(drive.model) for _ in range(2)]
    state, _ = rollout.rollout(drive.model, threads, begin, np.array([controls(steps, k) for k in range(lanes)]))
    np.testing.assert_array_equal(state, expected)
    for one in threads:
        drive.check(one)


@pytest.mark.long(but="implicitfast-BoundedServo")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_forward_between_steps_changes_nothing(kind, integrator):
    drive = arm(kind, integrator)
    expected, data = by_steps(drive, 1, 80), start(drive, 1)
    for k, ctrl in enumerate(controls(80, 1)):
        mujoco.mj_forward(drive.model, data)
        data.ctrl[:] = ctrl
        mujoco.set_mjcb_control(drive.callback())
        mujoco.mj_forward(drive.model, data)
        mujoco.mj_forwardSkip(drive.model, data, mujoco.mjtStage.mjSTAGE_VEL, 1)
        mujoco.set_mjcb_control(None)
        drive.step(data)
        np.testing.assert_allclose(state_of(drive, data), expected[k], rtol=0.0, atol=1e-12)


@pytest.mark.long(but="False-implicitfast-BoundedServo")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
@pytest.mark.parametrize("spec", [False, True])
def test_saved_and_restored_it_goes_on_bit_for_bit(kind, integrator, spec):
    drive = arm(kind, integrator, spec)
    expected, data = by_steps(drive, 2, 120), start(drive, 2)
    goals = controls(120, 2)
    for ctrl in goals[:50]:
        data.ctrl[:] = ctrl
        drive.step(data)
    state = pickle.loads(pickle.dumps(drive.save(data)))
    for place in (data, mujoco.MjData(drive.model)):
        drive.step(place, 7)
        drive.restore(place, state)
        for k in range(50, 120):
            place.ctrl[:] = goals[k]
            drive.step(place)
            np.testing.assert_array_equal(state_of(drive, place), expected[k])


@pytest.mark.long(but="BoundedServo")
@pytest.mark.parametrize("kind", KINDS)
def test_states_of_mujoco_hold_the_servos_of_a_spec(kind):
    """What `mj_getState` and `mj_copyData` have copied goes on as the original does."""
    drive = arm(kind, spec=True)
    expected, data = by_steps(drive, 4, 100), start(drive, 4)
    goals = controls(100, 4)
    for ctrl in goals[:50]:
        data.ctrl[:] = ctrl
        drive.step(data)
    whole, copied, other = state_of(drive, data, INTEGRATION), mujoco.MjData(drive.model), mujoco.MjData(drive.model)
    mujoco.mj_copyData(copied, drive.model, data)
    drive.step(other, 3)
    mujoco.mj_setState(drive.model, other, whole, INTEGRATION)
    for place in (copied, other):
        for k in range(50, 100):
            place.ctrl[:] = goals[k]
            drive.step(place)
            np.testing.assert_array_equal(state_of(drive, place), expected[k])


@pytest.mark.long
def test_a_batch_of_mujoco_is_many_robots():
    batch = pytest.importorskip("mujoco.batch")
    drive = arm(st.PulseServo, spec=True)
    expected = np.array([by_steps(drive, k, 60) for k in range(6)])
    mujoco.set_mjcb_control(drive.callback())
    many = batch.Batch(drive.model, nsim=6, nthread=2)
    qpos, ctrl = many.bind("qpos"), many.bind("ctrl")
    qpos[:] = [start(drive, k).qpos for k in range(6)]
    goals = np.array([controls(60, k) for k in range(6)])
    for n in range(60):
        ctrl[:] = goals[:, n]
        many.step()
        np.testing.assert_array_equal(qpos, expected[:, n, 1:3])


@pytest.mark.long(but="BoundedServo")
@pytest.mark.parametrize("kind", KINDS)
def test_time_that_goes_back_resets_the_servos(kind):
    drive = arm(kind)
    expected, data = by_steps(drive, 5, 60), start(drive, 5)
    drive.record(data)
    for _ in range(3):
        mujoco.mj_resetData(drive.model, data)
        data.qpos[:] = start(drive, 5).qpos
        for k, ctrl in enumerate(controls(60, 5)):
            data.ctrl[:] = ctrl
            drive.step(data)
            np.testing.assert_array_equal(state_of(drive, data), expected[k])
    assert len(drive.result(data)["elbow"].time) == 60


@pytest.mark.parametrize("integrator", ["implicitfast", "Euler"])
def test_derivatives_by_finite_differences_leave_the_servos_alone(integrator):
    """`mjd_transitionFD` steps many times from one instant, and steps on as if it had not."""
    drive = arm(st.BoundedServo, integrator)
    expected, data = by_steps(drive, 6, 60), start(drive, 6)
    A, B = np.zeros((4, 4)), np.zeros((4, 2))
    for k, ctrl in enumerate(controls(60, 6)):
        data.ctrl[:] = ctrl
        if k == 30:
            mujoco.set_mjcb_control(drive.callback())
            mujoco.mjd_transitionFD(drive.model, data, 1e-6, True, A, B, None, None)
            mujoco.set_mjcb_control(None)
        drive.step(data)
        np.testing.assert_allclose(state_of(drive, data), expected[k], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(A[:2, :2], np.eye(2), atol=5e-3)


@pytest.mark.long
def test_a_step_of_another_length_goes_on():
    """The length of MuJoCo's step may change on the way."""
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(hinge("RK4")), {"elbow": servo(st.PulseServo)})
    data = mujoco.MjData(drive.model)
    drive.command(data, {"elbow": 1.0})
    for dt, steps in ((1e-3, 100), (5e-4, 200), (1e-3, 300)):
        drive.model.opt.timestep = dt
        drive.step(data, steps)
    other = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(hinge("RK4")), {"elbow": servo(st.PulseServo)})
    one = mujoco.MjData(other.model)
    other.command(one, {"elbow": 1.0})
    other.step(one, 500)
    assert data.time == pytest.approx(one.time)
    assert data.qpos[0] == pytest.approx(one.qpos[0], abs=5e-4)


@pytest.mark.long
def test_other_models_have_no_servos():
    drive = arm(st.PulseServo)
    other = mujoco.MjModel.from_xml_string(hinge())
    alone, with_callback = mujoco.MjData(other), mujoco.MjData(other)
    mujoco.mj_step(other, alone, 100)
    mujoco.set_mjcb_control(drive.callback())
    mujoco.mj_step(other, with_callback, 100)
    np.testing.assert_array_equal(alone.qpos, with_callback.qpos)
