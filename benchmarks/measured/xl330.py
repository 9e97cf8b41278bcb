"""Dynamixel XL330 on a pendulum as a bus servo: P by its register, one gain held out at a time, laws of friction."""

import time
from pathlib import Path

import numpy as np
from bam import PUBLISHED
from bam_rule import STEP, error

import servotwin as st
from servotwin.identification import LogError, friction_ladder, read_bam_log

GAINS = (100.0, 200.0, 800.0)
PLANT = ("motor.armature_resistance", "output_torque_constant", "output_inertia")
LAWS = ("M1", "M3", "M4", "M6")
REDUCTION = 288.4
NEAR = {  # what first fits found, so that each search ends in one valley
    "motor.armature_resistance": 3.3, "motor.torque_constant": 0.33 / REDUCTION,
    "motor.back_emf_constant": 0.33 / REDUCTION, "motor.rotor_inertia": 2.1e-3 / REDUCTION**2,
    "motor.motor_viscous_friction": 8e-3 / REDUCTION**2, "friction.coulomb_torque_forward": 3e-3 / REDUCTION,
    "friction.coulomb_torque_backward": 3e-3 / REDUCTION, "friction.load_friction": 0.22}
NOISE = {"output_angle": 0.05}  # rad, what of a residual counts in full: what the model leaves open, not the encoder


def logs(folder: Path) -> list[st.Log]:
    """Return all runs as far as torque is on."""
    found: list[st.Log] = []
    for path in sorted((folder / "bam_xl330" / "raw").glob("*.json")):
        found += read_bam_log(path).without_torque_off()
    return found


def told(label: str, errors: tuple[LogError, ...]) -> None:
    """Print the rms error by gain [mrad]: over all samples, and of each run, by motion."""
    cells = []
    for gain in GAINS:
        some = [e for e in errors if e.conditions["gain"] == gain]
        if some:
            pooled = np.sqrt(sum(e.rms**2 * e.samples for e in some) / sum(e.samples for e in some))
            own = " ".join(f"{1e3 * e.rms:3.0f}" for e in sorted(some, key=lambda e: e.motion))
            cells.append(f"{gain:g}: {1e3 * pooled:5.1f} ({own})")
    print(f"  {label:34} {'   '.join(cells)}", flush=True)


def main(folder: Path) -> None:
    runs = logs(folder)
    servo = st.load_servo("dynamixel-xl330-m288").replace({
        "supply.open_circuit_voltage": 7.4, "supply.bridge_drop_resistance": None, **NEAR})
    print(f"XL330 as a bus servo: {len(runs)} runs; rms error by register P [mrad], over all samples "
          f"({', '.join(sorted({log.motion for log in runs}))})")
    for name, published in PUBLISHED.items():
        told(f"BAM's {name.upper()}, {1e3 * STEP:g} ms", tuple(error(log, published) for log in runs))
    best: dict[str, list[LogError]] = {}
    for gain in GAINS:
        began = time.process_time()
        held = [log.name for log in runs if log.conditions["gain"] == gain]
        ladder = friction_ladder(runs, servo, free=PLANT, rungs=LAWS, select="criterion", gives_way=True, priors=None,
                                 starts=1, intervals=False, noise=NOISE, sensors=["output_angle"], holdout=held)
        for rung in ladder.rungs:
            told(f"P {gain:g} held out, {rung.name}", rung.fit.holdout.errors["DigitalServo"])
            told("  fitted", rung.fit.training.errors["DigitalServo"])
            best.setdefault(rung.name, []).extend(rung.fit.holdout.errors["DigitalServo"])
            print("   ", ", ".join(f"{name.rpartition('.')[2]} {value:.4g}"
                                   for name, value in rung.fit.estimates.items()), flush=True)
        print(f"  chosen by what was fitted: {ladder.chosen}, {ladder.reason}; "
              f"{time.process_time() - began:.0f} s of CPU", flush=True)
    for name, errors in best.items():
        told(f"{name}, each gain held out", tuple(errors))
