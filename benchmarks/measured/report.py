"""Errors by kind over several folds, pooled over samples and as the mean of runs."""

import math
from collections.abc import Iterable

import servotwin as st
from servotwin.identification import LogError


def folds(logs: list[st.Log], number: int) -> list[list[str]]:
    """Return the names that each fold holds out: every n-th run of each kind of motion."""
    kinds: dict[str, list[str]] = {}
    for log in logs:
        kinds.setdefault(log.motion, []).append(log.name)
    return [[name for names in kinds.values() for name in names[k::number]] for k in range(number)]


def row(label: str, errors: Iterable[LogError], by: str = "motion") -> None:
    """Print the rms error of each kind [deg]: over all samples, and as the mean of the runs' own."""
    groups: dict[str, list[LogError]] = {}
    for error in errors:
        groups.setdefault(error.motion if by == "motion" else f"{error.conditions[by]:g}", []).append(error)
    cells = []
    for kind in sorted(groups):
        items = groups[kind]
        pooled = math.sqrt(sum(e.rms**2 * e.samples for e in items) / sum(e.samples for e in items))
        mean = sum(e.rms for e in items) / len(items)
        cells.append(f"{kind} {math.degrees(pooled):5.2f} ({math.degrees(mean):5.2f})")
    print(f"  {label:36} {'   '.join(cells)}", flush=True)
