"""A Feetech STS3215 that two others pull at: profile, droop and play as its registers and the catalogue have them."""

import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import servotwin as st
from validation import feetech_pulled

FILE = Path("feetech_backlash_robonine") / "motor_telemetry_single.csv"


def main(folder: Path) -> None:
    rows = feetech_pulled.read(folder / FILE)
    print(f"STS3215, P 32, speed 1000, acceleration 20, pulled by {feetech_pulled.PULL:.2f} N m either way: counts; "
          "nothing fitted but when goals come within a row")
    plain = feetech_pulled.servo()
    stiff = plain.replace({"gear.backlash": None, "gear.output_inertia": None})
    for label, servo in (("catalogue", plain), ("without play", stiff)):
        told = feetech_pulled.told(rows, servo)
        print(f"  {label:13} rms while it moves {told.moving:.1f}, at rest {told.resting:.1f}", flush=True)
        for name, found in (("measured", told.measured), ("predicted", told.predicted)):
            droops = ", ".join(f"{word} {value:+.1f}" for word, value in found.items())
            print(f"    {name:10} {droops}; apart {told.play(found):.1f}, after {told.play(found, pulled=False):.1f}")
        for k, name in enumerate(("measured", "predicted")):
            duties = told.duties
            print(f"    {name:10} duty turning {1e3 * duties.turning[k]:.0f}, at rest after a move "
                  f"{1e3 * duties.resting[k]:.0f}, pulled {1e3 * duties.pulled[k]:.0f} thousandths")
    balance(rows, plain, feetech_pulled.told(rows, plain).duties)


def balance(rows: feetech_pulled.Rows, twin: st.Servo, duties: feetech_pulled.Duties) -> None:
    """Print what duties are worth: of a bridge that brakes between its pulses, and of one whose current runs out.

    What it drives with at rest, unpulled, is its friction; that and what it drives with while it is pulled hold the
    pull. The ripple, inductance times frequency of the PWM, is what its currents at rest say of a bridge whose current
    runs out, so it is chosen on this recording; nothing else is.
    """
    V, R, K = (float(twin.get(name)) for name in (
        "supply.open_circuit_voltage", "motor.armature_resistance", "motor.torque_constant"))
    K *= float(twin.get("gear.gear_reduction"))
    rests = (np.gradient(rows.position) == 0.0) & (np.abs(rows.load) > 0.03)
    per_square = float(np.sum(rows.current[rests] * rows.load[rests] ** 2) / np.sum(rows.load[rests] ** 4))
    ripple = V / (2.0 * per_square)
    print(f"  current at rest {per_square:.2f} A times the square of the duty; turning at {duties.speed:.2f} rad/s the "
          f"back EMF alone is {1e3 * K * duties.speed / V:.0f} thousandths of the supply")
    for word, current in (("brakes", lambda d: d * V / R), ("runs out", lambda d: running_out(d, V, R, ripple))):
        friction, drive = (K * current(d[0]) for d in (duties.resting, duties.pulled))
        print(f"  bridge {word:8} friction {friction:.2f} + drive {drive:.2f} = {friction + drive:.2f} N m hold "
              f"{feetech_pulled.PULL:.2f} N m" + (f"; L f {ripple:.2f} ohm" if word == "runs out" else ""))


def running_out(duty: float, V: float, R: float, ripple: float, diode: float = 0.7) -> float:
    """Return the mean current of a motor at rest [A] that runs out through a diode between pulses [V, ohm, ohm, V]."""
    per = R / ripple
    peak = V / R * (1.0 - math.exp(-duty * per))
    on = V / R * (duty - (1.0 - math.exp(-duty * per)) / per)
    off = (peak - diode / R * math.log1p(peak * R / diode)) / per
    return on + off
