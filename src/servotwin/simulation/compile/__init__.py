"""Compile the kernels: derive them, print them as C, build or find their libraries, call them."""

from __future__ import annotations

import threading
from functools import cache
from typing import Any

from servotwin.simulation.compile.building import is_ready, source_key
from servotwin.simulation.compile.derive import Recipe
from servotwin.simulation.compile.library import loaded

__all__ = ["Recipe", "is_compiled", "kernels", "source_key"]

_lock = threading.Lock()


def kernels(recipe: Recipe) -> Any:
    """Return the kernels of a recipe, each under the name of its entry."""
    with _lock:
        return _kernels(recipe)


def is_compiled(recipe: Recipe) -> bool:
    """Tell whether there is a library of a recipe, in the package or in the cache."""
    return is_ready(recipe)


@cache
def _kernels(recipe: Recipe) -> Any:
    return loaded(recipe)
