"""All recipes of the package: what a wheel has libraries of."""

from __future__ import annotations

from functools import cache

from servotwin.simulation import bus_run, engine
from servotwin.simulation.compile import Recipe, calls
from servotwin.simulation.lanes import forms


@cache
def all_recipes() -> tuple[Recipe, ...]:
    """Return every recipe that anything in the package asks kernels of, sorted by name."""
    found: dict[str, Recipe] = {}
    for module in (forms, bus_run, calls, engine):
        for value in vars(module).values():
            for each in value.values() if isinstance(value, dict) else (value,):
                if isinstance(each, Recipe):
                    found[each.name] = each
    return tuple(found[name] for name in sorted(found))
