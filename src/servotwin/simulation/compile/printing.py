"""Print one function of a derived module as C99."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from servotwin.simulation.compile import c_functions
from servotwin.simulation.compile.c_types import Types, bracketed, identifier, member
from servotwin.simulation.compile.inference import (
    Specialised,
    constant_int,
    dimensions,
    is_range,
    list_length,
    ordered_arguments,
)
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
    leaves,
    of_value,
    united,
)
from servotwin.simulation.compile.variables import Variables

_MANY = 12  # numbers: in the vector form, what takes a tuple of more is inlined, or its numbers go through memory
_INDENT = "    "
_ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.BitAnd: "&", ast.BitOr: "|",
               ast.BitXor: "^"}
_ORDER = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


class Printer:
    """Prints functions, each after those that it calls.

    Attributes
    ----------
    types : Types
        Of all of them.
    functions : list of str
        Their text.
    """

    def __init__(self, vector: bool, in_any_order: frozenset[str]) -> None:
        self.vector, self.in_any_order = vector, in_any_order
        self.types = Types()
        self.functions: list[str] = []
        self._names: dict[Specialised, str] = {}

    def name_of(self, function: Specialised) -> str:
        """Return the name of a function in C, printing it where that has not been done."""
        if function not in self._names:
            text = _Text(self, function)
            self._names[function] = self.types.fresh(function.node.name)
            self.functions.append(text.whole(self._names[function]))
        return self._names[function]


class _Text:
    """The text of one function."""

    def __init__(self, printer: Printer, own: Specialised) -> None:
        self._printer, self._own, self._types = printer, own, printer.types
        self._variables = Variables(own)
        self._count = 0

    # --- the function -------------------------------------------------------------------------------------------------

    def whole(self, name: str) -> str:
        """Return the function under this name."""
        own = self._own
        heads, lines = [], []
        body = self._block(own.node.body, 1)
        used = set(re.findall(r"(?<![\w.>])[A-Za-z_]\w*", " ".join(body)))  # members of structs apart
        for argument, kind in zip(own.names, own.arguments, strict=True):
            there, c_name = own.local[argument], identifier(argument)
            changed = argument in own.stored
            by_pointer = _by_pointer(kind)
            if by_pointer and not changed:
                heads.append(f"const {self._types.of(kind)} *{c_name}")
            elif by_pointer or there != kind:
                pointer = "*" if by_pointer else ""
                heads.append(f"{'const ' * by_pointer}{self._types.declared(kind, pointer + c_name + '_given')}")
                value = self._types.converted(f"({pointer}{c_name}_given)" if pointer else f"{c_name}_given", kind, there)
                assert there is not None  # noqa: S101 - an argument has a kind
                lines.append(f"{_INDENT}{self._types.declared(there, c_name)} = {value};")
            else:
                heads.append(self._types.declared(kind, c_name))
            if c_name not in used:
                lines.append(f"{_INDENT}(void){c_name};")
        returned = self._types.of(own.result)
        head = f"{self._lead()} {returned}{'' if returned.endswith('*') else ' '}{name}({', '.join(heads) or 'void'})"
        return "\n".join([f"{head} {{", *lines, *body, "}", ""])

    def _lead(self) -> str:
        """Return how the function is to be compiled: in the vector form all is inlined but for loops over lanes."""
        loops = any(isinstance(node, (ast.For, ast.While)) for node in ast.walk(self._own.node))
        wide = any(isinstance(kind, Tuple) and leaves(kind) > _MANY for kind in self._own.arguments)
        return "INLINED" if self._printer.vector and (wide or not loops) else "static"

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
        assert kind is not None  # noqa: S101 - `Variables` has no others
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
        return [f"return {self._as(node.value, self._own.result)};"]

    def _expression(self, node: ast.Expr) -> list[str]:
        if isinstance(node.value, ast.Constant):
            return []
        text = self.of(node.value)
        return [f"(void){text};" if self._kind(node.value) is not None else f"{text};"]

    def _if(self, node: ast.If) -> list[str]:
        lines = [f"if ({self._truth(node.test)}) {{", *self._inner(node.body)]
        if node.orelse:
            lines += ["} else {", *self._inner(node.orelse)]
        return [*lines, "}"]

    def _while(self, node: ast.While) -> list[str]:
        return [f"while ({self._truth(node.test)}) {{", *self._inner(node.body), "}"]

    def _for(self, node: ast.For) -> list[str]:
        if is_range(node.iter):
            return [*self._summing(node), *self._counting(node)]
        return self._going_over(node)

    def _summing(self, node: ast.For) -> list[str]:
        """Return the line that lets sums be taken in any order."""
        if not self._printer.vector or self._own.node.name not in self._printer.in_any_order:
            return []
        sums = sorted({n.target.id for n in ast.walk(node) if isinstance(n, ast.AugAssign)
                       and isinstance(n.target, ast.Name) and isinstance(n.op, ast.Add)})
        return [f"SUM_IN_ANY_ORDER({', '.join(map(identifier, sums))})"] if sums else []

    def _counting(self, node: ast.For) -> list[str]:
        """Return a loop over a range, whose bounds are worked out once."""
        assert isinstance(node.iter, ast.Call)  # noqa: S101
        assert isinstance(node.target, ast.Name)  # noqa: S101
        bounds = node.iter.args
        low, high = ("0", self.of(bounds[0])) if len(bounds) == 1 else (self.of(bounds[0]), self.of(bounds[1]))
        step = constant_int(bounds[2], self._own.space) if len(bounds) == 3 else 1
        if step is None or step == 0:
            raise self._own.refused(node, "the step of a range is a constant")
        name = identifier(node.target.id)
        counter = name if node.target.id in self._variables.counters else self._fresh(name)
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
        kind, counter, over = self._kind(node.iter), self._fresh("at"), self._fresh("over")
        if isinstance(kind, Tuple):
            each = kind.elements[0]
            for element in kind.elements[1:]:
                each = united(each, element) or each
            parts = [self._types.converted(self._types.part(over, kind, k), element, each)
                     for k, element in enumerate(kind.elements)]
            if isinstance(node.iter, ast.Tuple):
                parts = [self._as(element, each) for element in node.iter.elts]
            lines = [] if isinstance(node.iter, ast.Tuple) else [
                f"const {self._types.of(kind)} {over} = {self.of(node.iter)};"]
            lines.append(f"const {self._types.of(each)} {over}_all[] = {{{', '.join(parts)}}};")
            value, count = f"{over}_all[{counter}]", str(len(parts))
        else:
            assert isinstance(kind, Array)  # noqa: S101 - `Specialised` has seen to it
            lines = [f"const {self._types.of(kind)} {over} = {self.of(node.iter)};"]
            each = kind.element
            value, count = f"{'&' * isinstance(each, Record)}{over}.p[{counter}]", f"{over}.n[0]"
        store = [_INDENT * 2 + line for line in self._stored(node.target, value, each)]
        return ["{", *(_INDENT + line for line in lines),
                f"{_INDENT}for (int64_t {counter} = 0; {counter} < {count}; {counter}++) {{", *store,
                *(_INDENT + line for line in self._inner(node.body)), f"{_INDENT}}}", "}"]

    def _assign(self, node: ast.Assign) -> list[str]:
        if list_length(node.value, self._own.space):
            return self._filled(node)
        if len(node.targets) == 1:
            (target,) = node.targets
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                return self._at_once(target, node.value)
            if not isinstance(target, ast.Tuple):
                return self._single(target, node.value)
        kind, name = self._kind(node.value), self._fresh("value")
        assert kind is not None  # noqa: S101
        lines = [f"{self._constant(kind)}{self._types.declared(kind, name)} = {self.of(node.value)};"]
        for target in node.targets:
            lines += self._stored(target, name, kind)
        return lines

    def _single(self, target: ast.expr, value: ast.expr) -> list[str]:
        kind = self._kind(value)
        if isinstance(target, ast.Name) and target.id not in self._variables.read:
            return [f"(void){bracketed(self.of(value))};"] if _calls(value) else []
        if isinstance(target, ast.Name) and isinstance(there := self._own.local[target.id], Scalar):
            return self._stored(target, self._as(value, there), there)
        return self._stored(target, self.of(value), kind, value)

    def _filled(self, node: ast.Assign) -> list[str]:
        """Return the loop that fills a list."""
        (target,) = node.targets
        assert isinstance(target, ast.Name)  # noqa: S101
        assert isinstance(value := node.value, ast.BinOp) and isinstance(value.left, ast.List)  # noqa: S101
        kind = self._own.local[target.id]
        assert isinstance(kind, Fixed)  # noqa: S101
        counter = self._fresh("at")
        lines = [self._declaration(target.id)] if self._variables.is_declared_by(node, target.id) else []
        return [*lines, f"for (int64_t {counter} = 0; {counter} < {kind.count}; {counter}++) {{",
                f"{_INDENT}{identifier(target.id)}[{counter}] = {self._as(value.left.elts[0], kind.element)};", "}"]

    def _at_once(self, targets: ast.Tuple, values: ast.Tuple) -> list[str]:
        """Return assignments of several values, which are all worked out before the first is stored."""
        stored: set[str] = set()
        apart = True
        for target, value in zip(targets.elts, values.elts, strict=True):
            read = {n.id for n in ast.walk(value) if isinstance(n, ast.Name)}
            apart = apart and not (stored & read) and isinstance(target, ast.Name)
            stored |= {target.id} if isinstance(target, ast.Name) else set()
        lines: list[str] = []
        if apart and not any(isinstance(self._kind(value), (Record, Fixed)) for value in values.elts):
            for target, value in zip(targets.elts, values.elts, strict=True):
                lines += self._single(target, value)
            return lines
        kept = []
        for target, value in zip(targets.elts, values.elts, strict=True):
            kind, name = self._kind(value), self._fresh("value")
            assert kind is not None  # noqa: S101
            lines.append(f"{self._constant(kind)}{self._types.declared(kind, name)} = {self.of(value)};")
            kept.append((target, name, kind))
        for target, name, kind in kept:
            if isinstance(target, ast.Name) and target.id not in self._variables.read:
                lines.append(f"(void){name};")
            else:
                lines += self._stored(target, name, kind)
        return lines

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
            assert there is not None  # noqa: S101
            name = identifier(target.id)
            if self._variables.is_declared_by(target, target.id):
                name = self._types.declared(there, name)
            return [f"{name} = {self._types.converted(text, kind, there)};"]
        there = self._kind(target)
        if isinstance(target, ast.Subscript) and isinstance(target.slice, ast.Slice):
            return self._all(target, text, kind)
        if isinstance(there, Record):
            return [f"*{bracketed(self.of(target))} = *{bracketed(text)};"]
        if isinstance(there, Fixed):
            return [f"memcpy({self.of(target)}, {text}, {there.count} * sizeof({self._types.element(there.element)}));"]
        if isinstance(there, Array):
            return self._all(target, text, kind)
        return [f"{self.of(target)} = {self._types.converted(text, kind, there)};"]

    def _all(self, target: ast.expr, text: str, kind: Kind | None) -> list[str]:
        """Return the loop that gives all elements of an array a value, or those of another array."""
        there, name, counter = self._kind(target), self._fresh("row"), self._fresh("at")
        assert isinstance(there, Array)  # noqa: S101
        if there.dimensions != 1:
            raise self._own.refused(target, "a row is stored at once, or a number")
        lines = [f"const {self._types.of(there)} {name} = {self.of(target)};"]
        if isinstance(kind, Scalar):
            value = self._fresh("value")
            lines.append(f"const {self._types.of(kind)} {value} = {text};")
            one = value
        else:
            other = self._fresh("row")
            lines.append(f"const {self._types.of(there)} {other} = {self._types.converted(text, kind, there)};")
            kind, one = there.element, f"{other}.p[{counter}]"
        return ["{", *(_INDENT + line for line in lines),
                f"{_INDENT}for (int64_t {counter} = 0; {counter} < {name}.n[0]; {counter}++) {{",
                f"{_INDENT * 2}{name}.p[{counter}] = {self._types.converted(one, kind, there.element)};",
                f"{_INDENT}}}", "}"]

    def _unpacked(self, target: ast.Tuple, text: str, kind: Kind | None) -> list[str]:
        lines = []
        for place, each in enumerate(target.elts):
            if isinstance(kind, Tuple):
                lines += self._stored(each, self._types.part(text, kind, place), kind.elements[place])
            else:
                assert isinstance(kind, (Array, Fixed))  # noqa: S101
                part, element = self._item(text, kind, [str(place)])
                lines += self._stored(each, part, element)
        return lines

    def _augmented(self, node: ast.AugAssign) -> list[str]:
        target, kind = node.target, self._kind(node.target)
        assert isinstance(kind, Scalar)  # noqa: S101
        if isinstance(target, ast.Name):
            kind = self._own.local[target.id]
            if target.id not in self._variables.read:
                return [f"(void){bracketed(self.of(node.value))};"] if _calls(node.value) else []
        sign = _ARITHMETIC.get(type(node.op))
        if sign is None or (sign == "/" and kind not in (FLOAT64, FLOAT32)):
            raise self._own.refused(node, "the operation is written out")
        if kind == FLOAT32 and self._kind(node.value) == FLOAT64:
            return [f"{self.of(target)} = (float)({self.of(target)} {sign} {bracketed(self.of(node.value))});"]
        return [f"{self.of(target)} {sign}= {self._as(node.value, kind)};"]

    # --- expressions --------------------------------------------------------------------------------------------------

    def of(self, node: ast.expr) -> str:
        """Return an expression."""
        return _EXPRESSIONS[type(node)](self, node)

    def _kind(self, node: ast.expr) -> Kind | None:
        if isinstance(node, ast.Name) and node.id in self._own.local:
            return self._own.local[node.id]
        return self._own.kinds[node]

    def _as(self, node: ast.expr, kind: Kind | None) -> str:
        """Return an expression as a value of a kind."""
        if kind in (FLOAT64, FLOAT32) and isinstance(node, ast.Constant) and self._kind(node) == INT64:
            return self._types.literal(float(node.value))  # type: ignore[arg-type]
        return self._types.converted(self.of(node), self._kind(node), kind)

    def _fresh(self, name: str) -> str:
        self._count += 1
        return f"{name}_{self._count}"

    def _truth(self, node: ast.expr) -> str:
        """Return an expression as a condition."""
        text = self._types.converted(self.of(node), self._kind(node), BOOL)
        return text[1:-1] if text.startswith("(") and bracketed(text) == text else text

    def _name(self, node: ast.Name) -> str:
        if node.id in self._own.local:
            if node.id in self._own.names and node.id not in self._own.stored and _by_pointer(self._own.local[node.id]):
                return f"(*{identifier(node.id)})"
            return identifier(node.id)
        return self._types.literal(self._own.space[node.id])

    def _constant_value(self, node: ast.Constant) -> str:
        return self._types.literal(node.value)

    def _tuple(self, node: ast.Tuple) -> str:
        self._in_order(node.elts, node)
        kind = self._kind(node)
        assert isinstance(kind, Tuple)  # noqa: S101
        return self._types.made(kind, [self.of(element) for element in node.elts])

    def _attribute(self, node: ast.Attribute) -> str:
        if isinstance(node.value, ast.Name) and node.value.id == "math":
            return self._types.literal(getattr(math, node.attr))
        owner, text = self._kind(node.value), self.of(node.value)
        if isinstance(owner, Tuple):
            return self._types.part(text, owner, owner.fields.index(node.attr))
        if isinstance(owner, Record):
            place = f"{text[1:]}.{identifier(node.attr)}" if text.startswith("&") else (
                f"{bracketed(text)}->{identifier(node.attr)}")
            return f"&{place}" if isinstance(self._kind(node), Record) else place
        assert isinstance(owner, (Array, Fixed))  # noqa: S101
        lengths = self._lengths(text, owner)
        if node.attr == "size":
            return f"({' * '.join(lengths)})" if len(lengths) > 1 else lengths[0]
        kind = self._kind(node)
        assert isinstance(kind, Tuple)  # noqa: S101
        return self._types.made(kind, lengths)

    @staticmethod
    def _lengths(text: str, owner: Array | Fixed) -> list[str]:
        if isinstance(owner, Fixed):
            return [f"INT64_C({length})" for length in owner.shape]
        return [f"{member(text, 'n')}[{k}]" for k in range(owner.dimensions)]

    def _subscript(self, node: ast.Subscript) -> str:
        owner, text, index = self._kind(node.value), self.of(node.value), node.slice
        if isinstance(index, ast.Slice):
            return self._slice(text, owner, index)
        if isinstance(owner, Tuple):
            place = constant_int(index, {} if isinstance(index, ast.Name) and index.id in self._own.local
                                 else self._own.space)
            if place is not None:
                return self._types.part(text, owner, place % len(owner.elements))
            text = self._types.converted(text, owner, Tuple(owner.elements))
            return f"{member(text, 'v')}[{self.of(index)}]"
        assert isinstance(owner, (Array, Fixed))  # noqa: S101
        places = index.elts if isinstance(index, ast.Tuple) else [index]
        lengths = self._lengths(text, owner)
        texts = []
        for place, each in zip(places, lengths, strict=False):
            known = constant_int(place, {})
            texts.append(f"{each} - {-known}" if known is not None and known < 0 else self.of(place))
        return self._item(text, owner, texts)[0]

    def _item(self, text: str, owner: Array | Fixed, places: list[str]) -> tuple[str, Kind]:
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

    def _slice(self, text: str, owner: Kind | None, index: ast.Slice) -> str:
        if isinstance(owner, Tuple):
            low, high = (constant_int(bound, {}) if bound is not None else None for bound in (index.lower, index.upper))
            part = Tuple(owner.elements[low:high])
            return self._types.made(part, [self._types.part(text, owner, k)
                                           for k in range(len(owner.elements))[low:high]])
        assert isinstance(owner, (Array, Fixed))  # noqa: S101
        array = owner if isinstance(owner, Array) else Array(owner.element, len(owner.shape))
        type_ = self._types.of(array)
        rest = "".join(f" * x.n[{k}]" for k in range(1, array.dimensions))

        def make(name: str) -> str:
            return (f"static inline {type_} {name}({type_} x, int64_t low, int64_t high) {{\n"
                    f"    low = clamped(low, x.n[0]), high = clamped(high, x.n[0]);\n"
                    f"    x.p += low{rest}, x.n[0] = high > low ? high - low : 0;\n    return x;\n}}")

        name = self._types.helper(("slice", array), f"slice_of_{type_}", make)
        low = self.of(index.lower) if index.lower is not None else "0"
        high = self.of(index.upper) if index.upper is not None else "INT64_MAX"
        return f"{name}({self._types.converted(text, owner, array)}, {low}, {high})"

    def _binary(self, node: ast.BinOp) -> str:
        self._in_order([node.left, node.right], node)
        left, right, kind = self._kind(node.left), self._kind(node.right), self._kind(node)
        if isinstance(kind, Tuple):
            return self._joined(node, kind)
        if isinstance(node.op, ast.Pow):
            return self._power(node, kind)
        if isinstance(node.op, (ast.FloorDiv, ast.Mod)):
            return self._divided(node, kind)
        a, b = self._as(node.left, kind), self._as(node.right, kind)
        if isinstance(node.op, ast.LShift):
            return f"(int64_t)((uint64_t){bracketed(a)} << {bracketed(b)})"
        if isinstance(node.op, ast.RShift):
            return f"((int64_t){bracketed(a)} >> {bracketed(b)})"
        if kind == INT64 and isinstance(node.left, ast.Constant) and isinstance(node.right, ast.Constant):
            a = f"(int64_t){bracketed(a)}"
        if kind == BOOL and left == right == BOOL:
            return f"(({a}) {_ARITHMETIC[type(node.op)]} ({b}))"
        return f"({a} {_ARITHMETIC[type(node.op)]} {b})"

    def _joined(self, node: ast.BinOp, kind: Tuple) -> str:
        left = self._kind(node.left)
        assert isinstance(left, Tuple)  # noqa: S101
        parts = [self._types.part(self.of(node.left), left, k) for k in range(len(left.elements))]
        right = self._kind(node.right)
        if isinstance(right, Tuple):
            parts += [self._types.part(self.of(node.right), right, k) for k in range(len(right.elements))]
        else:
            parts *= len(kind.elements) // len(parts)
        return self._types.made(kind, parts)

    def _divided(self, node: ast.BinOp, kind: Kind | None) -> str:
        a, b = self._as(node.left, kind), self._as(node.right, kind)
        down = isinstance(node.op, ast.FloorDiv)
        if kind == INT64:
            return f"{'floor_div' if down else 'floor_mod'}({a}, {b})"
        if kind == FLOAT32:
            raise self._own.refused(node, "a float32 is divided and rounded in two steps")
        return f"floor({a} / {b})" if down else f"mod_float({a}, {b})"

    def _power(self, node: ast.BinOp, kind: Kind | None) -> str:
        exponent = node.right.value if isinstance(node.right, ast.Constant) else None
        if isinstance(exponent, int) and 1 <= exponent <= 4 and isinstance(kind, Scalar):
            body = {1: "x", 2: "x * x", 3: "x * (x * x)", 4: "(x * x) * (x * x)"}[exponent]

            def make(name: str) -> str:
                return f"static inline {kind.c} {name}({kind.c} x) {{ return {body}; }}"

            return f"{self._types.helper(('power', kind, exponent), f'power_{exponent}', make)}({self._as(node.left, kind)})"
        return f"pow{'f' * (kind == FLOAT32)}({self._as(node.left, kind)}, {self._as(node.right, kind)})"

    def _unary(self, node: ast.UnaryOp) -> str:
        if isinstance(node.op, ast.Not):
            return f"(!{bracketed(self._truth(node.operand))})"
        text = self._as(node.operand, self._kind(node))
        sign = {ast.USub: "-", ast.UAdd: "", ast.Invert: "~"}[type(node.op)]
        if sign == "~":
            return f"(~(int64_t){bracketed(text)})"
        return f"({sign}{bracketed(text)})"

    def _boolean(self, node: ast.BoolOp) -> str:
        sign = " && " if isinstance(node.op, ast.And) else " || "
        return f"({sign.join(bracketed(self._types.converted(self.of(v), self._kind(v), BOOL)) for v in node.values)})"

    def _compare(self, node: ast.Compare) -> str:
        sides = [node.left, *node.comparators]
        self._in_order(sides, node)
        if len(node.ops) == 1:
            return f"({self._one_comparison(node.ops[0], node.left, node.comparators[0])})"
        if len(node.ops) != 2 or not all(type(op) in _ORDER for op in node.ops):
            raise self._own.refused(node, "a chain has two comparisons of numbers")
        kind: Kind | None = None
        for side in sides:
            kind = united(kind, self._kind(side))
        assert isinstance(kind, Scalar)  # noqa: S101
        first, second = (_ORDER[type(op)] for op in node.ops)

        def make(name: str) -> str:
            return (f"static inline bool {name}({kind.c} a, {kind.c} b, {kind.c} c) "
                    f"{{ return a {first} b && b {second} c; }}")

        name = self._types.helper(("chain", kind, first, second), "in_order", make)
        return f"{name}({', '.join(self._as(side, kind) for side in sides)})"

    def _one_comparison(self, op: ast.cmpop, left: ast.expr, right: ast.expr) -> str:
        kind, other = self._kind(left), self._kind(right)
        if type(op) in _ORDER:
            return f"{self.of(left)} {_ORDER[type(op)]} {self.of(right)}"
        assert kind is not None  # noqa: S101
        assert other is not None  # noqa: S101
        if isinstance(op, (ast.In, ast.NotIn)):
            assert isinstance(other, Tuple)  # noqa: S101
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
        kind = self._kind(node)
        return f"({self._truth(node.test)} ? {self._as(node.body, kind)} : {self._as(node.orelse, kind)})"

    def _call(self, node: ast.Call) -> str:
        if node in self._own.calls:
            return self._own_call(node, self._own.calls[node])
        self._in_order(node.args, node)
        if isinstance(node.func, ast.Attribute):
            return self._of_math(node, node.func.attr)
        assert isinstance(node.func, ast.Name)  # noqa: S101
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
            parts.append(self._address(text, kind) if _by_pointer(kind) else text)
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
        kind = self._kind(node)
        assert isinstance(kind, Tuple)  # noqa: S101
        self._in_order(list(values.values()), node)
        return self._types.made(kind, [
            self.of(values[name]) if name in values else self._types.literal(class_._field_defaults[name])
            for name in class_._fields])

    def _primitive(self, node: ast.Call, primitive: c_functions.Primitive) -> str:
        kind = self._kind(node)
        if primitive.result is None and isinstance(kind, Scalar):
            texts = [self._as(argument, kind) for argument in node.args]
        else:
            texts = [self.of(argument) for argument in node.args]
        return primitive.text.format(*texts, s="f" * (kind == FLOAT32), n=len(texts) - 1, all=", ".join(texts))

    def _of_math(self, node: ast.Call, name: str) -> str:
        kinds = [self._kind(argument) for argument in node.args]
        kind = FLOAT32 if FLOAT32 in kinds and FLOAT64 not in kinds else FLOAT64
        text = ", ".join(self._as(argument, kind) for argument in node.args)
        single = "f" * (kind == FLOAT32)
        if name in c_functions.ROUNDED:
            return f"whole({c_functions.ROUNDED[name]}{single}({text}))"
        if name in c_functions.TRUTHS:
            return f"({c_functions.TRUTHS[name]}({text}) != 0)"
        return f"{c_functions.MATH[name]}{single}({text})"

    def _built_in(self, node: ast.Call, name: str) -> str:
        argument = node.args[0]
        kind, own = self._kind(argument), self._kind(node)
        if name == "_f" and (number := _number(argument)) is not None:
            return self._types.literal(number if own == FLOAT64 else np.float32(number))
        if name in ("float", "_f"):
            return self._as(argument, own)
        if name == "bool":
            return self._types.converted(self.of(argument), kind, BOOL)
        if name == "int":
            return f"whole({self.of(argument)})" if kind in (FLOAT64, FLOAT32) else self._as(argument, INT64)
        if name == "round":
            return f"whole(NEAREST({self._as(argument, FLOAT64)}))"
        if name == "len":
            assert kind is not None  # noqa: S101
            return str(len(kind.elements)) if isinstance(kind, Tuple) else self._lengths(
                self.of(argument), kind)[0]  # type: ignore[arg-type]
        if name == "abs":
            return f"fabs{'f' * (own == FLOAT32)}({self.of(argument)})" if own != INT64 else (
                f"llabs({self._as(argument, INT64)})")
        return self._extreme(node, name, kind, own)

    def _extreme(self, node: ast.Call, name: str, first: Kind | None, own: Kind | None) -> str:
        """Return the least or largest of some values, as Python finds it: the first one where others are no better."""
        assert isinstance(own, Scalar)  # noqa: S101
        if len(node.args) == 1 and isinstance(first, Tuple):
            text = self.of(node.args[0])
            parts = [self._types.converted(self._types.part(text, first, k), kind, own)
                     for k, kind in enumerate(first.elements)]
        else:
            parts = [self._as(argument, own) for argument in node.args]
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


def _calls(node: ast.expr) -> bool:
    return any(isinstance(part, ast.Call) for part in ast.walk(node))


def _by_pointer(kind: Kind | None) -> bool:
    return isinstance(kind, Tuple) and len(kind.elements) > 0


def _number(node: ast.expr) -> float | None:
    """Return a literal, or an infinity."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return float(node.value)
    if isinstance(node, ast.Attribute) and node.attr == "inf":
        return math.inf
    return None


_STATEMENTS: dict[type[ast.stmt], Callable[[_Text, Any], list[str]]] = {
    ast.Pass: _Text._pass, ast.Break: _Text._break, ast.Continue: _Text._continue, ast.Return: _Text._return,
    ast.Expr: _Text._expression, ast.Assign: _Text._assign, ast.AugAssign: _Text._augmented, ast.If: _Text._if,
    ast.While: _Text._while, ast.For: _Text._for}
_EXPRESSIONS: dict[type[ast.expr], Callable[[_Text, Any], str]] = {
    ast.Name: _Text._name, ast.Constant: _Text._constant_value, ast.Tuple: _Text._tuple,
    ast.Attribute: _Text._attribute, ast.Subscript: _Text._subscript, ast.BinOp: _Text._binary,
    ast.UnaryOp: _Text._unary, ast.BoolOp: _Text._boolean, ast.Compare: _Text._compare,
    ast.IfExp: _Text._conditional, ast.Call: _Text._call}
