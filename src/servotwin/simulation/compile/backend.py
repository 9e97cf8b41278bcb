"""Kernels without a compiler: the derived text as it stands, in plain Python.

Slow, but what is compiled says the same. Numbers of arrays are NumPy's, which have inf or nan where C has them; where
Python raises an error instead, what a compiled kernel would make of such numbers is put in its place, for one servo.
"""

from __future__ import annotations

import ctypes
import linecache
import math
import os
from collections.abc import Callable, Sequence
from functools import cache, wraps
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.models.engine.memory import Memory, time_of
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.engine.observe import Observed
from servotwin.models.engine.step import DIVERGED
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.text.derive import derive

# --- Kernels without a compiler: the derived text as it stands, in plain Python ---------------------------------------

@cache
def plain_kernels(recipe: Recipe) -> ModuleType:
    """Return the derived module, whose entries are Python functions."""
    module = plain_module(recipe)
    for entry in recipe.entries:
        name = entry.partition(":")[2]
        setattr(module, name, _quiet(getattr(module, name)))
    return module


def plain_module(recipe: Recipe) -> ModuleType:
    """Return the derived text as a module, in which a servo whose numbers leave the range of floats fails alone."""
    name, text = f"<{recipe.name}, derived>", derive(recipe).text
    linecache.cache[name] = len(text), None, text.splitlines(keepends=True), name  # for tracebacks
    module = ModuleType(recipe.name)
    exec(compile(text, name, "exec"), vars(module))
    for flat, instead in _INSTEAD.items():
        if hasattr(module, flat):
            setattr(module, flat, _guarded(getattr(module, flat), instead))
    return module


def address_of(function: Callable[..., int | None], result: Any, *arguments: Any) -> int:
    """Return the address of a Python function for C, for as long as this process lives."""
    callback = ctypes.CFUNCTYPE(result, *arguments)(function)
    _callbacks.append(callback)
    return address(callback)


def address(callback: Any) -> int:
    """Return the address of a callback of ctypes."""
    return int(ctypes.cast(callback, ctypes.c_void_p).value or 0)


_callbacks: list[Any] = []


def _quiet(entry: FunctionType) -> Callable[..., Any]:
    """Return a kernel that divides by zero without a word."""
    @wraps(entry)
    def run(*arguments: Any, **named: Any) -> Any:
        with np.errstate(all="ignore"):
            return entry(*arguments, **named)

    return run


def _guarded(function: FunctionType, instead: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that returns something else where numbers leave the range of floats."""
    @wraps(function)
    def run(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except (ArithmeticError, ValueError):
            return instead(*arguments)

    return run


def _lost_step(numbers: Any, chip: Any, inputs: Any, memory: Memory, m: Motion,
               until: float) -> tuple[Memory, Motion, int, int]:
    return memory, m, -1, DIVERGED


def _lost_run(numbers: Any, chip: Any, inputs: Any, memory: Memory, *_: Any) -> tuple[Memory, int]:
    return memory, DIVERGED


def _lost_bus(inputs: Any, memories: Sequence[Memory], *_: Any) -> tuple[int, float]:
    return DIVERGED, time_of(memories[0])


def _not_calm(numbers: Any, u: float, tau: float, q: float, w: float, time: float) -> tuple[float, float, bool]:
    return q, w, False


def _mode_so_far(numbers: Any, u: Any, tau: Any, memory: Memory) -> Any:
    return memory.point.mode


def _nothing_seen(*_: Any) -> Observed:
    return Observed(*[math.nan] * len(Observed._fields))


def _no_marks(*_: Any) -> int:
    return 0


def _no_solution(square: Any, x: NDArray[np.float64]) -> None:
    x[:] = math.nan


_INSTEAD: dict[str, Callable[..., Any]] = {
    "engine_step__step": _lost_step, "run_runs__run": _lost_run, "bus_event_queue__through": _lost_bus,
    "batch_event_free__after": _not_calm, "run_run__mode_under": _mode_so_far,
    "engine_observe__observed": _nothing_seen, "engine_cosim__marks": _no_marks,
    "robots_joints___solve": _no_solution}


# --- How kernels run --------------------------------------------------------------------------------------------------

_VARIABLE = "SERVOTWIN_BACKEND"
_COMPILED, _PLAIN = "c", "plain"
_without_compiler: list[bool] = []


def is_plain() -> bool:
    """Tell whether kernels run in plain Python.

    Raises
    ------
    InputError
        If the variable says anything else than "plain" or "c".
    """
    return bool(_without_compiler) or _asked() == _PLAIN


def use_plain() -> None:
    """Let kernels run in plain Python from now on."""
    _without_compiler.append(True)


@cache
def _asked() -> str:
    asked = os.environ.get(_VARIABLE) or _COMPILED
    if asked not in (_COMPILED, _PLAIN):
        raise InputError(f"environment variable {_VARIABLE}", got=asked, allowed=f"{_COMPILED} or {_PLAIN}")
    return asked
