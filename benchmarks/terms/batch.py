"""Part 1: what each term costs in a batch; every row simulates the same servos, commands and loads."""

import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from servos import DURATION, PLAIN, TERMS, Population, Term, random_population, written

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

import servotwin as st

LANES = 256  # different ones
SECONDS = 0.3  # a call lasts about this at least: lanes that are quickly done come several times over
MOST_COPIES = 256
CHUNKS = 8  # of every call, so that each row uses all cores
LOAD = st.loads.Inertia(0.0) + st.loads.Constant(0.0)  # the parts that the lanes' numbers belong to


class Row(NamedTuple):
    """One line of the table."""

    name: str
    lanes: int
    seconds: float  # of a call [s]
    end: np.ndarray  # angles of the first LANES [rad]

    @property
    def per_lane(self) -> float:
        """Time of one lane [s]."""
        return self.seconds / self.lanes


def call(term: Term, lanes: Population) -> np.ndarray:
    """Return the angles at the end [rad]."""
    batch = st.simulate_many(term.model(), lanes.commands, duration=DURATION, load=LOAD, parameters=lanes.parameters,
                             output_times=[DURATION], chunk=len(lanes) // CHUNKS)
    batch.raise_if_failed()
    return batch["output_angle"][:, 0]


def seconds(term: Term, lanes: Population) -> float:
    """Return the time of a call, compiled before [s]."""
    return best(lambda: call(term, lanes), 3)


def measured(term: Term, lanes: Population) -> Row:
    """Measure the lanes as often over as makes a call last."""
    end = call(term, lanes)
    copies, taken = 1, seconds(term, lanes)
    while taken < SECONDS and copies < MOST_COPIES:
        copies = min(MOST_COPIES, math.ceil(1.3 * copies * SECONDS / taken))
        taken = seconds(term, lanes.times(copies))
    return Row(term.name, copies * len(lanes), taken, end)


def rows() -> list[Row]:
    """Measure all, the plain servo first."""
    lanes = random_population(LANES)
    return [measured(term, lanes) for term in (PLAIN, *TERMS)]


def factors(table: list[Row]) -> dict[str, float]:
    """Return how many times as long a lane takes as the plain one."""
    return {row.name: row.per_lane / table[0].per_lane for row in table}


def show(table: list[Row]) -> None:
    cost = factors(table)
    print(f"{LANES} random HS-755HB, {DURATION:g} s, float64, whole calls of simulate_many, only the last angle kept")
    print(f"{'':20} {'lanes':>7} {'call [s]':>9} {'lane [us]':>10} {'servo-s/s':>10} {'cost':>8} {'change [rad]':>13}")
    for row in table:
        change = np.sqrt(np.mean((row.end - table[0].end) ** 2))
        print(f"{row.name:20} {row.lanes:7d} {row.seconds:9.3f} {1e6 * row.per_lane:10.2f} "
              f"{DURATION / row.per_lane:10.2e} {written(cost[row.name]):>7}x {change:13.1e}")
    print("cost: time of a lane over that of a plain one. change: of the last angle by the term, rms over the lanes.")


def main() -> dict[str, float]:
    table = rows()
    show(table)
    return factors(table)


if __name__ == "__main__":
    main()
