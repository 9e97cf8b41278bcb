"""Dynamixel XL330 on a pendulum as a bus servo: P by its register, the plant fitted, one gain held out at a time."""

import time
from pathlib import Path

import numpy as np
from bam import PUBLISHED
from bam_rule import STEP, error

import servotwin as st
from servotwin.identification import LogError, read_bam_log

GAINS = (100.0, 200.0, 800.0)
FREE = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque",
        "motor.motor_viscous_friction", "friction.load_friction")
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
    print(f"  {label:20} {'   '.join(cells)}", flush=True)


def main(folder: Path) -> None:
    runs = logs(folder)
    servo = st.load_servo("dynamixel-xl330-m288").replace({"supply.open_circuit_voltage": 7.4})
    print(f"XL330 as a bus servo: {len(runs)} runs; rms error by register P [mrad], over all samples "
          f"({', '.join(sorted({log.motion for log in runs}))})")
    for name, published in PUBLISHED.items():
        told(f"BAM's {name.upper()}, {1e3 * STEP:g} ms", tuple(error(log, published) for log in runs))
    for gain in GAINS:
        began = time.perf_counter()
        fit = st.identify(runs, servo, free=FREE, priors=None, starts=1, intervals=False, diagnose=False, noise=NOISE,
                          compare_with=(), sensors=["output_angle"],
                          holdout=[log.name for log in runs if log.conditions["gain"] == gain])
        told(f"held out, P {gain:g}", fit.holdout.errors["DigitalServo"])
        told("  fitted", fit.training.errors["DigitalServo"])
        print("   ", ", ".join(f"{name.rpartition('.')[2]} {value:.4g}" for name, value in fit.estimates.items())
              + f"; {time.perf_counter() - began:.0f} s", flush=True)
