"""From a law over numbers to the same law over arrays, derived in memory when it is first called with one.

A law is a pure function: straight lines, conditional expressions and early returns, made of `math`, other laws, named
tuples and constants of its module. Its array form computes both branches and takes from each what the condition says.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import sys
import textwrap
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import cache, wraps
from itertools import count
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

_RENAMED = {"atanh": "arctanh", "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2",
            "pow": "power", "fabs": "abs"}
_ELEMENTARY = "servotwin.physics.elementary"  # whose functions NumPy has too
_BUILTINS = {"abs": "np.abs", "min": "np.minimum", "max": "np.maximum"}
_PLAIN = {float, int, bool, np.float64}
_NO_ARGUMENTS = ast.arguments([], [], None, [], [], None, [])
_COMPARED = (ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE)


def array_form(law: Callable[..., Any], home: str = "servotwin.physics") -> Callable[..., Any]:
    """Return a law that broadcasts over arrays; of numbers alone it returns what the law itself does.

    Parameters
    ----------
    law : callable
        Pure and without loops; its arguments may be named tuples.
    home : str
        The module under whose name the array form is found.

    Examples
    --------
    >>> array_form(ramp)(np.array([-1.0, 0.5, 2.0])), array_form(ramp)(0.5)
    (array([0. , 0.5, 2. ]), 0.5)
    """
    @wraps(law)
    def over_arrays(*args: Any, **more: Any) -> Any:
        if not more and _PLAIN.issuperset(map(type, args)):  # as it is called most often
            return law(*args)
        if any(x is None for x in (*args, *more.values())):  # None says: as if it were not given
            defaults = {name: p.default for name, p in inspect.signature(law).parameters.items()}
            given = dict(zip(defaults, args, strict=False)) | more
            args, more = (), {name: defaults[name] if x is None else x for name, x in given.items()}
        arrays = [*_arrays((*args, *more.values()))]
        if not arrays:
            return law(*args, **more)
        with np.errstate(all="ignore"):
            found = derived(law)(*(_each(_number, x) for x in args),
                                 **{name: _each(_number, x) for name, x in more.items()})
        if not isinstance(found, tuple) and np.shape(found) != (shape := np.broadcast_shapes(*map(np.shape, arrays))):
            found = np.array(np.broadcast_to(found, shape))  # an argument that does not matter counts too
        return _each(_result, found)

    over_arrays.__module__ = home
    return over_arrays


def ramp(x: float) -> float:
    """Return x where it is positive, else 0: the smallest law that decides something.

    Examples
    --------
    >>> ramp(-1.0)
    0.0
    """
    if x < 0.0:
        return 0.0
    return x


@cache
def derived(law: FunctionType) -> Callable[..., Any]:
    """Return what the array form runs; for arrays and numpy's own numbers, whose division by 0 is no error.

    Raises
    ------
    NotImplementedError
        If the law has a loop, or anything else that no array form can follow.
    """
    return _Derivation(law).function()


class _Derivation(ast.NodeTransformer):
    """Writes one function in static single assignment: branches become functions, and are merged where they end."""

    def __init__(self, law: FunctionType) -> None:
        self._law = law
        self._space: dict[str, Any] = {**vars(sys.modules[law.__module__]), "np": np, "where_": _where}
        self._lines: list[str] = []
        self._numbers = count()
        self._names: dict[str, str] = {}  # of the law's variables, as they stand now

    def function(self) -> Callable[..., Any]:
        """Return the derived function."""
        node = ast.parse(textwrap.dedent(inspect.getsource(self._law))).body[0]
        if not isinstance(node, ast.FunctionDef) or node.args.vararg or node.args.kwarg:
            raise self._refused(node)
        arguments = node.args
        for argument in (*arguments.args, *arguments.kwonlyargs):
            argument.annotation = None
            self._names[argument.arg] = argument.arg
        result = self._block(node.body)
        if result is None:
            raise self._refused(node)
        text = "\n    ".join([f"def derived({ast.unparse(arguments)}):", *self._lines,
                              f"return {ast.unparse(result)}"])
        exec(compile(text, f"<array form of {self._law.__module__}.{self._law.__name__}>", "exec"), self._space)
        function: Callable[..., Any] = self._space["derived"]
        return function

    def _block(self, body: list[ast.stmt]) -> ast.expr | None:
        """Write some statements; return what they return."""
        for k, statement in enumerate(body):
            match statement:
                case ast.Return(value=ast.expr() as value):
                    return self._expression(value)
                case ast.Assign(targets=[target], value=value):
                    self._assign(target, self._expression(value))
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    self._assign(target, self._expression(value))
                case ast.AugAssign(target=ast.Name(id=name) as target, op=op, value=value):
                    self._assign(target, self._expression(ast.BinOp(ast.Name(name, ast.Load()), op, value)))
                case ast.Expr(value=ast.Constant(value=str())):
                    continue
                case ast.If():
                    returns = any(isinstance(node, ast.Return) for node in ast.walk(statement))
                    result = self._choice(statement, body[k + 1:] if returns else [])
                    if returns:
                        return result
                case _:
                    raise self._refused(statement)
        return None

    def _choice(self, node: ast.If, rest: list[ast.stmt]) -> ast.expr | None:
        """Write both branches, each with the rest of the function where one of them returns."""
        before, lines = self._names, self._lines
        branches = []
        for body in (node.body, node.orelse):
            self._names, self._lines = dict(before), []
            branches.append((self._block([*body, *rest]), self._names, self._lines))
        self._names, self._lines = before, lines
        (yes, names_yes, _), (no, names_no, _) = branches
        if (yes is None) != (no is None):
            raise self._refused(node)
        changed = [name for name in names_yes if name in names_no and names_yes[name] != names_no[name]]
        calls = []
        for result, names, inside in branches:
            result = result or ast.Tuple([_name(names[name]) for name in changed], ast.Load())
            function = self._new("branch")
            inside = [*inside, f"return {ast.unparse(result)}"]
            self._lines += [f"def {function}():", *(f"    {line}" for line in inside)]
            calls.append(_name(function))
        chosen = _call("where_", self._expression(node.test), *calls)
        if yes is not None:
            return chosen
        if changed:
            self._assign(ast.Tuple([ast.Name(name, ast.Store()) for name in changed], ast.Store()), chosen)
        return None

    def _new(self, name: str) -> str:
        return f"{name}_{next(self._numbers)}"

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        """Write an assignment, each variable under a name of its own."""
        target = deepcopy(target)
        for node in [node for node in ast.walk(target) if isinstance(node, ast.Name)]:
            self._names[node.id] = node.id = self._new(node.id)
        self._lines.append(f"{ast.unparse(target)} = {ast.unparse(value)}")

    def _expression(self, node: ast.expr) -> ast.expr:
        found: ast.expr = self.visit(deepcopy(node))  # the end of a function may be written twice
        return found

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Put in the present name of a variable."""
        return _name(self._names.get(node.id, node.id))

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        """Choose element by element."""
        branches = (ast.Lambda(_NO_ARGUMENTS, self.visit(branch)) for branch in (node.body, node.orelse))
        return _call("where_", self.visit(node.test), *branches)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        """Combine element by element."""
        return _folded("np.logical_and" if isinstance(node.op, ast.And) else "np.logical_or",
                       [self.visit(value) for value in node.values])

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        """Negate element by element."""
        operand = self.visit(node.operand)
        return _call("np.logical_not", operand) if isinstance(node.op, ast.Not) else ast.UnaryOp(node.op, operand)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        """Compare in pairs."""
        if not all(isinstance(op, _COMPARED) for op in node.ops):
            raise self._refused(node)
        sides = [self.visit(side) for side in (node.left, *node.comparators)]
        return _folded("np.logical_and", [ast.Compare(a, [op], [b]) for a, op, b in
                                          zip(sides, node.ops, sides[1:], strict=False)])

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Call what does the same for arrays."""
        called = self._value(node.func)
        arguments = [self.visit(argument) for argument in node.args]
        keywords = [ast.keyword(word.arg, self.visit(word.value)) for word in node.keywords]
        if isinstance(called, FunctionType) and called.__module__ == _ELEMENTARY:
            return _call(f"np.{_RENAMED.get(called.__name__, called.__name__)}", *arguments)
        if isinstance(called, FunctionType):
            alias = f"law_{called.__module__.replace('.', '_')}_{called.__name__}"
            self._space[alias] = derived(called)
            return ast.Call(_name(alias), arguments, keywords)
        if isinstance(called, type) and issubclass(called, tuple):
            return ast.Call(node.func, arguments, keywords)
        name = getattr(called, "__name__", "")
        if called is getattr(builtins, name, None) and name in _BUILTINS:
            return _folded(_BUILTINS[name], arguments) if len(arguments) > 1 else _call(_BUILTINS[name], *arguments)
        if called is getattr(math, name, None):
            return _call(f"np.{_RENAMED.get(name, name)}", *arguments)
        raise self._refused(node)

    def _value(self, node: ast.expr) -> Any:
        """Return what a name, or a name in a module, stands for outside the law."""
        if isinstance(node, ast.Name) and node.id not in self._names:
            return self._space.get(node.id, getattr(builtins, node.id, None))
        if isinstance(node, ast.Attribute) and isinstance(owner := self._value(node.value), ModuleType):
            return getattr(owner, node.attr)
        return None

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Keep what is the same for arrays; refuse what is not."""
        if isinstance(node, (ast.comprehension, ast.Lambda, ast.NamedExpr, ast.Await, ast.Yield, ast.JoinedStr)):
            raise self._refused(node)
        return super().generic_visit(node)

    def _refused(self, node: ast.AST) -> NotImplementedError:
        return NotImplementedError(f"{self._law.__module__}.{self._law.__name__}: no array form of "
                                   f"{ast.unparse(node).splitlines()[0]!r}")


def _name(name: str) -> ast.expr:
    return ast.Name(name, ast.Load())


def _call(function: str, *arguments: ast.expr) -> ast.expr:
    return ast.Call(_name(function), list(arguments), [])


def _folded(function: str, values: list[ast.expr]) -> ast.expr:
    found = values[0]
    for value in values[1:]:
        found = _call(function, found, value)
    return found


def _where(condition: Any, yes: Callable[[], Any], no: Callable[[], Any]) -> Any:
    """Return what a condition takes of two branches; one that nothing takes is not computed."""
    if np.all(condition):
        return yes()
    return _merged(condition, yes(), no()) if np.any(condition) else no()


def _merged(condition: Any, yes: Any, no: Any) -> Any:
    if yes is no:  # as both branches found it
        return yes
    if isinstance(yes, tuple):
        return _made(yes, [_merged(condition, a, b) for a, b in zip(yes, no, strict=True)])
    return np.where(condition, yes, no)


def _made(like: Any, parts: list[Any]) -> Any:
    return type(like)(*parts) if hasattr(like, "_fields") else tuple(parts)


def _each(change: Callable[[Any], Any], value: Any) -> Any:
    """Return a value, or each part of a tuple, changed."""
    return _made(value, [_each(change, part) for part in value]) if isinstance(value, tuple) else change(value)


def _number(value: Any) -> Any:
    return np.float64(value) if isinstance(value, float) else value


def _result(value: Any) -> Any:
    return value[()] if isinstance(value, np.ndarray) else value


def _arrays(value: Any) -> Iterator[NDArray[Any]]:
    """Return the arrays among the parts of a tuple, and of tuples in it."""
    if isinstance(value, tuple):
        for part in value:
            yield from _arrays(part)
    elif isinstance(value, np.ndarray):
        yield value
