"""Dynamixel XL330 on a pendulum (BAM's raw logs): errors by firmware gain, beside M1 and BAM's own parameters."""

import json
import tempfile
import time
from pathlib import Path

from bam_rule import ERROR_GAIN
from report import row

import servotwin as st
from servotwin.identification import BamConvention, LogError, friction_ladder, read_bam_log, read_bam_parameters

# github.com/Rhoban/bam, bam/params/xl330/{m1,m6}.json at 11bb7ecc (Apache-2.0)
PUBLISHED = {
    "m1": {"kt": 0.37005152119117146, "R": 3.498349797205021, "armature": 0.0019898151031250474,
           "q_offset": -0.0017672434168936602, "friction_base": 0.01821167858833861,
           "friction_viscous": 0.005902005392322235},
    "m6": {"kt": 0.28638649600668775, "R": 2.000017119760972, "armature": 0.002569774737524995,
           "q_offset": 0.01553585638800363, "friction_base": 0.0023258418670152347,
           "friction_stribeck": 0.0001856264715700908, "load_friction_motor": 0.23063000784446322,
           "load_friction_external": 0.26077932692372613, "load_friction_motor_stribeck": 1.9157733081388423e-06,
           "load_friction_external_stribeck": 0.15158776983752117, "load_friction_motor_quad": 0.005595958708218643,
           "load_friction_external_quad": 0.0037747149629857673, "dtheta_stribeck": 0.11532863880939243,
           "alpha": 1.000022697315946, "friction_viscous": 0.0185448141303962},
}
FREE = ["motor.armature_resistance", "output_torque_constant", "output_inertia"]
HELD_OUT = (0, 6, 11)  # one run of each gain, each of another trajectory
RUNGS = ("M1", "M3")
# a quarter of the frames, for time; errors of all are told at 1 ms
FITTED = BamConvention(error_gain=ERROR_GAIN, frame_period=4e-3)
TOLD = BamConvention(error_gain=ERROR_GAIN)


def logs(folder: Path, convention: BamConvention) -> list[st.Log]:
    """Return all runs; where torque is off they end, for BAM's motor is then disconnected."""
    found = []
    for path in sorted((folder / "bam_xl330" / "raw").glob("*.json")):
        found += read_bam_log(path, convention=convention).without_torque_off()
    return found


def published(name: str, convention: BamConvention) -> st.Servo:
    """Return BAM's own parameters."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.json"
        path.write_text(json.dumps({**PUBLISHED[name], "model": name, "actuator": "xl330"}))
        return read_bam_parameters(path, gain=100, voltage=7.4, convention=convention)


def errors(servo: st.Servo, runs: list[st.Log]) -> tuple[LogError, ...]:
    """Return the errors of a servo on runs, without fitting anything to them."""
    table = st.validate(runs, servo, nuisance=()).errors
    return table.errors[table.models[0]]


def main(folder: Path) -> None:
    fitted, told = logs(folder, FITTED), logs(folder, TOLD)
    names = [fitted[k].name for k in HELD_OUT]
    began = time.perf_counter()
    print(f"XL330: {len(told)} runs, {len(names)} of them held out; rms error by firmware gain [deg], over all samples "
          "(mean of the runs)")
    ladder = friction_ladder(fitted, published("m1", FITTED), free=FREE, rungs=RUNGS, priors=None, starts=1,
                             holdout=names, intervals=False, sensors=["output_angle"])
    print(f"  chosen: {ladder.chosen}, {ladder.reason}; {time.perf_counter() - began:.0f} s")
    for title, wanted in (("held out", set(names)), ("fitted", {log.name for log in told} - set(names))):
        print(f"  -- {title}")
        for rung in ladder.rungs:
            own = rung.fit.holdout if title == "held out" else rung.fit.training
            row(f"fitted {rung.name}", own.errors["PulseServo"], "gain")
        some = [log for log in told if log.name in wanted]
        for name in PUBLISHED:
            row(f"BAM's {name.upper()}", errors(published(name, TOLD), some), "gain")
