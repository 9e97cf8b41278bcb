"""Which recipes of kernels there are, and which a run uses."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from servotwin.simulation import recipes
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.text.derive import Derivation

_NAMES = ("kernels", "call_of")  # what takes a recipe first, and is imported by name


def all_recipes() -> set[str]:
    """Return the names of all recipes."""
    return {recipe.name for recipe in recipes.all_recipes()}


@cache
def in_any_order(recipe: Recipe) -> bool:
    """Tell whether a recipe has sums that a compiler may take side by side."""
    work = Derivation(recipe)
    for entry in recipe.entries:
        work.function(*entry.split(":"))
    return bool(work.in_any_order & work.vector)


@contextmanager
def watched() -> Iterator[dict[str, Recipe]]:
    """Note the recipes, by name, of all kernels that are asked for."""
    used: dict[str, Recipe] = {}

    def noting(function: Any) -> Any:
        def noted(recipe: Recipe, *arguments: Any, **more: Any) -> Any:
            used[recipe.name] = recipe
            return function(recipe, *arguments, **more)
        return noted

    places = [(module, name, vars(module)[name]) for key, module in list(sys.modules.items())
              if key.startswith("servotwin.") for name in _NAMES if callable(vars(module).get(name))]
    try:
        for module, name, function in places:
            setattr(module, name, noting(function))
        yield used
    finally:
        for module, name, function in places:
            setattr(module, name, function)
