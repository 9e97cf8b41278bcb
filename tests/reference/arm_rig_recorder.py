"""A loop like that of LeRobot which teleoperates an arm and writes rows: its clock, its latencies, its units.

Nothing of the package. Turn k of the loop begins at t_k, reads the positions a little later, takes the leader's angles,
and sends them as goals later still; the row has t_k, those goals and those positions. So what a row's goals do shows in
the next row at the earliest. A turn waits until a period of 1/30 s is over and wakes a little late; now and then a
turn takes far longer. Datasets have k/fps for t_k, whatever the clock said.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arm_rig import SETTLING, STEP, Motion, Push, Truth, simulated
from .arm_rig_servo import DELTA

Array = NDArray[np.float64]

FPS = 30.0
KINDS = ("smooth", "steps", "mixed")


class Episode(NamedTuple):
    """Rows of one episode, and what is true of it."""

    time: Array  # stamps [s]
    action: Array  # (rows, joints) rad, in the encoders' angles
    state: Array  # (rows, joints) rad, likewise: whole counts
    true_time: Array  # when the turns began [s]
    true_angle: Array  # of the encoders when positions were sampled, before they were counted [rad]
    motion: Motion
    pushes: tuple[Push, ...]
    kind: str


def turns(duration: float, rng: np.random.Generator, fps: float = FPS) -> Array:
    """Return when the turns of a loop begin: a late waking of up to 1 ms each, and a long turn once in a while."""
    count = round(duration * fps)
    periods = 1.0 / fps + np.minimum(rng.exponential(2e-4, count), 1e-3)
    long = rng.random(count) < 0.005
    return np.concatenate([[0.0], np.cumsum(periods + long * rng.uniform(5e-3, 25e-3, count))[:-1]])


def _eased(t: Array, rate: float) -> Array:
    """Return the way from 0 to 1 that jerks least, over 1/rate."""
    x = np.clip(t * rate, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def goals(truth: Truth, times: Array, kind: str, rng: np.random.Generator, share: float = 0.5) -> Array:
    """Return the leader's angles at the turns of a loop [rad]: `share` of the joints' limits is used.

    "smooth" goes from place to place as a hand does, pausing; "steps" jumps by up to 20 degrees; "mixed" does both.
    """
    found = np.zeros((len(times), len(truth.servos)))
    for j, link in enumerate(truth.robot.links):
        low, high = link.limits
        middle, reach = 0.5 * (low + high), 0.5 * share * (high - low)
        at, t, now = np.zeros(len(times)), 0.0, middle + reach * rng.uniform(-1.0, 1.0)
        at += now
        while t < times[-1]:
            t += rng.uniform(0.1, 1.2)  # a pause
            jump = kind == "steps" or (kind == "mixed" and rng.random() < 0.3)
            to = middle + reach * rng.uniform(-1.0, 1.0)
            if jump:
                to = np.clip(now + np.radians(rng.uniform(-20.0, 20.0)), middle - reach, middle + reach)
                at = np.where(times >= t, to, at)
            else:
                spent = max(abs(to - now) / rng.uniform(0.5, 1.5), 0.3)  # at 0.5 to 1.5 rad/s
                at = np.where(times >= t, now + (to - now) * _eased(times - t, 1.0 / spent), at)
                t += spent
            now = to
        tremor = 2e-3 * np.sin(2.0 * np.pi * rng.uniform(4.0, 7.0) * times) * (np.abs(np.gradient(at)) > 1e-3)
        found[:, j] = at + tremor
    return DELTA * np.round(found / DELTA)  # the leader's encoders count


def record(truth: Truth, duration: float, kind: str = "mixed", *, episode: int = 0, pushes: Sequence[Push] = (),
           stamps: str = "frames", fps: float = FPS, step: float = STEP) -> Episode:
    """Return an episode of an arm that has stood under its first goals.

    Parameters
    ----------
    truth : Truth
    duration : float
        [s]
    kind : {"smooth", "steps", "mixed"}
    episode : int
        Each has motions and a clock of its own.
    pushes : sequence of Push
        Times count from the first turn.
    stamps : {"frames", "loop"}
        "frames": k/fps, as datasets have it; "loop": when the turn began.
    """
    rng = np.random.default_rng([truth.seed, 7, episode])
    begun = turns(duration, rng, fps)
    wanted = goals(truth, begun, kind, rng)
    written = begun + truth.write_after + np.minimum(rng.exponential(5e-4, len(begun)), 4e-3)
    sampled = begun + truth.read_after + np.minimum(rng.exponential(2e-4, len(begun)), 1e-3)
    motion = simulated(truth, np.concatenate([[-SETTLING], written]), np.vstack([wanted[:1], wanted]), sampled,
                       start=-SETTLING, pushes=pushes, step=step)
    true_angle = motion.angle + np.array([servo.zero for servo in truth.servos])
    state = DELTA * np.floor(true_angle / DELTA + 0.5)
    time = np.arange(len(begun)) / fps if stamps == "frames" else begun
    return Episode(time, wanted, state, begun, true_angle, motion, tuple(pushes), kind)


def pushed(truth: Truth, duration: float, seed: int, torque: float = 0.4) -> tuple[Push, ...]:
    """Return a hand that pushes one joint for a second somewhere in the middle of an episode."""
    rng = np.random.default_rng([truth.seed, 9, seed])
    start = duration * rng.uniform(0.3, 0.6)
    most = torque * truth.servos[0].K * truth.V_oc / truth.servos[0].R
    return (Push(int(rng.integers(len(truth.servos))), start, start + 1.0, float(rng.choice([-1.0, 1.0])) * most),)


def write_table(episode: Episode, truth: Truth, path: Path) -> Path:
    """Write rows as a table in degrees: timestamp, action.JOINT.pos, observation.state.JOINT.pos."""
    joints = truth.robot.joints
    names = ["timestamp", *(f"action.{j}.pos" for j in joints), *(f"observation.state.{j}.pos" for j in joints)]
    rows = np.column_stack([episode.time, np.degrees(episode.action), np.degrees(episode.state)])
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    return path


def write_dataset(episodes: Sequence[Episode], truth: Truth, folder: Path, *, unit: str = "deg",
                  robot_type: str = "") -> Path:
    """Write a dataset of LeRobot, version 3.0: `unit` "deg", or "range" for -100 to 100 of the joints' limits.

    A range has 0 in the middle of the limits; the gripper's goes from 0 to 100. Needs pyarrow.
    """
    import pyarrow
    import pyarrow.parquet

    joints = truth.robot.joints
    columns = [f"{joint}.pos" for joint in joints]
    feature = {"dtype": "float32", "shape": [len(joints)], "names": columns}
    info = {"codebase_version": "v3.0", "fps": int(FPS), "total_episodes": len(episodes),
            "robot_type": robot_type or ("so101_follower" if truth.robot.name == "so101" else truth.robot.name),
            "features": {"action": feature, "observation.state": feature}}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")

    def told(angles: Array) -> list[list[float]]:
        if unit == "deg":
            return np.degrees(angles).astype(np.float32).tolist()
        low, high = np.array([link.limits for link in truth.robot.links]).T
        share = 200.0 * (angles - low) / (high - low) - 100.0
        share = np.where(["gripper" in joint for joint in joints], 0.5 * (share + 100.0), share)
        return share.astype(np.float32).tolist()

    kind = pyarrow.list_(pyarrow.float32(), len(joints))
    tables = [pyarrow.table({
        "action": pyarrow.array(told(one.action), kind), "observation.state": pyarrow.array(told(one.state), kind),
        "timestamp": pyarrow.array(one.time.astype(np.float32)), "frame_index": pyarrow.array(np.arange(len(one.time))),
        "episode_index": pyarrow.array(np.full(len(one.time), k)),
        "task_index": pyarrow.array(np.zeros(len(one.time), dtype=np.int64)),
    }) for k, one in enumerate(episodes)]
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    pyarrow.parquet.write_table(pyarrow.concat_tables(tables), data / "file-000.parquet")
    return folder
