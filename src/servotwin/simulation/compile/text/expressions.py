"""Print the expressions of a derived function as C99."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Protocol

from servotwin.simulation.compile import c_types
from servotwin.simulation.compile.c_types import Types, bracketed, identifier, member
from servotwin.simulation.compile.text.inference import Specialised
from servotwin.simulation.compile.text.kind_rules import constant_int
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
    united,
)

ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.BitAnd: "&", ast.BitOr: "|",
              ast.BitXor: "^"}
_ORDER = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


class Functions(Protocol):
    """Where called functions are printed."""

    types: Types

    def name_of(self, function: Specialised) -> str:
        """Return the name of a function in C."""


class Expressions:
    """The expressions of one function, but for calls.

    Attributes
    ----------
    printers : dict
        Function that prints each kind of expression.
    """

    printers: ClassVar[dict[type[ast.expr], Callable[[Any, Any], str]]] = {}

    def __init__(self, printer: Functions, own: Specialised) -> None:
        self._printer, self._own, self._types = printer, own, printer.types
        self._count = 0

    def of(self, node: ast.expr) -> str:
        """Return an expression."""
        return self.printers[type(node)](self, node)

    def kind(self, node: ast.expr) -> Any:
        """Return the kind of an expression."""
        if isinstance(node, ast.Name) and node.id in self._own.local:
            return self._own.local[node.id]
        return self._own.kinds[node]

    def _known(self, node: ast.expr) -> int | None:
        """Return a whole number that is a constant."""
        return constant_int(node, {} if isinstance(node, ast.Name) and node.id in self._own.local else self._own.space)

    def as_(self, node: ast.expr, kind: Kind | None) -> str:
        """Return an expression as a value of a kind."""
        if kind in (FLOAT64, FLOAT32) and isinstance(node, ast.Constant) and self.kind(node) == INT64:
            return self._types.literal(float(str(node.value)))
        return self._types.converted(self.of(node), self.kind(node), kind)

    def fresh(self, name: str) -> str:
        """Return the name of another variable of the function, for which Python has none."""
        self._count += 1
        return f"{name.rstrip('_')}_{self._count}"

    def truth(self, node: ast.expr) -> str:
        """Return an expression as a condition."""
        text = self._types.converted(self.of(node), self.kind(node), BOOL)
        return text[1:-1] if text.startswith("(") and bracketed(text) == text else text

    def _name(self, node: ast.Name) -> str:
        if node.id in self._own.local:
            if node.id in self._own.names and node.id not in self._own.stored and by_pointer(self._own.local[node.id]):
                return f"(*{identifier(node.id)})"
            return identifier(node.id)
        return self._types.literal(self._own.space[node.id])

    def _constant_value(self, node: ast.Constant) -> str:
        return self._types.literal(node.value)

    def _tuple(self, node: ast.Tuple) -> str:
        self.in_order(node.elts, node)
        kind = self.kind(node)
        return self._types.made(kind, [self.of(element) for element in node.elts])

    def _attribute(self, node: ast.Attribute) -> str:
        if isinstance(node.value, ast.Name) and node.value.id == "math":
            return self._types.literal(getattr(math, node.attr))
        owner, text = self.kind(node.value), self.of(node.value)
        if isinstance(owner, Tuple):
            return self._types.part(text, owner, owner.fields.index(node.attr))
        if isinstance(owner, Record):
            place = f"{text[1:]}.{identifier(node.attr)}" if text.startswith("&") else (
                f"{bracketed(text)}->{identifier(node.attr)}")
            return f"&{place}" if isinstance(self.kind(node), Record) else place
        lengths = self.lengths(text, owner)
        if node.attr == "size":
            return f"({' * '.join(lengths)})" if len(lengths) > 1 else lengths[0]
        kind = self.kind(node)
        return self._types.made(kind, lengths)

    @staticmethod
    def lengths(text: str, owner: Array | Fixed) -> list[str]:
        """Return the lengths of an array."""
        if isinstance(owner, Fixed):
            return [f"INT64_C({length})" for length in owner.shape]
        return [f"{member(text, 'n')}[{k}]" for k in range(owner.dimensions)]

    def _subscript(self, node: ast.Subscript) -> str:
        owner, text, index = self.kind(node.value), self.of(node.value), node.slice
        if isinstance(index, ast.Slice):
            return self._slice(text, owner, index)
        if isinstance(owner, Tuple):
            known = self._known(index)
            if known is not None:
                return self._types.part(text, owner, known % len(owner.elements))
            text = self._types.converted(text, owner, Tuple(owner.elements))
            return f"{member(text, 'v')}[{self.of(index)}]"
        places = index.elts if isinstance(index, ast.Tuple) else [index]
        lengths = self.lengths(text, owner)
        texts = []
        for place, length in zip(places, lengths, strict=False):
            known = self._known(place)
            texts.append(f"{length} - {-known}" if known is not None and known < 0 else self.of(place))
        return self.item(text, owner, texts)[0]

    def item(self, text: str, owner: Array | Fixed, places: list[str]) -> tuple[str, Kind]:
        """Return an element or a row of an array."""
        lengths = self.lengths(text, owner) if isinstance(owner, Array) else [str(n) for n in owner.shape]
        linear = places[0]
        for length, place in zip(lengths[1:len(places)], places[1:], strict=True):
            linear = f"{bracketed(linear)} * {length} + {bracketed(place)}"
        left = lengths[len(places):]
        for length in left:
            linear = f"{bracketed(linear)} * {length}"
        there = f"{member(text, 'p') if isinstance(owner, Array) else bracketed(text)}[{linear}]"
        if isinstance(owner, Array) and left:
            row = Array(owner.element, len(left))
            return f"(({self._types.of(row)}){{&{there}, {{{', '.join(left)}}}}})", row
        if isinstance(owner, Fixed) and left:
            return f"&{there}", Fixed(owner.element, owner.shape[len(places):])
        return f"&{there}" if isinstance(owner.element, Record) else there, owner.element

    def _slice(self, text: str, owner: Any, index: ast.Slice) -> str:
        if isinstance(owner, Tuple):
            low, high = (constant_int(bound, {}) if bound is not None else None for bound in (index.lower, index.upper))
            part = Tuple(owner.elements[low:high])
            return self._types.made(part, [self._types.part(text, owner, k)
                                           for k in range(len(owner.elements))[low:high]])
        array = owner if isinstance(owner, Array) else Array(owner.element, len(owner.shape))
        type_ = self._types.of(array)
        rest = "".join(f" * x.n[{k}]" for k in range(1, array.dimensions))

        def make(name: str) -> str:
            return (f"static inline {type_} {name}({type_} x, int64_t low, int64_t high) {{\n"
                    f"    low = clamped(low, x.n[0]), high = clamped(high, x.n[0]);\n"
                    f"    x.p += low{rest}, x.n[0] = high > low ? high - low : 0;\n    return x;\n}}")

        name = self._types.helper(("slice", array), f"slice_of_{type_}", make)
        bounds = (self.of(bound) if bound is not None else none
                  for bound, none in ((index.lower, "0"), (index.upper, "INT64_MAX")))
        return f"{name}({', '.join((self._types.converted(text, owner, array), *bounds))})"

    def _binary(self, node: ast.BinOp) -> str:
        self.in_order([node.left, node.right], node)
        kind = self.kind(node)
        if isinstance(kind, Tuple):
            return self._joined(node, kind)
        left, right = self.kind(node.left), self.kind(node.right)
        if isinstance(node.op, ast.Pow):
            return self._power(node, kind)
        if isinstance(node.op, (ast.FloorDiv, ast.Mod)):
            return self._divided(node, kind)
        a, b = self.as_(node.left, kind), self.as_(node.right, kind)
        known = self._known(node.right)
        if isinstance(node.op, (ast.LShift, ast.RShift)) and (known is None or not 0 <= known < 64):
            return f"moved_{'left' if isinstance(node.op, ast.LShift) else 'right'}({a}, {b})"
        if isinstance(node.op, ast.LShift):
            return f"(int64_t)((uint64_t){bracketed(a)} << {bracketed(b)})"
        if isinstance(node.op, ast.RShift):
            return f"((int64_t){bracketed(a)} >> {bracketed(b)})"
        if kind == INT64 and self._is_short(node.left) and self._is_short(node.right):
            a = f"(int64_t){bracketed(a)}"
        if kind == BOOL and left == right == BOOL:
            return f"(({a}) {ARITHMETIC[type(node.op)]} ({b}))"
        return f"({a} {ARITHMETIC[type(node.op)]} {b})"

    def _is_short(self, node: ast.expr) -> bool:
        """Tell whether C would calculate with fewer bits than 64: with what constants alone make."""
        if isinstance(node, ast.UnaryOp):
            return self._is_short(node.operand)
        if isinstance(node, ast.IfExp):
            return self._is_short(node.body) and self._is_short(node.orelse)
        if isinstance(node, ast.Call):
            return isinstance(node.func, ast.Name) and node.func.id == "len"
        return isinstance(node, ast.Constant) or (isinstance(node, ast.Name) and node.id not in self._own.local)

    def _joined(self, node: ast.BinOp, kind: Tuple) -> str:
        self.once(node.left, node.right)
        left = self.kind(node.left)
        parts = [self._types.part(self.of(node.left), left, k) for k in range(len(left.elements))]
        right = self._own.kinds.get(node.right)
        if isinstance(right, Tuple):
            parts += [self._types.part(self.of(node.right), right, k) for k in range(len(right.elements))]
        else:
            parts *= len(kind.elements) // len(parts)
        return self._types.made(kind, parts)

    def _divided(self, node: ast.BinOp, kind: Kind | None) -> str:
        a, b = self.as_(node.left, kind), self.as_(node.right, kind)
        down = isinstance(node.op, ast.FloorDiv)
        if kind == INT64:
            return f"{'floor_div' if down else 'floor_mod'}({a}, {b})"
        if kind == FLOAT32:
            raise self._own.refused(node, "a float32 is divided and rounded in two steps")
        return f"{'floor_div_float' if down else 'mod_float'}({a}, {b})"

    def _power(self, node: ast.BinOp, kind: Any) -> str:
        exponent = node.right.value if isinstance(node.right, ast.Constant) else None
        if isinstance(exponent, int) and 1 <= exponent <= 4 and isinstance(kind, Scalar):
            body = {1: "x", 2: "x * x", 3: "x * (x * x)", 4: "(x * x) * (x * x)"}[exponent]

            def make(name: str) -> str:
                return f"static inline {kind.c} {name}({kind.c} x) {{ return {body}; }}"

            name = self._types.helper(("power", kind, exponent), f"power_{exponent}", make)
            return f"{name}({self.as_(node.left, kind)})"
        if kind == INT64:
            return f"whole_power({self.as_(node.left, kind)}, {exponent!r})"
        return f"pow{'f' * (kind == FLOAT32)}({self.as_(node.left, kind)}, {self.as_(node.right, kind)})"

    def _unary(self, node: ast.UnaryOp) -> str:
        if isinstance(node.op, ast.Not):
            return f"(!{bracketed(self.truth(node.operand))})"
        text = self.as_(node.operand, self.kind(node))
        sign = {ast.USub: "-", ast.UAdd: "", ast.Invert: "~"}[type(node.op)]
        if sign == "~":
            return f"(~(int64_t){bracketed(text)})"
        return f"({sign}{bracketed(text)})"

    def _boolean(self, node: ast.BoolOp) -> str:
        sign = " && " if isinstance(node.op, ast.And) else " || "
        return f"({sign.join(bracketed(self._types.converted(self.of(v), self.kind(v), BOOL)) for v in node.values)})"

    def _compare(self, node: ast.Compare) -> str:
        sides = [node.left, *node.comparators]
        self.in_order(sides, node)
        if len(node.ops) == 2 and (self.writes(sides[2]) or _guarded(sides)):
            raise self._own.refused(node, "a chain that ends with an index or a call is written with `and`")
        if len(node.ops) == 1:
            return f"({self._one_comparison(node.ops[0], node.left, node.comparators[0])})"
        if len(node.ops) != 2 or not all(type(op) in _ORDER for op in node.ops):
            raise self._own.refused(node, "a chain has two comparisons of numbers")
        kind: Any = None
        for side in sides:
            kind = united(kind, self.kind(side))
        first, second = (_ORDER[type(op)] for op in node.ops)

        def make(name: str) -> str:
            return (f"static inline bool {name}({kind.c} a, {kind.c} b, {kind.c} c) "
                    f"{{ return a {first} b && b {second} c; }}")

        name = self._types.helper(("chain", kind, first, second), "in_order", make)
        return f"{name}({', '.join(self.as_(side, kind) for side in sides)})"

    def _one_comparison(self, op: ast.cmpop, left: ast.expr, right: ast.expr) -> str:
        kind, other = self.kind(left), self.kind(right)
        if type(op) in _ORDER:
            return f"{self.of(left)} {_ORDER[type(op)]} {self.of(right)}"
        if isinstance(op, (ast.In, ast.NotIn)):
            text = self._is_in(left, kind, right, other)
            return text if isinstance(op, ast.In) else f"!{text}"
        text = self._types.equal(self.of(left), kind, self.of(right), other)
        if isinstance(op, ast.Eq):
            return text
        return f"{self.of(left)} != {self.of(right)}" if isinstance(kind, Scalar) else f"!{text}"

    def _is_in(self, left: ast.expr, kind: Kind, right: ast.expr, other: Tuple) -> str:
        type_, options = self._types.of(kind), self._types.of(other)

        def make(name: str) -> str:
            parts = [self._types.equal("x", kind, self._types.part("y", other, k), element)
                     for k, element in enumerate(other.elements)]
            condition = " || ".join(parts) or "(void)x, (void)y, false"
            return f"static inline bool {name}({type_} x, {options} y) {{ return {condition}; }}"

        return f"{self._types.helper(('in', kind, other), 'is_in', make)}({self.of(left)}, {self.of(right)})"

    def _conditional(self, node: ast.IfExp) -> str:
        kind = self.kind(node)
        return f"({self.truth(node.test)} ? {self.as_(node.body, kind)} : {self.as_(node.orelse, kind)})"

    def in_order(self, parts: Sequence[ast.expr], node: ast.expr) -> None:
        """Refuse what Python works out from left to right, and C in any order, where that makes a difference."""
        writing = [part for part in parts if self.writes(part)]
        if writing and any(part is not writing[0] and not self._is_settled(part) for part in parts):
            raise self._own.refused(node, "a call that changes records or arrays gets a statement of its own")

    def once(self, *parts: ast.expr) -> None:
        """Refuse what would be called more than once."""
        if any(map(self.writes, parts)):
            raise self._own.refused(parts[0], "a call that changes records or arrays gets a statement of its own")

    def writes(self, node: ast.expr) -> bool:
        """Tell whether an expression calls what changes records or arrays."""
        for part in ast.walk(node):
            if isinstance(part, ast.Call) and part in self._own.calls and self._own.calls[part].writes:
                return True
            if isinstance(part, ast.Call) and isinstance(part.func, ast.Name):
                primitive = c_types.PRIMITIVES.get(self._own.module.derived.primitives.get(part.func.id, ""))
                if primitive is not None and primitive.writes:
                    return True
        return False

    def _is_settled(self, node: ast.expr) -> bool:
        """Tell whether no call could change a value."""
        return not any(isinstance(part, (ast.Call, ast.Subscript)) or (
            isinstance(part, ast.Attribute) and isinstance(self._own.kinds.get(part.value), Record)
            and isinstance(self._own.kinds.get(part), Scalar)) for part in ast.walk(node))


def _guarded(sides: Sequence[ast.expr]) -> bool:
    """Tell whether the first comparison says if there is what the second one asks for: C works out both."""
    inside = {part for side in sides for index in ast.walk(side) if isinstance(index, ast.Subscript)
              for part in ast.walk(index.slice) if isinstance(part, ast.Name)}
    compared = {part.id for side in sides[:2] for part in ast.walk(side)
                if isinstance(part, ast.Name) and part not in inside}
    return any(part.id in compared for part in ast.walk(sides[2]) if isinstance(part, ast.Name) and part in inside)


def by_pointer(kind: Kind | None) -> bool:
    """Tell whether a function gets an argument by its address."""
    return isinstance(kind, Tuple) and len(kind.elements) > 0


Expressions.printers |= {
    ast.Name: Expressions._name, ast.Constant: Expressions._constant_value, ast.Tuple: Expressions._tuple,
    ast.Attribute: Expressions._attribute, ast.Subscript: Expressions._subscript, ast.BinOp: Expressions._binary,
    ast.UnaryOp: Expressions._unary, ast.BoolOp: Expressions._boolean, ast.Compare: Expressions._compare,
    ast.IfExp: Expressions._conditional}
