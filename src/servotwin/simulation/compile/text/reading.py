"""Which numbers of the terms a recipe's kernels do not cover, found by which of their functions read them.

Numbers that they do not cover would be as if they were not there. They cover a number that a function of their own
reads, which the general form has not. Else all functions that read it in the general form have to be among them, and no
function of their own may read what these read beside it: it would be another form of their law; and it may not belong
to a term that is left out. Of a number whose term says where it acts, less is asked: they cover it where they read
it at all, and need not where they follow nothing of that.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import replace

from servotwin.models.engine.log import WITH_ROWS
from servotwin.models.state import records
from servotwin.models.terms.numbers import ACTS, paths
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.signatures import signatures
from servotwin.simulation.compile.text.derive import derive, flat_name
from servotwin.simulation.compile.text.inference import Module, Specialised
from servotwin.simulation.compile.text.kinds import Kind, Record, Tuple
from servotwin.simulation.compile.text.unread import in_general

_Number = tuple[tuple[str, ...], str]  # the fields of its record, and its own name
_RUNS = tuple(f"servotwin.models.engine.run.runs:{name}" for name in ("start", "go_on"))
_COPYING = flat_name(records.__name__, "")  # functions that only take records out of memory, or put them there


def unread_numbers(recipe: Recipe, of: tuple[str, ...]) -> Iterator[str]:
    """Return the numbers that the general form reads and a recipe's kernels do not cover, as `unread` keeps them."""
    never = {*in_general(recipe).never, *WITH_ROWS}
    general = _readers(replace(recipe, entries=_RUNS, vector=False, single=False, never=tuple(sorted(never))))
    own = _readers(recipe, of)
    by_itself = set().union(*(own[name] for name in own.keys() - general.keys()))
    left_out = {path.split(".")[0] for path in ACTS} - {path.split(".")[0] for path in ACTS.keys() - recipe.absent}
    for path, record, number in paths():
        key, acts = (record._fields, number), ACTS.get(path, 0)
        there = {name for name, read in general.items() if key in read}
        beside = {other for name in there for other in general[name] if other[0] == key[0]}
        if acts:
            known = not acts & recipe.knows or any(key in read for read in own.values())
        else:
            known = key in by_itself or (
                path.split(".")[0] not in left_out and there <= own.keys() and not beside & by_itself)
        if there and not known:
            yield path


def _readers(recipe: Recipe, of: tuple[str, ...] = ()) -> dict[str, set[_Number]]:
    """Return what each function reads that is called."""
    derived = derive(recipe)
    module = Module(derived)
    waiting = [module.specialised(derived.entries[entry], kinds) for entry, kinds in signatures(recipe)]
    if of:
        names = {flat_name(*entry.split(":")) for entry in of}
        waiting = [own for (name, _), own in module.known.items() if name in names]
    found, seen = dict[str, set[_Number]](), set[Specialised]()
    while waiting:
        own = waiting.pop()
        if own not in seen and not own.node.name.startswith(_COPYING):
            seen.add(own)
            waiting += own.calls.values()
            found.setdefault(own.node.name, set()).update(_read_in(own))
    return found


def _read_in(own: Specialised) -> Iterator[_Number]:
    """Return the numbers that a function reads, but for those that it hands on to the next record of their kind."""
    nodes = list(ast.walk(own.node))
    handed = {argument for node in nodes if isinstance(node, ast.Call) and node not in own.calls
              for argument, name in zip(node.args, _fields(own.kinds.get(node)), strict=False)
              if isinstance(argument, ast.Attribute) and argument.attr == name
              and _fields(own.kinds.get(argument.value)) == _fields(own.kinds.get(node))}
    return ((_fields(own.kinds.get(node.value)), node.attr) for node in nodes
            if isinstance(node, ast.Attribute) and node not in handed)


def _fields(kind: Kind | None) -> tuple[str, ...]:
    """Return by what records are distinguished: the names of their fields."""
    return kind.fields if isinstance(kind, Tuple) else kind.dtype.names or () if isinstance(kind, Record) else ()
