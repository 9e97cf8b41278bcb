"""A policy learns to bring the tip of an SO-101 to a point, by PPO of Stable-Baselines3; then it meets other servos.

It takes six minutes on two cores; `python train_reach.py 5000` is a short run, which learns little.
"""

import sys
import time

import numpy as np

try:
    import gymnasium
    import mujoco  # noqa: F401 - to say what is missing
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import SubprocVecEnv, VecNormalize
except ImportError:
    print("train_reach.py needs MuJoCo and a trainer: pip install 'servotwin[robots]' stable-baselines3")
    sys.exit()

TASK = "servotwin.robots.gym:servotwin/SO101Reach-v0"
VARY = {"motor.torque_constant": "normal:5%", "motor.armature_resistance": "normal:10%", "gear.backlash": "uniform:50%",
        "friction.coulomb_torque_forward": "uniform:40%", "friction.coulomb_torque_backward": "uniform:40%",
        "supply.open_circuit_voltage": "uniform:10V..12.6V"}  # two of a kind are not alike, and batteries run down
ROBOTS, STEPS, EPISODES = 2, 100_000, 30
RATES = (1e-3, 1e-3, 5e-4, 2e-4)  # of learning, for a part of the steps each


def made(**options: object) -> gymnasium.Env:
    """Return an environment."""
    return gymnasium.make(TASK, **options)


def tried(model: PPO, robots: VecNormalize, **options: object) -> str:
    """Return how a policy does without noise, in episodes that it has not seen."""
    env, ends = made(**options), []
    for seed in range(10_000, 10_000 + EPISODES):
        seen, _ = env.reset(seed=seed)
        over = False
        while not over:
            action, _ = model.predict(robots.normalize_obs(seen), deterministic=True)
            seen, _, _, over, info = env.step(action)
        ends.append(1e3 * info["distance"])
    near = np.mean(np.array(ends) < 1e3 * env.unwrapped.NEAR)
    return f"{np.mean(ends):5.1f} mm off after 5 s, {np.median(ends):5.1f} in the median, {near:4.0%} within 20"


def main() -> None:
    """Train, and print what it was good for."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else STEPS
    torch.set_num_threads(1)  # the cores are for the robots
    robots = VecNormalize(SubprocVecEnv([made] * ROBOTS), gamma=0.9)
    rate = [RATES[0]]
    model = PPO("MlpPolicy", robots, learning_rate=lambda _: rate[0], n_steps=512, batch_size=256, gamma=0.9, seed=0,
                device="cpu", policy_kwargs={"net_arch": [64, 64], "log_std_init": -0.5})
    print(f"before              {tried(model, robots)}", flush=True)
    begin = time.perf_counter()
    for part, rate[0] in enumerate(RATES):
        model.learn(steps // len(RATES), reset_num_timesteps=part == 0)
        spent = time.perf_counter() - begin
        print(f"{model.num_timesteps:6d} steps, {spent:3.0f} s {tried(model, robots)}", flush=True)
    print(f"servos that differ  {tried(model, robots, vary=VARY)}")
    print(f"P of the factory    {tried(model, robots, registers={'P_Coefficient': 32})}")
    model.save("reach.zip")
    robots.close()


if __name__ == "__main__":  # processes of robots import this file
    main()
