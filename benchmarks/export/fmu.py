"""An FMU in fmpy beside `simulate` with as many outputs, and how large it is.

    python benchmarks/export/fmu.py

CPU time of 2 s of a servo with 2000 outputs, the best of five; kernels and library being there.
"""

import tempfile
import time as clock
import zipfile
from pathlib import Path

import fmpy

import servotwin as st
from servotwin.export.c_writing import wiring_of
from servotwin.models import default_model

SERVOS = ("hitec-hs-755hb", "feetech-sts3215-12v", "dynamixel-xl330-m288", "miuzei-25kg")
SECONDS, STEP = 2.0, 1e-3


def best(run):
    found = []
    for _ in range(5):
        began = clock.process_time()
        run()
        found.append(clock.process_time() - began)
    return min(found)


def main():
    print(f"{'':24}{'library':>10}{'fmpy':>10}{'simulate':>10}{'ratio':>8}")
    for name in SERVOS:
        model = default_model(st.load_servo(name))
        command, wiring = st.signals.step(0.0, 0.6, at=0.0, unit="rad"), wiring_of(model)
        told = {"command_angle" if wiring.per_angle == 1.0 else "pulse_width": 0.6 * wiring.per_angle + wiring.at_zero}
        with tempfile.TemporaryDirectory() as folder:
            path = str(st.export.fmu(model).write(Path(folder) / "servo.fmu"))
            with zipfile.ZipFile(path) as whole:
                size = max(each.file_size for each in whole.infolist() if each.filename.startswith("binaries/"))
            where, about = fmpy.extract(path, unzipdir=folder), fmpy.read_model_description(path)
            tool = best(lambda where=where, about=about, told=told: fmpy.simulate_fmu(
                where, model_description=about, stop_time=SECONDS, output_interval=STEP, output=["output_angle"],
                start_values=told, validate=False))
        alone = best(lambda model=model, command=command: st.simulate(
            model, command, duration=SECONDS, output_step=STEP)["output_angle"])
        print(f"{name:24}{size / 1000:7.0f} kB{1e3 * tool:7.1f} ms{1e3 * alone:7.1f} ms{alone / tool:8.1f}")


if __name__ == "__main__":
    main()
