"""Part 3: one servo by `simulate` and by `Simulator`, compiled and in plain Python, and a lane of the same run.

    python benchmarks/terms/single.py                  # this checkout
    python benchmarks/terms/single.py --beside FOLDER  # and in turns with another one, such as the commit before

Each run lasts 2 s and has 2001 output times; three signals are read. Seconds are the processor's, the least of several.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from servos import DURATION, PLAIN, SERVO, TERMS, random_command, written

import servotwin as st

LOAD = st.loads.Inertia(2e-3) + st.loads.Constant(0.1)
TIMES = np.linspace(0.0, DURATION, 2001)
SIGNALS = ("output_angle", "armature_current", "load_torque")
REPEATED = 5
BUS = "feetech-sts3215-12v"
GOALS = st.signals.samples(np.arange(0.0, DURATION, 0.3), [0.0, 30.0, -20.0, 50.0, 10.0, -40.0, 20.0], unit="deg")


def seconds(run: Callable[[], object]) -> float:
    """Return the processor time of a run [s], the least of several."""
    found = []
    run()
    for _ in range(REPEATED):
        begun = time.process_time()
        run()
        found.append(time.process_time() - begun)
    return min(found)


def read(model: st.models.Model, command: st.signals.Signal, load: st.loads.Load) -> st.Result:
    """Simulate a servo, and read its signals."""
    result = st.simulate(model, command, duration=DURATION, load=load, output_times=TIMES)
    for name in SIGNALS:
        result[name]
    return result


def stepped(model: st.models.Model, command: st.signals.Signal, load: st.loads.Load) -> None:
    """Go on by 1 ms a thousand times."""
    sim = st.Simulator(model, load)
    state = sim.initial(command)
    for k in range(1, 1001):
        state = sim.advance(state, 1e-3 * k, command)


def costs() -> dict[str, dict[str, float]]:
    """Return what each servo takes [s]: a run, the same with its signals read, its energy, a lane, a call of 1 ms."""
    command = random_command(np.random.default_rng(1))
    cases: dict[str, tuple[st.models.Model, st.signals.Signal]] = {
        term.name: (term.model(), command) for term in (PLAIN, *TERMS)}
    cases[BUS] = (st.DigitalServo(st.load_servo(BUS)), GOALS)
    found = {}
    for name, (model, asked) in cases.items():
        load = LOAD if name != BUS else st.loads.Inertia(1e-3)
        found[name] = {
            "simulate": seconds(lambda m=model, c=asked, h=load: st.simulate(
                m, c, duration=DURATION, load=h, output_times=TIMES)),
            "read": seconds(lambda m=model, c=asked, h=load: read(m, c, h)),
            "energy": seconds(lambda m=model, c=asked, h=load: read(m, c, h).energy),
            "lane": seconds(lambda m=model, c=asked, h=load: st.simulate_many(
                m, c, duration=DURATION, load=h, output_times=TIMES, outputs=SIGNALS)),
            "1 ms": 1e-3 * seconds(lambda m=model, c=asked, h=load: stepped(m, c, h))}
    return found


def of(folder: Path, **more: str) -> dict[str, dict[str, float]]:
    """Return the costs of a checkout, in a process of its own."""
    own = {**os.environ, "PYTHONPATH": str(folder / "src"), **more}
    done = subprocess.run([sys.executable, __file__, "--json"], env=own, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def main(words: tuple[str, ...] = ()) -> dict[str, float]:
    """Print the tables; return the cost of each term in plain Python."""
    here = Path(__file__).resolve().parents[2]
    compiled = of(here)
    plain = of(here, SERVOTWIN_BACKEND="plain")
    print(f"one {SERVO.title}, {DURATION:g} s, {len(TIMES)} times, {', '.join(SIGNALS)}: ms of the processor")
    print(f"{'':20}{'simulate':>9}{'and read':>9}{'energy':>9}{'a lane':>9}{'plain':>9}{'and read':>9}{'1 ms, us':>9}")
    for name, cost in compiled.items():
        print(f"{name:20}" + "".join(f"{1e3 * cost[part]:9.2f}" for part in ("simulate", "read", "energy", "lane"))
              + "".join(f"{1e3 * plain[name][part]:9.1f}" for part in ("simulate", "read"))
              + f"{1e6 * cost['1 ms']:9.2f}")
    if words:
        before = of(Path(words[0]))
        again = of(here)
        print("times as fast as that of the other checkout")
        for name, cost in before.items():
            now = {part: min(compiled[name][part], again[name][part]) for part in cost}
            print(f"{name:20}" + "".join(f"{cost[part] / now[part]:9.1f}" for part in ("simulate", "read", "energy"))
                  + " " * 27 + f"{cost['1 ms'] / now['1 ms']:18.1f}")
    factors = {name: plain[name]["simulate"] / plain[PLAIN.name]["simulate"] for name in (PLAIN.name, *(
        term.name for term in TERMS))}
    print("a term costs in plain Python: " + ", ".join(f"{name} {written(factor)}" for name, factor in factors.items()))
    return factors


if __name__ == "__main__":
    if sys.argv[1:] == ["--json"]:
        print(json.dumps(costs()))
    else:
        main(tuple(sys.argv[2:3]) if sys.argv[1:2] == ["--beside"] else ())
