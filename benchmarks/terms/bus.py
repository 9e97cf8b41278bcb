"""Part 3: four servos on one bus, in plain Python and compiled, beside one servo alone in plain Python."""

import math
import sys
from pathlib import Path

import numpy as np
from servos import DURATION, PLAIN, SERVO, TERMS, Term, random_command, written

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

import servotwin as st
from servotwin.simulation import bus_run

SERVOS = 4
LOAD = st.loads.Inertia(2e-3) + st.loads.Constant(0.1)
SUPPLY = st.Supply(open_circuit_voltage=SERVO.supply.open_circuit_voltage,
                   internal_resistance=SERVO.supply.internal_resistance)  # of each servo alone, too


def row(term: Term, commands: list[st.signals.Signal]) -> str:
    """Measure one kind of servo."""
    model = term.model()
    servos = {f"servo {k}": (model, command, LOAD) for k, command in enumerate(commands)}

    def alone() -> None:
        for command in commands:
            st.simulate(model, command, duration=DURATION, load=LOAD, output_times=[DURATION]).raise_if_failed()

    def bus(output_step: float = DURATION) -> st.Fleet:
        return st.simulate_bus(servos, supply=SUPPLY, duration=DURATION, output_step=output_step).raise_if_failed()

    bus_run.LOADS_FROM = bus_run.COMPILES_FROM = math.inf
    one, plain, lowest = best(alone, 5) / SERVOS, best(bus, 2), bus(1e-3).bus_voltage.min()
    bus_run.COMPILES_FROM = 0
    bus()
    compiled = best(bus, 9)
    return (f"{term.name:20} {1e3 * one:10.2f} {1e3 * plain:10.2f} {written(plain / one):>7}x {1e3 * compiled:13.2f} "
            f"{lowest:11.2f}")


def main() -> None:
    rng = np.random.default_rng(1)
    commands = [random_command(rng) for _ in range(SERVOS)]
    print(f"{SERVOS} servos, {DURATION:g} s: one alone in plain Python (the mean of the {SERVOS}), and all on one bus")
    print(f"{'':20} {'alone [ms]':>10} {'plain [ms]':>10} {'ratio':>8} {'compiled [ms]':>13} {'lowest [V]':>11}")
    for term in (PLAIN, TERMS[0]):
        print(row(term, commands), flush=True)


if __name__ == "__main__":
    main()
