"""How far servos inside MuJoCo are from the servo alone, and from themselves at a quarter of the step."""

import math

import arms
import mujoco
import numpy as np

import servotwin as st


def followed(xml: str, servos: dict, goals, duration: float, every: float = 1e-3) -> tuple[np.ndarray, ...]:
    """Return times, angles (joint, time) and places of the tool under goals over time."""
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(xml), servos, assume_heat=False)
    data, dt = mujoco.MjData(drive.model), drive.model.opt.timestep
    data.qpos[:] = [goals(0.0)[name] for name in drive.joints]
    times, angles, tools = [], [], []
    for k in range(round(duration / dt)):
        drive.command(data, goals(k * dt + 1e-9))
        drive.step(data)
        if (k + 1) % round(every / dt) == 0:
            mujoco.mj_kinematics(drive.model, data)
            times.append(data.time)
            angles.append(data.qpos.copy())
            tools.append(data.site_xpos[0].copy() if drive.model.nsite else np.zeros(3))
    return np.array(times), np.array(angles).T, np.array(tools).T


def hinge() -> None:
    """Print a weight on a hinge against `simulate`."""
    weight = st.loads.Pendulum(mass=arms.MASS, length=arms.LENGTH, inertia=arms.MASS * arms.LENGTH**2 + arms.SPREAD,
                               hanging_angle=math.pi / 2.0, gravity=9.81)
    print("a weight on a hinge, step of 1.2 rad, against `simulate` (mrad):")
    print(f"{'':10}{'integrator':14}{'ms':>5}{'on the way':>12}{'of dt w_max':>13}{'at rest':>9}")
    for name, model in arms.servos().items():
        alone = st.simulate(model, st.signals.step(0.3, 1.5, at=0.1, unit="rad"), duration=1.5, load=weight,
                            output_step=1e-4)
        fastest = np.abs(alone["output_speed"]).max()
        for integrator in ("RK4", "implicitfast", "Euler"):
            for dt in (2e-3, 1e-3, 5e-4, 2.5e-4):
                time, (angle,), _ = followed(arms.hinge(integrator, dt), {"elbow": model},
                                             lambda t: {"elbow": 0.3 if t < 0.1 else 1.5}, 1.5, max(dt, 1e-3))
                off = np.abs(angle - np.interp(time, alone.time, alone["output_angle"]))
                print(f"{name:10}{integrator:14}{1e3 * dt:5g}{1e3 * off.max():12.3f}{off.max() / dt / fastest:13.3f}"
                      f"{1e3 * off[-100:].max():9.3f}")


def arm_goals(t: float) -> dict[str, float]:
    return {"shoulder": 0.3 if t < 0.05 else 1.2, "elbow": 0.5 if t < 0.15 else 1.4 if t < 0.6 else 0.7}


def arm() -> None:
    """Print two links at 1 ms against 0.25 ms."""
    print("\ntwo links, 1 ms against 0.25 ms: joints (mrad), tool (mm), joints at the end (mrad)")
    for label, axis in (("hanging", "0 1 0"), ("flat, as a SCARA arm", "0 0 1")):
        for name, model in arms.servos().items():
            for integrator in ("RK4", "implicitfast"):
                (_, q, tool), (_, fine, finer) = (
                    followed(arms.links(integrator, dt, axis), dict.fromkeys(("shoulder", "elbow"), model), arm_goals,
                             1.2) for dt in (1e-3, 2.5e-4))
                apart = np.abs(q - fine)
                print(f"{label:22}{name:10}{integrator:14}{1e3 * apart.max():8.3f}"
                      f"{1e3 * np.linalg.norm(tool - finer, axis=0).max():8.3f}{1e3 * apart[:, -1].max():8.3f}")


def held() -> None:
    """Print how far a held arm moves between 3 and 100 s."""
    print("\ntwo links held against gravity, between 3 and 100 s (rad):")
    for name, model in arms.servos().items():
        for integrator in ("RK4", "implicitfast"):
            drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(arms.links(integrator, 1e-3, "0 1 0")),
                                         dict.fromkeys(("shoulder", "elbow"), model), assume_heat=False)
            data = mujoco.MjData(drive.model)
            data.qpos[:] = [0.3, 0.5]
            drive.step(data, 3000)
            before = data.qpos.copy()
            drive.step(data, 97_000)
            print(f"{name:10}{integrator:14}{np.abs(data.qpos - before).max():10.1e}")
