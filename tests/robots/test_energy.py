"""The energy books of a drive, and legs on servos with play that stand whatever the solver was told."""

import math
import warnings

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import LENGTH, MASS, SPREAD, hinge, servo

pytestmark = pytest.mark.long

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
TRUNK = 0.155  # m
LEGS = [f"{part}{k}" for k in range(4) for part in ("hip", "knee")]
PLAY = st.load_servo("feetech-sts3215-12v")
RIGID = PLAY.replace({"gear.backlash": None})


def quadruped(dt, integrator, iterations):
    """Return a trunk of 1 kg on four legs of two joints each."""
    legs = "".join(
        f'<body pos="{x} {y} 0"><joint name="hip{k}" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.08" size=".01" mass=".08" contype="0" conaffinity="0"/>'
        f'<body pos="0 0 -.08"><joint name="knee{k}" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.07" size=".008" mass=".04" contype="0" conaffinity="0"/>'
        '<geom type="sphere" size=".012" pos="0 0 -.08" mass=".01"/></body></body>'
        for k, (x, y) in enumerate([(0.1, 0.06), (0.1, -0.06), (-0.1, 0.06), (-0.1, -0.06)]))
    return (f'<mujoco><option timestep="{dt}" integrator="{integrator}" iterations="{iterations}"/><worldbody>'
            f'<geom type="plane" size="2 2 .1"/><body pos="0 0 {TRUNK}"><freejoint/>'
            f'<geom type="box" size=".1 .05 .025" mass="1.0"/>{legs}</body></worldbody></mujoco>')


def stood(own, dt, integrator, iterations, drop, **more):
    """Let a quadruped stand for a second, or drop onto its feet; return drive, data, heights and the record."""
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(quadruped(dt, integrator, iterations)),
                                 dict.fromkeys(LEGS, st.DigitalServo(own)), assume_heat=False, **more)
    data = mujoco.MjData(drive.model)
    data.qpos[2] += drop
    data.qpos[7::2], data.qpos[8::2] = 0.5, -1.0
    drive.record(data)
    heights = []
    for _ in range(round(1.0 / dt)):
        drive.step(data)
        heights.append(data.qpos[2])
    return drive, data, np.array(heights), drive.result(data)


def work_of(record):
    return sum(record[name]["joint_work"] for name in record)


def stands(dt, integrator, iterations, drop):
    """Compare a quadruped with play beside the same without: height, energy, speeds."""
    (_, _, plain, _), (_, data, heights, record) = (stood(own, dt, integrator, iterations, drop)
                                                    for own in (RIGID, PLAY))
    what = f"{integrator}, {1e3 * dt:g} ms, {iterations} iterations, drop {drop:g} m"
    for high, low in ((heights.max(), plain.max()), (heights[-1], plain[-1])):
        assert abs(high - low) <= min(0.1 * low, 5e-3), what
    assert np.all(record.energy <= record.energy[0] + work_of(record) + 0.01 * record.energy[0]), what
    assert np.abs(data.qvel[6:]).max() <= 2.0, what
    assert "energy from nowhere" not in [remark.kind for remark in record.remarks], what


ROWS = [(dt, integrator, iterations, drop) for integrator in ("Euler", "implicitfast", "RK4")
        for dt in (2e-3, 1e-3, 5e-4) for iterations in (1, 5, 100) for drop in (0.0, 0.05)]
FEW = [(2e-3, "implicitfast", 1, 0.05), (1e-3, "implicitfast", 1, 0.0), (1e-3, "Euler", 1, 0.05)]


@pytest.mark.parametrize("row", FEW)
def test_legs_with_play_stand(row):
    stands(*row)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [2e-3, 1e-3, 5e-4])
def test_legs_with_play_stand_by_any_solver(dt):
    for row in ROWS:
        if row[0] == dt and row not in FEW:
            stands(*row)


def test_a_solver_as_given_is_warned_of():
    """One iteration at 2 ms: the trunk jumps, by energy that nothing has given."""
    drive, data, heights, record = stood(PLAY, 2e-3, "implicitfast", 1, 0.0, solver="given")
    assert drive.model.opt.iterations == 1
    assert heights.max() > 1.2 * TRUNK
    assert record.energy_from_nowhere[-1] > record.energy[0]
    assert [remark.kind for remark in record.remarks] == ["few solver iterations", "energy from nowhere"]
    with pytest.warns(UserWarning, match="iterations = 1 .at least 10 is safe."):
        notes = drive.check(data)
    assert len(notes) == 2
    assert "J more than there was" in notes[1]


@pytest.mark.parametrize(("options", "own", "after"), [
    ('iterations="1" ls_iterations="5"', PLAY, (10, 20)), ('iterations="50" ls_iterations="5"', PLAY, (50, 20)),
    ('iterations="100" ls_iterations="50"', PLAY, (100, 50)), ('iterations="1" ls_iterations="5"', RIGID, (1, 5)),
    ('iterations="1" ls_iterations="5"', RIGID.replace({"gear.stiffness": 100.0}), (10, 20))])
def test_iterations_are_raised_where_motor_and_output_move_apart(options, own, after):
    xml = hinge().replace("<option", f"<option {options}")
    given = tuple(int(word.split('"')[1]) for word in options.split())
    for source in (mujoco.MjModel.from_xml_string(xml), mujoco.MjSpec.from_string(xml)):
        drive = st.robots.ServoDrive(source, {"elbow": st.DigitalServo(own)}, assume_heat=False)
        assert (drive.model.opt.iterations, drive.model.opt.ls_iterations) == after
        data = mujoco.MjData(drive.model)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            notes = drive.check(data)
        assert len(notes) == (given != after)
        assert all(f"to {new}" in notes[0] for old, new in zip(given, after, strict=True) if old != new)


def test_a_solver_is_raised_or_given():
    with pytest.raises(st.errors.InputError, match="solver: got 'more', allowed: 'raised' or 'given'"):
        st.robots.ServoDrive(mujoco.MjModel.from_xml_string(hinge()), {"elbow": servo(st.PulseServo)}, solver="more")


# --- the books --------------------------------------------------------------------------------------------------------


def lifted(**more):
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(hinge(**more)), {"elbow": servo(st.PulseServo)})
    data = mujoco.MjData(drive.model)
    data.qpos[0] = 1.0  # below the horizontal
    return drive, data


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast", "Euler"])
def test_the_work_of_a_servo_is_the_energy_that_it_gives(integrator):
    """m g l sin 1 when its weight is up, and ½ J w² on the way; a semi-implicit step errs by 0.4 % in gravity."""
    drive, data = lifted(integrator=integrator)
    drive.record(data)
    drive.command(data, {"elbow": 0.0})
    inertia = float(drive.model.dof_armature[0]) + MASS * LENGTH**2 + SPREAD
    for _ in range(60):
        drive.step(data, 10)
        record = drive.result(data)
        weight, moving = MASS * 9.81 * LENGTH, 0.5 * inertia * data.qvel[0] ** 2
        assert record.energy[-1] == pytest.approx(moving - weight * math.sin(data.qpos[0]), abs=1e-9)
        given = moving + weight * (math.sin(1.0) - math.sin(data.qpos[0]))
        assert record["elbow"]["joint_work"][-1] == pytest.approx(given, abs=4e-3 * np.abs(record.energy).max())
    assert given == pytest.approx(weight * math.sin(1.0), rel=0.05)  # it droops
    assert record.energy_from_nowhere[-1] <= 4e-3 * np.abs(record.energy).max()
    assert record.remarks == ()
    assert np.isfinite(record.energy).all()


def test_forces_of_others_are_work_and_not_from_nowhere():
    drive, data = lifted()
    drive.record(data)
    data.qfrc_applied[0] = -0.6  # lifts the weight, against the servo
    drive.step(data, 400)
    record = drive.result(data)
    assert record["elbow"]["joint_work"][-1] < -0.01
    assert record.energy[-1] > record.energy[0] + 0.003
    assert record.energy_from_nowhere[-1] <= 4e-3 * np.abs(record.energy).max()


def test_a_state_that_is_restored_brings_its_energy():
    drive, data = lifted()
    low = drive.save(data)
    drive.record(data)
    drive.command(data, {"elbow": 0.0})
    drive.step(data, 300)
    high = drive.save(data)
    drive.restore(data, low)
    drive.step(data, 10)
    drive.restore(data, high)
    drive.step(data, 10)
    assert drive.result(data).energy_from_nowhere[-1] <= 4e-3 * MASS * 9.81 * LENGTH


def test_mocap_bodies_may_give_what_they_want():
    xml = hinge().replace("<worldbody>", '<worldbody><body mocap="true"><geom size=".01"/></body>')
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(xml), {"elbow": servo(st.PulseServo)})
    data = mujoco.MjData(drive.model)
    drive.record(data)
    drive.step(data, 20)
    record = drive.result(data)
    assert np.isnan(record.energy_from_nowhere).all()
    assert [remark.kind for remark in record.remarks] == ["energy from nowhere not known"]
    assert record.notes[-1] == "energy from nowhere is not known: mocap bodies move, and nobody counts their work"
    assert np.isfinite(record.energy).all()
