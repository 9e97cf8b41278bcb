"""Bus servos of the arms' rig: two families as their registers set them, about what sheets and fits of others say.

Nothing of the package. Everything is SI and at the output shaft.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

DELTA = 2.0 * math.pi / 4096.0  # rad a count


class Servo(NamedTuple):
    """Motor, gear, bridge and firmware of one servo, in the order that `arm_rig.c` has them."""

    R: float = 4.3  # Ω, with bridge and wiring of its own
    K: float = 2.3  # N m/A and V s/rad
    J: float = 0.03  # kg m², of motor and gear
    B: float = 0.0  # N m s/rad
    forward: float = 0.28  # N m
    backward: float = 0.28
    breakaway: float = 1.0
    stribeck: float = 0.0  # rad/s; 0: none
    load_motor: float = 0.0  # K_m of M5; M3 where both are equal
    load_external: float = 0.0
    drop: float = 0.0  # V, of the bridge while it drives
    slope: float = 0.0  # Ω, likewise
    brush: float = 0.0  # V
    play: float = 0.0  # rad
    bearing: float = 0.0  # N m, what of the dry friction is behind the play
    stiffness: float = 2000.0  # N m/rad, of teeth that touch
    damping: float = 2.0  # N m s/rad
    wheel: float = 2e-6  # kg m², behind the play
    zero: float = 0.0  # rad, the encoder's angle less that of the joint
    dynamixel: float = 0.0  # of a Dynamixel X the divisor of P, and 8 times that of D; 0: Feetech STS
    P: float = 16.0
    D: float = 32.0
    zone: float = 1.0  # counts
    startup: float = 16.0  # steps of duty
    limit: float = 0.97
    torque_limit: float = 1.0
    speed: float = 3400.0  # counts/s, of the profile; 0: none
    acceleration: float = 25400.0  # counts/s²
    least_speed: float = 50.0  # counts/s
    slew: float = 0.0  # duty/s; 0: none
    wait: float = 1e-3  # s from tick to bridge
    phase: float = 0.0  # s, of its ticks


def feetech(P: float = 16.0, D: float = 32.0, acceleration: float = 254.0, **more: float) -> Servo:
    """Return an STS servo with registers as LeRobot writes them: acceleration in 100 counts/s², least speed 1 x 50."""
    return Servo(P=P, D=D, acceleration=100.0 * min(acceleration, 254.0))._replace(**more)


def dynamixel(P: float, D: float = 0.0, slew: float = 0.0, divisor: float = 128.0, **more: float) -> Servo:
    """Return an X servo without profile; `slew` is register 62 times 1.977 V/s over the supply.

    The divisor of P is the manual's, and 256 of an XL330.
    """
    return Servo(P=P, D=D, zone=0.0, startup=0.0, limit=1.0, speed=0.0, acceleration=0.0, least_speed=0.0, wait=0.0,
                 dynamixel=divisor, slew=slew)._replace(**more)


USUAL: dict[str, Servo] = {
    # 2.94 N m and 2.7 A at stall, 0.18 A and 4.7 rad/s without load at 12 V; J R/K² 25 ms
    "feetech-sts3215-12v": feetech(R=4.30, K=2.295, J=0.0307, forward=0.279, load_motor=0.25, load_external=0.25,
                                   drop=0.4),
    # as others fitted it: J R/K² 36 ms
    "feetech-sts3215-7v4": feetech(R=2.45, K=1.265, J=0.0235, B=0.0315, forward=0.0556, load_motor=0.21,
                                   load_external=0.21),
    "dynamixel-xl430-w250": dynamixel(P=640.0, R=8.37, K=1.559, J=0.00726, forward=0.208, load_motor=0.13,
                                      load_external=0.13, drop=0.4),
    "dynamixel-xl330-m288": dynamixel(P=400.0, slew=1.977 * 140.0 / 5.0, divisor=256.0, R=3.04, K=0.381, J=1.96e-3,
                                      B=4.4e-3, forward=0.0113, load_motor=0.123, load_external=0.123),
}
"""Servos about which truths are drawn; each turns alike both ways."""

SPREAD = {"R": 1.12, "K": 1.06, "J": 1.3, "forward": 1.3, "load_motor": 1.3, "B": 1.3}
"""How far truths lie about them, a factor either way."""


def drawn(name: str, rng: np.random.Generator) -> Servo:
    """Return a servo of a kind, drawn."""
    usual = USUAL[name]
    found = {field: getattr(usual, field) * share ** rng.uniform(-1.0, 1.0) for field, share in SPREAD.items()}
    return usual._replace(**found, backward=found["forward"], load_external=found["load_motor"])
