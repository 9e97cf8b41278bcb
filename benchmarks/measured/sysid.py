"""Beside `mujoco.sysid`: the same logs, the same folds, errors on what was held out, seconds of CPU.

    python benchmarks/measured/sysid.py [sts3250] [xl330] [miuzei] [maccepa]

`mujoco.sysid` (MuJoCo 4 with its extra `sysid`) fits five numbers of a hinge with a position actuator, which is what
people fit of a hobby servo: gain, damping, friction loss, armature and the limit of the torque, 20 ms of delay before
the command and 12 steps, from kp 20. Where logs say the servo's gain, its kp goes with it. `identify` runs by default
arguments but for intervals, causes and simpler models, which the other one has not. Needs the measured logs beside the
repository. Of the MACCEPA joint the first 90 ms after a step, in which the reading jumps with the supply, are left out
of both. Two recordings have no row: the motor of an MG90 at constant duty has no position loop, and Robonine's levers
are pulled by forces that were not measured.
"""

import contextlib
import io
import math
import sys
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import maccepa
import mujoco
import numpy as np
from report import folds

import servotwin as st
from servotwin.identification import read_bam_log, read_logs
from servotwin.loads import Load
from servotwin.models import default_model
from servotwin.parameters import Servo

DATA = next((one for up in Path(__file__).resolve().parents if (one := up / "shared" / "data").is_dir()), None)
DELAY, STEPS, TICK = 0.02, 12, 0.002
NUMBERS = {"kp": (20.0, 0.5, 500.0), "damping": (0.3, 0.0, 10.0), "frictionloss": (0.1, 0.0, 3.0),
           "armature": (0.02, 1e-4, 0.5), "force": (3.0, 0.1, 20.0)}


def spec_of(load: Load) -> mujoco.MjSpec:
    """Return a hinge with a position actuator and what hangs on it, angle 0 where the servo's is."""
    pendulums = "".join(
        f'<geom type="sphere" size="1e-3" mass="{p.mass:.9g}" contype="0" conaffinity="0" '
        f'pos="{-p.length * math.sin(p.hanging_angle):.9g} 0 {-p.length * math.cos(p.hanging_angle):.9g}"/>'
        for p in load.pendulums)
    return mujoco.MjSpec.from_string(f"""
      <mujoco><compiler angle="degree"/><option timestep="{TICK}" integrator="implicitfast"/><worldbody><body>
        <joint name="q" axis="0 -1 0"/>
        <geom type="sphere" size="1e-3" mass="1e-6"/>{pendulums}
      </body></worldbody><actuator><position name="servo" joint="q" kp="20" forcerange="-3 3"/></actuator>
      <sensor><jointpos name="angle" joint="q"/></sensor></mujoco>""")


def late(log: st.Log, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the command as it acts, on the grid of the steps, from the first sample on."""
    time = np.arange(0.0, log.duration + TICK, TICK)
    row = np.clip(np.searchsorted(log.time - log.start, time - DELAY, side="right") - 1, 0, None)
    return time, command[row]


def measured_of(log: st.Log) -> tuple[st.Log, np.ndarray]:
    """Return a log from where its angle was measured first on, and which of its rows have one."""
    first = int(np.argmax(np.isfinite(log.measured["output_angle"])))
    log = log.part(float(log.time[first]), math.inf)
    return log, np.isfinite(log.measured["output_angle"])


def angle_of(log: st.Log, servo: Servo) -> np.ndarray:
    """Return what a log asks for as angles [rad], by the calibration in the servo file."""
    if log.command_kind == "angle":
        return log.held
    model = default_model(servo)
    drive = model.command(st.signals.samples(log.time - log.start, log.held, unit="s"))
    return np.asarray(model.start_angle(drive(log.time - log.start)))


def fit(logs: Sequence[st.Log], servo: Servo) -> Callable[[st.Log], float]:
    """Return what tells how far a log is off the hinge that `mujoco.sysid` fits to some logs [rad]."""
    from mujoco import sysid

    reference = float(np.median([log.conditions.get("gain", 1.0) for log in logs]))

    known: dict[int, tuple[float, float]] = {}  # times kp, and inertia beside point masses, by specification

    def hinge(log: st.Log) -> mujoco.MjSpec:
        spec, load = spec_of(log.load), log.load
        known[id(spec)] = float(log.conditions.get("gain", reference)) / reference, load.inertia + sum(
            p.inertia - p.mass * p.length**2 for p in load.pendulums if p.inertia is not None)
        return spec

    def model_of(numbers: object, spec: mujoco.MjSpec) -> mujoco.MjModel:
        value = {name: float(numbers[name].value[0]) for name in NUMBERS}
        factor, inertia = known[id(spec)]
        sysid.apply_pgain(spec, "servo", factor * value["kp"])
        spec.actuator("servo").forcerange = np.array([-value["force"], value["force"]])
        spec.joint("q").damping = np.array([value["damping"], 0.0, 0.0])
        spec.joint("q").frictionloss, spec.joint("q").armature = value["frictionloss"], value["armature"] + inertia
        return spec.compile()

    def sequences(log: st.Log) -> object:
        log, seen = measured_of(log)
        spec = hinge(log)
        model = spec.compile()
        data, measured = mujoco.MjData(model), log.measured["output_angle"]
        data.qpos[:] = measured[0]
        time, command = late(log, angle_of(log, servo))
        return sysid.ModelSequences(
            log.name, spec, log.name, sysid.create_initial_state(model, data.qpos, data.qvel, data.act),
            sysid.TimeSeries(time, command[:, None]),
            sysid.TimeSeries.from_names(log.time[seen] - log.start, measured[seen, None], model))

    numbers = sysid.ParameterDict()
    for name, (start, low, high) in NUMBERS.items():
        numbers.add(sysid.Parameter(name, start, low, high))
    residual = sysid.build_residual_fn(models_sequences=[sequences(log) for log in logs], build_model=model_of)
    with contextlib.redirect_stdout(io.StringIO()):
        found, _ = sysid.optimize(numbers, residual, optimizer="mujoco", verbose=False, max_iters=STEPS)

    def error(log: st.Log) -> float:
        log, _ = measured_of(log)
        model, measured = model_of(found, hinge(log)), log.measured["output_angle"]
        data = mujoco.MjData(model)
        data.qpos[:] = measured[0]
        time, command = late(log, angle_of(log, servo))
        course = [measured[0]]
        for goal in command[:-1].tolist():
            data.ctrl[:] = goal
            mujoco.mj_step(model, data)
            course.append(float(data.qpos[0]))
        return float(np.sqrt(np.nanmean((np.interp(log.time - log.start, time, course) - measured)**2)))
    return error


def beside(label: str, logs: Sequence[st.Log], servo: Servo, held_out: Sequence[Sequence[str]], **more: object) -> None:
    """Print the errors of both on what each fold holds out [deg], and the seconds of CPU of the fits."""
    totals, spent, counts = np.zeros(2), np.zeros(2), 0
    for names in held_out:
        train = [log for log in logs if log.name not in names]
        began = clock.process_time()
        hinge = fit(train, servo)
        spent[0] += clock.process_time() - began
        began = clock.process_time()
        ours = st.identify(list(logs), servo, holdout=list(names), intervals=False, diagnose=False, compare_with=(),
                           **more)
        spent[1] += clock.process_time() - began
        cells = []
        for trace in ours.traces:
            if trace.held_out:
                errors = np.array([hinge(next(log for log in logs if log.name == trace.log.name)), trace.error.rms])
                totals += errors**2 * len(trace.time)
                counts += len(trace.time)
                cells.append(f"{trace.log.motion or trace.log.name} {math.degrees(errors[0]):.2f} "
                             f"{math.degrees(errors[1]):.2f}")
        print(f"    {label}, held out: {'; '.join(cells)}", flush=True)
    sysid_error, own = np.degrees(np.sqrt(totals / counts))
    print(f"  {label:10} mujoco.sysid {sysid_error:5.2f} deg, {spent[0] / len(held_out):5.1f} s a fit; servotwin "
          f"{own:5.2f} deg, {spent[1] / len(held_out):5.1f} s", flush=True)


def of_bam(folder: Path) -> list[st.Log]:
    """Return the logs of BAM in a folder as far as torque is on."""
    return [part for path in sorted(folder.glob("*.json")) for part in read_bam_log(path).without_torque_off()]


def without_jump(log: st.Log) -> st.Log:
    """Return a log of the MACCEPA joint without the readings while its motor starts."""
    at, angle = maccepa.step_of(log), log.measured["output_angle"].copy()
    angle[(log.time >= at) & (log.time < at + maccepa.DISTURBED)] = math.nan
    return replace(log, measured={"output_angle": angle})


def main(rows: Sequence[str]) -> None:
    if DATA is None:
        raise SystemExit("the measured logs are not beside the repository")
    print("held-out error of mujoco.sysid and of servotwin [deg]")
    if "sts3250" in rows:
        logs = of_bam(DATA / "bam_sts3250")
        beside("STS3250", logs, st.load_servo("feetech-sts3250"), [[log.name] for log in logs])
    if "xl330" in rows:
        logs = of_bam(DATA / "bam_xl330" / "raw")
        servo = st.load_servo("dynamixel-xl330-m288")
        beside("XL330", logs, servo, [[log.name for log in logs if log.conditions["gain"] == gain]
                                      for gain in (100.0, 200.0, 800.0)])
    if "miuzei" in rows:
        logs = [log for log in read_logs(DATA / "miuzei_25kg") if log.motion != "drop"]
        beside("Miuzei", logs, st.load_servo("miuzei-25kg"), folds(logs, 4))
    if "maccepa" in rows:
        logs = [without_jump(maccepa.read(path)) for path in sorted((DATA / "maccepa_hitec").glob("servo1_*.csv"))]
        servo = st.load_servo("hitec-hs-311").replace({"stops.lower_angle": None, "stops.upper_angle": None})
        beside("MACCEPA", logs, servo, [[log.name] for log in logs])


if __name__ == "__main__":
    main(sys.argv[1:] or ["sts3250", "xl330", "miuzei", "maccepa"])
