"""Where the local variables of a function are declared in C: as deep, and as late, as they can be."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from servotwin.simulation.compile.inference import Specialised
from servotwin.simulation.compile.kind_rules import is_range


class Variables:
    """The local variables of a function.

    Attributes
    ----------
    read : set of str
        Those whose values are used.
    counters : set of str
        Those that count loops alone, each declared by its loops.
    before : dict
        What is declared, with a value of zero, before a statement.
    """

    def __init__(self, own: Specialised) -> None:
        self._own = own
        self.read = {n.id for n in ast.walk(own.node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
        self.counters = {name for name in own.stored - set(own.names) if self._counts(name)}
        self.before: dict[ast.stmt, list[str]] = {}
        self._by: set[tuple[ast.AST, str]] = set()
        for name in sorted(own.stored - set(own.names) - self.counters):
            if name in self.read and own.local.get(name) is not None:
                self._place(own.node.body, name)

    def is_declared_by(self, node: ast.AST, name: str) -> bool:
        """Tell whether a variable is declared where a target gets its value (of a list: by the statement)."""
        return (node, name) in self._by

    def _place(self, body: Sequence[ast.stmt], name: str) -> None:
        """Find the place of a variable that occurs in this block alone."""
        found = [statement for statement in body if _has(statement, name)]
        if not found:
            return
        first = found[0]
        target = self._target(first, name)
        if target is not None:
            self._by.add((target, name))
        elif len(found) == 1 and self._fits_within(first, name):
            for block in _blocks(first):
                self._place(block, name)
        else:
            self.before.setdefault(first, []).append(name)

    def _target(self, statement: ast.stmt, name: str) -> ast.AST | None:
        """Return the target of a statement that gives a variable its value, and does no more with it."""
        if not isinstance(statement, ast.Assign) or _has(statement.value, name):
            return None
        if isinstance(statement.value, ast.BinOp) and isinstance(statement.value.left, ast.List):
            return statement
        targets = [n for target in statement.targets for n in ast.walk(target)
                   if isinstance(n, ast.Name) and n.id == name]
        return targets[0] if len(targets) == 1 and isinstance(targets[0].ctx, ast.Store) else None

    def _fits_within(self, statement: ast.stmt, name: str) -> bool:
        """Tell whether a variable belongs into the blocks of a statement; in a loop, one that keeps no value."""
        if isinstance(statement, ast.If):
            return not _has(statement.test, name)
        if isinstance(statement, (ast.For, ast.While)):
            head = statement.test if isinstance(statement, ast.While) else statement.iter
            if _has(head, name) or (isinstance(statement, ast.For) and _has(statement.target, name)):
                return False
            return self._begins_anew(statement.body, name)
        return False

    def _begins_anew(self, body: Sequence[ast.stmt], name: str) -> bool:
        """Tell whether a variable gets a value each time before it is used."""
        first = next(statement for statement in body if _has(statement, name))
        if self._target(first, name) is not None:
            return True
        only = sum(_has(statement, name) for statement in body) == 1
        if not only or not self._fits_within(first, name):
            return False
        return all(self._begins_anew(block, name) for block in _blocks(first)
                   if any(_has(statement, name) for statement in block))

    def _counts(self, name: str) -> bool:
        """Tell whether a variable is stored by loops over ranges alone, and used in them."""
        loops = [n for n in ast.walk(self._own.node) if isinstance(n, ast.For) and is_range(n.iter)
                 and isinstance(n.target, ast.Name) and n.target.id == name]
        inside: set[ast.AST] = set()
        for loop in loops:
            if any(n in loops for statement in loop.body for n in ast.walk(statement)):
                return False  # behind the inner one it has the value of that
            inside |= {n for statement in loop.body for n in ast.walk(statement)} | {loop.target}
        return bool(loops) and all(n in inside and (isinstance(n.ctx, ast.Load) or n in {x.target for x in loops})
                                   for n in ast.walk(self._own.node) if isinstance(n, ast.Name) and n.id == name)


def _has(node: ast.AST, name: str) -> bool:
    return any(isinstance(part, ast.Name) and part.id == name for part in ast.walk(node))


def _blocks(statement: ast.stmt) -> list[list[ast.stmt]]:
    if isinstance(statement, ast.If):
        return [statement.body, statement.orelse]
    return [statement.body] if isinstance(statement, (ast.For, ast.While)) else []
