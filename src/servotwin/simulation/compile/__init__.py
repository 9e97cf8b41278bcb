"""Compile the kernels: derive a real module from them, keep it in the user's cache, let numba compile it once."""

from __future__ import annotations

import sys
import threading
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import cast

from servotwin import physics
from servotwin.models import engine, terms
from servotwin.simulation.compile import derive as derive_module
from servotwin.simulation.compile.derive import Recipe, derive, surroundings
from servotwin.simulation.compile.storage import is_stored, key_of, loaded, stored

__all__ = ["Recipe", "is_compiled", "kernels", "source_key", "unread"]

_lock = threading.Lock()


def kernels(recipe: Recipe) -> ModuleType:
    """Return the derived module, with the recipe's entries compiled when they are first called.

    The first time on a machine a line on standard error says that this takes a while.
    """
    with _lock:
        return _kernels(recipe)


@cache
def _sources() -> tuple[str, ...]:
    """Return the text of everything from which a module is derived; to read it is quicker than to derive."""
    files = [Path(derive_module.__file__).with_name(name) for name in ("derive.py", "reading.py")]
    for package in (physics, terms, engine):
        files += sorted(Path(package.__path__[0]).glob("*.py"))
    return tuple(file.read_text(encoding="utf-8") for file in files)


def source_key() -> str:
    """Return a short name for all that compiled code depends on, a recipe apart."""
    return key_of(*_sources(), version("numba"), version("llvmlite"))


def is_compiled(recipe: Recipe) -> bool:
    """Tell whether this machine has compiled a recipe before, without loading the compiler."""
    return is_stored(_name(recipe))


@cache
def _name(recipe: Recipe) -> str:
    return f"servotwin_{recipe.name}_{key_of(source_key(), surroundings(recipe))}"


@cache
def _kernels(recipe: Recipe) -> ModuleType:
    path, known = stored(_name(recipe), lambda: derive(recipe))
    if not known:
        sys.stderr.write("servotwin: compiling the kernels for this machine, once (10 to 25 s)\n")
        sys.stderr.flush()
    import_module("numba")
    return loaded(path)


@cache
def unread(recipe: Recipe) -> tuple[str, ...]:
    """Return the numbers of terms that a recipe does not know and others do, found once on a machine.

    Lanes in which they are not neutral are not for it.
    """
    def text() -> str:
        from servotwin.simulation.compile import reading
        return f"NUMBERS = {reading.unread(recipe)!r}\n"

    with _lock:
        path, _ = stored(f"{_name(recipe)}_unread", text)
        return cast("tuple[str, ...]", loaded(path).NUMBERS)
