"""Logs as loggers break them: made from clean ones with a seed, each with what has to come back of it.

Ten kinds that hobbyists bring, and five more that loggers make. A kind is certain where only one log can have been
meant: it is mended by itself, and said. Of the others a sentence says what to type, and what is typed mends them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

SEEDS = (0, 1, 2)
_BOOT = (  # what boards say when they start
    "ets Jun  8 2016 00:22:57\n\nrst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)\nconfigsip: 0, SPIWP:0xee\n"
    "mode:DIO, clock div:1\nload:0x3fff0030,len:1344\nload:0x40078000,len:13964\nho 0 tail 12 room 4\n"
    "entry 0x400805f0\n",
    "Servo logger v1.2, 50 Hz, 6.0 V\nAS5600 found\n",
    "Brownout detector was triggered\n\nWiFi connected, IP 192.168.4.1\n",
)


@dataclass(frozen=True, kw_only=True)
class Rows:
    """A clean log, row by row: times in whole units of its clock, pulses [us], angles [deg] and currents [mA]."""

    stamp: list[int]
    pulse: list[int]
    angle: list[float]
    current: list[int]
    name: str = "ms"

    @property
    def header(self) -> list[str]:
        """Names of the columns, as a sketch prints them."""
        return [self.name, "pulse_us", "angle_deg", "current_mA"]

    def cells(self, k: int) -> list[str]:
        """Return one row in words."""
        return [str(self.stamp[k]), str(self.pulse[k]), f"{self.angle[k]:.2f}", str(self.current[k])]

    def text(self, rows: Sequence[int] | None = None, separator: str = ",", *, header: bool = True) -> str:
        """Return some rows as a file holds them."""
        some = range(len(self.stamp)) if rows is None else rows
        lines = [self.header] if header else []
        return "".join(separator.join(cells) + "\n" for cells in [*lines, *(self.cells(k) for k in some)])


@dataclass(frozen=True, kw_only=True)
class Broken:
    """A broken log, and the clean logs that have to come back of it.

    Parameters
    ----------
    kind : str
    seed : int
    certain : bool
        Whether it is mended by itself.
    broken : bytes
        The file.
    clean : tuple of bytes
        Files without what was lost, one for each log.
    typed : tuple of str
        What has to be typed, in words of the command line; empty where it is certain.
    unsure : tuple of int
        Rows of the clean log whose time nobody knows.
    """

    kind: str
    seed: int
    certain: bool
    broken: bytes
    clean: tuple[bytes, ...]
    typed: tuple[str, ...] = ()
    unsure: tuple[int, ...] = ()


def clean_rows(seed: int, *, unit: str = "ms", rows: int = 300) -> Rows:
    """Return a log of steps that a servo followed with delay, slew and lag, as a sensor with noise saw it."""
    rng = np.random.default_rng(1000 + seed)
    step = {"ms": 1, "us": 1000}[unit] * int(rng.choice([5, 10, 20]))
    seconds = {"ms": 1e-3, "us": 1e-6}[unit]
    jitter = rng.integers(0, max(step // 10, 1), rows) if unit == "us" else np.zeros(rows, int)
    stamp = step * np.arange(rows) + jitter
    time = stamp * seconds
    levels = rng.choice([1100, 1300, 1500, 1700, 1900], 1 + int(time[-1] / 0.5))
    levels[0] = 1500
    pulse = levels[(time / 0.5).astype(int)]
    angle, seen = 0.0, []
    for k, t in enumerate(time):
        goal = (pulse[np.searchsorted(time, max(t - 0.03, 0.0), side="right") - 1] - 1500) * 0.09
        apart = time[k] - time[k - 1] if k else 0.0
        angle += float(np.clip((goal - angle) * min(apart / 0.04, 1.0), -300.0 * apart, 300.0 * apart))
        seen.append(round(angle + rng.normal(0.0, 0.1), 2) + 0.0)
    current = rng.integers(8, 30, rows) + (np.abs(np.gradient(seen)) * 40).astype(int)
    return Rows(stamp=stamp.tolist(), pulse=pulse.tolist(), angle=seen, current=current.tolist(),
                name={"ms": "ms", "us": "micros"}[unit])


def _separator(seed: int) -> str:
    return (",", "\t", ";")[seed % 3]


def _shifted(rows: Rows, by: int) -> Rows:
    return Rows(stamp=[t + by for t in rows.stamp], pulse=rows.pulse, angle=rows.angle, current=rows.current,
                name=rows.name)


def _overflow(kind: str, seed: int, unit: str, bits: int, typed: tuple[str, ...] = ()) -> Broken:
    """Return a log whose counter of time begins again at a power of two."""
    rows = clean_rows(seed, unit=unit)
    rng = np.random.default_rng(seed)
    at = int(rng.integers(20, len(rows.stamp) - 20))
    whole = _shifted(rows, 2**bits - rows.stamp[at] + int(rng.integers(0, rows.stamp[1] - rows.stamp[0])))
    wrapped = Rows(stamp=[t % 2**bits for t in whole.stamp], pulse=rows.pulse, angle=rows.angle,
                   current=rows.current, name=rows.name)
    separator = _separator(seed)
    return Broken(kind=kind, seed=seed, certain=not typed, broken=wrapped.text(separator=separator).encode(),
                  clean=(whole.text(separator=separator).encode(),), typed=typed)


def _micros(seed: int) -> Broken:
    return _overflow("micros", seed, "us", 32)


def _millis(seed: int) -> Broken:
    return _overflow("millis", seed, "ms", 32)


def _clock16(seed: int) -> Broken:
    """`unsigned int t = millis();` on a board whose int has 16 bits."""
    return _overflow("clock16", seed, "ms", 16, ("--mend", "clock16"))


def _torn_last(seed: int) -> Broken:
    """The power went, or the plug was pulled: with a line end behind, where a terminal program added one."""
    rows, rng = clean_rows(seed), np.random.default_rng(seed)
    text = rows.text()
    last = text.rstrip("\n").rsplit("\n", 1)[1]
    cut = int(rng.integers(1, last.rindex(","))) if seed == 2 else int(rng.integers(1, len(last)))
    broken = text[:len(text) - 1 - len(last) + cut] + ("\n" if seed == 2 else "")
    return Broken(kind="torn-last", seed=seed, certain=True, broken=broken.encode(),
                  clean=(rows.text(range(len(rows.stamp) - 1)).encode(),))


def _boot_text(seed: int) -> Broken:
    """Text among the rows, while time goes on."""
    rows = clean_rows(seed)
    at = int(np.random.default_rng(seed).integers(20, len(rows.stamp) - 20))
    n = len(rows.stamp)
    separator = (",", " ", ",")[seed]
    broken = rows.text(range(at), separator) + _BOOT[seed] + rows.text(range(at, n), separator, header=False)
    return Broken(kind="boot-text", seed=seed, certain=True, broken=broken.encode(),
                  clean=(rows.text(separator=separator).encode(),))


def _repeated_header(seed: int) -> Broken:
    rows, rng = clean_rows(seed), np.random.default_rng(seed)
    separator, n = _separator(seed), len(rows.stamp)
    places = sorted(rng.choice(np.arange(10, n - 10), 1 + seed, replace=False).tolist())
    ends = [0, *places, n]
    again = separator.join(rows.header) + "\n"
    if seed == 2:  # a sketch that prints it with blanks behind the commas
        again = (separator + " ").join(rows.header) + "\r\n"
    parts = [rows.text(range(a, b), separator, header=a == 0) for a, b in pairwise(ends)]
    return Broken(kind="repeated-header", seed=seed, certain=True, broken=again.join(parts).encode(),
                  clean=(rows.text(separator=separator).encode(),))


def _repeated_stamp(seed: int) -> Broken:
    """A clock that did not go on: rows dropped, or (seed 1) spread between their neighbours."""
    rows, rng = clean_rows(seed), np.random.default_rng(seed)
    at = sorted(rng.choice(np.arange(10, len(rows.stamp) - 10, 4), 3, replace=False).tolist())
    stamps = list(rows.stamp)
    for k in at:
        stamps[k] = stamps[k - 1]
    broken = Rows(stamp=stamps, pulse=rows.pulse, angle=rows.angle, current=rows.current)
    spread = seed == 1
    kept = [k for k in range(len(stamps)) if spread or k not in at]
    return Broken(kind="repeated-stamp", seed=seed, certain=False, broken=broken.text().encode(),
                  clean=(rows.text(kept).encode(),), unsure=tuple(at) if spread else (),
                  typed=("--mend", "spread-repeated" if spread else "drop-repeated"))


def _torn_between(seed: int) -> Broken:
    """Characters were lost on the line: a row too short, two rows joined, or a cell that is no number."""
    rows = clean_rows(seed)
    at = int(np.random.default_rng(seed).integers(20, len(rows.stamp) - 20))
    lines = rows.text().splitlines(keepends=True)
    row = at + 1  # below the header
    lost = [at]
    if seed == 0:
        lines[row] = lines[row][:lines[row].rindex(",")] + "\n"
    elif seed == 1:
        lines[row:row + 2] = [lines[row][:7] + lines[row + 1][4:]]
        lost = [at, at + 1]
    else:
        cells = lines[row].split(",")
        lines[row] = ",".join([cells[0], cells[1], cells[2][:1] + "#" + cells[2][2:], cells[3]])
    kept = [k for k in range(len(rows.stamp)) if k not in lost]
    return Broken(kind="torn-between", seed=seed, certain=False, broken="".join(lines).encode(),
                  clean=(rows.text(kept).encode(),), typed=("--mend", "torn"))


def _reset(seed: int) -> Broken:
    """The board started again: time counts anew, behind a header, boot text, or both and a row that was cut."""
    rows, more = clean_rows(seed), clean_rows(seed + 10)
    at = int(np.random.default_rng(seed).integers(60, 200))
    between = ("", _BOOT[0], rows.text([at])[len(rows.text([])):][:9] + "\n" + _BOOT[1])[seed]
    broken = rows.text(range(at)) + between + more.text(header=seed != 1)
    return Broken(kind="reset", seed=seed, certain=False, broken=broken.encode(), typed=("--mend", "reset"),
                  clean=(rows.text(range(at)).encode(), more.text().encode()))


def _plotter(seed: int) -> Broken:
    """What a sketch prints for the Serial Plotter: labels in each row, and no time."""
    rows = clean_rows(seed)
    rate = 1000 // (rows.stamp[1] - rows.stamp[0])
    separator = (",", "\t", " ")[seed]
    names = ("pwm", "angle", "current_mA")
    lines = [separator.join(f"{name}:{cell}" for name, cell in zip(names, rows.cells(k)[1:], strict=True))
             for k in range(len(rows.stamp))]
    clean = ["time_s,pwm_us,angle_deg,current_mA"]
    clean += [",".join([repr(k / rate), *rows.cells(k)[1:]]) for k in range(len(rows.stamp))]
    return Broken(kind="plotter", seed=seed, certain=False, broken="\n".join([*lines, ""]).encode(),
                  clean=("\n".join([*clean, ""]).encode(),), typed=("--rate", f"{rate}Hz"))


def _clock(milliseconds: int) -> str:
    day = milliseconds % 86_400_000
    return f"{day // 3_600_000:02}:{day // 60_000 % 60:02}:{day // 1000 % 60:02}.{day % 1000:03}"


def _monitor(seed: int) -> Broken:
    """The Serial Monitor with times, copied out; seed 1 passes midnight, seed 2 has the clock of the sketch too."""
    rows, rng = clean_rows(seed), np.random.default_rng(seed)
    start = 86_400_000 - 700 if seed == 1 else int(rng.integers(40_000_000, 60_000_000))
    own = seed == 2
    arrives = [start + t + (int(rng.integers(0, 4)) if own else 0) for t in rows.stamp]
    header = rows.header if own else rows.header[1:]
    lines = [f"{_clock(start - 3)} -> {','.join(header)}"]
    lines += [f"{_clock(t)} -> {','.join(rows.cells(k)[0 if own else 1:])}" for k, t in enumerate(arrives)]
    clean = rows.text() if own else "\n".join(["time," + ",".join(header), *(
        f"{_clock(t)},{','.join(rows.cells(k)[1:])}" for k, t in enumerate(arrives)), ""])
    return Broken(kind="monitor", seed=seed, certain=True, broken="\n".join([*lines, ""]).encode(),
                  clean=(clean.encode(),))


def _nul_tail(seed: int) -> Broken:
    """A card whose last block was never written: zeros from the middle of a row to the end of the block."""
    rows, rng = clean_rows(seed), np.random.default_rng(seed)
    text = rows.text().encode()
    whole = int(rng.integers(len(text) // 2, len(text) - 100))
    broken = text[:whole] + bytes(512 - whole % 512)
    kept = text[:whole].count(b"\n") - 1
    return Broken(kind="nul-tail", seed=seed, certain=True, broken=broken, clean=(rows.text(range(kept)).encode(),))


def _sent_twice(seed: int) -> Broken:
    """A buffer that was sent again after the link came back: rows come twice, each cell the same."""
    rows, rng = clean_rows(seed), np.random.default_rng(seed)
    at, again = int(rng.integers(60, 200)), int(rng.integers(5, 40))
    n = len(rows.stamp)
    broken = rows.text(range(at)) + rows.text(range(at - again, n), header=False)
    return Broken(kind="sent-twice", seed=seed, certain=True, broken=broken.encode(), clean=(rows.text().encode(),))


def _interleaved(seed: int) -> Broken:
    """Two tasks that print at once: the rest of a row stands behind the next one."""
    rows = clean_rows(seed)
    at = int(np.random.default_rng(seed).integers(20, len(rows.stamp) - 20))
    lines = rows.text().splitlines()
    first, second = lines[at + 1], lines[at + 2]
    cut = first.rindex(",") + 1 + (seed == 1)
    lines[at + 1:at + 3] = [first[:cut] + second, first[cut:]]
    kept = [k for k in range(len(rows.stamp)) if k not in (at, at + 1)]
    return Broken(kind="interleaved", seed=seed, certain=False, broken="\n".join([*lines, ""]).encode(),
                  clean=(rows.text(kept).encode(),), typed=("--mend", "torn"))


def _thousands(seed: int) -> Broken:
    """A spreadsheet of a country with decimal commas: times from 1000 ms on are written 1.000."""
    rows = _shifted(clean_rows(seed), (0, 900, 12_000)[seed])
    lines = [";".join(rows.header)]
    for k in range(len(rows.stamp)):
        stamp, pulse, angle, current = rows.cells(k)
        lines.append(";".join([f"{int(stamp):,}".replace(",", "."), pulse, angle.replace(".", ","), current]))
    clean = rows.text(separator=";").replace(".", ",")
    return Broken(kind="thousands", seed=seed, certain=False, broken="\n".join([*lines, ""]).encode(),
                  clean=(clean.encode(),), typed=("--mend", "thousands"))


KINDS: dict[str, Callable[[int], Broken]] = {
    "micros": _micros, "millis": _millis, "torn-last": _torn_last, "boot-text": _boot_text,
    "repeated-header": _repeated_header, "repeated-stamp": _repeated_stamp, "torn-between": _torn_between,
    "reset": _reset, "plotter": _plotter, "monitor": _monitor,
}
OWN = {"nul-tail": _nul_tail, "sent-twice": _sent_twice, "interleaved": _interleaved, "clock16": _clock16,
       "thousands": _thousands}


def broken_logs() -> list[Broken]:
    """Return all kinds, three of each."""
    return [make(seed) for make in (*KINDS.values(), *OWN.values()) for seed in SEEDS]


def write_all(folder: Path) -> None:
    """Write all of them, and the clean ones beside them."""
    for one in broken_logs():
        stem = f"{one.kind}-{one.seed}"
        (folder / f"{stem}.csv").write_bytes(one.broken)
        for k, clean in enumerate(one.clean):
            (folder / f"{stem}-clean{k}.csv").write_bytes(clean)


if __name__ == "__main__":
    import sys

    write_all(Path(sys.argv[1]))
