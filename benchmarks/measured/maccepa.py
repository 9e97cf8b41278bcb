"""Two Hitec servos in a MACCEPA joint: a supply that sags as the motor starts, fitted, left out, or overlooked."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

import servotwin as st

FREE = ["output_torque_constant", "output_inertia", "output_coulomb_torque", "electronics.stretcher_gain"]
DISTURBED = 0.09  # s after the step
SIDECAR = {"time": ("%time", 1e-9), "angle": "field.servo1_position", "command": "field.u1"}


def read(path: Path) -> st.Log:
    """Return the run of servo 1 from 40 ms before its step on."""
    table = np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding=None, deletechars="")
    stamp = np.array(table[SIDECAR["time"][0]], np.int64)
    time = (stamp - stamp[0]) * SIDECAR["time"][1]
    new = np.concatenate([[True], np.diff(time) > 0.0])
    log = st.Log(name=path.stem, time=time[new], command=table[SIDECAR["command"]][new].astype(float),
                 command_kind="angle", measured={"output_angle": table[SIDECAR["angle"]][new].astype(float)},
                 motion="step")
    at = step_of(log)
    return log.part(max(at - 0.04, 0.0), at + 0.9)


def step_of(log: st.Log) -> float:
    """Return when the command steps [s]."""
    return float(log.time[np.flatnonzero(np.diff(log.command))[0] + 1])


def main(folder: Path) -> None:
    logs = [read(path) for path in sorted((folder / "maccepa_hitec").glob("servo1_*.csv"))]
    windowed = [replace(log, left_out=((step_of(log), step_of(log) + DISTURBED),)) for log in logs]
    servo = st.load_servo("hitec-hs-311").replace({
        "stops.lower_angle": None, "stops.upper_angle": None, "supply.internal_resistance": 0.3})
    usual = ("delay", "angle_offset", "initial_state")
    print(f"MACCEPA joint, servo 1: {len(logs)} steps; the reading jumps by about -25 deg as the motor starts")
    for label, runs, nuisance in (("overlooked", logs, usual), ("window left out", windowed, usual),
                                  ("coupling fitted", logs, (*usual, "angle_sag"))):
        fit = st.identify(runs, servo, free=FREE, nuisance=nuisance, priors=None, starts=2, holdout=0, compare_with=())
        error = math.degrees(fit.training.total()["PulseServo"])
        print(f"  {label:16} rms {error:5.2f} deg, noise {math.degrees(fit.noise['output_angle']):.2f} deg")
        for name, interval in fit.intervals().items():
            print(f"    {name:28} {fit.estimates[name]:10.4g}  {interval.lower:10.4g} to {interval.upper:10.4g}  "
                  f"{interval.method}", flush=True)
