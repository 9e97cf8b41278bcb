"""Servos of the catalog on the independent bench, with what goes wrong at home: 23 defects, fitted as anyone would.

A servo is one that its file describes: off by up to 20 % in resistance, 80 % in inertia and 40 % in friction. Four logs
of 7.5 s at 50 Hz have steps, a random binary sequence, a triangle and small steps one after the other; the shaft is
free, the encoder has 12 bits and 0.5 mrad of noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import servotwin as st

from . import rig
from . import rig_draws as draws
from .rig_draws import COUNT, MOTIONS
from .rig_logs import log_of

DURATION, LOGS, SAMPLE = 7.5, 4, draws.SAMPLE  # s, -, s
_MIDDLE = 1.5  # rad, about which a potentiometer of the bench is bent
_COPPER = 3.9e-3  # 1/K
_FREE = rig.Load()


class Bench(NamedTuple):
    """A servo of the catalog on the bench.

    Parameters
    ----------
    file : Servo
    servo : rig.Servo
        Its angles are larger by `shift`, so that the middle of the commands is at 1.5 rad.
    shift : float
        [rad]
    seed : int
    """

    file: st.Servo
    servo: rig.Servo
    shift: float
    seed: int


def bench(name: str, seed: int) -> Bench:
    """Return a servo that a file of the catalog describes."""
    file, rng = st.load_servo(name), np.random.default_rng([seed, 21])

    def of(key: str) -> float:
        value = file.get(key)
        return float(value) if value is not None else 0.0

    def about(share: float) -> float:
        return float(share ** rng.uniform(-1.0, 1.0))

    N, slope = of("gear.gear_reduction"), of("electronics.one_shot_slope") * of("potentiometer.feedback_gain")
    zero = of("electronics.one_shot_offset") + of("electronics.one_shot_slope") * of("potentiometer.feedback_offset")
    shift = _MIDDLE - (draws.MIDDLE - zero) / slope
    friction = N * of("friction.coulomb_torque_forward") * about(1.4)
    return Bench(file, rig.Servo(
        R=of("motor.armature_resistance") * about(1.2), K=N * of("motor.torque_constant") * about(1.05),
        J=N**2 * of("motor.rotor_inertia") * about(1.8), forward=friction, backward=friction,
        B=N**2 * of("motor.motor_viscous_friction"), V_oc=of("supply.open_circuit_voltage"),
        V_ce0=of("supply.bridge_drop_voltage"), R_b=of("supply.internal_resistance"), zero=zero - slope * shift,
        slope=slope, gain=of("electronics.stretcher_gain") * about(1.3), deadband=of("electronics.deadband"),
        motor_share=of("friction.load_friction_motor"), external_share=of("friction.load_friction_external"),
        t_min=of("electronics.minimum_drive_time")), shift, seed)


def logs(this: Bench, servos: list[rig.Servo] | None = None, load: rig.Load = _FREE, *,
         change: Callable[[rig.Recording, np.random.Generator], rig.Recording] | None = None, step: float = 0.0,
         begin: float = 0.0, **taking: Any) -> list[st.Log]:
    """Return the logs of a bench, perhaps of other servos log by log, or changed after they were written.

    What is sent is a multiple of `step` from `begin` on [s], where that is given; the log says what was asked for.
    """
    found = []
    for k in range(LOGS if servos is None else len(servos)):
        rng = np.random.default_rng([this.seed, 22, k])
        share = DURATION / len(MOTIONS)
        widths = np.concatenate([draws.motion(kind, share, rng)[:round(share / SAMPLE)]
                                 for kind in rng.permutation(MOTIONS)])
        widths = draws.MIDDLE + min(rng.uniform(1.0, 1.8), _room(this) / draws.REACH) * (widths - draws.MIDDLE)
        sent = begin + step * np.round((widths - begin) / step) if step else widths
        servo = this.servo if servos is None else servos[k]
        said = rig.record(servo, load, sent, **{
            "delay": 0.015, "angle_offset": 0.01 - this.shift, "noise": 5e-4, "counts": COUNT,
            "seed": int(rng.integers(2**31)), **taking})._replace(command=widths)
        if change is not None:
            said = change(said, rng)
        found.append(log_of(said, load, f"{k + 1}"))
    return found


def _room(this: Bench) -> float:
    """Return how far pulses may lie off the middle without a stop [s]; the bench has none."""
    middle = _MIDDLE - this.shift
    ends = (middle - float(this.file.get("stops.lower_angle") or -math.inf),
            float(this.file.get("stops.upper_angle") or math.inf) - middle)
    return 0.9 * this.servo.slope * min(ends)


Defect = Callable[[Bench], list[st.Log]]


def _of(**changed: Any) -> Defect:
    """Return a defect of the servo: numbers of the bench's, or what its own number is multiplied by."""
    def made(this: Bench) -> list[st.Log]:
        there = {name: value(this.servo) if callable(value) else value for name, value in changed.items()}
        return logs(this, [this.servo._replace(**there)] * LOGS)
    return made


def _in_turn(**changed: Callable[[rig.Servo, int], float]) -> Defect:
    """Return a defect that differs from log to log."""
    def made(this: Bench) -> list[st.Log]:
        return logs(this, [this.servo._replace(**{name: value(this.servo, k) for name, value in changed.items()})
                           for k in range(LOGS)])
    return made


def _told(change: Callable[[rig.Recording, np.random.Generator], rig.Recording]) -> Defect:
    return lambda this: logs(this, change=change)


def _late(said: rig.Recording, rng: np.random.Generator) -> rig.Recording:
    time = said.time.copy()
    hit = np.flatnonzero(rng.random(len(time) - 2) < 0.2) + 1
    time[hit] += rng.uniform(0.008, 0.018, len(hit))
    return said._replace(time=np.maximum.accumulate(time + 1e-6 * np.arange(len(time))))


def _dropped(said: rig.Recording, rng: np.random.Generator) -> rig.Recording:
    keep = rng.random(len(said.time)) >= 0.06
    keep[0] = True
    less = rig.Recording(*(values[keep] for values in said))
    return less._replace(time=SAMPLE * np.arange(len(less.time)))


def _outliers(said: rig.Recording, rng: np.random.Generator) -> rig.Recording:
    hit = rng.random(len(said.angle)) < 0.05
    return said._replace(angle=said.angle + hit * rng.uniform(-0.5, 0.5, len(hit)))


def _wrapped(said: rig.Recording, rng: np.random.Generator) -> rig.Recording:
    seam = float(np.quantile(said.angle, 0.8))
    return said._replace(angle=np.where(said.angle > seam, said.angle - 2.0 * math.pi, said.angle))


def _two(this: Bench) -> list[st.Log]:
    s = this.servo
    other = s._replace(R=1.4 * s.R, J=0.6 * s.J, forward=1.5 * s.forward, backward=1.5 * s.backward, gain=0.7 * s.gain)
    return logs(this, [s, other] * 3)


def _warm(this: Bench) -> list[st.Log]:
    """60 K: in each log from cold, or over all of them."""
    s, share = this.servo, 60.0 * _COPPER
    if this.seed % 2:
        return logs(this, [s._replace(warms=share / DURATION)] * LOGS)
    return logs(this, [s._replace(R=s.R * (1.0 + share * k / LOGS), warms=share / LOGS / DURATION)
                       for k in range(LOGS)])


def _loaded(this: Bench) -> list[st.Log]:
    """A gear that loses 20 % of all torque on either side, against a fifth of the stall torque."""
    s = this.servo
    stall = s.K * (s.V_oc - s.V_ce0) / s.R
    lossy = s._replace(motor_share=0.2, external_share=0.2)
    return logs(this, [lossy] * LOGS, rig.Load(inertia=s.J, torque=0.2 * stall))


DEFECTS: dict[str, Defect] = {
    "none": lambda this: logs(this),
    "bent potentiometer": _of(bend=0.06),
    "falling supply": _of(fall=1.0 / 6.0 / DURATION),
    "dropping supply": _of(drop=0.15),
    "another supply in some logs": _in_turn(V_oc=lambda s, k: s.V_oc * (1.2 if k % 2 else 1.0)),
    "lost pulses": lambda this: logs(this, lost=0.04),
    "late stamps": _told(_late),
    "dropped rows": _told(_dropped),
    "angle times 1.1": _told(lambda said, rng: said._replace(angle=1.1 * said.angle)),
    "reversed sign": _told(lambda said, rng: said._replace(angle=-said.angle)),
    "degrees": _told(lambda said, rng: said._replace(angle=np.degrees(said.angle))),
    "wrapped angle": _told(_wrapped),
    "outliers": _told(_outliers),
    "rounded commands": lambda this: logs(this, step=1856e-6 / 180.0, begin=544e-6),
    "frame 20.48 ms": lambda this: logs(this, period=0.02048),
    "play": _of(play=math.radians(1.2), wheel=lambda s: 0.05 * s.J),
    "growing play": _in_turn(play=lambda s, k: math.radians(0.3 + 2.2 * k / (LOGS - 1)), wheel=lambda s, k: 0.05 * s.J),
    "play at the potentiometer": _of(wiper_play=math.radians(1.2)),
    "directed friction": _of(backward=lambda s: 1.6 * s.backward),
    "coast": _of(coasts=1.0),
    "warming": _warm,
    "load friction": _loaded,
    "digital P servo": _of(digital_rate=1500.0, digital_gain=8.0),
    "two servos": _two,
}
"""What is wrong, by name; nothing first."""
