"""Compile kernels before tests ask for them, two at a time and largest first: `kernels.py [--for NAME] [RECIPE ...]`.

They go where every process looks for them, under a key of what they are made of: what is there already is not made.
"""

from __future__ import annotations

import argparse
import sys
import time
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from servotwin.simulation.compile.finding import is_ready, problems
from servotwin.simulation.compile.library import loaded
from servotwin.simulation.recipes import all_recipes

AT_ONCE = 2  # processes
_BUDGETS = tomllib.loads(Path(__file__).with_name("budgets.toml").read_text(encoding="utf-8"))
RECIPES = {recipe.name: recipe for recipe in all_recipes()}


def make(name: str) -> str:
    """Make one; return what is wrong."""
    return "" if loaded(RECIPES[name]) is not None else "; ".join(problems) or "it cannot be loaded"


def wanted(asked: list[str], purpose: str | None) -> list[str]:
    """Return the kernels that are not there yet, the one that takes longest first."""
    names = asked or (_BUDGETS["kernels"]["quick"] if purpose == "quick" else list(RECIPES))
    seconds = _BUDGETS["kernels"]["seconds"]
    return sorted((name for name in names if not is_ready(RECIPES[name])), key=lambda name: -seconds.get(name, 99.0))


def main() -> None:
    asked = argparse.ArgumentParser(usage=__doc__)
    asked.add_argument("recipes", nargs="*", metavar="RECIPE")
    asked.add_argument("--for", dest="purpose", metavar="NAME", help="quick: those that the quick tests use; else all")
    given = asked.parse_args()
    if unknown := set(given.recipes) - set(RECIPES):
        sys.exit(f"kernels.py: got {', '.join(sorted(unknown))}, allowed: {', '.join(RECIPES)}")
    names, start = wanted(given.recipes, given.purpose), time.monotonic()
    with ProcessPoolExecutor(AT_ONCE) as pool:
        for name, problem in zip(names, pool.map(make, names), strict=True):
            if problem:
                print(f"{name}: {problem}", flush=True)
    if names:
        print(f"{len(names)} kernels made in {time.monotonic() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
