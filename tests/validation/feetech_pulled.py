"""An STS3215 that others pull at, alternately, as its registers predict it: profile, droop and play.

The recording (Boris Kotov, Robonine, CC BY 4.0): 10 rows a second, goals that reach the servo one row later, a lever of
100 mm at which two more servos pull through elastic bands, about 0.3 kgf each. The servo is the catalogue's, its gains,
zone, start, speed and acceleration by registers; nothing is fitted but the instant within a row at which goals come.
"""

from __future__ import annotations

import csv
import math
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import servotwin as st

Array = NDArray[np.float64]

COUNT = 2.0 * math.pi / 4096.0  # rad
PULL = 0.3 * 9.80665 * 0.1  # N m, of a puller that has gone all its way
MIDDLE = 2048.0  # counts
REGISTERS = {  # of the file "single": P, zone and start as its loads at rest show them, the rest as its author says
    "P_Coefficient": 32, "D_Coefficient": 32, "I_Coefficient": 0, "CW_Dead_Zone": 1, "CCW_Dead_Zone": 1,
    "Minimum_Startup_Force": 0, "Goal_Velocity": 1000, "Acceleration": 20, "Phase": 12}
TURNS = 250.0  # counts/s, from which on it surely turns
LEVER = 2e-4  # kg m2, with horn: a guess


class Rows(NamedTuple):
    """The recording: times [s], counts, loads in duty with the sign of the torque, and the pull on the shaft [N m]."""

    time: Array
    goal: Array
    position: Array
    load: Array
    pull: Array  # in +q
    current: Array  # A, as its register says


class Duties(NamedTuple):
    """Mean duty, in the sense of the motion or of the pull, as measured and as predicted."""

    turning: tuple[float, float]  # faster than 250 counts/s
    speed: float  # rad/s, the mean of these
    resting: tuple[float, float]  # after a move
    pulled: tuple[float, float]


class Told(NamedTuple):
    """Rms of predicted less measured counts while it moves and while it rests, droops of both [counts], its times."""

    moving: float
    resting: float
    measured: dict[str, float]
    predicted: dict[str, float]
    late: tuple[float, ...]  # s, of each goal behind its row
    duties: Duties

    def play(self, of: dict[str, float], pulled: bool = True) -> float:
        """Return how far two pulls the other way move it [counts], while they pull or after."""
        word = "pulled" if pulled else "after"
        return of[f"{word} up"] - of[f"{word} down"]


def read(path: Path, tested: int = 5, pullers: tuple[int, int] = (3, 4)) -> Rows:
    """Return the rows of a recording; a puller pulls by how far it is on its way, as a band does."""
    with path.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row[f"pos ({tested})"]]
    begun = datetime.fromisoformat(rows[0]["timestamp"])
    time = np.array([(datetime.fromisoformat(row["timestamp"]) - begun).total_seconds() for row in rows])

    def column(word: str, who: int) -> Array:
        return np.array([float(row[f"{word} ({who})"]) for row in rows])

    word = column("load", tested)
    load = np.where(word >= 1024.0, word - 1024.0, -word) / 1000.0  # its word counts a drive towards lower counts
    one, other = (column("pos", who) for who in pullers)
    pull = PULL * ((other.max() - other) / np.ptp(other) - (one - one.min()) / np.ptp(one))
    return Rows(time, column("target pos", tested), column("pos", tested), load, pull,
                6.5e-3 * column("current", tested))


def servo(**registers: int) -> st.Servo:
    """Return the catalogue's servo with these registers."""
    return st.feetech_sts({**REGISTERS, **registers}, servo="feetech-sts3215-12v")


def predicted(rows: Rows, late: float, twin: st.Servo) -> tuple[Array, Array]:
    """Return positions [counts] and duties at the rows' times, goals coming so late behind their rows."""
    goals = COUNT * (rows.goal - MIDDLE)
    first = COUNT * (rows.position[0] - MIDDLE)
    end = float(rows.time[-1])
    command = st.signals.samples(np.append(0.0, rows.time[1:] + late), goals, unit="rad", hold="previous")
    load = st.loads.Inertia(LEVER) + st.loads.Recorded(rows.time, -rows.pull)
    run = st.simulate(st.DigitalServo(twin), command, duration=end, load=load, output_times=rows.time,
                      initial={"output_angle": first})
    return np.floor(run["output_angle"] / COUNT + 0.5) + MIDDLE, np.asarray(run["duty"])


def told(rows: Rows, twin: st.Servo) -> Told:
    """Return what the registers predict beside what was measured, each goal as late as its move fits best."""
    begins = np.flatnonzero(np.diff(rows.goal)) + 1
    windows = [np.arange(k, min(k + 8, len(rows.time))) for k in begins]
    runs = {float(late): predicted(rows, float(late), twin) for late in np.arange(0.03, 0.121, 0.01)}
    tries = {x: counts - rows.position for x, (counts, _) in runs.items()}
    late = tuple(min(tries, key=lambda x: float(np.sum(tries[x][window] ** 2))) for window in windows)
    moving = np.concatenate([tries[x][window] for x, window in zip(late, windows, strict=True)])
    rests = np.arange(len(rows.time)) > begins[0]
    rests[np.concatenate(windows)] = False
    rests &= np.abs(np.gradient(rows.pull)) < 0.02 * PULL
    usual = float(np.median(late)) if float(np.median(late)) in tries else next(iter(tries))
    off, (counts, duty) = tries[usual], runs[usual]
    return Told(float(np.sqrt(np.mean(moving**2))), float(np.sqrt(np.mean(off[rests] ** 2))),
                _droops(rows, rows.position, begins), _droops(rows, counts, begins), late,
                _duties(rows, counts, duty, begins[0]))


def _duties(rows: Rows, counts: Array, duty: Array, first: int) -> Duties:
    """Return duties of a prediction beside those measured, each where its own shaft turns, rests or is pulled."""
    def of(position: Array, drive: Array) -> tuple[float, float, float, float]:
        speed = np.gradient(position, rows.time)
        later = np.arange(len(position)) > first
        turns = later & (np.abs(speed) > TURNS)
        stays = later & (np.abs(np.gradient(position)) == 0.0) & (np.abs(np.gradient(rows.pull)) < 0.02 * PULL)
        pulled = stays & (np.abs(rows.pull) > 0.98 * PULL)
        moved = np.maximum.accumulate(np.where(turns, np.arange(len(position)), -1))
        pulls = np.maximum.accumulate(np.where(np.abs(rows.pull) > 0.1 * PULL, np.arange(len(position)), -1))
        alone = stays & (np.abs(rows.pull) < 0.02 * PULL) & (moved > pulls)
        return (float(np.mean((drive * np.sign(speed))[turns])), float(np.mean(np.abs(speed[turns]))) * COUNT,
                float(np.mean(np.abs(drive[alone]))), float(np.mean(-(drive * np.sign(rows.pull))[pulled])))

    measured, ours = of(rows.position, rows.load), of(counts, duty)
    return Duties((measured[0], ours[0]), measured[1], (measured[2], ours[2]), (measured[3], ours[3]))


def _droops(rows: Rows, counts: Array, begins: NDArray[np.intp]) -> dict[str, float]:
    """Return how far it stands off its goal [counts]: pulled either way, and left alone after that."""
    error, last, found = counts - rows.goal, 0.0, dict[str, list[float]]()
    for k in range(begins[0], len(counts)):
        side = math.copysign(1.0, rows.pull[k])
        if k in begins:
            last = 0.0
        elif abs(rows.pull[k]) > 0.98 * PULL:
            last = side
            found.setdefault("pulled up" if side > 0.0 else "pulled down", []).append(error[k])
        elif abs(rows.pull[k]) < 0.02 * PULL and last and abs(rows.pull[k - 1]) < 0.02 * PULL:
            found.setdefault("after up" if last > 0.0 else "after down", []).append(error[k])
    return {word: float(np.mean(values)) for word, values in found.items()}
