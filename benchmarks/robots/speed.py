"""What servos cost beside MuJoCo's own step: from Python, in rollouts, and beside controllers written in Python."""

import math
from collections.abc import Callable

import arms
import mujoco
import numpy as np
from common import best
from mujoco import rollout

import servotwin as st

STEPS, LANES = 600, 4


def goals(joints: int, k: int) -> dict[str, float]:
    return {f"j{i}": 0.3 + 0.5 * ((k + i) % 2) for i in range(joints)}


def moved(step: Callable[[int], None]) -> float:
    """Return the time of a step, with joints that are sent to and fro every 300 steps [s]."""
    return best(lambda: [step(k) for k in range(STEPS)] and None, 7) / STEPS


def python_controller(model: mujoco.MjModel, servo: st.Servo) -> Callable[[mujoco.MjData, np.ndarray], None]:
    """Return a controller in the manner of published ones: voltage law and friction of each joint, in Python.

    Friction goes into MuJoCo's friction loss, the voltage law into a torque.
    """
    N, R = servo.gear.gear_reduction, servo.motor.armature_resistance
    K, V = N * servo.motor.torque_constant, servo.supply.open_circuit_voltage
    model.dof_armature[:] = servo.motor.rotor_inertia * N**2

    def control(data: mujoco.MjData, goal: np.ndarray) -> None:
        for k in range(model.nv):
            q, w = data.qpos[k], data.qvel[k]
            volts = min(max(40.0 * (goal[k] - q), -V), V)
            data.qfrc_applied[k] = K * (volts - K * w) / R
            model.dof_frictionloss[k] = N * servo.friction.coulomb_torque_forward * (1.0 + 0.2 * math.exp(-abs(w)))
            model.dof_damping[k] = 1e-3
    return control


def table() -> None:
    """Print times per joint."""
    print(f"{'joints':>6} {'':10}{'mj_step':>9}{'step':>9}{'us a joint':>12}{'rollout':>10}{'with':>8}"
          f"{'us a joint':>12}")
    for joints in (1, 12):
        plain = mujoco.MjModel.from_xml_string(arms.chains(joints))
        idle = mujoco.MjData(plain)
        own = best(lambda m=plain, d=idle: mujoco.mj_step(m, d, STEPS), 7) / STEPS
        single = moved(lambda k, m=plain, d=idle: mujoco.mj_step(m, d))
        for name, model in arms.servos().items():
            drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(arms.chains(joints)),
                                         {f"j{k}": model for k in range(joints)}, assume_heat=False)
            data = mujoco.MjData(drive.model)

            def step(k: int, drive: st.robots.ServoDrive = drive, data: mujoco.MjData = data, n: int = joints) -> None:
                if k % 300 == 0:
                    drive.command(data, goals(n, k // 300))
                drive.step(data)
            taken = moved(step)
            alone, served = rolled(drive, data)
            print(f"{joints:6} {name:10}{1e6 * single:9.2f}{1e6 * taken:9.2f}{1e6 * (taken - single) / joints:12.2f}"
                  f"{1e6 * alone:10.2f}{1e6 * served:8.2f}{1e6 * (served - alone) / joints:12.3f}", flush=True)
        control = python_controller(plain, st.load_servo("hitec-hs-755hb"))

        def by_python(k: int, n: int = joints, m: mujoco.MjModel = plain, d: mujoco.MjData = idle,
                      control: Callable[[mujoco.MjData, np.ndarray], None] = control) -> None:
            control(d, np.full(n, 0.3 + 0.5 * (k // 300 % 2)))
            mujoco.mj_step(m, d)
        taken = moved(by_python)
        print(f"{joints:6} {'in Python':10}{1e6 * single:9.2f}{1e6 * taken:9.2f}{1e6 * (taken - single) / joints:12.2f}"
              f"   (mj_step in one call: {1e6 * own:.2f} us)")


def rolled(drive: st.robots.ServoDrive, data: mujoco.MjData) -> tuple[float, float]:
    """Return the time of a step in `mujoco.rollout`, without and with servos [s]."""
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros((LANES, mujoco.mj_stateSize(drive.model, kind)))
    fresh = mujoco.MjData(drive.model)
    drive.command(fresh, goals(len(drive.joints), 1))
    mujoco.mj_getState(drive.model, fresh, start[0], kind)
    start[:] = start[0]
    taken = []
    for callback in (None, drive.callback()):
        mujoco.set_mjcb_control(callback)
        taken.append(best(lambda: rollout.rollout(drive.model, fresh, start, nstep=STEPS), 7) / (LANES * STEPS))
    mujoco.set_mjcb_control(None)
    drive.check(fresh)
    return taken[0], taken[1]
