"""Which numbers of the terms a recipe's kernels do not cover, as `reading` finds it: kept beside the kernels."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace
from functools import cache

from servotwin.simulation.compile.finding import shipped_folder, source_key
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.storage import is_there, kept_folder, key_of, write

IN_GENERAL = "_in_general"
FROM_TICK_TO_TICK = ("LEGS", "SPRING_LEGS", "POWER_SERIES")  # ways to advance that a program may take


@cache
def in_general(recipe: Recipe) -> Recipe:
    """Return a recipe in which no way to advance is chosen by the numbers that it covers."""
    return replace(recipe, name=recipe.name + IN_GENERAL, knows=-1, always=0, parts=(),
                   never=(*recipe.never, *FROM_TICK_TO_TICK))


@cache
def unread(recipe: Recipe, of: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the numbers that the general form reads and a recipe's kernels do not cover ("friction.K_m", "chip.beta").

    With `of`, "module:function", it is asked of what these call alone. The answer is kept beside the kernels.
    """
    name = f"{recipe.name}-unread-{key_of(source_key(), repr((recipe, of)))}.json"
    kept = kept_folder() / name
    for path in (shipped_folder() / name, *([kept] if is_there(kept) else [])):
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
            return tuple(map(str, json.loads(path.read_text(encoding="utf-8"))["unread"]))
    from servotwin.simulation.compile.text.reading import unread_numbers  # which translates

    found = tuple(unread_numbers(recipe, of))
    with contextlib.suppress(OSError):  # to find it again costs its time alone
        kept.parent.mkdir(0o700, parents=True, exist_ok=True)
        write(kept, json.dumps({"unread": found}))
    return found
