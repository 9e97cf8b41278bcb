"""Derive one module from the kernels and laws, mechanically: plain Python that the translator can print as C.

Starting from the entries, every function that is called is collected from its own module under the name
`package_module__function`, with the name of its part where a recipe has parts; constants come along by value, classes
are imported from where they are. A kernel is changed in these ways only: docstrings and annotations are dropped; what a
recipe has no use for is left out, and what plain Python alone does (`if PLAIN`); in the float32 form every float
literal gets that type; in the vector form exponentials, logarithms, sines and floors become those of
`engine.elementary`, and the sums of functions that a module names `IN_ANY_ORDER` are taken so; those that it names in
`CALLED` are not inlined. A constant that it names in `ONLY_FOR` is empty where nothing is left of what needs it.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, reduce
from importlib import import_module
from types import FunctionType, ModuleType
from typing import Any, cast

from servotwin.models.terms.numbers import NOTHING
from servotwin.physics.pieces import Piece
from servotwin.simulation.compile.recipe import Recipe

# --- How one function is rewritten for compiled code ------------------------------------------------------------------

ELEMENTARY = "servotwin.models.engine.motions.elementary"
EVERYWHERE = "servotwin.physics.elementary"
DOUBLE = ("servotwin.models.state.noise", "servotwin.physics.pieces", EVERYWHERE)  # in float64 throughout
_REPLACED = ("exp", "log", "log1p", "sin", "floor")  # in the vector form, by those of `engine.elementary`
_OF_C = {"power": "pow"}  # by another name
_PRIMITIVE = ("binary_exponent", "scaled")  # of `physics.elementary`, in any form
_PACKAGE = "servotwin."
_MODELS = "servotwin.models."


class Rewriting(ast.NodeTransformer):
    """Rewrites one function: names of other things, literals, annotations."""

    def __init__(self, work: Derivation, module: str, local: set[str]) -> None:
        self._work = work
        self._module = module
        self._local = local
        self._space = vars(import_module(module))
        self._flags: dict[str, ast.expr] = {}  # what a local variable of flags is

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Drop docstring, annotations and decorators."""
        node.returns = None
        node.decorator_list = []
        for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
            argument.annotation = None
        if ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:]
        self._flags = _given_once(_function(self._module, node.name))
        node.body = self._reached(node.body) or [ast.Pass()]
        self._by_place(node.args)
        node.args.defaults = [self.visit(default) for default in node.args.defaults]
        return node

    def _by_place(self, arguments: ast.arguments) -> None:
        """Let arguments that have to be named be named or not, for C has no others."""
        named = list(zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True))
        for argument, default in sorted(named, key=lambda pair: pair[1] is not None):
            arguments.args.append(argument)
            if default is not None or arguments.defaults:  # None: it has to be given all the same
                arguments.defaults.append(default or ast.Constant(None))
        arguments.kwonlyargs, arguments.kw_defaults = [], []

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        """Leave out the branch that is not taken."""
        known = self._truth(node.test)
        if known is not None:
            return self._reached(node.body if known else node.orelse)
        node.test = self.visit(node.test)
        node.body, node.orelse = self._reached(node.body) or [ast.Pass()], self._reached(node.orelse)
        return node

    def visit_For(self, node: ast.For) -> ast.AST:
        """Leave out what is not reached in a round."""
        node.target, node.iter = self.visit(node.target), self.visit(node.iter)
        node.body, node.orelse = self._reached(node.body) or [ast.Pass()], self._reached(node.orelse)
        return node

    def visit_While(self, node: ast.While) -> ast.AST:
        """Leave out what is not reached in a round."""
        node.test = self.visit(node.test)
        node.body, node.orelse = self._reached(node.body) or [ast.Pass()], self._reached(node.orelse)
        return node

    def _reached(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Return statements rewritten, but for those behind one that always leaves."""
        found: list[ast.stmt] = []
        for statement in statements:
            new = self.visit(statement)
            found += [one for one in (new if isinstance(new, list) else [new]) if not isinstance(one, ast.Pass)]
            if found and _leaves(found[-1]):
                break
        return found

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        """Leave out the value that is not taken."""
        known = self._truth(node.test)
        if known is None:
            return self.generic_visit(node)
        return cast("ast.AST", self.visit(node.body if known else node.orelse))

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        """Leave out what decides nothing."""
        decided = self._truth(node)
        if decided is not None:
            return ast.Constant(decided)
        left = [self.visit(value) for value in node.values if self._truth(value) is None]
        return left[0] if len(left) == 1 else ast.copy_location(ast.BoolOp(node.op, left), node)

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        """Tell the outcome where it is known."""
        known = self._truth(node)
        return self.generic_visit(node) if known is None else ast.Constant(known)

    def _truth(self, node: ast.expr) -> bool | None:
        """Return whether a condition holds for all that a recipe is for; None where it depends."""
        if isinstance(node, ast.Name) and node.id == "PLAIN":  # what plain Python alone does
            return False
        if not self._work.recipe.absent and not self._work.recipe.excluded:
            return None
        if isinstance(node, ast.BoolOp):
            parts = [self._truth(value) for value in node.values]
            decisive = isinstance(node.op, ast.Or)
            if decisive in parts:
                return decisive
            return None if None in parts else not decisive
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            inner = self._truth(node.operand)
            return None if inner is None else not inner
        if isinstance(node, ast.Call):
            line = self._line(node)
            return None if line is None else line[0]._truth(line[1])
        if isinstance(node, ast.BinOp):
            return False if self._possible(node) == 0 else None
        if not isinstance(node, ast.Compare) or len(node.ops) != 1:
            return None
        sides, op = (node.left, node.comparators[0]), node.ops[0]
        never = self._work.recipe.excluded
        if any(isinstance(side, ast.Name | ast.Attribute) and _last(side) in never for side in sides):
            return {ast.Eq: False, ast.NotEq: True}.get(type(op))
        if isinstance(op, ast.Gt) and self._number(sides[1]) == 0.0 and self._is_present(sides[0]):
            return True
        a, b = (self._number(side) for side in sides)
        compare = _COMPARISONS.get(type(op))
        return None if a is None or b is None or compare is None else bool(compare(a, b))

    def _line(self, node: ast.Call) -> tuple[Rewriting, ast.expr] | None:
        """Return what a called function of one line returns, such as `heat.present(numbers.heat)`."""
        if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            called = getattr(self._space.get(node.func.value.id), node.func.attr, None)
        else:
            called = self._space.get(_last(node.func))
        if not isinstance(called, FunctionType) or not called.__module__.startswith(_MODELS) or hasattr(called, "text"):
            return None
        body = _function(called.__module__, called.__name__).body
        line = body[-1]
        if len(body) > 2 or not isinstance(line, ast.Return) or line.value is None:
            return None
        return Rewriting(self._work, called.__module__, set()), line.value

    def _possible(self, node: ast.expr) -> int | None:
        """Return all flags that a number may have; None where that is not known."""
        if isinstance(node, ast.Constant):
            return node.value if type(node.value) is int else None
        if isinstance(node, ast.Name):
            value = self._space.get(node.id) if node.id not in self._local else None
            given = self._flags.get(node.id)
            return value if type(value) is int else None if given is None else self._possible(given)
        if isinstance(node, ast.IfExp):
            known = self._truth(node.test)
            parts = [node.body, node.orelse] if known is None else [node.body if known else node.orelse]
            bits = [self._possible(part) for part in parts]
            return None if None in bits else reduce(operator.or_, cast("list[int]", bits))
        if isinstance(node, ast.Call):
            line = self._line(node)
            return None if line is None else line[0]._possible(line[1])
        if isinstance(node, ast.BinOp) and type(node.op) in _FLAG_OPERATIONS:
            a, b = self._possible(node.left), self._possible(node.right)
            return None if a is None or b is None else _FLAG_OPERATIONS[type(node.op)](a, b)
        return None

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Tell the outcome where it is known."""
        known = self._truth(node)
        return self.generic_visit(node) if known is None else ast.Constant(known)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        """Tell the outcome where it is known."""
        known = self._truth(node)
        return self.generic_visit(node) if known is None else ast.Constant(known)

    def _number(self, node: ast.expr) -> float | None:
        """Return the value of a number that is known."""
        if isinstance(node, ast.Constant) and isinstance(node.value, float | int):
            return node.value
        if isinstance(node, ast.Attribute):
            return math.inf if ast.unparse(node) == "math.inf" else self._absent(node)
        return None

    def _is_present(self, node: ast.expr) -> bool:
        """Tell whether a number is certainly positive."""
        return isinstance(node, ast.Attribute) and f"{_last(node.value)}.{node.attr}" in self._work.recipe.present

    def _absent(self, node: ast.Attribute) -> float | None:
        """Return the neutral value of a number that is absent; a term goes by the name of its record."""
        known = _neutral(self._work.recipe.absent)
        return known.get(node.attr, known.get(f"{_last(node.value)}.{node.attr}"))

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        """Drop the annotation of a local variable."""
        if node.value is None:
            return ast.Pass()
        return ast.Assign(targets=[self.visit(node.target)], value=self.visit(node.value))

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Give what is not local its name in the derived module."""
        name = node.id
        if name in self._local or name not in self._space:
            if name == "float" and self._work.typed(self._module):
                return ast.copy_location(ast.Name("_f", node.ctx), node)
            if name not in self._local and not hasattr(builtins, name):
                raise NameError(f"{self._module}: {name} is not known")
            return node
        value = self._space[name]
        if isinstance(value, ModuleType):
            return node
        if isinstance(value, FunctionType) and value.__module__ == EVERYWHERE:
            in_double, recipe = self._module in DOUBLE, self._work.recipe
            if recipe.vector and name in _REPLACED and not in_double:
                return self._of_vectors(name, node)
            if recipe.single and not in_double and name not in _PRIMITIVE:
                return ast.parse(f"math.{_OF_C.get(name, name)}", mode="eval").body
        return ast.copy_location(ast.Name(self._work.value(*_home(self._module, name, value)), node.ctx), node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """Flatten `module.name`, and put in the value of what is absent."""
        owner = node.value
        value = self._absent(node)
        if value is not None and isinstance(node.ctx, ast.Load):
            text = f"_f({value!r})" if math.isfinite(value) else "_f(math.inf)"
            return ast.parse(text, mode="eval").body
        if isinstance(owner, ast.Name) and owner.id not in self._local:
            module = self._space.get(owner.id)
            if isinstance(module, ModuleType):
                return self._of_module(module, node)
        return self.generic_visit(node)

    def _of_module(self, module: ModuleType, node: ast.Attribute) -> ast.AST:
        if module is math:
            if self._work.recipe.vector and node.attr in _REPLACED and self._module not in DOUBLE:
                return self._of_vectors(node.attr, node)
            if isinstance(getattr(math, node.attr), float):
                return self._typed(node)
            return node
        if not module.__name__.startswith(_PACKAGE):
            raise NameError(f"{self._module}: {module.__name__} is out of a kernel's reach")
        flat = self._work.value(*_home(module.__name__, node.attr, getattr(module, node.attr)))
        return ast.copy_location(ast.Name(flat, node.ctx), node)

    def _of_vectors(self, name: str, node: ast.Name | ast.Attribute) -> ast.AST:
        """Return the name of a function that a compiler can run in many lanes side by side."""
        flat = self._work.value(ELEMENTARY, name, getattr(import_module(ELEMENTARY), name))
        return ast.copy_location(ast.Name(flat, node.ctx), node)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        """Give a float literal its type."""
        return self._typed(node) if isinstance(node.value, float) else node

    def _typed(self, node: ast.expr) -> ast.expr:
        if not self._work.typed(self._module):
            return node
        return ast.copy_location(ast.Call(ast.Name("_f", ast.Load()), [node], []), node)


_FLAG_OPERATIONS: dict[type[ast.operator], Callable[[int, int], int]] = {
    ast.BitOr: operator.or_, ast.BitAnd: operator.and_}
_COMPARISONS: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge}


@cache
def _neutral(absent: frozenset[str]) -> dict[str, float]:
    """Return the values of numbers that are absent, by "term.number", or of a command by "number"."""
    found: dict[str, float] = {}
    for name in absent:
        room, *fields = name.split(".")
        found[".".join([room, *fields][-2:])] = reduce(getattr, fields, NOTHING[room]) if fields else getattr(
            Piece(), name)
    return found


def _given_once(node: ast.FunctionDef) -> dict[str, ast.expr]:
    """Return the values of local variables that get one once and for all; the tree is not to be changed."""
    found: dict[str, ast.expr] = {}
    stored = [n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
    for part in ast.walk(node):
        if isinstance(part, ast.Assign) and len(part.targets) == 1:
            names, values = part.targets[0], part.value
            pairs = (zip(names.elts, values.elts, strict=False)
                     if isinstance(names, ast.Tuple) and isinstance(values, ast.Tuple) else [(names, values)])
            found |= {name.id: value for name, value in pairs if isinstance(name, ast.Name)}
    return {name: value for name, value in found.items() if stored.count(name) == 1}


def _leaves(node: ast.stmt) -> bool:
    """Tell whether nothing behind a statement is reached."""
    if isinstance(node, ast.If):
        return bool(node.orelse) and _leaves(node.body[-1]) and _leaves(node.orelse[-1])
    return isinstance(node, ast.Return | ast.Break | ast.Continue)


def _last(node: ast.expr) -> str:
    """Return the name, or what stands after the last dot."""
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _home(module: str, name: str, value: object) -> tuple[str, str, object]:
    """Return where a name that `module` has imported comes from, so that it is carried over once."""
    if not isinstance(value, (FunctionType, type)):
        for node in _tree(module).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    if (alias.asname or alias.name) == name:
                        return _home(node.module, alias.name, value)
    return module, name, value


def flat_name(module: str, name: str) -> str:
    """Return what something of a module is called in a derived one."""
    return f"{'_'.join(module.split('.')[-2:])}__{name}"


@cache
def _tree(module: str) -> ast.Module:
    return ast.parse(inspect.getsource(import_module(module)))


@cache
def _functions(module: str) -> dict[str, ast.FunctionDef]:
    return {node.name: node for node in _tree(module).body if isinstance(node, ast.FunctionDef)}


def _function(module: str, name: str) -> ast.FunctionDef:
    """Return a function of a module, in the tree of that; not to be changed."""
    if name not in _functions(module):
        raise NameError(f"{module} has no function {name}")
    return _functions(module)[name]


def definition(module: str, name: str) -> ast.FunctionDef:
    """Return a function of a module as a tree of its own."""
    return cast("ast.FunctionDef", ast.parse(_text(module, name)).body[0])


@cache
def _text(module: str, name: str) -> str:
    return ast.unparse(_function(module, name))


def local_names(node: ast.FunctionDef) -> set[str]:
    """Return the names of arguments and of what a function assigns."""
    names = {argument.arg for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)}
    return names | {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


# --- Derive one module from the kernels and laws, mechanically --------------------------------------------------------

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
        Functions that C has an expression for, by their names in the module.
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
            self.constants[flat] = repr(self.recipe.single or self.recipe.in_floats)
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
