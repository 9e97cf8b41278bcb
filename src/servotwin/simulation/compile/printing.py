"""Print one function of a derived module as C99: its variables, calls and statements."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from servotwin.simulation.compile import c_types
from servotwin.simulation.compile.c_types import Types, bracketed, identifier, member
from servotwin.simulation.compile.text.expressions import ARITHMETIC, Expressions, by_pointer
from servotwin.simulation.compile.text.inference import Specialised
from servotwin.simulation.compile.text.kind_rules import (
    constant_int,
    dimensions,
    is_range,
    list_length,
    ordered_arguments,
)
from servotwin.simulation.compile.text.kinds import (
    BOOL,
    FLOAT32,
    FLOAT64,
    INT64,
    Array,
    Fixed,
    Kind,
    Record,
    Scalar,
    Tuple,
    leaves,
    united,
)

# --- Where the local variables of a function are declared in C: as deep, and as late, as they can be ------------------

class Variables:
    """The local variables of a function.

    Attributes
    ----------
    read : set of str
        Those whose values are used.
    counters : set of str
        Those that count loops alone, each declared by its loops.
    before : dict
        Variables that are declared, with a value of zero, before a statement.
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


# --- Print the calls in a derived function as C99 ---------------------------------------------------------------------

class CallExpressions(Expressions):
    """The expressions of one function."""

    def _call(self, node: Any) -> str:
        if node in self._own.calls:
            return self._own_call(node, self._own.calls[node])
        if isinstance(node.func, ast.Attribute) and node.func.attr == "_replace":
            return self._replaced(node, node.func.value)
        self.in_order(node.args, node)
        if isinstance(node.func, ast.Attribute):
            return self._of_math(node, node.func.attr)
        name = node.func.id
        primitive = self._own.module.derived.primitives.get(name)
        if primitive is not None:
            return self._primitive(node, c_types.PRIMITIVES[primitive])
        value = self._own.space.get(name)
        if isinstance(value, type) and hasattr(value, "_fields"):
            return self._named_tuple(node, value)
        return self._built_in(node, name)

    def _own_call(self, node: ast.Call, called: Specialised) -> str:
        ordered = ordered_arguments(called.node, node)
        self.in_order(ordered, node)
        name = self._printer.name_of(called)
        parts = []
        for argument, kind in zip(ordered, called.arguments, strict=True):
            text = self.of(argument)
            parts.append(self._address(text, kind) if by_pointer(kind) else text)
        return f"{name}({', '.join(parts)})"

    def _address(self, text: str, kind: Kind) -> str:
        """Return the address of a tuple, of a copy where it has none."""
        if text.startswith("(*") and text.endswith(")") and "(" not in text[2:]:
            return text[2:-1]
        if text.replace("_", "").replace(".", "").replace("->", "").replace("[", "").replace("]", "").isalnum():
            return f"&{text}"
        return f"({self._types.of(kind)}[1]){{{text}}}"

    def _named_tuple(self, node: ast.Call, class_: Any) -> str:
        values: dict[str, ast.expr] = dict(zip(class_._fields, node.args, strict=False))
        values |= {k.arg: k.value for k in node.keywords if k.arg is not None}
        kind = self.kind(node)
        self.in_order(list(values.values()), node)
        return self._types.made(kind, [
            self.of(values[name]) if name in values else self._types.literal(class_._field_defaults[name])
            for name in class_._fields])

    def _replaced(self, node: ast.Call, owner: ast.expr) -> str:
        """Return a named tuple with some fields of its own; of what it replaces all others are taken one by one."""
        if not isinstance(owner, ast.Name):
            raise self._own.refused(node, "what is replaced has a name")
        values = {k.arg: k.value for k in node.keywords}
        self.in_order([owner, *values.values()], node)
        before, text = self.kind(owner), self.of(owner)
        return self._types.made(self.kind(node), [
            self.of(values[name]) if name in values else self._types.part(text, before, k)
            for k, name in enumerate(before.fields)])

    def _primitive(self, node: ast.Call, primitive: c_types.Primitive) -> str:
        kind = self.kind(node)
        if primitive.result is None and isinstance(kind, Scalar):
            texts = [self.as_(argument, kind) for argument in node.args]
        else:
            texts = [self.of(argument) for argument in node.args]
        return primitive.text.format(*texts, s="f" * (kind == FLOAT32), n=len(texts) - 1, all=", ".join(texts))

    def _of_math(self, node: ast.Call, name: str) -> str:
        kinds = [self.kind(argument) for argument in node.args]
        kind = FLOAT32 if FLOAT32 in kinds and FLOAT64 not in kinds else FLOAT64
        text = ", ".join(self.as_(argument, kind) for argument in node.args)
        single = "f" * (kind == FLOAT32)
        if name in c_types.ROUNDED:
            if kinds[0] not in (FLOAT64, FLOAT32):
                return self.as_(node.args[0], INT64)
            return f"whole({c_types.ROUNDED[name]}{single}({text}))"
        if name in c_types.TRUTHS:
            return f"({c_types.TRUTHS[name]}({text}) != 0)"
        return f"{c_types.MATH[name]}{single}({text})"

    def _built_in(self, node: ast.Call, name: str) -> str:
        argument = node.args[0]
        kind, own = self.kind(argument), self.kind(node)
        if name == "_f" and (number := _number(argument)) is not None:
            return self._types.literal(number if own == FLOAT64 else np.float32(number))
        if name in ("float", "_f"):
            return self.as_(argument, own)
        if name == "bool":
            return self._types.converted(self.of(argument), kind, BOOL)
        if name in ("int", "round") and kind not in (FLOAT64, FLOAT32):
            return self.as_(argument, INT64)
        if name == "int":
            return f"whole({self.of(argument)})"
        if name == "round":
            return f"whole(NEAREST({self.as_(argument, FLOAT64)}))"
        if name == "len":
            return str(len(kind.elements)) if isinstance(kind, Tuple) else self.lengths(
                self.of(argument), kind)[0]
        if name == "abs":
            return f"fabs{'f' * (own == FLOAT32)}({self.of(argument)})" if own != INT64 else (
                f"llabs({self.as_(argument, INT64)})")
        return self._extreme(node, name, kind, own)

    def _extreme(self, node: ast.Call, name: str, first: Kind | None, own: Any) -> str:
        """Return the least or largest of some values, as Python finds it: the first one where others are no better."""
        if len(node.args) == 1 and isinstance(first, Tuple):
            self.once(node.args[0])
            text = self.of(node.args[0])
            parts = [self._types.converted(self._types.part(text, first, k), kind, own)
                     for k, kind in enumerate(first.elements)]
        else:
            parts = [self.as_(argument, own) for argument in node.args]
        sign = "<" if name == "min" else ">"

        def make(own_name: str) -> str:
            return f"INLINED {own.c} {own_name}({own.c} a, {own.c} b) {{ return b {sign} a ? b : a; }}"

        helper = self._types.helper((name, own), f"{name}_{own.c}", make)
        text, *rest = parts
        for part in rest:
            text = f"{helper}({text}, {part})"
        return text

    printers: ClassVar[dict[type[ast.expr], Callable[[Any, Any], str]]] = {**Expressions.printers, ast.Call: _call}


def _number(node: ast.expr) -> float | None:
    """Return a literal, or an infinity."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return float(node.value)
    if isinstance(node, ast.Attribute) and node.attr == "inf":
        return math.inf
    return None


# --- Print one function of a derived module as C99 --------------------------------------------------------------------

_MANY = 12  # numbers: in the vector form, what takes a tuple of more is inlined, or its numbers go through memory
_INDENT = "    "


class Printer:
    """Prints functions, each after those that it calls.

    Attributes
    ----------
    types : Types
        Of all of them.
    functions : list of str
        Their text.
    """

    def __init__(self, vector: frozenset[str], in_any_order: frozenset[str], called: frozenset[str],
                 inlined: frozenset[str] = frozenset(), unstored: frozenset[tuple[str, str]] = frozenset()) -> None:
        self.vector, self.in_any_order, self.called, self.inlined = vector, in_any_order, called, inlined
        self.types = Types(unstored)
        self.functions: list[str] = []
        self._names: dict[Specialised, str] = {}

    def name_of(self, function: Specialised) -> str:
        """Return the name of a function in C, printing it where that has not been done."""
        if function not in self._names:
            text = _Text(self, function)
            self._names[function] = self.types.fresh(identifier(function.node.name))
            self.functions.append(text.whole(self._names[function]))
        return self._names[function]


class _Text(CallExpressions):
    """The text of one function."""

    def __init__(self, printer: Printer, own: Specialised) -> None:
        super().__init__(printer, own)
        self._in_any_order, self._called = printer.in_any_order, printer.called
        self._vector, self._inlined = own.node.name in printer.vector, printer.inlined
        self._variables = Variables(own)

    # --- the function -------------------------------------------------------------------------------------------------

    def whole(self, name: str) -> str:
        """Return the function under this name."""
        own = self._own
        heads, lines = [], []
        body = self._block(own.node.body, 1)
        used = set(re.findall(r"(?<![\w.>])[A-Za-z_]\w*", " ".join(body)))  # members of structs apart
        for argument, kind in zip(own.names, own.arguments, strict=True):
            c_name = identifier(argument)
            head, line = self._argument(argument, c_name, kind)
            heads.append(head)
            lines += [_INDENT + line] if line else []
            if c_name not in used:
                lines.append(f"{_INDENT}(void){c_name};")
        returned = self._types.of(own.result)
        head = f"{self._lead()} {returned}{'' if returned.endswith('*') else ' '}{name}({', '.join(heads) or 'void'})"
        return "\n".join([f"{head} {{", *lines, *body, "}", ""])

    def _argument(self, argument: str, name: str, kind: Kind) -> tuple[str, str]:
        """Return the declaration of an argument, and the line that copies one that is changed or of another kind."""
        there, types = self._own.local[argument], self._types
        if by_pointer(kind) and argument not in self._own.stored:
            return f"const {types.of(kind)} *{name}", ""
        if by_pointer(kind):
            value = types.converted(f"(*{name}_given)", kind, there)
            return f"const {types.of(kind)} *{name}_given", f"{types.declared(there, name)} = {value};"
        if there != kind:
            value = types.converted(f"{name}_given", kind, there)
            return types.declared(kind, f"{name}_given"), f"{types.declared(there, name)} = {value};"
        return types.declared(kind, name), ""

    def _lead(self) -> str:
        """Return how the function is to be compiled.

        In the vector form all is inlined but for loops over lanes, and what is seldom called.
        """
        if self._own.node.name in self._inlined:
            return "INLINED"
        if self._vector and self._own.node.name in self._called:
            return "ASIDE"
        loops = any(isinstance(node, (ast.For, ast.While)) for node in ast.walk(self._own.node))
        wide = any(isinstance(kind, Tuple) and leaves(kind) > _MANY for kind in self._own.arguments)
        return "INLINED" if self._vector and (wide or not loops) else "static"

    # --- statements ---------------------------------------------------------------------------------------------------

    def _block(self, body: Sequence[ast.stmt], depth: int) -> list[str]:
        lines = []
        for statement in body:
            for name in self._variables.before.get(statement, ()):
                lines.append(_INDENT * depth + self._declaration(name))
            lines += [_INDENT * depth + line for line in _STATEMENTS[type(statement)](self, statement)]
        return lines

    def _declaration(self, name: str) -> str:
        """Return the declaration of a variable whose first value comes within a deeper block."""
        kind = self._own.local[name]
        if name in self._own.owned and isinstance(kind, Fixed):
            return f"{self._types.element(kind.element)} {identifier(name)}[{kind.count}];"
        zero = "0" if isinstance(kind, (Scalar, Record, Fixed)) else "{0}"
        return f"{self._types.declared(kind, identifier(name))} = {zero};"

    def _inner(self, body: Sequence[ast.stmt]) -> list[str]:
        return self._block(body, 1)

    def _pass(self, node: ast.Pass) -> list[str]:
        return []

    def _break(self, node: ast.Break) -> list[str]:
        return ["break;"]

    def _continue(self, node: ast.Continue) -> list[str]:
        return ["continue;"]

    def _return(self, node: ast.Return) -> list[str]:
        if node.value is None or self._own.result is None:
            return ["return;"]
        return [f"return {self.as_(node.value, self._own.result)};"]

    def _expression(self, node: ast.Expr) -> list[str]:
        if isinstance(node.value, ast.Constant):
            return []
        text = self.of(node.value)
        return [f"(void){text};" if self.kind(node.value) is not None else f"{text};"]

    def _if(self, node: ast.If) -> list[str]:
        lines = [f"if ({self.truth(node.test)}) {{", *self._inner(node.body)]
        if node.orelse:
            lines += ["} else {", *self._inner(node.orelse)]
        return [*lines, "}"]

    def _while(self, node: ast.While) -> list[str]:
        return [f"while ({self.truth(node.test)}) {{", *self._inner(node.body), "}"]

    def _for(self, node: ast.For) -> list[str]:
        if is_range(node.iter):
            return [*self._summing(node), *self._counting(node)]
        return self._going_over(node)

    def _summing(self, node: ast.For) -> list[str]:
        """Return the line that lets sums be taken in any order."""
        if not self._vector or self._own.node.name not in self._in_any_order:
            return []
        sums = sorted({n.target.id for n in ast.walk(node) if isinstance(n, ast.AugAssign)
                       and isinstance(n.target, ast.Name) and isinstance(n.op, ast.Add)})
        return [f"SUM_IN_ANY_ORDER({', '.join(map(identifier, sums))})"] if sums else []

    def _counting(self, node: Any) -> list[str]:
        """Return a loop over a range, whose bounds are worked out once."""
        bounds = node.iter.args
        low, high = ("0", self.of(bounds[0])) if len(bounds) == 1 else (self.of(bounds[0]), self.of(bounds[1]))
        step = constant_int(bounds[2], self._own.space) if len(bounds) == 3 else 1
        if step is None or step == 0:
            raise self._own.refused(node, "the step of a range is a constant")
        name = identifier(node.target.id)
        counter = name if node.target.id in self._variables.counters else self.fresh(name)
        sign, on = ("<", "++" if step == 1 else f" += {step}") if step > 0 else (">", f" -= {-step}")
        first = f"int64_t {counter} = {low}"
        if not high.isdigit():
            first, high = f"{first}, {counter}_end = {high}", f"{counter}_end"
        lines = [f"for ({first}; {counter} {sign} {high}; {counter}{on}) {{"]
        if counter != name and node.target.id in self._variables.read:
            lines.append(f"{_INDENT}{name} = {counter};")
        return [*lines, *self._inner(node.body), "}"]

    def _going_over(self, node: ast.For) -> list[str]:
        """Return a loop over a tuple or an array."""
        kind, counter, over = self.kind(node.iter), self.fresh("at"), self.fresh("over")
        if isinstance(kind, Tuple):
            each = kind.elements[0]
            for element in kind.elements[1:]:
                each = united(each, element) or each
            parts = [self._types.converted(self._types.part(over, kind, k), element, each)
                     for k, element in enumerate(kind.elements)]
            if isinstance(node.iter, ast.Tuple):
                parts = [self.as_(element, each) for element in node.iter.elts]
            lines = [] if isinstance(node.iter, ast.Tuple) else [
                f"const {self._types.of(kind)} {over} = {self.of(node.iter)};"]
            lines.append(f"const {self._types.of(each)} {over}_all[] = {{{', '.join(parts)}}};")
            value, count = f"{over}_all[{counter}]", str(len(parts))
        else:
            array = kind if isinstance(kind, Array) else Array(kind.element, 1)
            lines = [f"const {self._types.of(array)} {over} = {self.as_(node.iter, array)};"]
            value, each = self.item(over, array, [counter])
            count = f"{over}.n[0]"
        store = [_INDENT * 2 + line for line in self._stored(node.target, value, each)]
        return ["{", *(_INDENT + line for line in lines),
                f"{_INDENT}for (int64_t {counter} = 0; {counter} < {count}; {counter}++) {{", *store,
                *(_INDENT + line for line in self._inner(node.body)), f"{_INDENT}}}", "}"]

    def _assign(self, node: ast.Assign) -> list[str]:
        if list_length(node.value, self._own.space):
            return self._filled(node)
        for target in node.targets:
            self._settled_targets(target)
        if len(node.targets) == 1:
            (target,) = node.targets
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                return self._at_once(target, node.value)
            if not isinstance(target, ast.Tuple):
                return self._single(target, node.value)
        kind, name = self.kind(node.value), self.fresh("value")
        lines = [f"{self._constant(kind)}{self._types.declared(kind, name)} = {self.of(node.value)};"]
        for target in node.targets:
            lines += self._stored(target, name, kind)
        return lines

    def _single(self, target: ast.expr, value: ast.expr) -> list[str]:
        kind = self.kind(value)
        if isinstance(target, ast.Name) and isinstance(value, ast.Name) and target.id == value.id:
            return []  # what is left of a choice
        if isinstance(target, ast.Name) and target.id not in self._variables.read:
            return [f"(void){bracketed(self.of(value))};"] if _calls(value) else []
        if isinstance(target, ast.Name) and isinstance(there := self._own.local[target.id], Scalar):
            return self._stored(target, self.as_(value, there), there)
        return self._stored(target, self.of(value), kind, value)

    def _filled(self, node: Any) -> list[str]:
        """Return the loop that fills a list."""
        ((target,), value) = node.targets, node.value
        kind = self._own.local[target.id]
        counter = self.fresh("at")
        lines = [self._declaration(target.id)] if self._variables.is_declared_by(node, target.id) else []
        return [*lines, f"for (int64_t {counter} = 0; {counter} < {kind.count}; {counter}++) {{",
                f"{_INDENT}{identifier(target.id)}[{counter}] = {self.as_(value.left.elts[0], kind.element)};", "}"]

    def _at_once(self, targets: ast.Tuple, values: ast.Tuple) -> list[str]:
        """Return assignments of several values, which are all worked out before the first is stored."""
        self._settled_targets(targets)
        stored: set[str] = set()
        apart = True
        for target, value in zip(targets.elts, values.elts, strict=True):
            read = {n.id for n in ast.walk(value) if isinstance(n, ast.Name)}
            apart = apart and not (stored & read) and isinstance(target, ast.Name)
            stored |= {target.id} if isinstance(target, ast.Name) else set()
        lines: list[str] = []
        if apart and not any(isinstance(self.kind(value), (Record, Fixed)) for value in values.elts):
            for target, value in zip(targets.elts, values.elts, strict=True):
                lines += self._single(target, value)
            return lines
        kept = []
        for target, value in zip(targets.elts, values.elts, strict=True):
            kind, name = self.kind(value), self.fresh("value")
            lines.append(f"{self._constant(kind)}{self._types.declared(kind, name)} = {self.of(value)};")
            kept.append((target, name, kind))
        for target, name, kind in kept:
            if isinstance(target, ast.Name) and target.id not in self._variables.read:
                lines.append(f"(void){name};")
            else:
                lines += self._stored(target, name, kind)
        return lines

    def _settled_targets(self, target: ast.expr) -> None:
        if self.writes(target):
            raise self._own.refused(target, "a call that changes records or arrays gets a statement of its own")

    @staticmethod
    def _constant(kind: Kind) -> str:
        return "" if isinstance(kind, (Record, Fixed)) else "const "

    def _stored(self, target: ast.expr, text: str, kind: Kind | None, value: ast.expr | None = None) -> list[str]:
        """Return the assignment of a value of a kind to a target."""
        if isinstance(target, ast.Tuple):
            return self._unpacked(target, text, kind)
        if isinstance(target, ast.Name):
            if target.id not in self._variables.read:
                return []
            there = self._own.local[target.id]
            name = identifier(target.id)
            if self._variables.is_declared_by(target, target.id):
                name = self._types.declared(there, name)
            return [f"{name} = {self._types.converted(text, kind, there)};"]
        there = self.kind(target)
        if isinstance(target, ast.Subscript) and isinstance(target.slice, ast.Slice):
            return self._all(target, text, kind)
        if isinstance(there, Record):
            return [f"*{bracketed(self.of(target))} = *{bracketed(text)};"]
        if isinstance(there, Fixed) and kind == there:
            return [f"memcpy({self.of(target)}, {text}, {there.count} * sizeof({self._types.element(there.element)}));"]
        if isinstance(there, (Array, Fixed)):
            return self._all(target, text, kind)
        return [f"{self.of(target)} = {self._types.converted(text, kind, there)};"]

    def _all(self, target: ast.expr, text: str, kind: Kind | None) -> list[str]:
        """Return the loop that gives all elements of an array a value, or those of another array."""
        own, name, counter = self.kind(target), self.fresh("row"), self.fresh("at")
        if dimensions(own) != 1:
            raise self._own.refused(target, "a row is stored at once, or a number")
        there = Array(own.element, 1)
        lines = [f"const {self._types.of(there)} {name} = {self._types.converted(self.of(target), own, there)};"]
        if isinstance(kind, Scalar):
            value = self.fresh("value")
            lines.append(f"const {self._types.of(kind)} {value} = {text};")
            one = value
        else:
            if isinstance(kind, Array) and kind.element == there.element:  # it may be part of the same array
                size = f"(size_t){name}.n[0] * sizeof *{name}.p"
                return ["{", *(_INDENT + line for line in lines),
                        f"{_INDENT}memmove({name}.p, {member(text, 'p')}, {size});", "}"]
            other = self.fresh("row")
            lines.append(f"const {self._types.of(there)} {other} = {self._types.converted(text, kind, there)};")
            kind, one = there.element, f"{other}.p[{counter}]"
        return ["{", *(_INDENT + line for line in lines),
                f"{_INDENT}for (int64_t {counter} = 0; {counter} < {name}.n[0]; {counter}++) {{",
                f"{_INDENT * 2}{name}.p[{counter}] = {self._types.converted(one, kind, there.element)};",
                f"{_INDENT}}}", "}"]

    def _unpacked(self, target: ast.Tuple, text: str, kind: Any) -> list[str]:
        lines = []
        for place, each in enumerate(target.elts):
            if isinstance(kind, Tuple):
                lines += self._stored(each, self._types.part(text, kind, place), kind.elements[place])
            else:
                part, element = self.item(text, kind, [str(place)])
                lines += self._stored(each, part, element)
        return lines

    def _augmented(self, node: Any) -> list[str]:
        target, kind = node.target, self.kind(node.target)
        if self.writes(target) or (self.writes(node.value) and not isinstance(target, ast.Name)):
            raise self._own.refused(node, "a call that changes records or arrays gets a statement of its own")
        if isinstance(target, ast.Name):
            kind = self._own.local[target.id]
            if target.id not in self._variables.read:
                return [f"(void){bracketed(self.of(node.value))};"] if _calls(node.value) else []
        sign = ARITHMETIC.get(type(node.op))
        if sign is None or (sign == "/" and kind not in (FLOAT64, FLOAT32)):
            raise self._own.refused(node, "the operation is written out")
        if kind == FLOAT32 and self.kind(node.value) == FLOAT64:
            return [f"{self.of(target)} = (float)({self.of(target)} {sign} {bracketed(self.of(node.value))});"]
        return [f"{self.of(target)} {sign}= {self.as_(node.value, kind)};"]


def _calls(node: ast.expr) -> bool:
    return any(isinstance(part, ast.Call) for part in ast.walk(node))


_STATEMENTS: dict[type[ast.stmt], Callable[[_Text, Any], list[str]]] = {
    ast.Pass: _Text._pass, ast.Break: _Text._break, ast.Continue: _Text._continue, ast.Return: _Text._return,
    ast.Expr: _Text._expression, ast.Assign: _Text._assign, ast.AugAssign: _Text._augmented, ast.If: _Text._if,
    ast.While: _Text._while, ast.For: _Text._for}
