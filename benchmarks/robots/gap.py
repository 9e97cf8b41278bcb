"""The joints of an SO-101 by actuators that policies are trained with, beside its servos: angles, torques, currents.

All follow the same goals, at steps of 1 ms. The servos have the registers that LeRobot writes. `<position>` and
`<dcmotor>` have the numbers of `recipe_of`; the PD has those of the first, held for a step, clipped, and delayed by 10
ms (assumed; trainers draw it). "Menagerie" is robotstudio_so101 of MuJoCo Menagerie (commit 191a7ba). "BAM M6" is the
friction model of Duclusaud et al., identified on an STS3215 at 7.4 V (Rhoban/bam, params/feetech_sts3215_7_4V/m6.json,
commit 31e5b97), with P 16, in MuJoCo as its authors put it there. "factory" are the same servos with the registers that
Feetech writes.
"""

import sys
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import servotwin as st
from servotwin.robots.mjcf_models import JOINTS, so101

DT, EACH = 1e-3, 6
FACTORY = st.DigitalServo(st.load_servo("feetech-sts3215-7v4"))
SERVO = st.DigitalServo(st.feetech_sts("lerobot", servo="feetech-sts3215-7v4"))
Goals = Callable[[float], np.ndarray]
START = np.array([0.0, -0.5, 0.6, 0.3, 0.0, 0.5])  # rad
_POLICY = np.random.default_rng(0).normal(0.0, 0.12, (100, EACH))
MOTIONS: dict[str, tuple[Goals, float]] = {
    "a step of 20 deg": (lambda t: START + 0.35 * (t >= 0.1), 1.5),
    "a slow sine, 15 deg at 0.2 Hz": (lambda t: START + 0.26 * np.sin(0.4 * np.pi * t), 5.0),
    "a fast sine, 8 deg at 2 Hz": (lambda t: START + 0.14 * np.sin(4.0 * np.pi * t), 2.0),
    "stretched out, and held": (lambda t: START + min(t, 1.0) * np.array([0.0, 1.2, -0.6, -0.3, 0.0, 0.0]), 3.0),
    "steps of 0.5 deg": (lambda t: START + 0.0087 * np.floor(4.0 * t), 2.0),
    "a policy: goals at 20 Hz, 7 deg": (lambda t: START + _POLICY[int(20.0 * t)], 3.0),
}


class Trace(NamedTuple):
    """Angles [rad] of joints, torques that move their links [N m]; mean current of a joint [A], nan: it has none."""

    angle: np.ndarray
    torque: np.ndarray
    current: float


def model_of(actuators: str = "") -> mujoco.MjModel:
    """Return the arm, with joints that have nothing of their own."""
    model = mujoco.MjModel.from_xml_string(so101().replace("</mujoco>", f"<actuator>{actuators}</actuator></mujoco>"))
    model.opt.timestep, model.opt.integrator = DT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for name in ("dof_armature", "dof_damping", "dof_frictionloss"):
        getattr(model, name)[:EACH] = 0.0
    return model


def run(model: mujoco.MjModel, goals: Goals, duration: float, step: Callable[[mujoco.MjData, np.ndarray], None],
        current: Callable[[mujoco.MjData], float] = lambda data: np.nan) -> Trace:
    """Let an actuator follow goals."""
    data, angles, torques, currents = mujoco.MjData(model), [], [], []
    data.qpos[:EACH] = START
    found = np.zeros(model.nv)
    for k in range(round(duration / DT)):
        step(data, goals(k * DT))
        angles.append(data.qpos[:EACH].copy())
        mujoco.mj_rne(model, data, 1, found)
        torques.append(found[:EACH].copy())
        currents.append(current(data))
    return Trace(np.array(angles), np.array(torques), float(np.mean(currents)))


def twin(goals: Goals, duration: float, servo: st.DigitalServo = SERVO) -> Trace:
    """Follow goals by servos."""
    model = model_of()
    drive = st.robots.ServoDrive(model, dict.fromkeys(JOINTS, servo))
    began = []

    def step(data: mujoco.MjData, goal: np.ndarray) -> None:
        if not began:
            drive.reset(data)
            drive.record(data)
            began.append(data)
        drive.command(data, dict(zip(JOINTS, goal.tolist(), strict=True)))
        drive.step(data)

    trace = run(model, goals, duration, step)
    record = drive.result(began[0])
    return trace._replace(current=float(np.mean([np.abs(record[name]["armature_current"]) for name in JOINTS])))


@cache
def recipe() -> st.robots.Recipe:
    """Return the nearest of MuJoCo's own actuators."""
    return st.robots.recipe_of(SERVO)


def with_recipe(actuators: str) -> mujoco.MjModel:
    """Return the arm with joints of the recipe."""
    model, own = model_of(actuators), recipe()
    model.dof_armature[:EACH], model.dof_frictionloss[:EACH] = own.armature, own.friction_loss
    model.dof_damping[:EACH, ...] = 0.0
    model.dof_damping.reshape(model.nv, -1)[:EACH, 0] = own.viscous_friction
    model.dof_solimp[:EACH, :3] = (0.9999, 0.9999, 0.001)
    if "dcmotor" in actuators:
        model.jnt_actfrclimited[:EACH], model.jnt_actfrcrange[:EACH] = 1, (-own.most_torque, own.most_torque)
    return model


def by_control(data: mujoco.MjData, goal: np.ndarray, model: mujoco.MjModel) -> None:
    """Step by actuators whose controls are the goals."""
    data.ctrl[:EACH] = goal
    mujoco.mj_step(model, data)


def built_in(kind: str) -> Callable[[Goals, float], Trace]:
    """Return `<position>` or `<dcmotor>` of the recipe."""
    def followed(goals: Goals, duration: float) -> Trace:
        model = with_recipe("".join(getattr(recipe(), kind)(name) for name in JOINTS))
        return run(model, goals, duration, lambda data, goal: by_control(data, goal, model))
    return followed


def delayed_pd(goals: Goals, duration: float) -> Trace:
    """Follow goals by a PD that is held for a step, clipped, and 10 ms late."""
    model, own = with_recipe(""), recipe()
    waiting = [START] * 10

    def step(data: mujoco.MjData, goal: np.ndarray) -> None:
        waiting.append(goal)
        torque = own.stiffness * (waiting.pop(0) - data.qpos[:EACH]) - own.damping * data.qvel[:EACH]
        data.qfrc_applied[:EACH] = np.clip(torque, -own.most_torque, own.most_torque)
        mujoco.mj_step(model, data)

    return run(model, goals, duration, step)


def menagerie(goals: Goals, duration: float) -> Trace:
    """Follow goals by the actuators of MuJoCo Menagerie's SO-101."""
    model = model_of("".join(f'<position joint="{name}" kp="998.22" kv="2.731" forcerange="-2.94 2.94"/>'
                             for name in JOINTS))
    model.dof_armature[:EACH], model.dof_frictionloss[:EACH] = 0.028, 0.052
    model.dof_damping.reshape(model.nv, -1)[:EACH, 0] = 0.60
    return run(model, goals, duration, lambda data, goal: by_control(data, goal, model))


BAM = {"kt": 1.2753202369175398, "R": 2.753421214375944, "gain": 0.166 * 1.1616979929275297 * 16.0, "vin": 7.4,
       "armature": 0.021564290129722483, "speed": 5.095754044445978, "base": 0.0533134815909817,
       "stribeck": 4.257322248151969e-05, "motor": 0.044912012282132555, "external": 0.24355483356616028,
       "motor_stribeck": 0.00012448975632695385, "external_stribeck": 0.1422905635963302,
       "motor_quad": 0.007594943296670792, "external_quad": 0.00340408727365082, "omega": 0.371136775424206,
       "alpha": 9.93094944677977, "viscous": 0.028160537042911545}


def bam(goals: Goals, duration: float) -> Trace:
    """Follow goals by model M6 of BAM."""
    model, own = model_of(), BAM
    model.dof_armature[:EACH] = own["armature"]
    model.dof_damping.reshape(model.nv, -1)[:EACH, 0] = own["viscous"]
    smooth, torque = START.copy(), np.zeros(EACH)

    def step(data: mujoco.MjData, goal: np.ndarray) -> None:
        nonlocal torque
        way = own["speed"] * DT
        smooth[:] = np.clip(goal, smooth - way, smooth + way)
        speed = data.qvel[:EACH]
        duty = np.clip(own["gain"] * (smooth - data.qpos[:EACH]), -0.97, 0.97)
        before, torque = torque, own["kt"] / own["R"] * (own["vin"] * duty - own["kt"] * speed)
        friction = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)
        held = np.zeros(model.nv)
        held[data.efc_id[friction]] = data.efc_force[friction]
        external = (data.qfrc_constraint - data.qfrc_bias - held)[:EACH]
        still = np.exp(-np.abs(speed / own["omega"]) ** own["alpha"])
        loss = own["base"] + np.abs(external * own["external"] - before * own["motor"]) + still * (
            own["stribeck"] + np.abs(external * own["external_stribeck"] - before * own["motor_stribeck"]))
        against = np.sign(external) != np.sign(before)
        loss += still * against * np.where(np.abs(external) < np.abs(before), own["external_quad"] * external**2,
                                           own["motor_quad"] * before**2)
        model.dof_frictionloss[:EACH] = loss
        data.qfrc_applied[:EACH] = torque
        mujoco.mj_step(model, data)

    return run(model, goals, duration, step, lambda data: float(np.abs(torque).mean() / own["kt"]))


ACTUATORS: dict[str, Callable[[Goals, float], Trace]] = {
    "<position>": built_in("position"), "<dcmotor>": built_in("dcmotor"), "PD, clip, delay": delayed_pd,
    "Menagerie": menagerie, "BAM M6": bam, "factory": partial(twin, servo=FACTORY)}


def rms(values: np.ndarray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def rows() -> Iterator[tuple[str, float, float, float, list[tuple[float, float, float]]]]:
    """Yield of each motion: its name; the servos' error [rad], torque [N m], current [A]; what others are off."""
    for name, (goals, duration) in MOTIONS.items():
        true = twin(goals, duration)
        wanted = np.array([goals(k * DT) for k in range(len(true.angle))])
        others = [actuator(goals, duration) for actuator in ACTUATORS.values()]
        yield name, rms(true.angle - wanted), rms(true.torque), true.current, [
            (rms(one.angle - true.angle), rms(one.torque - true.torque), one.current) for one in others]


def table() -> None:
    """Print how far joints, torques and currents are off those of the servos."""
    print("SO-101 on STS3215 at 7.4 V: rms of six joints; off the servos: angle, torque (and the mean current)")
    print(f"{'':34}{'off its goal':>13}{'torque':>9}{'current':>9}" + "".join(f"{name:>21}" for name in ACTUATORS))
    for name, error, torque, current, others in rows():
        print(f"{name:34}{np.degrees(error):9.2f} deg{torque:5.2f} N m{current:7.2f} A" + "".join(
            f"{np.degrees(angle):8.2f} deg{off:5.2f} N m" + (f" {amps:4.2f} A" if np.isfinite(amps) else "")
            for angle, off, amps in others))
