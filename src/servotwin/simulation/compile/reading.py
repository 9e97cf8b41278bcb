"""Which numbers of the terms a derived module knows, told by what its functions read, as their annotations have it.

A module knows a number if every function that reads it in the general form is in the module as well, or if a function
of its own reads it. What it does not know would be as if it were not there.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from typing import Any, get_args, get_origin

from servotwin.models.terms.chip import Chip
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.numbers import NEUTRAL, Numbers
from servotwin.simulation.compile.derive import Derivation, Recipe

_RUNS = tuple(f"servotwin.models.engine.runs:{name}" for name in ("start", "go_on"))
_STEPS = ("GLIDES",)  # what the general form does not do: it goes from event to event


def unread(recipe: Recipe) -> tuple[str, ...]:
    """Return the numbers that the general form reads and a recipe does not know ("friction.K_m", "chip.beta").

    The general form has none of the recipe's absent terms either, but only their first numbers say so.
    """
    general = Recipe("general", _RUNS, absent=tuple(map(_told, recipe.absent)), never=(*recipe.never, *_STEPS),
                     present=recipe.present)
    own, reference = Readers(recipe), Readers(general)
    found = [key for key, readers in reference.items()
             if not (readers <= own.functions or own.get(key, set()) - reference.functions)]
    places: Iterator[tuple[str, Any]] = iter((*_hints(Numbers).items(), ("chip", Chip), ("firmware", Firmware)))
    return tuple(path for room, kind in places for path, key in _paths(room, kind)
                 if key in found and path not in recipe.spares)


def _told(name: str) -> str:
    """Return the number that tells of an absent term that it is absent."""
    return f"{name}.{getattr(NEUTRAL, name)._fields[0]}" if name in Numbers._fields else name


def _paths(path: str, kind: Any) -> Iterator[tuple[str, tuple[Any, str]]]:
    """Return the numbers of a record and of those in it."""
    for name, hint in _hints(kind).items():
        if hasattr(hint, "_fields"):
            yield from _paths(f"{path}.{name}", hint)
        else:
            yield f"{path}.{name}", (kind, name)


class Readers(dict[tuple[Any, str], set[str]]):
    """Which functions of a recipe's module read a number, by its record and its name, and all that are ever called."""

    def __init__(self, recipe: Recipe) -> None:
        super().__init__()
        self.work, self.functions = Derivation(recipe), set[str]()
        waiting = [self.work.function(*entry.split(":")) for entry in recipe.entries]
        while waiting:
            flat = waiting.pop()
            home = self.work.homes.get(flat)
            if home is not None and not hasattr(home, "text") and flat not in self.functions:
                self.functions.add(flat)
                function = _Function(self, flat)
                function.run(ast.parse(self.work.functions[flat]).body)
                waiting += function.called


class _Function(ast.NodeVisitor):
    """Follows the types of local variables through one function, as far as it can be run."""

    def __init__(self, readers: Readers, flat: str) -> None:
        self.called: set[str] = set()
        self._readers, self._flat, self._work = readers, flat, readers.work
        self._types = dict(_hints(self._work.homes[flat]))

    def run(self, body: Iterable[ast.stmt]) -> None:
        """Visit statements up to one that returns."""
        for statement in body:
            self.visit(statement)
            if isinstance(statement, ast.Return):
                return

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Visit what is in it."""
        self.run(node.body)

    def visit_If(self, node: ast.If) -> None:
        """Visit both branches."""
        self.visit(node.test)
        self.run(node.body)
        self.run(node.orelse)

    def visit_Assign(self, node: ast.Assign) -> None:
        """Learn what a variable is."""
        self.generic_visit(node)
        for target in node.targets:
            self._learn(target, node.value, self._type(node.value))

    def visit_Name(self, node: ast.Name) -> None:
        """Note that a function is called, or handed on."""
        self.called.add(node.id)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        """Note that a number is read."""
        self.generic_visit(node)
        kind = self._type(node.value)
        if isinstance(node.ctx, ast.Load) and kind in _records() and _hints(kind).get(node.attr) is float:
            self._readers.setdefault((kind, node.attr), set()).add(self._flat)

    def visit_Call(self, node: ast.Call) -> None:
        """Pass over the numbers of a record that are only handed to the next one of its kind."""
        kind = self._type(node)
        copied = kind._fields if kind in _records() and isinstance(node.func, ast.Name) and (
            node.func.id in self._work.imports) else ()
        self.visit(node.func)
        for k, argument in enumerate(node.args):
            if not (k < len(copied) and isinstance(argument, ast.Attribute) and argument.attr == copied[k]
                    and self._type(argument.value) is kind):
                self.visit(argument)
        for word in node.keywords:
            self.visit(word.value)

    def _learn(self, target: ast.expr, value: ast.expr | None, kind: Any) -> None:
        if isinstance(target, ast.Name):
            self._types[target.id] = kind
        elif isinstance(target, ast.Tuple):
            values: list[Any] = value.elts if isinstance(value, ast.Tuple) else [None] * len(target.elts)
            kinds = ([self._type(one) for one in values] if isinstance(value, ast.Tuple) else
                     [_hints(kind).get(name) for name in kind._fields] if hasattr(kind, "_fields") else
                     list(get_args(kind)) if get_origin(kind) is tuple else [None] * len(values))
            for one, own, its in zip(target.elts, values, kinds, strict=False):
                self._learn(one, own, its)

    def _type(self, node: ast.expr) -> Any:
        """Return the type of a value where it is told; where it is not, a term goes by the name of its record."""
        match node:
            case ast.Name(id=name):
                return self._types.get(name) or _rooms().get(name)
            case ast.Attribute(value=owner, attr=name):
                told = _hints(self._type(owner)).get(name)
                return _rooms().get(name) if told in (None, Any) else told
            case ast.Subscript(value=owner):
                whole = self._type(owner)
                parts = get_args(whole)
                return parts[0] if parts else whole if whole in _records() else None
            case ast.IfExp(body=one, orelse=other):
                return self._type(one) or self._type(other)
            case ast.Call(func=ast.Name(id=name)) if name in self._work.imports:
                return getattr(import_module(self._work.imports[name][0]), self._work.imports[name][1], None)
            case ast.Call(func=ast.Name(id=name)) if name in self._work.homes:
                return _hints(self._work.homes[name]).get("return")
        return None


@cache
def _hints(of: Any) -> dict[str, Any]:
    """Return the annotations of a function or a record, but for those that are only known to a type checker."""
    if hasattr(of, "text"):
        value: Any = ast.parse(of.text).body[0]
        made = getattr(value.body[-1], "value", None)
        return {"return": of.kinds.get(ast.unparse(made.func))} if isinstance(made, ast.Call) else {}
    space, found = vars(import_module(of.__module__)) if hasattr(of, "__module__") else {}, {}
    for name, hint in getattr(of, "__annotations__", {}).items():
        text = getattr(hint, "__forward_arg__", hint)
        try:
            found[name] = eval(text, dict(space)) if isinstance(text, str) else hint
        except NameError:
            continue
    return found


@cache
def _rooms() -> dict[str, Any]:
    return {**_hints(Numbers), "chip": Chip, "firmware": Firmware}


@cache
def _records() -> frozenset[Any]:
    """Return the records of all terms, and those in them."""
    return frozenset(kind for room, its in _rooms().items() for _, (kind, _) in _paths(room, its))
