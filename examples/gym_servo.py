"""Reacher of Gymnasium with the motors that it came with, and with real servos in their place: one policy, its returns.

The policy knows where the joints have to be to touch the target. Motors are told torques, by a controller that brings
the joints there; servos are told the angles.
"""

import math

import gymnasium
import numpy as np

import servotwin as st
from servotwin.robots.gym import ServoActuated

EPISODES = 20
LINKS = 0.1, 0.11  # m
GAIN, DAMPING = 2.0, 0.2  # of the motors' controller, whose 200 N m turn 1 kg m²
analog = st.PulseServo(st.load_servo("hitec-hs-755hb"))
digital = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
cells = st.Supply(open_circuit_voltage=4.8, internal_resistance=0.8)  # four, far from fresh


def wanted(target: np.ndarray) -> np.ndarray:
    """Return the angles of both joints [rad] that bring the fingertip to a place."""
    a, b = LINKS
    bend = math.acos(np.clip((target @ target - a * a - b * b) / (2.0 * a * b), -1.0, 1.0))
    ahead, turn = math.atan2(target[1], target[0]), math.atan2(b * math.sin(bend), a + b * math.cos(bend))
    choices = [(math.remainder(ahead - side * turn, math.tau), side * bend) for side in (1.0, -1.0)]
    return np.array(min(choices, key=lambda angles: abs(angles[0])))


def run(name: str, servo: st.robots.Mount | None, **options: object) -> None:
    """Print what the policy gets, without a price of control."""
    env = gymnasium.make("Reacher-v5", reward_control_weight=0.0)
    if servo is not None:
        env = ServoActuated(env, {"joint0": servo, "joint1": servo}, **options)
    returns, ends = [], []
    for seed in range(EPISODES):
        seen, _ = env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            angles, data = wanted(seen[4:6]), env.unwrapped.data
            if servo is None:
                action = np.clip(GAIN * (angles - data.qpos[:2]) - DAMPING * data.qvel[:2], -1.0, 1.0)
            else:
                action = np.array([one.control(q) for one, q in zip(env.maps.values(), angles, strict=True)])
            seen, reward, _, over, _ = env.step(action.astype(np.float32))
            total += float(reward)
        returns.append(total)
        ends.append(-1e3 * float(reward))
    print(f"{name:34} return {np.mean(returns):6.2f}, {np.median(ends):5.1f} mm off after {data.time:.0f} s")


run("motors of 200 N m and a controller", None)
run("two STS3215 at 12 V", st.robots.Mount(digital))
geared = st.robots.Mount(analog, zero=-math.pi, ratio=2.0)  # 180 degrees of the servo are 360 of the joint
run("two HS-755HB geared up 1:2", geared)
run("the same on four tired cells", geared, bus=cells)
