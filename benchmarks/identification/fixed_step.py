"""The peer of `recover.py`: a pendulum servo in NumPy with a fixed step of 5 ms, as BAM simulates, and least squares.

All logs and all copies for the derivatives run side by side. Friction of a step is at most what stops the shaft.
"""

import time as clock
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

import servotwin as st
from logs import FREE, SAMPLE, Task, servo_with

STARTS, EVALUATIONS, NEAR = 3, 40, 1e-4
NAMES = FREE[st.BoundedServo]


class Found(NamedTuple):
    """Where the fit ended, and how long it took [s]."""

    values: dict[str, float]
    error: float  # of its own simulation, against the truth without noise [rad]
    own_error: float  # the same of its simulation at the true parameters [rad]
    seconds: float


class Simulator:
    """The bounded servo on a pendulum by semi-implicit Euler."""

    def __init__(self, task: Task) -> None:
        arms = [log.load.pendulums[0] for log in task.logs]
        self.gravity = np.array([arm.mass * arm.gravity * arm.length for arm in arms])
        self.inertia = np.array([arm.mass * arm.length**2 for arm in arms])
        self.hanging = np.array([arm.hanging_angle for arm in arms])
        servo = servo_with(task.truth)  # of it only what is not searched
        electronics = servo.electronics
        width = np.array([log.command for log in task.logs])
        self.command = (width - electronics.one_shot_offset) / electronics.one_shot_slope
        self.offset = servo.potentiometer.feedback_offset
        self.reduction = servo.gear.gear_reduction
        self.limit = servo.supply.open_circuit_voltage - servo.supply.bridge_drop_voltage
        self.comparator = electronics.comparator_gain

    def angles(self, values: np.ndarray) -> np.ndarray:
        """Return the angles of all logs for copies of the servo, shape (C, logs, times) [rad]."""
        R, K, J, forward, backward, gain, deadband, p = values.T[:, :, None]
        J, gain = J + self.inertia, gain * self.comparator
        forward, backward = self.reduction * forward, self.reduction * backward
        q = (self.command[:, 0] - self.offset) / p
        w, found = np.zeros_like(q), np.empty((*q.shape, self.command.shape[1]))
        for k in range(self.command.shape[1]):
            found[..., k] = q
            v_e = self.command[:, k] - p * q - self.offset
            v_d = v_e - np.clip(v_e, -0.5 * deadband, 0.5 * deadband)
            v_a = np.clip(gain * v_d, -self.limit, self.limit)
            torque = K * (v_a - K * w) / R - self.gravity * np.sin(q - self.hanging)
            stopping = J * w / SAMPLE + torque
            w = w + (torque - np.clip(stopping, -backward, forward)) * SAMPLE / J
            q = q + w * SAMPLE
        return found


def fit(task: Task, seed: int) -> Found:
    """Fit from random starts within the bounds of the task."""
    began = clock.perf_counter()
    simulator, rng = Simulator(task), np.random.default_rng(seed)
    measured = np.array([log.measured["output_angle"] for log in task.logs])
    low, high = (np.log([task.bounds[name][k] for name in NAMES]) for k in (0, 1))

    def residual(x: np.ndarray) -> np.ndarray:
        return (simulator.angles(np.exp(x)[None])[0] - measured).ravel()

    def jacobian(x: np.ndarray) -> np.ndarray:
        copies = np.exp(x + NEAR * np.vstack([np.zeros(len(x)), np.eye(len(x))]))
        angles = simulator.angles(copies).reshape(len(copies), -1)
        return (angles[1:] - angles[0]).T / NEAR

    ends = [least_squares(residual, rng.uniform(low, high), jac=jacobian, bounds=(low, high), max_nfev=EVALUATIONS)
            for _ in range(STARTS)]
    best = min(ends, key=lambda end: float(end.cost))
    spent = clock.perf_counter() - began
    truth = np.array([[task.truth[name] for name in NAMES]])
    errors = [float(np.sqrt(np.mean((simulator.angles(values)[0] - task.exact) ** 2)))
              for values in (np.exp(best.x)[None], truth)]
    return Found(dict(zip(NAMES, np.exp(best.x).tolist(), strict=True)), *errors, spent)
