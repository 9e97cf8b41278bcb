"""Part 6: fits of whole arms, whose truth is known: intervals, unseen episodes, and a wrong register.

The arms (`tests/reference/arm_rig.py`) share no code with the package: three robots, two families of servos, a loop like
that of LeRobot. The search begins at the catalogue's servos and the masses of the robot's file. Judged are the intervals
of what episodes determine, the error on an episode that was not fitted beside that of the engine with the true numbers,
and which cause is named first where one joint's P register is not what it is said to be.
"""

import math
import sys
import tempfile
import time as clock
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import servotwin as st
from reference import arm_rig as rig
from reference import arm_rig_recorder as recorder
from servotwin.identification import arms
from servotwin.robots import Mount, read_motion, validate_robot

SEEDS, EPISODES, DURATION = 20, 3, 30.0  # s
WRONG = 0.5, 2.0  # times the P register that is said
PLAIN = "as it is", "wrong register"


class Job(NamedTuple):
    """One arm to be fitted."""

    robot: str
    family: str
    seed: int
    kind: str = PLAIN[0]


def jobs(seeds: range, kind: str = PLAIN[0]) -> list[Job]:
    """Return all robots and families, seed by seed."""
    return [Job(robot, family, seed, kind) for seed in seeds for robot in rig.ROBOTS for family in rig.FAMILIES]


def said(name: str, servo: Any, volts: float) -> st.Servo:
    """Return the catalogue's servo with the registers that the arm has; its play is none of the arm's."""
    made = st.load_servo(name)
    made = (st.dynamixel_x({"Position_P_Gain": int(servo.P), "Position_D_Gain": 0}, servo=made) if servo.dynamixel else
            st.feetech_sts({"P_Coefficient": int(servo.P), "D_Coefficient": int(servo.D), "I_Coefficient": 0,
                            "Acceleration": 254, "Maximum_Acceleration": 254}, servo=made))
    return made.replace({"gear.backlash": None, "gear.output_inertia": None, "supply.open_circuit_voltage": volts})


def true(name: str, servo: Any, volts: float) -> st.Servo:
    """Return the servo as it is."""
    made = said(name, servo, volts)
    N = float(made.gear.gear_reduction)
    return made.replace({
        "motor.armature_resistance": servo.R, "motor.torque_constant": servo.K / N,
        "motor.back_emf_constant": servo.K / N, "motor.rotor_inertia": servo.J / N**2,
        "motor.motor_viscous_friction": servo.B / N**2, "friction.coulomb_torque_forward": servo.forward / N,
        "friction.coulomb_torque_backward": servo.backward / N, "friction.load_friction": None,
        "friction.load_friction_motor": servo.load_motor, "friction.load_friction_external": servo.load_external,
        "supply.bridge_drop_voltage": servo.drop, "firmware.control_phase": servo.phase,
        "firmware.duty_slew": servo.slew or None})


def truths(truth: rig.Truth) -> dict[str, float]:
    """Return what a fit should find, by the names of the fit."""
    names = truth.robot.servos[truth.family]
    found = {"supply.open_circuit_voltage": truth.V_oc, "supply.internal_resistance": truth.R_b,
             "latency": truth.write_after - truth.read_after}
    for link, share in zip(truth.robot.links, truth.masses, strict=True):
        found[f"mass.{link.name}"] = float(share)
    for link, servo in zip(truth.robot.links, truth.servos, strict=True):
        found[f"zero.{link.joint}"] = -servo.zero
    for name, servo in zip(names, truth.servos, strict=True):
        N = float(st.load_servo(name).gear.gear_reduction)
        own = {"motor.armature_resistance": servo.R, "output_torque_constant": servo.K, "output_inertia": servo.J,
               "output_coulomb_torque": servo.forward, "motor.motor_viscous_friction": servo.B / N**2,
               "friction.load_friction": servo.load_motor, "friction.load_friction_motor": servo.load_motor,
               "friction.load_friction_external": servo.load_external}
        prefix = f"{st.load_servo(name).name}: " if len(set(names)) > 1 else ""
        found |= {prefix + key: value for key, value in own.items()}
    return found


def job(robot: str, family: str, seed: int, kind: str = PLAIN[0], duration: float = DURATION) -> dict[str, Any]:
    """Fit one arm, and judge what is said of it."""
    truth = rig.random_truth(rig.ROBOTS[robot], family, seed)
    rng, joints = np.random.default_rng([seed, 11]), truth.robot.joints
    wrong = int(rng.integers(len(joints))) if kind == PLAIN[1] else None
    built = truth if wrong is None else rig.with_wrong_gain(truth, wrong, float(rng.choice(WRONG)))
    names = truth.robot.servos[family]
    volts = truth.robot.voltage[family]
    episodes = [recorder.record(built, duration, "mixed", episode=k) for k in range(EPISODES)]
    servos = {joint: said(name, servo, volts) for joint, name, servo in zip(joints, names, truth.servos, strict=True)}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = Path(folder) / "arm.xml"
        model.write_text(rig.mjcf(truth.robot), encoding="utf-8")
        logs = recorder.write_dataset(episodes, built, Path(folder) / "set", robot_type=truth.robot.name)
        plant, motions = motions_of(model, logs)
        began = clock.process_time()
        fit = arms.identify_arm(motions, plant, servos, bus=st.Supply(open_circuit_voltage=volts))
        spent = clock.process_time() - began
        least = truth_left(plant, built, motions[-1])
    right, held, endless = truths(built), {}, {}
    for name, (lower, upper, method) in fit.intervals().items():
        if name not in right:
            continue
        if method != "normal" or math.isnan(lower):
            endless[name] = method
            continue
        held[name] = bool(lower <= right[name] <= upper)
    return {"held": held, "endless": endless, "causes": [cause.name for cause in fit.causes],
            "sentences": [cause.sentence for cause in fit.causes], "joint": None if wrong is None else joints[wrong],
            "unseen": fit.holdout.rms() if fit.holdout else math.nan, "truth": least,
            "before": fit.before_holdout.rms() if fit.before_holdout else math.nan, "seconds": spent,
            "stages": dict(fit.stages), "undetermined": list(fit.undetermined)}


def motions_of(model: Path, logs: Path) -> tuple[Any, list[Any]]:
    """Return the plant and the motions of all episodes of a dataset."""
    from servotwin.robots import joint_names, joint_ranges, robot_model

    plant = robot_model(model)
    return plant, [read_motion(logs, joint_names(plant), unit="deg", ranges=joint_ranges(plant), episode=k)
                   for k in range(EPISODES)]


def truth_left(plant: Any, truth: rig.Truth, motion: Any) -> float:
    """Return how far the engine with the true numbers is off an episode [rad]."""
    from dataclasses import replace

    from servotwin.identification.arms.dynamics import links_of, with_masses

    joints = truth.robot.joints
    heavier = with_masses(plant, links_of(plant, list(joints)), truth.masses)
    zeros = {joint: -servo.zero for joint, servo in zip(joints, truth.servos, strict=True)}
    mounts = {joint: Mount(st.DigitalServo(true(name, servo, truth.V_oc)), zero=zeros[joint]) for joint, name, servo in
              zip(joints, truth.robot.servos[truth.family], truth.servos, strict=True)}
    moved = replace(motion, robot="", angles={name: motion.angles[name] + zeros[name] for name in joints},
                    measured={name: motion.measured[name] + zeros[name] for name in joints})
    bus = st.Supply(open_circuit_voltage=truth.V_oc, internal_resistance=truth.R_b)
    return float(validate_robot(heavier, mounts, moved, bus=bus, rivals=(), joint_friction="keep", assume_heat=False,
                                latency=truth.write_after - truth.read_after).rms())


def row(name: str, found: list[dict[str, Any]]) -> str:
    """Return the line of a robot and family."""
    held = [x for one in found for x in one["held"].values()]
    share = f"{100.0 * np.mean(held):5.1f} % of {len(held):4d}" if held else "   none        "
    ratio = np.array([one["unseen"] / one["truth"] for one in found])
    mean = {key: 1e3 * float(np.mean([one[key] for one in found])) for key in ("before", "unseen", "truth")}
    return (f"  {name:26} {share}  {mean['before']:7.2f} {mean['unseen']:7.2f} {mean['truth']:7.2f}  "
            f"{np.median(ratio):5.2f} {ratio.max():5.2f} {np.mean([one['seconds'] for one in found]):7.1f}")


def main(seeds: int = SEEDS, *, first: int = 0) -> None:
    chosen = range(first, first + seeds)
    print(f"{EPISODES} episodes of {DURATION:g} s at 30 Hz, the last one unseen, {seeds} arms a row")
    print("  robot, servos                    intervals hold   mrad before,  after, by truth   after/truth: median, "
          "worst; s of CPU")
    everything: dict[str, list[dict[str, Any]]] = {}
    for one in sorted(jobs(chosen), key=lambda job: (job.robot, job.family)):
        everything.setdefault(f"{one.robot}, {one.family}", []).append(job(*one))
        if len(everything[f"{one.robot}, {one.family}"]) == seeds:
            print(row(f"{one.robot}, {one.family}", everything[f"{one.robot}, {one.family}"]), flush=True)
    wrong = [job(*one) for one in jobs(range(first, first + max(seeds // 6, 1)), PLAIN[1])]
    first_named = sum(one["causes"][:1] == ["proportional gain"] and one["joint"] in one["sentences"][0]
                      for one in wrong)
    print(f"  a wrong P register: named first in {first_named} of {len(wrong)}", flush=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
