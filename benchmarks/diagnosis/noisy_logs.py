"""Noisy logs of healthy servos and of servos with one planted fault, drawn from a seed: what `diagnose` says of them.

    python benchmarks/diagnosis/noisy_logs.py SEED ...

Each seed makes 20 logs of healthy servos and 10 of ill ones, all drawn by the rule below, which knows nothing of how a
log is judged. Servos, loads and faults are those of `planted.py`, a third each of pulse, digital and bus servos. The
doctor is given the healthy servo's file, its load, and the log:

- moves, in turn: stands still after one step; steps of 10 to 90 deg every 0.6 to 4 s; ramps of 20 to 150 deg/s with
  rests of 1 to 4 s; two to five periods of a sine of 5 to 30 deg and 0.1 to 0.6 Hz, rests of 1 to 4 s and a step. A
  controller sends them every 10 ms. The record lasts 10 to 60 s; every second log begins and every second one ends
  within 0.8 s after the target was changed, in the middle of a move; the command is
  what was sent last when a sample is taken.
- recorders, drawn: the 12 bit encoder of a bus servo with 0 to 1 count of noise; a 10 bit converter over 300 deg with
  0.3 to 1.5 counts; a magnetic encoder of 12 bit with 0.015 to 0.043 deg (the AS5600's sheet); a camera with 0.1 to
  0.5 deg and no counts. Noise is Gaussian and white, 20 to 1000 samples a second, their times off by up to a tenth of
  the period; the rest is assumed. Every second log has a current with 5 to 50 mA of noise.
- truth: what the noiseless motion shows, by the measures of `shown_by`. Of a healthy log no symptom is above 0.8 of its
  threshold in all that the controller sends, recorded or not; of an ill one the wanted symptom is at 1.1 times it or
  more within the log, and without the fault it is healthy. Faults: a swing, a sag, an overshoot, a shaft that does not
  move.

A healthy log is right where nothing is found, an ill one where its symptom is found in the log.
"""

from __future__ import annotations

import math
import random
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from planted import CAUSES, HEALTHY, SHOWS, Case, base, healthy, planted, quietly, swinging, warmth

import servotwin as st
from servotwin.logs import Log
from servotwin.models import DigitalServo, default_model, mid_travel
from servotwin.simulation.metrics import resolution

TICK, LOOK = 0.01, 0.5e-3  # s: of the controller; between two looks at the truth, shorter than a bridge's pulses
HALF_SECOND = 0.5  # s: what stands still for less is no rest
MOVES = ("still", "steps", "ramps", "sines")
RECORDERS = ("bus", "converter", "magnetic", "camera")
FAULTS = ("buzzes", "sags", "overshoots", "does not move", "buzzes", "sags", "overshoots", "does not move", "buzzes",
          "sags")
HEALTHY_LOGS = 20
KINDS = ("pulse", "digital", "bus")
TRIES = 400  # of servos and moves, until the next cause is taken
LEAST_SWING = math.radians(0.1)


class Moves(NamedTuple):
    """What a controller sends: target [rad] from each tick on, and where the log begins and ends [s]."""

    kind: str
    target: np.ndarray
    begin: float
    end: float

    def at(self, clock: np.ndarray) -> np.ndarray:
        """Return the target that was sent last at some times."""
        return self.target[np.minimum((clock / TICK + 1e-6).astype(int), len(self.target) - 1)]


class Recorder(NamedTuple):
    """What notes the angle: samples per second, count and noise [rad], noise of the current [A] or none."""

    kind: str
    rate: float
    count: float
    noise: float
    current: float | None


class Drawn(NamedTuple):
    """A log, the healthy servo's file with its load, and what the log ought to show."""

    servo: Any
    load: Any
    log: Log
    wanted: str
    words: str


def log_uniform(rng: random.Random, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def moves(rng: random.Random, kind: str, middle: float, number: int) -> Moves:
    """Return moves of a kind around the middle of the travel."""
    lasts = log_uniform(rng, 10.0, 60.0)
    sent = [0.0] * 50  # deg from the middle, half a second of it

    def hold(seconds: float) -> None:
        sent.extend(sent[-1:] * round(seconds / TICK))

    def jump() -> None:
        to = sent[-1]
        while abs(to - sent[-1]) < 10.0:
            to = rng.uniform(-45.0, 45.0)
        sent.append(to)

    while len(sent) * TICK < lasts + 5.0:
        if kind == "still":
            sent.append(rng.choice((-1.0, 1.0)) * rng.uniform(5.0, 45.0))
            hold(lasts + 5.0)
        elif kind == "steps":
            jump()
            hold(rng.uniform(0.6, 4.0))
        elif kind == "ramps":
            to = rng.uniform(-45.0, 45.0)
            ticks = max(1, round(abs(to - sent[-1]) / rng.uniform(20.0, 150.0) / TICK))
            sent.extend(np.linspace(sent[-1], to, ticks + 1)[1:].tolist())
            hold(rng.uniform(1.0, 4.0))
        else:
            amplitude, period = rng.uniform(5.0, 30.0), round(1.0 / rng.uniform(0.1, 0.6) / TICK)
            turned = np.arange(1, rng.randint(2, 5) * period + 1) / period
            sent.extend((sent[-1] + amplitude * np.sin(2.0 * math.pi * turned)).tolist())
            hold(rng.uniform(1.0, 4.0))
            jump()
            hold(rng.uniform(1.0, 4.0))
    target = middle + np.radians(sent)
    changes = TICK * (np.flatnonzero(np.diff(target)) + 1)
    after, before = rng.uniform(0.0, 0.8), rng.uniform(0.0, 0.8)
    early, late = changes[changes < 5.0], changes[(changes >= 0.75 * lasts) & (changes < lasts)]
    begin = float(rng.choice(early.tolist())) + after if number % 2 and len(early) else 0.0
    end = float(rng.choice(late.tolist())) + before if number // 2 % 2 and len(late) else lasts
    return Moves(kind, target, begin, end)


def recorder(rng: random.Random, number: int) -> Recorder:
    kind = rng.choice(RECORDERS)
    count = {"bus": 360.0 / 4096, "converter": 300.0 / 1024, "magnetic": 360.0 / 4096, "camera": 0.0}[kind]
    noise = {"bus": count * rng.uniform(0.0, 1.0), "converter": count * rng.uniform(0.3, 1.5),
             "magnetic": rng.uniform(0.015, 0.043), "camera": rng.uniform(0.1, 0.5)}[kind]
    current = rng.uniform(5e-3, 50e-3) if number % 2 else None
    return Recorder(kind, log_uniform(rng, 20.0, 1000.0), math.radians(count), math.radians(noise), current)


def motion(case: Case, made: Moves, clock: np.ndarray) -> dict[str, np.ndarray]:
    """Return the noiseless angle [rad], current [A] and drive of a servo under its load at some times."""
    ticks = TICK * np.arange(len(made.target))
    command = st.signals.samples(ticks, made.target, unit="rad", hold="previous")
    model = default_model(case.servo)
    names = ("output_angle", "armature_current", "duty" if isinstance(model, DigitalServo) else "drive")
    batch = st.simulate_many(model, [command], duration=float(clock[-1]), load=case.load, output_times=clock, seeds=0,
                             outputs=names).raise_if_failed()
    return dict(zip(("output_angle", "armature_current", "driven"), (batch[name][0] for name in names), strict=True))


def shown_by(case: Case, finest: float, made: Moves, whole: bool) -> dict[str, float]:
    """Return how strong each symptom is, 1 at its threshold, in the noiseless motion within the log or in all."""
    begin, end = (0.0, TICK * len(made.target)) if whole else (made.begin, made.end)
    clock = np.arange(0.0, end, LOOK)
    run = motion(case, made, clock)
    target, angle = made.at(clock), run["output_angle"]
    strong = dict.fromkeys(("buzzes", "sags", "overshoots", "may overshoot", "does not move"), 0.0)
    bounds = [0, *(np.flatnonzero(np.diff(target)) + 1).tolist(), len(clock)]
    stood = None  # angle of the rest right before
    for a, b in pairwise(bounds):
        lasts = (b - a) * LOOK + 0.5 * LOOK
        if lasts < HALF_SECOND:
            stood = None
            continue
        last = angle[b - round(HALF_SECOND / LOOK):b]
        rests, final = np.ptp(last) < LEAST_SWING, float(last.mean())
        if clock[b - 1] >= begin + HALF_SECOND:
            late = angle[max(a, b - round(1.0 / LOOK)):b]
            if not rests and len(late) * LOOK >= 0.9:
                strong["buzzes"] = max(strong["buzzes"], swing(late))
            if rests:
                farthest = float(np.abs(angle[max(0, a - round(3.0 / LOOK)):b] - target[a]).max())
                strong["sags"] = max(strong["sags"], abs(final - target[a]) / max(
                    math.radians(1.0), 0.05 * farthest, 2.0 * finest))
        ends = min(b, round(made.end / LOOK))  # of the log, where a run's bridge is looked at
        window = slice(ends - len(last), ends)
        if clock[a] + HALF_SECOND <= made.end <= clock[b - 1] + TICK and np.ptp(angle[window]) < LEAST_SWING:
            strong["buzzes"] = max(strong["buzzes"], 1.0 * switches_on(run["driven"][window]))
        if stood is not None and clock[a] >= begin + HALF_SECOND - LOOK:
            gone, way = target[a] - stood, target[a] - target[a - 1]
            sense = math.copysign(1.0, gone)
            if abs(gone) >= math.radians(3.0):
                past = (sense * angle[a:b]).max() - (sense * final if rests else min(sense * final, sense * target[a]))
                name = "overshoots" if rests else "may overshoot"
                strong[name] = max(strong[name], float(past) / (0.1 * abs(gone)))
            if rests and abs(way) >= math.radians(1.0):
                strong["does not move"] = max(strong["does not move"], (1.0 - (final - stood) / way) / 0.5)
        stood = final if rests else None
    squared = float(np.mean(run["armature_current"][clock >= 0.5 * (begin + end)]**2))
    strong["gets warm"] = warmth(default_model(case.servo), squared * case.servo.motor.armature_resistance)
    return strong


def switches_on(driven: np.ndarray) -> bool:
    """Tell whether a bridge begins to drive or reverses: no log shows that, but the run beside it does."""
    return bool(((driven[1:] != 0.0) & (driven[1:] * driven[:-1] <= 0.0)).any())


def swing(angle: np.ndarray) -> float:
    """Return how far a shaft that goes on to and fro does so, 1 at a tenth of a degree."""
    wide = float(np.ptp(angle)) / LEAST_SWING
    return wide if swinging(angle, 0.8 * LEAST_SWING) else 0.0


def recorded(rng: random.Random, case: Case, made: Moves, by: Recorder, name: str) -> Log:
    """Return what a recorder notes of a servo."""
    period = 1.0 / by.rate
    clock = made.begin + period * np.arange(int((made.end - made.begin) * by.rate))
    noise = np.random.default_rng(rng.getrandbits(32))
    clock = np.sort(np.maximum(clock + 0.1 * period * noise.uniform(-1.0, 1.0, len(clock)), made.begin))
    clock = clock[np.append(True, np.diff(clock) > 0.0)]
    run = motion(case, made, clock)
    angle = run["output_angle"] + by.noise * noise.normal(size=len(clock))
    if by.count:
        angle = by.count * np.round(angle / by.count)
    measured = {"output_angle": angle}
    if by.current is not None:
        measured["armature_current"] = run["armature_current"] + by.current * noise.normal(size=len(clock))
    return Log(name=name, time=clock, command=made.at(clock), command_kind="angle", measured=measured, load=case.load)


def of_kind(rng: random.Random, kind: str) -> tuple[Case, float]:
    """Return a healthy servo of a kind under a load, and the angle that it does not tell from another."""
    while True:
        case = base(rng)
        model = quietly(default_model, case.servo)
        is_a = "pulse" if not isinstance(model, DigitalServo) else "bus" if model.takes_goals else "digital"
        if is_a == kind and healthy(case):
            return case, float(resolution(model))


def drawn(seed: int, number: int, wanted: str) -> Drawn:
    """Return the log of a number, which shows one symptom, or none where none is wanted."""
    rng = random.Random(f"noisy logs {seed} {wanted} {number}")
    kind, how, by = KINDS[number % 3], MOVES[number % 4], recorder(rng, number)
    if wanted:
        how = MOVES[1] if wanted in ("overshoots", "does not move") else how  # those only show in steps
        causes = [cause for cause in CAUSES["stops" if wanted == "does not move" else wanted] if cause != "deadband"]
        rng.shuffle(causes)
    while True:
        for cause in causes if wanted else ("",):
            for _ in range(TRIES):
                case, finest = of_kind(rng, kind)
                ill = planted(rng, case, "stops" if wanted == "does not move" else wanted, cause) if wanted else case
                if ill is None:
                    break
                made = moves(rng, how, mid_travel(quietly(default_model, case.servo)), number)
                try:
                    sound = quietly(shown_by, case, finest, made, True)
                    strong = quietly(shown_by, ill, finest, made, False) if wanted else {}
                except (st.errors.ServotwinError, ArithmeticError, ValueError):
                    continue
                if max(sound.values()) > HEALTHY or (wanted and strong[wanted] < SHOWS):
                    continue
                words = (f"{kind} {ill.words}; {how}, {made.begin:.1f} to {made.end:.1f} s; {by.kind}, "
                         f"{by.rate:.0f}/s, {math.degrees(by.noise):.2f} deg")
                words += f"; {strong[wanted]:.1f} of its threshold" if wanted else ""
                log = quietly(recorded, rng, ill, made, by, f"log {number}")
                return Drawn(case.servo, case.load, log, wanted, words)


def sample(seed: int) -> Iterator[Drawn]:
    """Return the logs of a seed, the healthy ones first."""
    yield from (drawn(seed, k, "") for k in range(HEALTHY_LOGS))
    yield from (drawn(seed, k, each) for k, each in enumerate(FAULTS))


def found_in(one: Drawn) -> tuple[str, ...]:
    """Return the symptoms that are found: of a healthy servo in run or log, of an ill one in the log."""
    found = quietly(lambda: st.diagnose(one.servo, load=one.load, log=one.log))
    run = tuple(each.symptom.name for each in found.findings if not one.wanted or each.log.found)
    return run + found.log_only


def main(seeds: list[int]) -> None:
    for seed in seeds:
        quiet = seen = 0
        for one in sample(seed):
            began = time.process_time()
            found = found_in(one)
            right = one.wanted in found if one.wanted else not found
            quiet, seen = quiet + (right and not one.wanted), seen + (right and bool(one.wanted))
            took = time.process_time() - began
            print(f"{'right' if right else 'WRONG'}  {one.wanted or 'healthy':13s} {took:5.1f} s  "
                  f"{one.words}; says {', '.join(found) or 'nothing'}", flush=True)
        print(f"seed {seed}: nothing found in {quiet} of {HEALTHY_LOGS} healthy logs, "
              f"the fault in {seen} of {len(FAULTS)}")


if __name__ == "__main__":
    main([int(each) for each in sys.argv[1:]])
