"""Derive one module from the kernels and laws, mechanically: plain Python that the translator can print as C.

Starting from the entries, every function that is called is collected from its own module under the name
`package_module__function`; constants come along by value, classes are imported from where they are. A kernel is changed
in these ways only: docstrings and annotations are dropped; what a recipe has no use for is left out, and what plain
Python alone does (`if PLAIN`); in the float32 form every float literal gets that type; in the vector form exponentials,
logarithms, sines and floors become those of `engine.elementary`, and the sums of functions that a module names
`IN_ANY_ORDER` are taken so; those that it names in `CALLED` are not inlined. A constant that it names in `ONLY_FOR` is
empty where nothing is left of what needs it.
"""

from __future__ import annotations

import ast
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from types import FunctionType
from typing import Any, cast

from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.rewriting import (
    DOUBLE,
    ELEMENTARY,
    EVERYWHERE,
    Rewriting,
    definition,
    flat_name,
    local_names,
)

_PRIMITIVES = ("fma", "two_power", "binary_exponent", "scaled", "nearest", "floor")  # single instructions
_ADDRESSES = "servotwin.simulation.compile.addresses"
_LONG = 12  # a tuple of more numbers is a table


@dataclass(frozen=True, eq=False)
class Derived:
    """A derived module.

    Attributes
    ----------
    recipe : Recipe
    functions : dict of str to ast.FunctionDef
        By their names in the module, each after those that it calls.
    head : str
        Imports and constants.
    primitives : dict of str to str
        What C has an expression for, by its name in the module.
    in_any_order : frozenset of str
        Functions whose sums may be taken in any order.
    called : frozenset of str
        Functions that are called where others are inlined.
    entries : dict of str to str
        Names in the module, by those of the entries.
    vector : frozenset of str
        Functions in the vector form: all of them, or those of parts of the recipe.
    """

    recipe: Recipe
    functions: dict[str, ast.FunctionDef]
    head: str
    primitives: dict[str, str]
    in_any_order: frozenset[str]
    called: frozenset[str]
    entries: dict[str, str]
    vector: frozenset[str] = frozenset()

    @cached_property
    def space(self) -> dict[str, Any]:
        """Constants and classes, by their names in the module."""
        space: dict[str, Any] = {}
        exec(self.head, space)
        return space

    @property
    def text(self) -> str:
        """The module as plain Python."""
        functions = (f"\n\n{ast.unparse(node)}\n" for node in self.functions.values())
        entries = (f"{entry} = {name}\n" for entry, name in self.entries.items())
        return "".join([self.head, *functions, "\n\n", *entries])


def derive(recipe: Recipe) -> Derived:
    """Derive a module."""
    work = Derivation(recipe)
    names = [work.function(*entry.split(":")) for entry in recipe.entries]
    lines = ["# Derived from servotwin's kernels; do not edit.", "import math", "", "import numpy as np", ""]
    lines += [f"from {module} import {name} as {alias}" for alias, (module, name) in sorted(work.imports.items())]
    lines += ["", f"_f = np.{'float32' if recipe.single else 'float64'}", ""]
    lines += [f"{alias} = {text}" for alias, text in sorted(work.constants.items())]
    entries = dict(zip((entry.split(":")[1] for entry in recipe.entries), names, strict=True))
    return Derived(recipe, {name: work.functions[name] for name in work.order}, "\n".join([*lines, ""]),
                   work.primitives, frozenset(work.in_any_order), frozenset(work.called), entries,
                   frozenset(work.vector))


@dataclass
class Derivation:
    """The functions, constants and imports collected so far."""

    recipe: Recipe
    order: list[str] = field(default_factory=list)
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    imports: dict[str, tuple[str, str]] = field(default_factory=dict)
    primitives: dict[str, str] = field(default_factory=dict)
    in_any_order: set[str] = field(default_factory=set)
    called: set[str] = field(default_factory=set)
    vector: set[str] = field(default_factory=set)
    part: str = ""

    def function(self, module: str, name: str) -> str:
        """Collect a function after those that it calls, and return its name in the derived module."""
        for part in self.recipe.parts:
            if f"{module}:{name}" in part.entries:
                whole = self.recipe
                self.recipe, self.part = replace(part, never=(*part.never, *whole.never)), f"_{part.name}"
                flat = self._function(module, name)
                self.recipe, self.part = whole, ""
                return flat
        return self._function(module, name)

    def _function(self, module: str, name: str) -> str:
        flat = flat_name(module, name) + self.part
        if flat not in self.functions:
            self.functions[flat] = node = definition(module, name)  # marks a call of itself
            if self.recipe.vector:
                self.vector.add(flat)
            if name in getattr(import_module(module), "IN_ANY_ORDER", ()):
                self.in_any_order.add(flat)
            if name in getattr(import_module(module), "CALLED", ()):
                self.called.add(flat)
            rewritten = Rewriting(self, module, local_names(node)).visit(node)
            rewritten.name = flat
            self.functions[flat] = ast.fix_missing_locations(rewritten)
            self.order.append(flat)
        return flat

    def value(self, module: str, name: str, value: object) -> str:
        """Return the name in the derived module of what `module` calls `name`."""
        if isinstance(value, FunctionType):
            return self._callable(value)
        flat = flat_name(module, name)
        if self.recipe.in_floats:
            value = getattr(import_module(module), "IN_FLOATS", {}).get(name, value)
        if isinstance(value, type):
            flat = flat_name(value.__module__, value.__name__)
            self.imports[flat] = (value.__module__, value.__name__)
        elif name == "SINGLE":
            self.constants[flat] = repr(self.recipe.single)
        elif self.recipe.excluded.issuperset(getattr(import_module(module), "ONLY_FOR", {}).get(name, ("",))):
            flat += self.part  # where all is known it may be needed
            self.constants[flat] = "()"
        else:
            self.constants[flat] = self._constant(module, value)
        return flat

    def _callable(self, function: FunctionType) -> str:
        module, name = function.__module__, function.__name__
        if hasattr(function, "text"):
            return self._generated(function)
        if module == _ADDRESSES or (module in (ELEMENTARY, EVERYWHERE) and name in _PRIMITIVES):
            flat = flat_name(module, name)
            self.imports[flat], self.primitives[flat] = (module, name), name
            return flat
        return self.function(module, name)

    def _generated(self, function: Any) -> str:
        """Collect a function of `engine.records`, which comes as text."""
        flat = flat_name(function.__module__, function.__name__) + self.part
        if flat not in self.functions:
            if self.recipe.vector:
                self.vector.add(flat)
            aliases = {name: self.value(kind.__module__, name, kind) for name, kind in function.kinds.items()}
            node = cast("ast.FunctionDef", ast.parse(function.text).body[0])
            for part in ast.walk(node):
                if isinstance(part, ast.Name) and part.id in aliases:
                    part.id = aliases[part.id]
            node.name = flat
            self.functions[flat] = node
            self.order.append(flat)
        return flat

    def typed(self, module: str) -> bool:
        """Tell whether float literals of this module get the type of the recipe."""
        return self.recipe.single and module not in DOUBLE

    def _constant(self, module: str, value: object) -> str:
        if isinstance(value, float):
            text = repr(value) if math.isfinite(value) else f'float("{value}")'
            return f"_f({text})" if self.typed(module) else text
        if isinstance(value, tuple):
            parts = ", ".join(self._constant(module, part) for part in value) + ("," if len(value) == 1 else "")
            if type(value) is tuple and len(value) > _LONG and isinstance(value[0], float | int):
                return f"np.array(({parts}))"  # looked up by number: a tuple would be laid out anew each time
            if type(value) is tuple:
                return f"({parts})"
            return f"{self.value(module, '', type(value))}({parts})"
        if isinstance(value, (bool, int, str)):
            return repr(value)
        raise TypeError(f"{module}: a {type(value).__name__} cannot be carried into compiled code")

