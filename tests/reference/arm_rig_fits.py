"""The arms' rig as a user of the package has it: files of its servos, and fits of its episodes judged by its truths."""

from __future__ import annotations

import math
import time as clock
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import servotwin as st

from . import arm_rig as rig
from . import arm_rig_recorder as recorder
from .arm_rig_servo import DELTA, USUAL, Servo

MOTOR = "motor.armature_resistance"
FREE = (MOTOR, "output_torque_constant", "output_inertia", "output_coulomb_torque", "motor.motor_viscous_friction",
        "friction.load_friction")
WRITTEN, SAMPLED = 5e-4, 2e-4  # s, by which the recorder's goals and positions come later in the mean
_COUNTED = DELTA / math.sqrt(12.0)  # rad, rms of an angle less its count


class Judged(NamedTuple):
    """One fit: which intervals hold the truth, by method; rms of unseen episodes, and what the truth leaves [rad]."""

    held: dict[str, bool]
    methods: dict[str, str]
    off: dict[str, float]  # of the truth, in half widths
    unseen: float
    left: float
    causes: tuple[str, ...]
    seconds: float


def servo_of(name: str, servo: Servo, V_oc: float, *, registers: Servo | None = None) -> st.Servo:
    """Return the file of a servo of the rig; `registers` says its firmware where another is believed."""
    chip, made = registers or servo, st.load_servo(name)
    if chip.dynamixel:
        made = st.dynamixel_x({"Position_P_Gain": int(chip.P), "Position_D_Gain": int(chip.D)}, servo=made)
    else:
        made = st.feetech_sts({"P_Coefficient": int(chip.P), "D_Coefficient": int(chip.D), "I_Coefficient": 0,
                               "Acceleration": 254, "Maximum_Acceleration": 254}, servo=made)
    N = made.gear.gear_reduction
    friction = ({"friction.load_friction": servo.load_motor, "friction.load_friction_motor": None,
                 "friction.load_friction_external": None})
    return made.replace({
        MOTOR: servo.R, "motor.torque_constant": servo.K / N, "motor.back_emf_constant": servo.K / N,
        "motor.rotor_inertia": servo.J / N**2, "motor.motor_viscous_friction": servo.B / N**2,
        "friction.coulomb_torque_forward": servo.forward / N, "friction.coulomb_torque_backward": servo.backward / N,
        **friction, "supply.bridge_drop_voltage": servo.drop, "supply.bridge_drop_resistance": None,
        "supply.open_circuit_voltage": V_oc,
        "gear.backlash": servo.play or None, "gear.output_inertia": servo.wheel if servo.play else None,
        "firmware.control_phase": servo.phase, "firmware.duty_slew": servo.slew or None})


def files_of(truth: rig.Truth) -> dict[str, st.Servo]:
    """Return the servos that a user has files of: the usual ones at the nominal voltage, by joint."""
    V_oc, names = truth.robot.voltage[truth.family], truth.robot.servos[truth.family]
    usual = {name: USUAL[name]._replace(backward=USUAL[name].forward) for name in names}
    return {joint: servo_of(name, usual[name], V_oc) for joint, name in zip(truth.robot.joints, names, strict=True)}


def truths_of(truth: rig.Truth) -> dict[str, float]:
    """Return what a fit should find (SI), by its names."""
    names = truth.robot.servos[truth.family]
    kinds, found = dict(zip(names, truth.servos, strict=True)), dict[str, float]()
    for name, servo in kinds.items():
        prefix = f"{name}: " if len(kinds) > 1 else ""
        reduction = float(st.load_servo(name).gear.gear_reduction or 1.0)
        values = (servo.R, servo.K, servo.J, servo.forward, servo.B / reduction**2, servo.load_motor)
        found |= {prefix + key: value for key, value in zip(FREE, values, strict=True)}
    found |= {"supply.open_circuit_voltage": truth.V_oc, "supply.internal_resistance": truth.R_b,
              "latency": truth.write_after + WRITTEN - truth.read_after - SAMPLED}
    found |= {f"mass.{link.name}": float(share) for link, share in zip(truth.robot.links, truth.masses, strict=True)}
    return found | {f"zero.{joint}": -servo.zero for joint, servo in zip(truth.robot.joints, truth.servos, strict=True)}


def late_by(episodes: Sequence[recorder.Episode]) -> float:
    """Return by which share turns of the loop took longer than their stamps say, in the mean."""
    return float(np.mean([np.ptp(one.true_time) / np.ptp(one.time) for one in episodes])) - 1.0


def left_by(truth: rig.Truth, episode: recorder.Episode) -> float:
    """Return the rms that the rig itself leaves of an episode: counts, and a clock that is the stamps' [rad]."""
    start = -recorder.SETTLING
    written = np.append(start, episode.time + truth.write_after + WRITTEN)
    again = rig.simulated(truth, written, np.vstack([episode.action[:1], episode.action]),
                          episode.time + truth.read_after + SAMPLED, start=start, pushes=episode.pushes)
    off = again.angle + np.array([servo.zero for servo in truth.servos]) - episode.state
    return float(math.hypot(np.sqrt(np.mean(off**2)), _COUNTED))


def judged(truth: rig.Truth, folder: Path, *, duration: float = 20.0, episodes: int = 3, stamps: str = "frames",
           **more: Any) -> Judged:
    """Record episodes of an arm, fit all but the last, and look where the truth lies."""
    from servotwin.identification import identify_arm
    from servotwin.robots import read_motion

    kinds = ("mixed", "smooth", "steps")
    made = [recorder.record(truth, duration, kinds[k % 3], episode=k, stamps=stamps) for k in range(episodes)]
    data = recorder.write_dataset(made, truth, folder / "episodes", robot_type="of_the_rig")
    unit = {"*": "deg", **{joint: "deg" for joint in truth.robot.joints if joint == "gripper"}}
    motions = [read_motion(data, truth.robot.joints, unit=unit, episode=k) for k in range(episodes)]
    file = folder / f"{truth.robot.name}.xml"
    file.write_text(rig.mjcf(truth.robot), encoding="utf-8")
    began = clock.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = identify_arm(motions, file, files_of(truth), **{"free": FREE, "holdout": 1, **more})
    spent = clock.process_time() - began
    held, methods, off = dict[str, bool](), dict[str, str](), dict[str, float]()
    true = truths_of(truth) | {"clock": late_by(made[:episodes - 1])}
    for name, (lower, upper, method) in fit.intervals().items():
        methods[name] = method
        if name in true and not math.isnan(lower):
            held[name] = bool(lower <= true[name] <= upper)
            off[name] = (true[name] - 0.5 * (lower + upper)) / max(0.5 * (upper - lower), 1e-300)
    return Judged(held, methods, off, fit.holdout.rms() if fit.holdout else math.nan, left_by(truth, made[-1]),
                  tuple(cause.name for cause in fit.causes), spent)
