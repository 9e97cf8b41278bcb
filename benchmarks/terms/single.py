"""Part 2: what each term costs one servo in plain Python."""

import sys
from pathlib import Path

import numpy as np
from servos import DURATION, PLAIN, SERVO, TERMS, Term, random_command, written

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

import servotwin as st

LOAD = st.loads.Inertia(2e-3) + st.loads.Constant(0.1)
SECONDS = 1.0  # of repetitions


def seconds(term: Term, command: st.signals.Signal) -> float:
    """Return the time of `simulate` [s]."""
    model = term.model()

    def run() -> st.Result:
        return st.simulate(model, command, duration=DURATION, load=LOAD, output_times=[DURATION])

    return best(run, min(50, max(2, round(SECONDS / best(run, 1)))))


def main() -> dict[str, float]:
    command = random_command(np.random.default_rng(1))
    times = {term.name: seconds(term, command) for term in (PLAIN, *TERMS)}
    cost = {name: taken / times[PLAIN.name] for name, taken in times.items()}
    print(f"one {SERVO.title}, {DURATION:g} s, st.simulate in plain Python")
    for name, taken in times.items():
        print(f"{name:20} {1e3 * taken:9.2f} ms {written(cost[name]):>8}x")
    return cost


if __name__ == "__main__":
    main()
