"""BAM's rule, written from its code: an explicit step of 5 ms in which friction stops the shaft if it can.

github.com/Rhoban/bam, bam/simulate.py, model.py, testbench.py and process.py (Apache-2.0). Logs are read between their
rows at every step, a duty is held for it, and friction takes away what it would take to stop, at most its budget.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

import servotwin as st
from servotwin.identification import LogError

Array = NDArray[np.float64]

STEP = 5e-3  # s
ERROR_GAIN = 0.00246  # duty per rad and unit of the gain: what BAM's code had when its parameters here were found
GRAVITY = 9.80665  # m/s2


def budget(p: Mapping[str, float], motor: float, outside: float, speed: float) -> float:
    """Return the most friction [N m] of M1 or M6, as far as the parameters have it."""
    def of(name: str) -> float:
        return p.get(name, 0.0)

    total = of("friction_base") + of("friction_viscous") * abs(speed)
    total += abs(outside * of("load_friction_external") - motor * of("load_friction_motor"))
    if "dtheta_stribeck" not in p:
        return total
    still = math.exp(-abs(speed / p["dtheta_stribeck"]) ** p["alpha"])
    more = of("friction_stribeck") + abs(
        outside * of("load_friction_external_stribeck") - motor * of("load_friction_motor_stribeck"))
    if motor * outside < 0.0:
        drives = abs(outside) < abs(motor)
        more += of("load_friction_external_quad") * outside**2 if drives else of("load_friction_motor_quad") * motor**2
    return total + still * more


def rollout(log: st.Log, p: Mapping[str, float], step: float = STEP) -> tuple[Array, Array]:
    """Return the instants of a log's steps, from its first sample on [s], and the angles there [rad]."""
    (pendulum,) = log.load.pendulums
    inertia = log.load.total_inertia + p["armature"]
    weight = pendulum.mass * GRAVITY * pendulum.length
    gain = ERROR_GAIN * log.conditions["gain"]
    voltage = log.parameters["supply.open_circuit_voltage"]
    since = log.time - log.time[0]
    times = np.arange(0.0, since[-1], step)
    goals = np.interp(times, since, log.command)
    q, w = float(log.measured["output_angle"][0]), 0.0
    if "output_speed" in log.measured:
        w = float(log.measured["output_speed"][0])
    angles = np.empty(len(times))
    for k, goal in enumerate(goals):
        angles[k] = q
        duty = min(max(gain * (goal - q), -1.0), 1.0)
        motor = p["kt"] * (duty * voltage - p["kt"] * w) / p["R"]
        outside = -weight * math.sin(q + p["q_offset"])
        stopping = inertia / step * w + motor + outside
        friction = -math.copysign(min(abs(stopping), budget(p, motor, outside, w)), stopping)
        a = (motor + outside + friction) / inertia
        w += a * step
        q += w * step + 0.5 * a * step**2
    return times, angles


def error(log: st.Log, p: Mapping[str, float], step: float = STEP) -> LogError:
    """Return how far a published servo is off a log by this rule, at the samples that count."""
    times, angles = rollout(log, p, step)
    used = log.used("output_angle") & (log.time - log.time[0] <= times[-1])
    there = np.interp(log.time[used] - log.time[0], times, angles)
    off = there - log.measured["output_angle"][used]
    return LogError(log=log.name, motion=log.motion, conditions=log.conditions, samples=int(used.sum()),
                    rms=float(np.sqrt(np.mean(off**2))), largest=float(np.abs(off).max()))
