"""Draw the pictures of the pages on digital servos again: run this file."""

import runpy
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

import servotwin as st

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"


def loop():
    """The torque of a joint of an SO-101 over its error."""
    servo = st.feetech_sts({"P_Coefficient": 16}, servo="feetech-sts3215-12v")
    return st.plotting.loop_curve([st.datasheet.Loop(st.DigitalServo(servo))])


if __name__ == "__main__":
    st.plotting.save(loop(), IMAGES / "digital_loop.png", overwrite=True)
    with TemporaryDirectory() as folder, chdir(folder):
        runpy.run_path(str(ROOT / "examples" / "so101.py"))
        (IMAGES / "so101.png").write_bytes(Path("so101.png").read_bytes())
