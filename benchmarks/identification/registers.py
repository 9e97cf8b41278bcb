"""Joints whose registers nobody recorded: are they found, and how far off is motion that the fit has not seen.

    python benchmarks/identification/registers.py [DRAWS [FIRST]] [--search]

One joint with a pendulum, of a simulator that shares no code with the package (`tests/reference/arm_rig.py`), recorded
by a loop of 30 Hz with latencies: an STS3215 with P, D, acceleration and speed registers drawn, its motor and friction
off the servo file's by what truths of that rig are. A fit by default arguments sees one episode of 30 s. A draw counts
as found where each register lies in the interval that the fit says, or where what is left is within 5 % of what the
true registers leave; what a fit leaves on an unseen episode stands beside. `--search` stops before the fit.
"""

import math
import sys
import time as clock
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import servotwin as st
from reference import arm_rig as rig
from reference.arm_rig_recorder import Episode, record
from reference.arm_rig_servo import drawn
from servotwin.identification.fitting.registers import register_search
from servotwin.loads import Pendulum

FILE = "feetech-sts3215-7v4"
MASS, LENGTH, ARM = 0.25, 0.10, 0.2  # kg, m to the centre of mass, m
JOINT = rig.Robot("pendulum", (
    rig.Link("beam", "joint", (0.0, 0.0, 0.4), rig._FLAT, (-2.5, 2.5), MASS, (LENGTH, 0.0, 0.0),
             rig._rod(MASS, ARM)),), {"feetech": (FILE,)}, {"feetech": 7.4})
NONE = 1e9  # counts/s2
ACCELERATIONS = (10, 20, 50, 100, 150, 254, None)


class Drawn(NamedTuple):
    """A joint, what stands in its registers, and two episodes of it as logs."""

    registers: dict[str, int | None]
    seen: st.Log
    unseen: st.Log


def log_of(episode: Episode, name: str) -> st.Log:
    """Return an episode as a log of the joint; the pendulum hangs at -90 degrees."""
    inertia = MASS * LENGTH**2 + MASS * (ARM**2 + 0.03**2) / 12.0
    load = Pendulum(mass=MASS, length=LENGTH, inertia=inertia, hanging_angle=-0.5 * math.pi).as_load()
    return st.Log(name=name, time=episode.time, command=episode.action[:, 0], command_kind="angle", load=load,
                  measured={"output_angle": episode.state[:, 0]})


def joint(seed: int) -> Drawn:
    """Return a joint whose registers and servo are drawn."""
    rng = np.random.default_rng([seed, 52])
    P, D = int(rng.choice((8, 12, 16, 20, 24, 32, 40, 48, 64))), int(rng.choice((0, 8, 16, 32, 48)))
    acceleration, speed = ACCELERATIONS[rng.integers(len(ACCELERATIONS))], int(rng.choice((20, 40, 68, 100)))
    servo = drawn(FILE, rng)._replace(
        P=P, D=D, acceleration=NONE if acceleration is None else 100.0 * acceleration, speed=50.0 * speed,
        phase=1e-3 * rng.random())
    truth = rig.Truth(JOINT, "feetech", np.ones(1), (servo,), 7.4 * rng.uniform(0.99, 1.01), rng.uniform(0.05, 0.3),
                      rng.uniform(1e-3, 5e-3), rng.uniform(6e-3, 14e-3), seed)
    seen, unseen = (log_of(record(truth, 30.0, "mixed", episode=k), f"episode {k}") for k in (0, 1))
    return Drawn({"P_Coefficient": P, "D_Coefficient": D, "Maximum_Acceleration": acceleration,
                  "Maximum_Velocity_Limit": speed}, seen, unseen)


def set_as(registers: dict[str, int | None]) -> st.Servo:
    """Return the servo of the file with registers."""
    given = {name: value for name, value in registers.items() if value is not None}
    acceleration = registers["Maximum_Acceleration"]
    servo = st.feetech_sts(given | ({} if acceleration is None else {"Acceleration": acceleration}), servo=FILE)
    return servo.replace({"firmware.acceleration_limit": None}) if acceleration is None else servo


def inside(fit: st.identification.Fit, true: st.Servo) -> tuple[int, int]:
    """Return how many of the registers' numbers lie in their intervals, of how many that were searched."""
    asked = [name for name in fit.names if name.startswith("firmware.") and true.get(name) is not None]
    spans = fit.intervals()
    return sum(spans[name].lower <= true.get(name) <= spans[name].upper for name in asked), len(asked)


def main(draws: int = 20, first: int = 1, *, search: bool = False) -> None:
    print("registers; CPU s of the search; error by the file, then as the search leaves it [deg] | fit: CPU s; error "
          "and error with true registers given, seen; likewise unseen; registers inside their intervals")
    found_in, far = 0, 0
    for seed in range(first, first + draws):
        it, servo = joint(seed), st.load_servo(FILE)
        begun = clock.process_time()
        found = register_search(st.DigitalServo(servo), [it.seen])
        spent = clock.process_time() - begun
        print(f"{seed:3d} P {it.registers['P_Coefficient']:2d} D {it.registers['D_Coefficient']:2d} acceleration "
              f"{it.registers['Maximum_Acceleration'] or 'none':>4} speed {it.registers['Maximum_Velocity_Limit']:3d}; "
              f"{spent:4.1f}; {math.degrees(found.given.error):6.3f}"
              + (f", {math.degrees(found.best[0].error):5.3f} ({found.best[0].said})" if found.best else ""), end="")
        if search:
            print(flush=True)
            continue
        begun = clock.process_time()
        fit = st.identify([it.seen], servo)
        spent = clock.process_time() - begun
        true = st.identify([it.seen], set_as(it.registers), intervals=False, diagnose=False, compare_with=())
        left, best = (math.degrees(one.traces[0].error.rms) for one in (fit, true))
        unseen, known = (math.degrees(st.validate([it.unseen], one.servo).total) for one in (fit, true))
        held, asked = inside(fit, set_as(it.registers))
        found_in += left <= 1.05 * best or held == asked
        far += unseen > 0.2
        print(f" | {spent:5.1f}; {left:5.3f}, {best:5.3f}; {unseen:5.3f}, {known:5.3f}; {held} of {asked}", flush=True)
    if not search:
        print(f"found {found_in} of {draws}; unseen above 0.2 deg: {far}")


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdecimal()]
    main(*numbers, search="--search" in sys.argv)
