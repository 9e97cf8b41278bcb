"""Print the expressions of a derived function as C99."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from servotwin.simulation.compile import c_functions
from servotwin.simulation.compile.c_types import Types, bracketed, identifier, member
from servotwin.simulation.compile.inference import Specialised, constant_int, ordered_arguments
from servotwin.simulation.compile.kinds import (
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
    """The expressions of one function."""

    def __init__(self, printer: Functions, own: Specialised) -> None:
        self._printer, self._own, self._types = printer, own, printer.types
        self._count = 0

    def of(self, node: ast.expr) -> str:
        """Return an expression."""
        return _EXPRESSIONS[type(node)](self, node)

    def kind(self, node: ast.expr) -> Any:
        """Return the kind of an expression."""
        if isinstance(node, ast.Name) and node.id in self._own.local:
            return self._own.local[node.id]
        return self._own.kinds[node]

    def as_(self, node: ast.expr, kind: Kind | None) -> str:
        """Return an expression as a value of a kind."""
        if kind in (FLOAT64, FLOAT32) and isinstance(node, ast.Constant) and self.kind(node) == INT64:
            return self._types.literal(float(str(node.value)))
        return self._types.converted(self.of(node), self.kind(node), kind)

    def fresh(self, name: str) -> str:
        """Return the name of another variable of the function, for which Python has none."""
        self._count += 1
        return f"{name}_{self._count}"

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
        self._in_order(node.elts, node)
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
        lengths = self._lengths(text, owner)
        if node.attr == "size":
            return f"({' * '.join(lengths)})" if len(lengths) > 1 else lengths[0]
        kind = self.kind(node)
        return self._types.made(kind, lengths)

    @staticmethod
    def _lengths(text: str, owner: Array | Fixed) -> list[str]:
        if isinstance(owner, Fixed):
            return [f"INT64_C({length})" for length in owner.shape]
        return [f"{member(text, 'n')}[{k}]" for k in range(owner.dimensions)]

    def _subscript(self, node: ast.Subscript) -> str:
        owner, text, index = self.kind(node.value), self.of(node.value), node.slice
        if isinstance(index, ast.Slice):
            return self._slice(text, owner, index)
        if isinstance(owner, Tuple):
            place = constant_int(index, {} if isinstance(index, ast.Name) and index.id in self._own.local
                                 else self._own.space)
            if place is not None:
                return self._types.part(text, owner, place % len(owner.elements))
            text = self._types.converted(text, owner, Tuple(owner.elements))
            return f"{member(text, 'v')}[{self.of(index)}]"
        places = index.elts if isinstance(index, ast.Tuple) else [index]
        lengths = self._lengths(text, owner)
        texts = []
        for index, length in zip(places, lengths, strict=False):
            known = constant_int(index, {})
            texts.append(f"{length} - {-known}" if known is not None and known < 0 else self.of(index))
        return self.item(text, owner, texts)[0]

    def item(self, text: str, owner: Array | Fixed, places: list[str]) -> tuple[str, Kind]:
        """Return an element or a row of an array."""
        lengths = self._lengths(text, owner) if isinstance(owner, Array) else [str(n) for n in owner.shape]
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
        self._in_order([node.left, node.right], node)
        left, right, kind = self.kind(node.left), self.kind(node.right), self.kind(node)
        if isinstance(kind, Tuple):
            return self._joined(node, kind)
        if isinstance(node.op, ast.Pow):
            return self._power(node, kind)
        if isinstance(node.op, (ast.FloorDiv, ast.Mod)):
            return self._divided(node, kind)
        a, b = self.as_(node.left, kind), self.as_(node.right, kind)
        if isinstance(node.op, ast.LShift):
            return f"(int64_t)((uint64_t){bracketed(a)} << {bracketed(b)})"
        if isinstance(node.op, ast.RShift):
            return f"((int64_t){bracketed(a)} >> {bracketed(b)})"
        if kind == INT64 and isinstance(node.left, ast.Constant) and isinstance(node.right, ast.Constant):
            a = f"(int64_t){bracketed(a)}"
        if kind == BOOL and left == right == BOOL:
            return f"(({a}) {ARITHMETIC[type(node.op)]} ({b}))"
        return f"({a} {ARITHMETIC[type(node.op)]} {b})"

    def _joined(self, node: ast.BinOp, kind: Tuple) -> str:
        left = self.kind(node.left)
        parts = [self._types.part(self.of(node.left), left, k) for k in range(len(left.elements))]
        right = self.kind(node.right)
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
        return f"floor({a} / {b})" if down else f"mod_float({a}, {b})"

    def _power(self, node: ast.BinOp, kind: Any) -> str:
        exponent = node.right.value if isinstance(node.right, ast.Constant) else None
        if isinstance(exponent, int) and 1 <= exponent <= 4 and isinstance(kind, Scalar):
            body = {1: "x", 2: "x * x", 3: "x * (x * x)", 4: "(x * x) * (x * x)"}[exponent]

            def make(name: str) -> str:
                return f"static inline {kind.c} {name}({kind.c} x) {{ return {body}; }}"

            name = self._types.helper(("power", kind, exponent), f"power_{exponent}", make)
            return f"{name}({self.as_(node.left, kind)})"
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
        self._in_order(sides, node)
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
            return f"static inline bool {name}({type_} x, {options} y) {{ return {' || '.join(parts)}; }}"

        return f"{self._types.helper(('in', kind, other), 'is_in', make)}({self.of(left)}, {self.of(right)})"

    def _conditional(self, node: ast.IfExp) -> str:
        kind = self.kind(node)
        return f"({self.truth(node.test)} ? {self.as_(node.body, kind)} : {self.as_(node.orelse, kind)})"

    def _call(self, node: Any) -> str:
        if node in self._own.calls:
            return self._own_call(node, self._own.calls[node])
        self._in_order(node.args, node)
        if isinstance(node.func, ast.Attribute):
            return self._of_math(node, node.func.attr)
        name = node.func.id
        primitive = self._own.module.derived.primitives.get(name)
        if primitive is not None:
            return self._primitive(node, c_functions.PRIMITIVES[primitive])
        value = self._own.space.get(name)
        if isinstance(value, type) and hasattr(value, "_fields"):
            return self._named_tuple(node, value)
        return self._built_in(node, name)

    def _own_call(self, node: ast.Call, called: Specialised) -> str:
        ordered = ordered_arguments(called.node, node)
        self._in_order(ordered, node)
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
        self._in_order(list(values.values()), node)
        return self._types.made(kind, [
            self.of(values[name]) if name in values else self._types.literal(class_._field_defaults[name])
            for name in class_._fields])

    def _primitive(self, node: ast.Call, primitive: c_functions.Primitive) -> str:
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
        if name in c_functions.ROUNDED:
            return f"whole({c_functions.ROUNDED[name]}{single}({text}))"
        if name in c_functions.TRUTHS:
            return f"({c_functions.TRUTHS[name]}({text}) != 0)"
        return f"{c_functions.MATH[name]}{single}({text})"

    def _built_in(self, node: ast.Call, name: str) -> str:
        argument = node.args[0]
        kind, own = self.kind(argument), self.kind(node)
        if name == "_f" and (number := _number(argument)) is not None:
            return self._types.literal(number if own == FLOAT64 else np.float32(number))
        if name in ("float", "_f"):
            return self.as_(argument, own)
        if name == "bool":
            return self._types.converted(self.of(argument), kind, BOOL)
        if name == "int":
            return f"whole({self.of(argument)})" if kind in (FLOAT64, FLOAT32) else self.as_(argument, INT64)
        if name == "round":
            return f"whole(NEAREST({self.as_(argument, FLOAT64)}))"
        if name == "len":
            return str(len(kind.elements)) if isinstance(kind, Tuple) else self._lengths(
                self.of(argument), kind)[0]
        if name == "abs":
            return f"fabs{'f' * (own == FLOAT32)}({self.of(argument)})" if own != INT64 else (
                f"llabs({self.as_(argument, INT64)})")
        return self._extreme(node, name, kind, own)

    def _extreme(self, node: ast.Call, name: str, first: Kind | None, own: Any) -> str:
        """Return the least or largest of some values, as Python finds it: the first one where others are no better."""
        if len(node.args) == 1 and isinstance(first, Tuple):
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

    def _in_order(self, parts: Sequence[ast.expr], node: ast.expr) -> None:
        """Refuse what Python works out from left to right, and C in any order, where that makes a difference."""
        writing = [part for part in parts if any(n in self._own.calls and self._own.calls[n].writes
                                                 for n in ast.walk(part) if isinstance(n, ast.Call))]
        if writing and any(part is not writing[0] and not _is_settled(part) for part in parts):
            raise self._own.refused(node, "a call that changes records or arrays gets a statement of its own")


def _is_settled(node: ast.expr) -> bool:
    """Tell whether no call could change a value."""
    return not any(isinstance(part, (ast.Call, ast.Subscript)) for part in ast.walk(node))


def by_pointer(kind: Kind | None) -> bool:
    """Tell whether a function gets an argument by its address."""
    return isinstance(kind, Tuple) and len(kind.elements) > 0


def _number(node: ast.expr) -> float | None:
    """Return a literal, or an infinity."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return float(node.value)
    if isinstance(node, ast.Attribute) and node.attr == "inf":
        return math.inf
    return None


_EXPRESSIONS: dict[type[ast.expr], Callable[[Expressions, Any], str]] = {
    ast.Name: Expressions._name, ast.Constant: Expressions._constant_value, ast.Tuple: Expressions._tuple,
    ast.Attribute: Expressions._attribute, ast.Subscript: Expressions._subscript, ast.BinOp: Expressions._binary,
    ast.UnaryOp: Expressions._unary, ast.BoolOp: Expressions._boolean, ast.Compare: Expressions._compare,
    ast.IfExp: Expressions._conditional, ast.Call: Expressions._call}
