"""Logs of bus servos by the independent reference, whose register for P is not what the logs say.

Nothing of the package moves anything here; a log's goals are those of a loop of 50 Hz, its encoder has 1 mrad of noise.
A loop of 30 Hz is one like that of LeRobot: turns are late, and stamps are the number of the turn over 30.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import servotwin as st

from .digital import run

SAMPLE, PERIOD = 0.02, 1.0 / 30.0  # s
MOTIONS = ("steps", "prbs", "triangle", "small steps")
FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "motor.motor_viscous_friction")
_REDUCTION = 250.0


def truth(seed: int) -> dict[str, dict[str, Any]]:
    """Return a random servo of the 1.5 N m class, as the reference takes it."""
    rng = np.random.default_rng([seed, 11])

    def about(value: float, share: float = 1.25) -> float:
        return float(value * share ** rng.uniform(-1.0, 1.0))

    k, friction = about(0.95) / _REDUCTION, about(0.12) / _REDUCTION
    return {
        "motor": {"armature_resistance": about(2.2), "torque_constant": k, "back_emf_constant": k,
                  "rotor_inertia": about(5e-3) / _REDUCTION**2, "motor_viscous_friction": about(0.015) / _REDUCTION**2},
        "gear": {"gear_reduction": _REDUCTION},
        "friction": {"coulomb_torque_forward": friction, "coulomb_torque_backward": friction},
        "supply": {"open_circuit_voltage": 7.4, "bridge_drop_voltage": 0.2},
        "firmware": {"control_period": 2e-3, "proportional_gain": about(4.0), "command_kind": "goal"}}


def file_of(servo: dict[str, dict[str, Any]], seed: int) -> st.Servo:
    """Return the servo as its file has it: what a fit looks for is off by 10 to 25 %."""
    rng = np.random.default_rng([seed, 12])
    changed = {group: dict(values) for group, values in servo.items()}
    for name in ("armature_resistance", "rotor_inertia", "motor_viscous_friction"):
        changed["motor"][name] *= 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.25)
    return st.servo_from_values("bus rig", changed)


def logs(servo: dict[str, dict[str, Any]], seed: int, factors: tuple[float, ...] = (1.0,) * 4, *,
         waking: float = 0.0) -> list[st.Log]:
    """Return a log of each motion, in which P is larger by a factor than the file says.

    With `waking` [s] it is one of a loop of 30 Hz, 10 s long, whose turns are too long by so much in the mean.
    """
    found = []
    for k, (motion, factor) in enumerate(zip(MOTIONS, factors, strict=True)):
        rng = np.random.default_rng([seed, 13, k])
        time = SAMPLE * np.arange(round(rng.uniform(2.0, 3.0) / SAMPLE) + 1)
        stamps = time
        if waking:
            stamps = PERIOD * np.arange(300)
            long = (rng.random(300) < 0.005) * rng.uniform(5e-3, 25e-3, 300)
            time = stamps + np.append(0.0, np.cumsum(rng.exponential(waking, 300) + long)[:-1])
        goals = _goals(motion, time, rng)
        there = {**servo, "firmware": {**servo["firmware"], "proportional_gain":
                                       factor * servo["firmware"]["proportional_gain"]}}
        pieces = [(float(t), float(q), 0.0) for k, (t, q) in enumerate(zip(time, goals, strict=True))
                  if k == 0 or q != goals[k - 1]]
        said = run(there, {"kind": "goal", "pieces": pieces}, {"inertia": 4e-3, "torque": 0.25}, float(time[-1]), time,
                   initial_angle=float(goals[0]))
        noise = 1e-3 * rng.standard_normal(len(time))
        found.append(st.Log(name=f"{k + 1} {motion}", motion=motion, time=stamps, command=goals, command_kind="angle",
                            measured={"output_angle": said.output_angle + noise},
                            load=st.loads.Inertia(4e-3) + st.loads.Constant(0.25)))
    return found


def _goals(motion: str, time: np.ndarray[Any, Any], rng: np.random.Generator) -> np.ndarray[Any, Any]:
    if motion == "triangle":
        return np.asarray(0.7 * 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * time / rng.uniform(1.5, 2.5))))
    hold = {"steps": 0.5, "prbs": 0.16, "small steps": 0.25}[motion]
    at = np.maximum((time - 0.1) / hold, -1.0).astype(int) + 1
    if motion == "small steps":
        return np.asarray(np.cumsum(rng.uniform(-0.12, 0.12, at[-1] + 1))[at])
    return np.asarray(0.8 * rng.uniform(0.3, 1.0, at[-1] + 1)[at] * np.where(at % 2, 1.0, -1.0))
