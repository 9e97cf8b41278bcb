"""Find the kinds of all values in derived functions, from those of an entry's arguments on.

A function is looked at once for each combination of kinds that it is called with. Its local variables have one kind
each, which is found by going through its statements until nothing changes any more.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from typing import Any

from servotwin.simulation.compile.text.derive import Derived
from servotwin.simulation.compile.text.kind_rules import fits, in_memory, is_range, leaves, list_length, row
from servotwin.simulation.compile.text.kinds import (
    INT64,
    Array,
    Fixed,
    Kind,
    TranslationError,
    Tuple,
    told,
)
from servotwin.simulation.compile.text.values import Values

_ROUNDS = 12  # more than any kernel needs until its kinds are settled


class Module:
    """The functions of a derived text, and what they have been called with."""

    def __init__(self, derived: Derived) -> None:
        self.derived = derived
        self.known: dict[tuple[str, tuple[Kind, ...]], Specialised] = {}
        self._open: list[str] = []  # functions that are looked at, each called by the one before

    def specialised(self, name: str, arguments: tuple[Kind, ...]) -> Specialised:
        """Return a function with the kinds of all that is in it."""
        key = (name, arguments)
        if name in self._open:
            raise TranslationError(name, f"{name}(...)", "a kernel does not call itself: a loop takes its place")
        if key not in self.known:
            self._open.append(name)
            self.known[key] = Specialised(self, self.derived.functions[name], arguments)
            self.known[key].settle()
            self._open.pop()
        return self.known[key]


class Specialised(Values):
    """A function with the kinds of all that is in it, found from its statements."""

    def settle(self) -> None:
        """Find all kinds."""
        for _ in range(_ROUNDS):
            before = (dict(self.local), self.result, self.writes)
            self.calls.clear()
            self._block(self.node.body)
            if before == (self.local, self.result, self.writes):
                self._check()
                return
        raise self.refused(self.node, "the kinds of its variables do not settle")

    def _check(self) -> None:
        """Refuse what has no value where one is needed."""
        for node in ast.walk(self.node):
            if isinstance(node, ast.Assign) and not list_length(node.value, self.space) and (
                    self.kinds.get(node.value) is None):
                raise self.refused(node, "there is no value: a function returns none, or its kind is not known")
            if isinstance(node, ast.Return) and self.result is not None and (
                    node.value is None or self.kinds.get(node.value) is None):
                raise self.refused(node, "a function returns a value everywhere, or nowhere")
        if self.result is not None and not leaves(self.node.body[-1]):
            raise self.refused(self.node.body[-1], "a function that returns a value ends with a return")

    # --- statements ---------------------------------------------------------------------------------------------------

    def _block(self, body: Sequence[ast.stmt]) -> None:
        for statement in body:
            handler = _STATEMENTS.get(type(statement))
            if handler is None:
                raise self.refused(statement, "a kernel has assignments, if, for, while, break, continue and return")
            handler(self, statement)

    def _return(self, node: ast.Return) -> None:
        if node.value is not None and not (isinstance(node.value, ast.Constant) and node.value.value is None):
            kind = self.of(node.value)
            if self.owned and kind is not None and in_memory(kind):
                raise self.refused(node, "a list ends with its function: give an array to it instead")
            self.result = self.united(self.result, kind, node)

    def _expression(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.of(node.value)

    def _assign(self, node: ast.Assign) -> None:
        value = node.value
        if length := list_length(value, self.space):
            self._list(node, length)
            return
        kind = self.of(value)
        for target in node.targets:
            self._put(target, kind, value)

    def _list(self, node: Any, length: int) -> None:
        target, elements = node.targets[0], node.value.left.elts
        if not isinstance(target, ast.Name) or len(node.targets) > 1 or len(elements) != 1:
            raise self.refused(node, "a list of a constant length has a name of its own, and one value for all")
        kind = self.of(elements[0])
        self.owned.add(target.id)
        if kind is not None:
            if self.local.get(target.id) not in (None, Fixed(kind, (length,))):
                raise self.refused(node, "a list stays what it is: another one has another name")
            self.local[target.id] = Fixed(kind, (length,))

    def _augmented(self, node: ast.AugAssign) -> None:
        left, right = self.of(node.target), self.of(node.value)
        self._put(node.target, self.arithmetic(node.op, left, right, node), node.value)

    def _put(self, target: ast.expr, kind: Kind | None, value: ast.expr) -> None:
        """Note that a value of a kind gets to a target."""
        if isinstance(target, ast.Name):
            if target.id != "_":
                self.local[target.id] = self.united(self.local.get(target.id), kind, target)
        elif isinstance(target, ast.Tuple):
            for place, element in enumerate(target.elts):
                part = value.elts[place] if isinstance(value, ast.Tuple) else value
                self._put(element, self._element(kind, place, len(target.elts), target), part)
        else:
            self.writes = self.writes or not self.is_own(target)
            there = self.of(target)
            if self.is_constant(self.root(target)):
                raise self.refused(target, "constants of a module are not written to")
            if isinstance(target, (ast.Attribute, ast.Subscript)) and isinstance(self.kinds.get(target.value), Tuple):
                raise self.refused(target, "a tuple is made anew: what is in it does not change")
            if kind is not None and there is not None and not fits(kind, there):
                raise self.refused(target, f"it gets {told(kind)}, and holds {told(there)}")

    def _element(self, kind: Kind | None, place: int, count: int, node: ast.AST) -> Kind | None:
        if kind is None:
            return None
        if isinstance(kind, Tuple):
            if len(kind.elements) != count:
                raise self.refused(node, f"there are {len(kind.elements)} values")
            return kind.elements[place]
        if isinstance(kind, (Array, Fixed)):
            return row(kind, 1)
        raise self.refused(node, f"{told(kind)} is no tuple")

    def _if(self, node: ast.If) -> None:
        self.truth(node.test)
        self._block(node.body)
        self._block(node.orelse)

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.refused(node, "a loop of a kernel has no else")
        self.truth(node.test)
        self._block(node.body)

    def _for(self, node: Any) -> None:
        if node.orelse:
            raise self.refused(node, "a loop of a kernel has no else")
        if is_range(node.iter):
            for bound in node.iter.args:
                self.whole(bound)
            self._put(node.target, INT64, node.iter)
        else:
            over = self.of(node.iter)
            if over is not None:
                self._put(node.target, self._each(over, node), node.iter)
        self._block(node.body)

    def _each(self, over: Kind, node: ast.For) -> Kind | None:
        if isinstance(over, Tuple):
            each: Kind | None = None
            for element in over.elements:
                each = self.united(each, element, node)
            return each
        if isinstance(over, Array) or (isinstance(over, Fixed) and len(over.shape) == 1):
            return row(over, 1)
        raise self.refused(node, "a loop goes over a range, a tuple or an array")


_STATEMENTS: dict[type[ast.stmt], Callable[[Specialised, Any], None]] = {
    ast.Pass: lambda own, node: None, ast.Break: lambda own, node: None, ast.Continue: lambda own, node: None,
    ast.Return: Specialised._return, ast.Expr: Specialised._expression, ast.Assign: Specialised._assign,
    ast.AugAssign: Specialised._augmented, ast.If: Specialised._if, ast.While: Specialised._while,
    ast.For: Specialised._for}
