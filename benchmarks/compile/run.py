"""What compiled kernels cost: the first use, a lane of each set, a tick, a joint; beside those that numba compiled.

    run.py [PART ...]                               beside the times in numba.json, which are for orientation alone
    run.py --numba CHECKOUT [--python PYTHON] ...   beside a checkout whose kernels numba compiles, in turns: A, B, A, B
    run.py --record [--numba CHECKOUT] ...          measures that checkout, or this, and writes numba.json

CHECKOUT is one of the last commit with numba, and PYTHON an interpreter that has numba, MuJoCo and what the package
needs. Parts are `first`, `lanes`, `alone`, `ticks`, `joints` and `filled`. All times are of the CPU, best of several.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
from simulation.recorded.machine import about

HERE = Path(__file__).resolve().parent
ROOT, FILE = HERE.parents[1], HERE / "numba.json"
PARTS = ("first", "lanes", "alone", "ticks", "joints", "filled")
FIRST = ("plain", "all together", "digital")
ROUNDS = {"first": 1, "lanes": 3, "alone": 3, "ticks": 3, "joints": 3, "filled": 5}
# How many times as fast as numba's the first use has to be, and how many times its time the others may take
FASTER = {"first": {"plain": 6.0, "all together": 10.0, "digital": 8.0}}
MOST = {"lanes": 1.10, "alone": 0.5, "ticks": 1.05, "joints": 1.05}
MOST_BY_GCC, MOST_FILLED = 2.2, 0.030  # of a lane; s
Times = dict[str, dict[str, float]]


class Side(NamedTuple):
    """Whose kernels are measured: a checkout, and the interpreter that runs it."""

    checkout: Path
    python: str

    def measured(self, *arguments: str, cache: str | None = None) -> dict[str, float]:
        """Measure in a process of its own; with another cache than the user's where one is named."""
        more = {} if cache is None else {"SERVOTWIN_CACHE_DIR": cache}
        done = subprocess.run(
            [self.python, str(HERE / "measure.py"), *arguments], capture_output=True, text=True, check=False,
            env=os.environ | more | {"PYTHONPATH": str(self.checkout / "src")})
        if done.returncode != 0:
            sys.exit(f"measure.py {' '.join(arguments)} of {self.checkout}:\n{done.stderr}")
        return dict(json.loads(done.stdout))

    def part(self, part: str) -> dict[str, float]:
        """Measure a part once."""
        if part == "first":
            found = {}
            for name in FIRST:
                with tempfile.TemporaryDirectory() as empty:
                    found[name] = self.measured("first", name, cache=empty)["first"]
            return found
        if part == "filled":
            return {name: self.measured("first", name)["first without second"] for name in ("all together", "plain")}
        return self.measured(part)


def alternating(sides: dict[str, Side], parts: list[str]) -> dict[str, Times]:
    """Measure all sides in turns; the least of each counts."""
    found: dict[str, Times] = {name: {part: {} for part in parts} for name in sides}
    for part in parts:
        if part != "first":
            for side in sides.values():
                side.part(part)  # what has to be compiled is
        for _ in range(ROUNDS[part]):
            for name, side in sides.items():
                least = found[name][part]
                for row, seconds in side.part(part).items():
                    least[row] = min(seconds, least.get(row, seconds))
    return found


def rows(part: str, now: dict[str, float], before: dict[str, float]) -> Iterator[tuple[str, ...]]:
    """Return name, both times, their ratio and the bar of each row."""
    for name, seconds in now.items():
        peer = before.get(name)
        if part == "filled":
            ratio, bar = "", f"<= {1e3 * MOST_FILLED:.0f} ms"
        elif part == "first":
            ratio, bar = "" if peer is None else f"{peer / seconds:.2f}x faster", f">= {FASTER[part][name]:.0f}x"
        elif name.endswith("[1]"):
            ratio, bar = "" if peer is None else f"{seconds / peer:.2f}", ""
        else:
            ratio, bar = "" if peer is None else f"{seconds / peer:.2f}", f"<= {MOST[part]:.2f}"
            bar += f" (gcc {MOST_BY_GCC})" if part == "lanes" else ""
        yield name, written(name, peer), written(name, seconds), ratio, bar


def written(name: str, seconds: float | None) -> str:
    """Write a time with its unit, or a ratio."""
    if seconds is None:
        return "-"
    if name.endswith("[1]"):
        return f"{seconds:.3g}"
    scale, unit = (1.0, "s") if seconds >= 1.0 else (1e3, "ms") if seconds >= 1e-3 else (1e6, "us")
    return f"{scale * seconds:.3g} {unit}"


TITLES = {
    "first": "first call of a process whose cache is empty: 128 lanes, 4 with all terms, 128 digital ones",
    "lanes": "a lane of 2 s, kernels alone, one thread",
    "alone": "a lane of 2 s with all terms, which runs one by one",
    "ticks": "VectorSimulator.advance of 1 ms, one thread",
    "joints": "ServoDrive.step of 1 ms less MuJoCo's own, per joint",
    "filled": "first call of a process whose cache is filled, less its second",
}


def show(parts: list[str], now: Times, before: Times, peer: str) -> None:
    print(f"CPU times, the best of several; numba: {peer}")
    for part in parts:
        print(f"\n{TITLES[part]}")
        print(f"{'':48} {'numba':>10} {'this':>10} {'ratio':>13}  bar")
        for name, *cells, bar in rows(part, now[part], before.get(part, {})):
            print(f"{name:48} {cells[0]:>10} {cells[1]:>10} {cells[2]:>13}  {bar}", flush=True)


def commit_of(checkout: Path) -> str:
    """Return the last commit of a checkout that changed the package."""
    return subprocess.run(["git", "-C", str(checkout), "log", "-1", "--format=%h", "--", "src"], stdout=subprocess.PIPE,
                          text=True, check=True).stdout.strip()


def record(side: Side, parts: list[str]) -> None:
    """Measure a side and write numba.json; of what is there already the lesser time stays, of the same commit."""
    head = {**about(), "commit": commit_of(side.checkout), "load": [round(load, 1) for load in os.getloadavg()]}
    times = alternating({"numba": side}, parts)["numba"]
    kept = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {"seconds": {}}
    if kept.get("commit") != head["commit"] or kept.get("cpu") != head["cpu"]:
        kept = {"seconds": {}}
    for part, found in times.items():
        least = kept["seconds"].setdefault(part, {})
        for name, seconds in found.items():
            least[name] = float(f"{min(seconds, least.get(name, seconds)):.4g}")
    seconds = {part: kept["seconds"][part] for part in PARTS if part in kept["seconds"]}
    FILE.write_text(json.dumps(head | {"seconds": seconds}, indent=1) + "\n", encoding="utf-8")
    show(list(seconds), seconds, {}, f"recorded now into {FILE.name}, in the column 'this'")


def main() -> None:
    asked = argparse.ArgumentParser(usage=__doc__)
    asked.add_argument("parts", nargs="*")
    asked.add_argument("--numba", type=Path)
    asked.add_argument("--python", default=sys.executable)
    asked.add_argument("--record", action="store_true")
    given = asked.parse_args()
    parts = given.parts or list(PARTS)
    for part in parts:
        if part not in PARTS:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(PARTS)}")
    this = Side(ROOT, sys.executable)
    peer = None if given.numba is None else Side(given.numba.resolve(), given.python)
    if given.record:
        record(peer or this, parts)
    elif peer is not None:
        times = alternating({"numba": peer, "this": this}, parts)
        show(parts, times["this"], times["numba"], f"{given.numba}, measured in turns with this in one run")
    else:
        kept = json.loads(FILE.read_text(encoding="utf-8"))
        show(parts, alternating({"this": this}, parts)["this"], kept["seconds"],
             f"recorded {kept['date']} on {kept['cpu']}: for orientation alone, --numba measures both in turns")


if __name__ == "__main__":
    main()
