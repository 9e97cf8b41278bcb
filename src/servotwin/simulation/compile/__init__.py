"""Kernels: derived from the engine, printed as C, found or built as libraries, called from Python and from C."""

from __future__ import annotations

import threading
import warnings
from functools import cache
from typing import Any

from servotwin.simulation.compile.backend import is_plain, use_plain
from servotwin.simulation.compile.finding import WAY_OUT, is_ready, problems, source_key
from servotwin.simulation.compile.recipe import Recipe

__all__ = ["Recipe", "is_compiled", "is_plain", "kernels", "source_key"]

_lock = threading.Lock()


def kernels(recipe: Recipe) -> Any:
    """Return the kernels of a recipe, each under the name of its entry.

    Where there is neither a library nor a compiler they run in plain Python from then on, which is said once.
    """
    with _lock:
        return _in_python(recipe) if is_plain() else _kernels(recipe)


def is_compiled(recipe: Recipe) -> bool:
    """Tell whether there is a library of a recipe, in the package or in the cache."""
    return is_ready(recipe)


@cache
def _kernels(recipe: Recipe) -> Any:
    from servotwin.simulation.compile.library import loaded  # nothing of it before it is needed

    found = loaded(recipe)
    if found is None:
        use_plain()
        warnings.warn(f"{'; '.join(problems)}: many servos run in plain Python, a hundred times slower. {WAY_OUT}",
                      RuntimeWarning, stacklevel=4)
        return _in_python(recipe)
    return found


def _in_python(recipe: Recipe) -> Any:
    from servotwin.simulation.compile.backend import plain_kernels

    return plain_kernels(recipe)
