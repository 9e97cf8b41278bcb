"""Real arms for judging fits of them: bus servos at the joints of rigid bodies, on one supply, by small fixed steps.

Nothing of the package: `arm_rig.c` says how bodies, servos, friction and supply move, `arm_rig_servo` which servos, and
`arm_rig_recorder` what a loop like that of LeRobot writes down of them. Everything is SI.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arm_rig_servo import Servo, drawn

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

STEP = 2e-4  # s
GRAVITY = 9.80665
SETTLING = 1.5  # s for which an arm has stood under its first goals before anything is written down
ENERGIES = ("source", "winding", "bridge", "wires", "dry", "viscous", "pushed", "teeth", "gained")


class Link(NamedTuple):
    """A link that turns about the z axis of its frame."""

    name: str
    joint: str
    place: Vector  # of its frame in that of the link before [m]
    turn: tuple[float, float, float, float]  # quaternion
    limits: tuple[float, float]  # rad
    mass: float
    centre: Vector
    inertia: tuple[float, float, float, float, float, float]  # about the centre: xx yy zz xy xz yz


class Robot(NamedTuple):
    """A chain of links, and which servo of each family turns them; voltages by family."""

    name: str
    links: tuple[Link, ...]
    servos: Mapping[str, tuple[str, ...]]
    voltage: Mapping[str, float]

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(link.joint for link in self.links)


class Truth(NamedTuple):
    """One real arm: its robot with the masses that it has, its servos, its supply, the latencies of its loop."""

    robot: Robot
    family: str
    masses: Array  # shares of the links' masses
    servos: tuple[Servo, ...]
    V_oc: float
    R_b: float
    read_after: float  # s from the loop's start to when positions are sampled
    write_after: float  # s from the loop's start to when goals are there
    seed: int


class Push(NamedTuple):
    """A hand or a contact: a torque on a joint for a while."""

    joint: int
    start: float
    stop: float
    torque: float


class Motion(NamedTuple):
    """What an arm did: arrays at the asked times, and the energies of the whole run."""

    angle: Array  # (times, joints) rad, of the joints
    speed: Array
    current: Array  # A, of the windings
    bus: Array  # (times,)
    energy: dict[str, float]
    most_duty: Array  # (joints,)


def _rod(mass: float, length: float, width: float = 0.03) -> tuple[float, ...]:
    """Return the inertia of a rod along x."""
    across, along = mass * (length**2 + width**2) / 12.0, mass * width**2 / 6.0
    return (along, across, across, 0.0, 0.0, 0.0)


_FLAT = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)  # z of the link before becomes -y: an axis that lies
_KIND = {"feetech": "feetech-sts3215-12v", "dynamixel": "dynamixel-xl430-w250"}
_SMALL = "dynamixel-xl330-m288"

# TheRobotStudio/SO-ARM100 (Apache-2.0), Simulation/SO101/so101_new_calib.xml
SO101 = Robot("so101", (
    Link("shoulder", "shoulder_pan", (0.0388353, -8.97657e-09, 0.0624), (0.0, 0.0, -1.0, 0.0), (-1.91986, 1.91986),
         0.100006, (-0.0307604, -1.66727e-05, -0.0252713),
         (8.3759e-05, 8.10403e-05, 2.39783e-05, 7.55525e-08, -1.16342e-06, 1.54663e-07)),
    Link("upper_arm", "shoulder_lift", (-0.0303992, -0.0182778, -0.0542), (0.5, -0.5, -0.5, -0.5),
         (-1.74533, 1.74533), 0.103, (-0.0898471, -0.00838224, 0.0184089),
         (4.08002e-05, 0.000147318, 0.000142487, -1.97819e-05, -4.03016e-08, 8.97326e-09)),
    Link("lower_arm", "elbow_flex", (-0.11257, -0.028, 0.0), (1.0, 0.0, 0.0, 1.0), (-1.69, 1.69), 0.104,
         (-0.0980701, 0.00324376, 0.0182831),
         (2.87438e-05, 0.000159844, 0.00014529, 7.41152e-06, 1.26409e-06, -4.90188e-08)),
    Link("wrist", "wrist_flex", (-0.1349, 0.0052, 0.0), (1.0, 0.0, 0.0, -1.0), (-1.65806, 1.65806), 0.079,
         (-0.000103312, -0.0386143, 0.0281156),
         (3.68263e-05, 2.5391e-05, 2.1e-05, 1.7893e-08, -5.28128e-08, 3.6412e-06)),
    Link("gripper", "wrist_roll", (0.0, -0.0611, 0.0181), (0.0, 0.0, 1.0, 1.0), (-2.79253, 2.79253), 0.087,
         (0.000213627, 0.000245138, -0.025187),
         (2.75087e-05, 4.33657e-05, 3.45059e-05, -3.35241e-07, -5.7352e-06, -5.17847e-08)),
    Link("moving_jaw", "gripper", (0.0202, 0.0188, -0.0234), (1.0, 1.0, 0.0, 0.0), (-0.174533, 1.74533), 0.012,
         (-0.00157495, -0.0300244, 0.0192755),
         (6.61427e-06, 1.89032e-06, 5.28738e-06, -3.19807e-07, -5.90717e-09, -1.09945e-07)),
), {"feetech": 6 * ("feetech-sts3215-12v",), "dynamixel": (*3 * ("dynamixel-xl430-w250",), *3 * (_SMALL,))},
    {"feetech": 12.0, "dynamixel": 7.4})

TWO_LINK = Robot("two_link", (
    Link("upper", "shoulder", (0.0, 0.0, 0.4), _FLAT, (-3.0, 3.0), 0.15, (0.075, 0.0, 0.0), _rod(0.15, 0.15)),
    Link("lower", "elbow", (0.15, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (-2.6, 2.6), 0.18, (0.08, 0.0, 0.0),
         _rod(0.18, 0.12)),
), {family: 2 * (kind,) for family, kind in _KIND.items()}, {"feetech": 12.0, "dynamixel": 12.0})

PAN_TILT_LIFT = Robot("pan_tilt_lift", (
    Link("turntable", "pan", (0.0, 0.0, 0.05), (1.0, 0.0, 0.0, 0.0), (-2.5, 2.5), 0.2, (0.0, 0.0, 0.03),
         (1.2e-4, 1.2e-4, 1.6e-4, 0.0, 0.0, 0.0)),
    Link("boom", "lift", (0.0, 0.0, 0.08), _FLAT, (-1.6, 1.6), 0.16, (0.07, 0.0, 0.0), _rod(0.16, 0.16)),
    Link("head", "tilt", (0.16, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (-2.0, 2.0), 0.14, (0.035, 0.01, 0.0),
         (6e-5, 8e-5, 9e-5, 0.0, 0.0, 0.0)),
), {family: 3 * (kind,) for family, kind in _KIND.items()}, {"feetech": 12.0, "dynamixel": 12.0})

ROBOTS = {robot.name: robot for robot in (SO101, TWO_LINK, PAN_TILT_LIFT)}
FAMILIES = ("feetech", "dynamixel")


def random_truth(robot: Robot, family: str, seed: int, *, play: float = 0.0) -> Truth:
    """Return an arm as somebody built it: servos of a kind alike, masses within 15 %, zeros within 2 degrees."""
    rng = np.random.default_rng([seed, sorted(ROBOTS).index(robot.name), FAMILIES.index(family)])
    names = robot.servos[family]
    kinds = {name: drawn(name, rng) for name in dict.fromkeys(names)}
    V_oc = robot.voltage[family] * rng.uniform(0.97, 1.03)
    servos = tuple(kinds[name]._replace(
        zero=math.radians(rng.uniform(-2.0, 2.0)), phase=1e-3 * rng.random(), play=play,
        bearing=0.06 * kinds[name].forward if play else 0.0) for name in names)
    return Truth(robot, family, rng.uniform(0.85, 1.15, len(names)), servos, V_oc, rng.uniform(0.05, 0.3),
                 rng.uniform(1e-3, 5e-3), rng.uniform(6e-3, 14e-3), seed)


def with_wrong_gain(truth: Truth, joint: int, factor: float) -> Truth:
    """Return an arm one servo of which has a P register other than the rest."""
    servos = list(truth.servos)
    servos[joint] = servos[joint]._replace(P=float(round(factor * servos[joint].P)))
    return truth._replace(servos=tuple(servos))


def _quaternion(q: Sequence[float]) -> Array:
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def simulated(truth: Truth, write_time: Array, goals: Array, times: Array, *, start: float = 0.0,
              first: Array | None = None, pushes: Sequence[Push] = (), step: float = STEP) -> Motion:
    """Return the motion of an arm that rests at its first goals at `start`.

    Parameters
    ----------
    write_time : ndarray, shape (w,)
        When goals reach the servos, rising [s].
    goals : ndarray, shape (w, joints)
        In the encoders' angles [rad]; nan: none.
    times : ndarray, shape (t,)
        Rising [s].
    first : ndarray, shape (joints,), optional
        Angles of the joints at `start` [rad].
    """
    links = np.array([[*_quaternion(link.turn).ravel(), *link.place, link.mass * share, *link.centre,
                       *(share * x for x in link.inertia)]
                      for link, share in zip(truth.robot.links, truth.masses, strict=True)])
    servos = np.array(truth.servos, dtype=float)
    n = len(servos)
    if np.any(np.diff(times) < 0.0) or np.any(np.diff(write_time) < 0.0) or goals.shape != (len(write_time), n):
        raise ValueError("times must rise, and goals have a column a joint")
    zeros = np.array([servo.zero for servo in truth.servos])
    q = np.ascontiguousarray(goals[0] - zeros if first is None else first, dtype=float).copy()
    out, energy, most = np.zeros((len(times), n, 4)), np.zeros(len(ENERGIES)), np.zeros(n)
    pushed = np.array(pushes, dtype=float).reshape(-1, 4)
    keep = [np.ascontiguousarray(x, dtype=float) for x in (
        links, servos, [0.0, 0.0, GRAVITY], write_time, goals, times, pushed)]
    at = [x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in (*keep, q, out, energy, most)]
    real = ctypes.c_double
    bad = _library().run_arm(
        n, at[0], at[1], at[2], real(truth.V_oc), real(truth.R_b), real(step), real(start),
        ctypes.c_long(len(write_time)), at[3], at[4], ctypes.c_long(len(times)), at[5],
        ctypes.c_long(len(pushed)), at[6], at[7], at[8], at[9], at[10])
    if bad:
        raise ArithmeticError("the arm's motion is no number")
    return Motion(out[:, :, 0], out[:, :, 1], out[:, :, 2], out[:, 0, 3],
                  dict(zip(ENERGIES, energy.tolist(), strict=True)), most)


def mjcf(robot: Robot) -> str:
    """Return the robot as a user has it in a file: nominal masses, no ground, joints without friction."""
    def words(values: Sequence[float]) -> str:
        return " ".join(f"{x:.9g}" for x in values)

    lines = [f'<mujoco model="{robot.name}">', '<compiler angle="radian"/>', "<worldbody>"]
    for link in robot.links:
        lines += [f'<body name="{link.name}" pos="{words(link.place)}" quat="{words(link.turn)}">',
                  f'<joint name="{link.joint}" type="hinge" axis="0 0 1" range="{words(link.limits)}"/>',
                  f'<inertial pos="{words(link.centre)}" mass="{link.mass:.9g}" fullinertia="{words(link.inertia)}"/>']
    lines += [*len(robot.links) * ["</body>"], "</worldbody>", "</mujoco>"]
    return "\n".join(lines)


def compiler() -> list[str] | None:
    """Return the command of a C compiler; None where there is none."""
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    try:
        import ziglang  # noqa: F401
    except ImportError:
        return None
    return [sys.executable, "-m", "ziglang", "cc"]


@functools.cache
def _library() -> ctypes.CDLL:
    source = Path(__file__).with_name("arm_rig.c")
    command = compiler()
    if command is None:
        raise FileNotFoundError("no C compiler")
    key = hashlib.sha256(source.read_bytes() + " ".join(command).encode()).hexdigest()[:16]
    made = Path(tempfile.gettempdir()) / f"arm_rig_{os.getuid()}_{key}.so"
    if not made.exists():
        part = made.with_suffix(f".{os.getpid()}")
        subprocess.run([*command, "-O2", "-ffp-contract=off", "-shared", "-fPIC", str(source), "-o", str(part), "-lm"],
                       check=True)
        part.replace(made)
    return ctypes.CDLL(str(made))
