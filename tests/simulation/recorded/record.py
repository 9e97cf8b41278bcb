"""What kernels gave: `numbers.npz` and `numbers.json`, which `test_recorded_numbers.py` reads.

Most are of the kernels that numba compiled. Sets with play, with springs between two bodies and with programs are of
later ones, in which lanes go by legs: their sums have another order.

    python tests/simulation/recorded/record.py --write [SET ...]

runs the sets of `populations.py` (all unless some are named) and writes what the kernels give that are there. That may
be done only where a change of results is meant, and said in the CHANGELOG; other compilers, forms and structures leave
the files as they are.

Of every signal the files have the SHA-256 of its bits, and some numbers of it, so that a difference can be read, and
so that a machine which rounds otherwise has something to compare with. These are numbers that rounding moves little:
each set is run again with parameters that are changed by one rounding.
"""

import hashlib
import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from simulation.recorded.machine import about, digest, rounding
from simulation.recorded.populations import SETS
from simulation.recorded.recipes import all_recipes, in_any_order, watched

HERE = Path(__file__).resolve().parent
TEXT, NUMBERS = HERE / "numbers.json", HERE / "numbers.npz"
KEPT = 24  # numbers of each signal
NUDGES = 1.0 + 2.0**-52, 1.0 - 2.0**-53, 1.0 + 2.0**-50
SINGLE_NUDGES = 1.0 + 2.0**-23, 1.0 - 2.0**-24

# What a number may be off, relative to the largest of its signal but at least to 1; and what rounding may move it by,
# so that it is kept
ANY_ORDER, ELSEWHERE, SINGLE = 1e-12, 1e-9, 1e-4
CALM = {ANY_ORDER: 5e-14, ELSEWHERE: 2e-11, SINGLE: 5e-6}

Found = dict[str, np.ndarray]


def same_machine(recorded: dict[str, Any]) -> bool:
    """Tell whether this machine rounds as that of the files."""
    return rounding() == recorded["rounding"]


def whole(found: Found) -> str:
    """Return the SHA-256 of all signals of a set."""
    return hashlib.sha256("".join(f"{name} {x.shape} {digest(x)}\n" for name, x in found.items()).encode()).hexdigest()


def loaded() -> tuple[dict[str, Any], dict[str, Found], dict[str, Found]]:
    """Return what the files say, and of each set the places and the values of the numbers that are kept."""
    text = json.loads(TEXT.read_text(encoding="utf-8"))
    places: dict[str, Found] = {}
    values: dict[str, Found] = {}
    with np.load(NUMBERS) as file:
        at, all_places, all_values = 0, file["places"], file["values"]
    for name, one in text["sets"].items():
        places[name], values[name] = {}, {}
        for signal, (_, _, count) in one["signals"].items():
            places[name][signal], values[name][signal] = all_places[at:at + count], all_values[at:at + count]
            at += count
    return text, places, values


def tolerance_of(name: str, one: dict[str, Any], exact: bool) -> float:
    """Return what the numbers of a set may be off; 0 where all bits are compared."""
    if name.endswith("float32") and not exact:
        return SINGLE
    if not exact:
        return ELSEWHERE
    return ANY_ORDER if one["in any order"] else 0.0


def differences(found: Found, one: dict[str, Any], places: Found, values: Found, tolerance: float) -> Iterator[str]:
    """Return a line for every signal of a set that is not what it was."""
    if list(found) != list(one["signals"]):
        yield f"signals are {list(found)}, were {list(one['signals'])}"
    for signal, (bits, shape, _) in one["signals"].items():
        now = found.get(signal, np.zeros(0))
        if list(now.shape) != shape:
            yield f"{signal}: shape {list(now.shape)}, was {shape}"
            continue
        kept, before = np.asarray(now, np.float64).reshape(-1)[places[signal]], values[signal]
        if tolerance == 0.0 and digest(now)[:len(bits)] != bits:
            yield f"{signal}: other bits; {worst(before, kept)}"
        moved = off(before, kept)
        if tolerance > 0.0 and moved.max(initial=0.0) > tolerance:
            yield f"{signal}: {int((moved > tolerance).sum())} of {moved.size} off by more; {worst(before, kept)}"


def worst(before: np.ndarray, now: np.ndarray) -> str:
    """Return where two rows of numbers differ most, as people read it."""
    moved = off(before, now)
    if not moved.any():
        return "those that are kept are the same"
    k = int(np.argmax(moved))
    ulp = np.spacing(max(abs(now[k]), abs(before[k])))
    return (f"{now[k]:.17g}, was {before[k]:.17g} ({abs(now[k] - before[k]) / ulp:.3g} ulp); "
            f"{int((moved > 0.0).sum())} of {moved.size} kept numbers differ")


def off(before: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Return by how much numbers moved, relative to the largest but at least to 1; by inf where only one is nan."""
    size = np.max(np.abs(before), initial=1.0, where=np.isfinite(before))
    with np.errstate(invalid="ignore"):
        moved = np.where(before == now, 0.0, np.abs(now - before) / size)
    return np.where(np.isnan(before) & np.isnan(now), 0.0, np.where(np.isnan(moved), np.inf, moved))


# --- writing ----------------------------------------------------------------------------------------------------------


def recorded(name: str, run: Callable[..., Found]) -> tuple[dict[str, Any], Found, Found]:
    """Run a set; return what the text says of it, and places and values of the numbers that are kept."""
    with watched() as used:
        found = run()
    free = any(map(in_any_order, used.values()))
    limit = CALM[SINGLE if name.endswith("float32") else ANY_ORDER if free else ELSEWHERE]
    probes = [run(nudge) for nudge in (SINGLE_NUDGES if name.endswith("float32") else NUDGES)]
    rng, signals, places, values = np.random.default_rng(len(name)), {}, {}, {}
    for signal, x in found.items():
        flat = np.asarray(x, np.float64).reshape(-1)
        calm = np.ones(flat.size, np.bool_)
        for probe in probes:
            other = np.asarray(probe[signal], np.float64).reshape(-1)
            calm &= off(flat, other) <= limit if other.shape == flat.shape else False
        kept = np.sort(rng.permutation(np.flatnonzero(calm))[:KEPT])
        places[signal], values[signal] = kept, flat[kept]
        signals[signal] = [digest(x)[:12], list(x.shape), len(kept)]
    kept_count = sum(row[2] for row in signals.values())
    most = sum(min(KEPT, x.size) for x in found.values())
    print(f"{name:36} {'any order' if free else '':10} kept {kept_count} of {most}: {', '.join(sorted(used))}",
          flush=True)
    return {"sha256": whole(found), "in any order": free, "recipes": sorted(recipe.name for recipe in used.values()),
            "signals": signals}, places, values


def write(names: list[str]) -> None:
    """Run some sets, or all, and write the files; those that are not named stay."""
    warnings.simplefilter("ignore")
    began = time.process_time()
    text, places, values = loaded() if names and TEXT.exists() else ({"sets": {}}, {}, {})
    if text["sets"] and not same_machine(text):
        sys.exit("record.py: this machine rounds otherwise than the files' one; name no set, so that all are written")
    for name in names or SETS:
        text["sets"][name], places[name], values[name] = recorded(name, SETS[name])
    text["sets"] = {name: text["sets"][name] for name in SETS if name in text["sets"]}
    head = about() | {"rounding": rounding()}
    lines = json.dumps(head, indent=1)[:-2] + ',\n "sets": {\n'
    lines += ",\n".join(f"{json.dumps(name)}: {_lines(one)}" for name, one in text["sets"].items()) + "\n}}\n"
    TEXT.write_text(lines, encoding="utf-8")
    order = [(name, signal) for name, one in text["sets"].items() for signal in one["signals"]]
    np.savez_compressed(NUMBERS, places=np.concatenate([places[a][b] for a, b in order]).astype(np.int32),
                        values=np.concatenate([values[a][b] for a, b in order]))
    used = {recipe for one in text["sets"].values() for recipe in one["recipes"]}
    print(f"{len(used)} of {len(all_recipes())} recipes: {', '.join(sorted(used))}; "
          f"left out: {', '.join(sorted(all_recipes() - used)) or 'none'}")
    print(f"{(TEXT.stat().st_size + NUMBERS.stat().st_size) / 1e3:.0f} kB, {time.process_time() - began:.0f} s of CPU")


def _lines(one: dict[str, Any]) -> str:
    rows = ",\n  ".join(f"{json.dumps(name)}: {json.dumps(row)}" for name, row in one["signals"].items())
    rest = ",\n ".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in one.items() if key != "signals")
    return f'{{{rest},\n "signals": {{\n  {rows}}}}}'


if __name__ == "__main__":
    if sys.argv[1:2] != ["--write"]:
        sys.exit(__doc__)
    write(sys.argv[2:])
