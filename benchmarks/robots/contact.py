"""What the scheme makes of contacts and limits, whose forces it knows of the last step: force, chatter, energy."""

from collections.abc import Callable

import arms
import mujoco
import numpy as np

import servotwin as st


def pressed(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the sum of all normal forces at the box, or the torque of the limit."""
    if model.ngeom == 0:
        return float(np.abs(data.qfrc_constraint).max())
    force, total = np.zeros(6), 0.0
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, force)
        bodies = {int(model.geom_bodyid[g]) for g in data.contact[k].geom}
        total += force[0] if 1 in bodies and 0 not in bodies else 0.0
    return total


def run(xml: str, model: object, goals: dict[str, float], duration: float = 1.5, **start: float) -> np.ndarray:
    """Return rows of time, force, fastest joint, energy, and the work of servos and of contacts and limits [J]."""
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(xml), dict.fromkeys(goals, model), assume_heat=False)
    data, own = mujoco.MjData(drive.model), drive.model
    dofs = [int(own.jnt_dofadr[own.joint(name).id]) for name in goals]
    for name, angle in start.items():
        data.joint(name).qpos[0] = angle
    drive.command(data, goals)
    rows, work, given = [], 0.0, 0.0
    for _ in range(round(duration / own.opt.timestep)):
        before = data.qvel.copy()
        drive.step(data)
        way = 0.5 * own.opt.timestep * (before + data.qvel)
        work += float(drive.torque(data) @ way[dofs])
        given += float(data.qfrc_constraint @ way)
        mujoco.mj_energyPos(own, data)
        mujoco.mj_energyVel(own, data)
        rows.append((data.time, pressed(own, data), np.abs(data.qvel[dofs]).max(), data.energy.sum(), work, given))
    return np.array(rows)


def balance(rows: np.ndarray) -> tuple[float, float]:
    """Return the most energy that came from nowhere, of what was there and moved, and the most that contacts gave."""
    _, _, _, energy, work, given = rows.T
    rest = energy - work - given
    rest = rest - rest[0]
    return float(rest.max() / np.abs(np.concatenate([energy, work])).max()), float(
        (given - np.minimum.accumulate(given)).max())


def table() -> None:
    """Print forces at 1 and 0.25 ms, what moves at rest, and the balance of energy.

    Soft contacts and limits of MuJoCo give back some of what they took, which is printed too.
    """
    cases: dict[str, tuple[Callable[[str, float], str], dict[str, float]]] = {
        "box": (arms.gripper, {"left": -0.6, "right": 0.6}),
        "free box": (lambda i, dt: arms.gripper(i, dt, free=True), {"left": -0.6, "right": 0.6}),
        "limit": (arms.limited, {"elbow": 1.2}),
        "limit, 4 ms": (lambda i, dt: arms.limited(i, dt, "0.004 1"), {"elbow": 1.2})}
    print("force at 1 and 0.25 ms (N, N m), its scatter and the fastest joint (rad/s) at rest; energy from nowhere, of "
          "the\nlargest there is, and what contacts have given back (mJ), at 1 ms (of RK4 MuJoCo keeps one stage's "
          "forces)")
    print(f"{'':13}{'':9}{'integrator':13}{'1 ms':>8}{'0.25 ms':>9}{'apart':>9}{'scatter':>9}{'at rest':>10}"
          f"{'nowhere':>10}{'given':>8}")
    for name, (xml, goals) in cases.items():
        for kind, model in arms.servos().items():
            for integrator in ("implicitfast", "RK4"):
                coarse, fine = (run(xml(integrator, dt), model, goals) for dt in (1e-3, 2.5e-4))
                (_, force, speed, *_), (_, finer, *_) = (part[part[:, 0] > 1.2].T for part in (coarse, fine))
                nowhere, given = balance(coarse)
                of_energy = f"{nowhere:10.1e}{1e3 * given:8.2f}" if integrator != "RK4" else f"{'–':>10}{'–':>8}"
                apart = 100.0 * (force.mean() / finer.mean() - 1.0)
                print(f"{name:13}{kind:9}{integrator:13}{force.mean():8.3f}{finer.mean():9.3f}{apart:+8.1f}%"
                      f"{force.std():9.4f}{speed.max():10.1e}{of_energy}")
    without_supply()


def without_supply() -> None:
    """Print what an arm gains that falls onto its limit, by servos that drive nothing."""
    print("\nfalling onto a limit with the motor shorted: energy from nowhere, given back and lost in all (mJ)")
    servo = st.load_servo("hitec-hs-755hb").replace({"electronics.voltage_deadband": 1e3, "gear.gear_reduction": 40.0})
    for dt in (1e-3, 2.5e-4):
        rows = run(arms.limited("implicitfast", dt), st.BoundedServo(servo), {"elbow": 0.0}, 1.0, elbow=-1.0)
        nowhere, given = balance(rows)
        lost = rows[0, 3] - rows[-1, 3]
        print(f"implicitfast {1e3 * dt:5g} ms{nowhere:10.1e}{1e3 * given:8.2f}{1e3 * lost:10.2f}")
