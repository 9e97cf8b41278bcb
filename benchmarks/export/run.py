"""Exported C beside Python: what a call costs that goes on by 1 ms, in one run.

`run.py` prints, for servos of several kinds, the CPU time of such a call of `Simulator.advance`, of the exported
function by each compiler that is there, and of a lane of a compiled `VectorSimulator`, of 1024 on one core. Lanes with
pulses go side by side, in vectors; the others one by one, as the exported servo does.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time

import numpy as np

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

HERE = Path(__file__).parent
SERVO, BUS = "hitec-hs-755hb", "feetech-sts3215-12v"
STEP, TURN = 1e-3, 500  # s; calls from one command to the next
LOW, HIGH = 0.5, 1.5  # rad
CALLS, PYTHON, LANES, TICKS = 1_000_000, 3000, 1024, 500
HEAT = {"thermal.winding_capacity": 3.0, "thermal.housing_capacity": 30.0, "thermal.winding_to_housing": 10.0,
        "thermal.housing_to_ambient": 20.0}
SERVOS = {
    "pulses": (st.PulseServo, SERVO, {}), "bounded": (st.BoundedServo, SERVO, {}),
    "averaged": (st.AveragedServo, SERVO, {}),
    "play": (st.PulseServo, SERVO, {"gear.backlash": 0.02, "gear.output_inertia": 1e-4}),
    "inductance": (st.PulseServoInductive, SERVO, {"motor.armature_inductance": 5e-4}),
    "heat": (st.PulseServo, SERVO, HEAT), "on a bus": (st.DigitalServo, BUS, {})}


def exported(model: st.models.Model, folder: Path, compiler: str) -> float:
    """Return the time of a call in C [s]."""
    st.export.c(model, name="servo").write(folder, overwrite=True)
    text = (HERE / "advance.c").read_text(encoding="utf-8")
    for word, value in (("NAME", "servo"), ("LOW", LOW), ("HIGH", HIGH)):
        text = text.replace(word, str(value))
    (folder / "main.c").write_text(text, encoding="utf-8")
    subprocess.run([compiler, "-O2", "-std=c99", "-o", str(folder / "main"), str(folder / "main.c"),
                    str(folder / "servo.c"), "-lm"], check=True)
    runs = (subprocess.run([str(folder / "main"), str(CALLS)], capture_output=True, text=True, check=True)
            for _ in range(3))
    return min(float(done.stdout.split()[0]) for done in runs)


def told(model: st.models.Model) -> tuple[list[float], str]:
    """Return two commands as the exported servo takes them, and their unit."""
    if isinstance(model, st.DigitalServo) and model.takes_goals:
        return [LOW, HIGH], "rad"
    wiring = st.export.c_writing.wiring_of(model)
    return [wiring.per_angle * angle + wiring.at_zero for angle in (LOW, HIGH)], "s"


def python(model: st.models.Model) -> float:
    """Return the time of a call of `Simulator.advance` [s]."""
    values, unit = told(model)
    signals, sim = [st.signals.constant(value, unit=unit) for value in values], st.Simulator(model)

    def run() -> None:
        state = sim.initial(signals[0])
        for k in range(1, PYTHON + 1):
            state = sim.advance(state, STEP * k, signals[k // TURN % 2])

    return best(run, 2) / PYTHON


def lanes(model: st.models.Model, spread: float) -> float:
    """Return the time of a lane's tick [s], compiled before; each lane has its own command, that far from the next."""
    values, unit = told(model)
    name = "command_angle" if unit == "rad" else "pulse_width"
    sims = st.VectorSimulator(model, lanes=LANES, threads=1)
    commands = [value * (1.0 + spread * np.linspace(0.0, 1.0, LANES)) for value in values]
    sims.reset(**{name: commands[0]})
    sims.advance(STEP, **{name: commands[0]})

    def run() -> None:
        for k in range(1, TICKS + 1):
            sims.advance(STEP, **{name: commands[k // 50 % 2]})

    started = process_time()
    run()
    return (process_time() - started) / TICKS / LANES


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        print(f"{'servo':12}{'compiler':>9}{'Python':>10}{'C':>10}{'a lane':>10}   Python/C   lane/C")
        for name, (kind, servo, changes) in SERVOS.items():
            model = kind(st.load_servo(servo).replace(changes))
            plain, lane = python(model), lanes(model, 0.05)
            for compiler in filter(shutil.which, ("clang", "gcc")):
                own = exported(model, Path(folder), compiler)
                print(f"{name:12}{compiler:>9}{1e6 * plain:7.1f} us{1e9 * own:7.0f} ns{1e9 * lane:7.0f} ns"
                      f"   {plain / own:8.0f}   {lane / own:6.2f}")


if __name__ == "__main__":
    main()
