"""A Feetech STS3215 that two others pull at: profile, droop and play as its registers and the catalogue have them."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

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
