"""Print the calls in a derived function as C99."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from servotwin.simulation.compile import c_functions
from servotwin.simulation.compile.expressions import Expressions, by_pointer
from servotwin.simulation.compile.inference import Specialised
from servotwin.simulation.compile.kind_rules import ordered_arguments
from servotwin.simulation.compile.kinds import BOOL, FLOAT32, FLOAT64, INT64, Kind, Scalar, Tuple


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
            return self._primitive(node, c_functions.PRIMITIVES[primitive])
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
            if kinds[0] not in (FLOAT64, FLOAT32):
                return self.as_(node.args[0], INT64)
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
