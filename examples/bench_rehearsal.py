"""From an emulated bench to a fitted servo: what an afternoon with a real one looks like, in a minute.

The firmware of the bench runs under simavr where that is installed, else a mock of it; a simulated servo hangs on its
pins. Its logs are fitted from numbers that are off, and the truth is known here.
"""

from pathlib import Path

import servotwin as st
from servotwin.bench.recording import About, Limits, Wiring, experiments, record
from servotwin.bench.rehearsal import rehearsal_rig

FREE = ["output_inertia", "output_torque_constant", "electronics.stretcher_gain"]
truth = st.load_servo("hitec-hs-755hb").replace({"supply.open_circuit_voltage": 6.0})
load = st.loads.Inertia(2e-3) + st.loads.Constant(0.2)  # a disc, and a weight on a drum
limits = Limits(kind="pulse_width", low=1.0e-3, high=2.0e-3, voltage=6.0, current=2.5)
about = About(servo="HS-755HB (emulated)", licence="CC0-1.0", load={"inertia": 2e-3, "torque": 0.2})

rig, remark = rehearsal_rig(st.PulseServo(truth), load, Wiring(), rate="frame")
print(remark or f"board: {rig.board.backend.name}")
folder = Path("rehearsal")
folder.mkdir(exist_ok=True)
rig.open()
try:
    for experiment in experiments("steps,ramp", limits, duration=4.0):
        found = record(rig, experiment, folder / f"{experiment.name}.csv", limits=limits, about=about, overwrite=True)
        print(f"{found.path}: {found.rows} rows")
finally:
    rig.close()

begin = truth.replace({"motor.rotor_inertia": 1.3 * truth.motor.rotor_inertia,
                       "electronics.stretcher_gain": 0.8 * truth.electronics.stretcher_gain})
fit = st.identify(st.read_logs(folder), begin, free=FREE, priors=None, holdout=0)
for name, interval in fit.intervals().items():
    if name in FREE:
        print(f"{name}: {interval.lower:.4g} to {interval.upper:.4g}")
print(f"the stretcher gain is {truth.electronics.stretcher_gain:.4g}")
