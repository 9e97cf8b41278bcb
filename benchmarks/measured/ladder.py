"""The friction laws M1 to M6 on the Dynamixel XL330's runs, with loops of 1 ms: errors by firmware gain, and times."""

import time
from pathlib import Path

import bam
from report import row

from servotwin.identification import RUNGS, friction_ladder

NUISANCE = ("delay", "angle_offset", "initial_state")  # loops of 1 ms are short: when they come tells nothing


class Begun:
    """Tells when each rung begins."""

    def __init__(self) -> None:
        self.began, self.rung = time.perf_counter(), ""

    def __call__(self, share: float, text: str) -> None:
        rung = text.partition(":")[0]
        if rung != self.rung:
            self.rung = rung
            print(f"  {rung} begins after {time.perf_counter() - self.began:.0f} s", flush=True)


def main(folder: Path, most: int | None = None, seconds: float | None = None) -> None:
    """Fit all laws to all runs but three, which are predicted, or to some runs alone, perhaps to their beginnings."""
    runs = bam.logs(folder, bam.TOLD)
    if seconds is not None:
        runs = [run.part(0.0, min(seconds, run.duration)) for run in runs]
    held_out = [runs[k].name for k in bam.HELD_OUT]
    if most is not None and most < len(runs):
        runs, held_out = [runs[k * len(runs) // most] for k in range(most)], []
    print(f"XL330, loops of 1 ms: {len(runs)} runs, {len(held_out)} of them held out; rms error by firmware gain "
          "[deg], over all samples (mean of the runs)")
    ladder = friction_ladder(runs, bam.published("m1", bam.TOLD), free=bam.FREE, rungs=tuple(RUNGS), priors=None,
                             starts=1, holdout=held_out or 0, intervals=False, sensors=["output_angle"],
                             nuisance=NUISANCE, progress=Begun())
    print(f"  chosen: {ladder.chosen}, {ladder.reason}")
    for rung in ladder.rungs:
        row(f"{rung.name}, fitted, {rung.fit.seconds:.0f} s", rung.fit.training.errors["PulseServo"], "gain")
        if held_out:
            row(f"{rung.name}, held out", rung.fit.holdout.errors["PulseServo"], "gain")
    names = {run.name for run in runs}
    for title, wanted in (("fitted", names - set(held_out)), ("held out", set(held_out))):
        some = [run for run in runs if run.name in wanted]
        for name in bam.PUBLISHED if some else ():
            row(f"BAM's {name.upper()}, {title}", bam.errors(bam.published(name, bam.TOLD), some), "gain")
