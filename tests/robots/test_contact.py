"""Contacts and limits, whose forces a servo knows of the last step: no chatter, forces, and no energy from nowhere."""

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import LENGTH, MASS, SPREAD, option, servo

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
FINGER = """<body pos="0 {} 0"><joint name="{}" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 .12 0 0" size=".006"
  mass=".03"/></body>"""


def gripper(dt, free):
    return f"""<mujoco>{option("implicitfast", dt)}<worldbody><geom type="plane" size="1 1 .1" pos="0 0 -.0125"/>
      <body name="box" pos=".09 0 0">{"<freejoint/>" if free else ""}<geom type="box" size=".012 .012 .012" mass=".05"/>
      </body>{FINGER.format(".03", "left")}{FINGER.format("-.03", "right")}</worldbody></mujoco>"""


def limited(dt, solref="0.02 1"):
    return f"""<mujoco>{option("implicitfast", dt)}<worldbody><body>
      <joint name="elbow" axis="0 1 0" limited="true" range="-60 30" solreflimit="{solref}"/>
      <inertial pos="{LENGTH} 0 0" mass="{MASS}" diaginertia="{SPREAD} {SPREAD} {SPREAD}"/>
    </body></worldbody></mujoco>"""


LIGHT = 5.74e-8  # kg m², a rotor of 7 times the arm: heavier ones behind play tremble at limits (docs/theory/mujoco)


def own(kind):
    """Return a servo; that with play has a light rotor."""
    return st.DigitalServo(servo(kind).servo.replace({"motor.rotor_inertia": LIGHT})) if kind is st.DigitalServo else (
        servo(kind))


CLOSE, PUSH = {"left": -0.6, "right": 0.6}, {"elbow": 1.2}


def run(xml, model, goals, duration=1.5, start=None):
    """Return, step by step: force of the constraints, fastest joint, energy, work of servos and of constraints."""
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(xml), dict.fromkeys(goals, model), assume_heat=False)
    own, data = drive.model, mujoco.MjData(drive.model)
    data.qpos[own.jnt_qposadr[own.joint(next(iter(goals))).id]] = start or 0.0
    drive.command(data, goals)
    dofs, rows, work, given = [own.jnt_dofadr[own.joint(name).id] for name in goals], [], 0.0, 0.0
    for _ in range(round(duration / own.opt.timestep)):
        before = data.qvel.copy()
        drive.step(data)
        way = 0.5 * own.opt.timestep * (before + data.qvel)
        work, given = work + drive.torque(data) @ way[dofs], given + data.qfrc_constraint @ way
        mujoco.mj_energyPos(own, data)
        mujoco.mj_energyVel(own, data)
        rows.append((np.abs(data.qfrc_constraint[dofs]).max(), np.abs(data.qvel[dofs]).max(), data.energy.sum(), work,
                     given))
    return np.array(rows).T


def from_nowhere(energy, work, given):
    """Return the most energy that neither servos nor constraints have given, of the largest that there was."""
    rest = energy - work - given
    return (rest - rest[0]).max() / np.abs(np.concatenate([energy, work])).max()


@pytest.mark.long(but="0.004 1-BoundedServo")
@pytest.mark.parametrize("kind", [st.BoundedServo, st.PulseServo, st.DigitalServo])
@pytest.mark.parametrize("solref", ["0.02 1", "0.004 1"])
def test_an_arm_rests_at_its_limit(kind, solref):
    """Still, with the same force at a quarter of the step; with play and a stiff limit that takes half the step."""
    step = 5e-4 if kind is st.DigitalServo else 1e-3
    force, speed, *energies = run(limited(step, solref), own(kind), PUSH)
    finer, _, *_ = run(limited(0.25 * step, solref), own(kind), PUSH)
    assert speed[-200:].max() < 1e-5
    assert np.ptp(force[-200:]) < 1e-4 * force[-1]
    assert force[-1] == pytest.approx(finer[-1], rel=0.05)
    assert from_nowhere(*energies) < 0.01


@pytest.mark.long
@pytest.mark.parametrize("kind", [st.BoundedServo, st.DigitalServo])
def test_a_gripper_rests_at_a_box(kind):
    force, speed, *energies = run(gripper(1e-3, False), own(kind), CLOSE)
    finer, _, *_ = run(gripper(2.5e-4, False), own(kind), CLOSE)
    assert speed[-200:].max() < 1e-5
    assert force[-1] == pytest.approx(finer[-1], rel=0.05)
    assert from_nowhere(*energies) < 1e-6


@pytest.mark.long
def test_pulses_shake_a_gripper_alike_at_any_step():
    """At a box that blocks it a servo gets a pulse each frame: its mean force is the same within 5 %."""
    force, finer = (run(gripper(dt, False), servo(st.PulseServo), CLOSE)[0] for dt in (1e-3, 2.5e-4))
    assert force[1000:].mean() == pytest.approx(finer[4000:].mean(), rel=0.05)


@pytest.mark.long(but="BoundedServo")
@pytest.mark.parametrize("kind", [st.BoundedServo, st.PulseServo, st.DigitalServo])
def test_a_box_that_moves_gets_no_energy_from_nowhere(kind):
    _, _, *energies = run(gripper(1e-3, True), servo(kind), CLOSE)
    assert from_nowhere(*energies) < 1e-3


def test_a_motor_without_drive_takes_energy():
    """An arm falls onto its limit and loses all it has, to the shorted motor and the limit."""
    braking = st.BoundedServo(st.load_servo("hitec-hs-755hb").replace(
        {"electronics.voltage_deadband": 1e3, "gear.gear_reduction": 40.0}))
    _, speed, energy, work, given = run(limited(1e-3), braking, {"elbow": 0.0}, 1.5, -1.0)
    assert np.diff(work).max() < 1e-12
    assert from_nowhere(energy, work, given) < 0.005
    assert energy[-1] < energy[0] - 0.1
    assert speed[-1] < 1e-6
