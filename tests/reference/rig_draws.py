"""Random servos, loads and motions of the bench, as a hobbyist has them, and the conditions under which logs are taken.

Nothing of the package. Logs: 50 Hz, pulses at 50 Hz, four motions of 2 to 4 s, an encoder with 1 mrad of noise, a delay
of 10 to 50 ms; the servo is of the 100 g class, and turns a known disc against a known torque, or lifts a known arm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .rig import SAMPLE, Load, Recording, Servo, record

Array = NDArray[np.float64]
Taking = dict[str, Any]  # arguments of `record`

MOTIONS = ("steps", "prbs", "triangle", "small steps")
MIDDLE, REACH = 1.5e-3, 0.35e-3  # s
COUNT = 2.0 * math.pi / 4096.0  # rad, of a 12-bit encoder
_SPREAD = {"R": 1.2, "K": 1.15, "J": 1.4, "forward": 1.3, "gain": 1.3}  # about the usual, a factor either way


class Truth(NamedTuple):
    """One bench: what is on it, and what its logs have in common."""

    servo: Servo
    load: Load
    delay: float  # s
    angle_offset: float  # rad
    crystal: float  # which way its clock is off: 1 or -1
    seed: int


class Run(NamedTuple):
    """One log, before anyone reads it."""

    motion: str
    load: Load
    said: Recording


def random_servo(rng: np.random.Generator) -> Servo:
    """Return a servo about the usual one."""
    usual = Servo()
    drawn = {name: getattr(usual, name) * share ** rng.uniform(-1.0, 1.0) for name, share in _SPREAD.items()}
    return usual._replace(**drawn, backward=drawn["forward"], deadband=rng.uniform(4e-6, 10e-6))


def random_load(rng: np.random.Generator, kind: str = "disc") -> Load:
    """Return a disc against a torque, or an arm that hangs somewhere within reach."""
    inertia = 1e-2 * 2.0 ** rng.uniform(-1.0, 1.0)
    if kind == "arm":
        return Load(inertia=inertia, gravity=rng.uniform(0.3, 0.6), hanging=rng.uniform(0.5, 2.5))
    return Load(inertia=inertia, torque=rng.uniform(0.1, 0.4) * rng.choice([-1.0, 1.0]))


def random_truth(seed: int) -> Truth:
    """Return a bench; every fifth has an arm, the others a disc."""
    rng = np.random.default_rng([seed, 1])
    return Truth(random_servo(rng), random_load(rng, "arm" if seed % 5 == 4 else "disc"), rng.uniform(0.01, 0.05),
                 rng.uniform(-0.02, 0.02), _either(np.random.default_rng([seed, 4])), seed)


def motion(kind: str, duration: float, rng: np.random.Generator, sample: float = SAMPLE) -> Array:
    """Return pulse widths, one a turn of the loop [s]."""
    time = sample * np.arange(round(duration / sample) + 1)
    if kind == "triangle":
        shape = 2.0 / math.pi * np.arcsin(np.sin(2.0 * math.pi * time / rng.uniform(1.5, 2.5)))
        return MIDDLE + REACH * shape
    hold = {"steps": 0.5, "prbs": 0.16, "small steps": 0.25}[kind]
    at = np.maximum((time - 0.1) / hold, -1.0).astype(int) + 1
    count = at[-1] + 1
    if kind == "steps":
        levels = rng.uniform(0.2, 1.0, count) * np.where(np.arange(count) % 2, -1.0, 1.0) * rng.choice([-1.0, 1.0])
    elif kind == "prbs":
        levels = 0.7 * rng.choice([-1.0, 1.0], count)
    else:
        levels = rng.uniform(-0.4, 0.4) + np.cumsum(rng.uniform(-0.06, 0.06, count))
    return MIDDLE + REACH * levels[at]


def runs(truth: Truth, taking: Callable[[np.random.Generator], Taking], *, duration: float | None = None,
         motions: tuple[str, ...] = MOTIONS, sample: float = SAMPLE) -> list[Run]:
    """Return a log of each motion, taken as a condition says, which is asked anew for each.

    A clock is one of the bench's parts and runs alike in all its logs.
    """
    found = []
    for k, kind in enumerate(motions):
        rng = np.random.default_rng([truth.seed, 2, k])
        widths = motion(kind, rng.uniform(2.0, 4.0) if duration is None else duration, rng, sample)
        told = {"delay": truth.delay, "angle_offset": truth.angle_offset, "sample": sample, **taking(rng)}
        if "clock" in told:
            told["clock"] *= truth.crystal
        step = told.pop("rounds", 0.0)  # s: what is sent is a multiple of it, and the log says what was asked for
        begin = told.pop("rounds_from", 0.0)
        sent = begin + step * np.round((widths - begin) / step) if step else widths
        said = record(truth.servo, truth.load, sent, **told, seed=int(rng.integers(2**31)))._replace(command=widths)
        found.append(Run(kind, truth.load, said))
    return found


def _either(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def free_running(rng: np.random.Generator) -> Taking:
    """Frames of a generator that no loop triggers: any phase, a crystal of its own, turns that begin late or early."""
    return {"phase": rng.uniform(0.0, 0.02), "loop_jitter": 3e-4, "clock": 2e-5}


def with_left_out(truth: Truth) -> Truth:
    """Return a bench with what servo files leave out: 0 to 1 Ω in the supply, viscous friction and friction at rest."""
    rng, s = np.random.default_rng([truth.seed, 5]), truth.servo
    return truth._replace(servo=s._replace(
        R_b=rng.uniform(0.0, 1.0), B=rng.uniform(0.0, 0.1) * s.K**2 / s.R, breakaway=1.0 + rng.uniform(0.0, 1.0),
        stribeck=rng.uniform(0.1, 0.3)))


LEFT_OUT = "left out"
"""The condition under which a bench has that, and a generator that sends whole microseconds."""
CONDITIONS: dict[str, Callable[[np.random.Generator], Taking]] = {
    "white noise": lambda rng: {},
    "AR(1) 0.8": lambda rng: {"ar": 0.8},
    "counts": lambda rng: {"noise": 0.0, "counts": COUNT},
    "short logs": lambda rng: {},
    "stamps 1 us": lambda rng: {"stamp_jitter": 1e-6},
    "stamps 2 ms": lambda rng: {"stamp_jitter": 2e-3},
    "free-running": free_running,
    "clock 1 ppm": lambda rng: {"clock": 1e-6},
    "clock 200 ppm": lambda rng: {"clock": 2e-4},
    "frame 20.48 ms": lambda rng: {"period": 0.02048, "phase": rng.uniform(0.0, 0.02)},
}
SHORT = 0.8  # s, of a short log


def taken(truth: Truth, condition: str) -> list[Run]:
    """Return the logs of a bench under a condition."""
    if condition == LEFT_OUT:
        return runs(truth, lambda rng: {"rounds": 1e-6})
    return runs(truth, CONDITIONS[condition], duration=SHORT if condition == "short logs" else None)


def file_of(truth: Truth) -> Servo:
    """Return the servo as its file has it: every number that a fit looks for is off by 10 to 30 %.

    What `with_left_out` adds is in it.
    """
    rng = np.random.default_rng([truth.seed, 3])
    off = {name: getattr(truth.servo, name) * (1.0 + _either(rng) * rng.uniform(0.1, 0.3))
           for name in ("R", "K", "J", "forward", "gain", "deadband")}
    return truth.servo._replace(**off, backward=off["forward"])
