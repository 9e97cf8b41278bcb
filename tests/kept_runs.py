"""What runs of 300 generated servos, of all servos of the catalog and of buses come to, kept and compared.

    python tests/kept_runs.py keep FILE          # at one commit
    python tests/kept_runs.py compare FILE       # at another: what differs, and by how much

A change of the engine's structure is held against the commit before by it; `test_kept_runs.py` runs some of the cases
two ways. Of each run it keeps signals, events, energy, metrics, remarks, status and the number of motions; the end of
the same run by `Simulator` in pieces; the same in a lane of `simulate_many`, and by `VectorSimulator` in ticks.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from dataclasses import astuple
from functools import cache
from typing import Any

import numpy as np

import servotwin as st
from leg_extremes import extreme
from models.frozen_servos import BATCHED, Case, bus_of, case_of, plan
from servotwin.errors import ServotwinError
from servotwin.models import DigitalServo, PulseServo, PulseServoInductive, default_model

DRAW, GENERATED, DIGITAL, BUSES = 901, 240, 60, 16
TIMES, PIECES = 60, (0.13, 0.31, 0.55, 0.83)
Kept = dict[str, np.ndarray]


@cache
def every() -> dict[str, Case]:
    """Return all runs by name."""
    return dict(cases())


def cases() -> Iterator[tuple[str, Case]]:
    """Yield every run with its name."""
    for number in np.linspace(0, len(plan()) - 1, GENERATED).astype(int).tolist():
        yield f"generated {number} ({plan()[number][0]}: {', '.join(plan()[number][1])})", case_of(number, DRAW)
    for seed in range(3000, 3000 + DIGITAL):
        one = extreme(seed)
        yield f"digital {seed}", Case(one.model, one.command, one.load, one.duration, {"output_angle": 0.0}, seed)
    for name in st.catalog_names():
        servo = st.load_servo(name)
        for kind in (default_model, PulseServo, PulseServoInductive, DigitalServo):
            try:
                model = kind(servo)
                command = st.signals.samples([0.0, 0.05, 0.25], [0.0, 35.0, 10.0], unit="deg")
                model.command(command)
            except ServotwinError:
                continue
            if kind is default_model or type(model) is not type(default_model(servo)):
                yield (f"{name} as {type(model).__name__}",
                       Case(model, command, st.loads.Inertia(1e-3) + st.loads.Constant(0.02), 0.4, {}, 1))


def kept(one: Case) -> Kept:
    """Return what is kept of a run, by name."""
    times = np.linspace(0.0, one.duration, TIMES)
    result = st.simulate(one.model, one.command, duration=one.duration, load=one.load, initial=one.initial,
                         seed=one.seed, output_times=times)
    found: Kept = {f"signal {name}": result[name] for name in result.names}
    kinds = sorted({event.kind for event in result.events})
    found["exact events"] = np.array([sum(map(ord, event.kind)) for event in result.events], float)
    found["events"] = np.array([(event.time, event.value) for event in result.events]).reshape(-1, 2)
    found["exact kinds"] = np.array([sum(map(ord, kind)) for kind in kinds], float)
    found["exact status"] = np.array([result.status.code, result.stats.motions, result.stats.events, result.stats.held])
    found["ended"] = np.array([result.ended])
    if result.status.ok:
        found["energy"] = np.array(astuple(result.energy))
        found["exact remarks"] = np.array([sum(map(ord, remark.kind)) for remark in result.remarks], float)
        found["metrics"] = np.array([result.peak(result.names[2]), result.mean(result.names[1]), result.mean_current,
                                     result.holding_error])
        sag = result.sag
        found["sag"] = np.array([sag.voltage, sag.time] if sag is not None else [])
    found["in pieces"] = pieces(one)
    if isinstance(one.model, BATCHED):
        batch = st.simulate_many(one.model, one.command, duration=one.duration, load=one.load, initial=one.initial,
                                 seeds=one.seed, output_times=times, outputs=("output_angle", "output_speed"))
        found["lane"] = np.concatenate([batch["output_angle"][0], batch["output_speed"][0]])
        found["exact lane"] = np.array([int(batch.status[0]), len(batch.remarks)])
    return found


def pieces(one: Case) -> np.ndarray:
    """Return where a run by `Simulator` in pieces stands after each."""
    sim = st.Simulator(one.model, one.load, one.seed)
    command = sim.framed(one.command, one.duration)
    found, state = [], sim.initial(command, one.initial)
    for share in (*PIECES, 1.0):
        try:
            state = sim.advance(state, share * one.duration, command)
        except st.SimulationError as error:
            return np.array([*found, error.time])
        found += [*state.values, sim.observe(state, one.model.available[-1], command)]
    return np.array(found)


def on_bus(number: int) -> Kept:
    """Return what is kept of a bus."""
    bus = bus_of(number, DRAW)
    names = [f"servo {k}" for k in range(len(bus.servos))]
    fleet = st.simulate_bus(
        {name: (one.model, one.command, one.load) for name, one in zip(names, bus.servos, strict=True)},
        supply=bus.supply, duration=bus.duration, output_times=np.linspace(0.0, bus.duration, TIMES), seed=bus.seed,
        initial={name: one.initial for name, one in zip(names, bus.servos, strict=True)})
    found: Kept = {"signal bus": fleet.bus_voltage, "exact status": np.array([fleet.status.code])}
    for name in names:
        own = fleet[name]
        found |= {f"signal {name} {signal}": own[signal] for signal in own.names}
        found[f"exact {name} events"] = np.array([sum(map(ord, event.kind)) for event in own.events], float)
        found[f"{name} events"] = np.array([(event.time, event.value) for event in own.events]).reshape(-1, 2)
        found[f"exact {name} motions"] = np.array([own.stats.motions])
        found[f"{name} energy"] = np.array(astuple(own.energy))
    return found


def everything() -> Iterator[tuple[str, Kept]]:
    """Yield what is kept of every case."""
    for name, one in cases():
        yield name, kept(one)
    for number in range(BUSES):
        yield f"bus {number}", on_bus(number)


def moved(before: np.ndarray, after: np.ndarray) -> float:
    """Return how far numbers moved, relative to the largest but at least to 1; inf where there are others."""
    if before.shape != after.shape or not (np.isfinite(before) == np.isfinite(after)).all():
        return np.inf
    size = max(1.0, float(np.max(np.abs(before), initial=0.0, where=np.isfinite(before))))
    with np.errstate(invalid="ignore"):
        return float(np.max(np.abs(after - before), initial=0.0, where=np.isfinite(before))) / size


def compare(path: str) -> None:
    """Print what differs from what was kept."""
    worst: dict[str, tuple[float, str]] = {}
    count = same = 0
    with np.load(path) as file:
        for name, found in everything():
            exact = True
            for what, after in found.items():
                before = file[f"{name}|{what}"]
                far = moved(before, np.asarray(after))
                exact = exact and far == 0.0
                if far > worst.get(what, (0.0, ""))[0]:
                    worst[what] = (far, name)
                if far > (0.0 if what.startswith("exact") else 1e-9):
                    print(f"{name}: {what} moved by {far:.1e}", flush=True)
            count, same = count + 1, same + exact
    print(f"{count} runs, {same} to the bit; the furthest of each:")
    for what, (far, name) in sorted(worst.items(), key=lambda one: -one[1][0]):
        print(f"{far:9.1e}  {what}: {name}")


def main(words: list[Any]) -> None:
    """Keep or compare."""
    if len(words) != 2 or words[0] not in ("keep", "compare"):
        sys.exit(f"usage: {sys.argv[0]} keep|compare FILE.npz")
    warnings.simplefilter("ignore", UserWarning)
    if words[0] == "compare":
        compare(words[1])
        return
    np.savez_compressed(words[1], **{f"{name}|{what}": value for name, found in everything()
                                     for what, value in found.items()})


if __name__ == "__main__":
    main(sys.argv[1:])
