"""Rules of kinds: what fits where, what a part of a value is, and what the text of a kernel says of itself."""

from __future__ import annotations

import ast
from typing import Any

from servotwin.simulation.compile.text.kinds import (
    BOOL,
    FLOAT32,
    FLOAT64,
    INT8,
    INT32,
    INT64,
    Array,
    Fixed,
    Kind,
    Record,
    Scalar,
    Tuple,
    of_dtype,
    united,
)

WHOLE = (INT64, INT32, INT8, BOOL)


def fits(kind: Kind, there: Kind) -> bool:
    """Tell whether a value of a kind may be put where another one is."""
    if isinstance(there, (Array, Fixed)) and isinstance(kind, Scalar):
        return True  # x[:] = 0.0
    try:
        both = united(kind, there)
    except TypeError:
        return False
    return both == there or not (isinstance(there, Scalar) and there in WHOLE and both not in WHOLE)


def comparable(a: Kind, b: Kind) -> bool:
    """Tell whether two values may be equal."""
    if isinstance(a, Tuple) and isinstance(b, Tuple):
        return len(a.elements) == len(b.elements) and all(map(comparable, a.elements, b.elements))
    return isinstance(a, Scalar) and isinstance(b, Scalar)


def dimensions(kind: Array | Fixed) -> int:
    """Return how many dimensions an array has."""
    return kind.dimensions if isinstance(kind, Array) else len(kind.shape)


def row(kind: Array | Fixed, places: int) -> Kind:
    """Return the kind of what stands behind so many indices."""
    left = dimensions(kind) - places
    if left == 0:
        return kind.element
    return Array(kind.element, left) if isinstance(kind, Array) else Fixed(kind.element, kind.shape[places:])


def field_kind(record: Record, name: str) -> Kind:
    """Return the kind of a field of a record."""
    own = record.dtype[name]
    base, shape = own.subdtype if own.subdtype else (own, ())
    element = of_dtype(base)
    return Fixed(element, shape) if shape else element


def power(kind: Kind | None, node: ast.AST) -> Kind | None:
    """Return the kind of a power of a number; a constant whole exponent leaves it as it is."""
    whole = is_whole_constant(node)
    return kind if whole and kind not in WHOLE else INT64 if whole else FLOAT32 if kind == FLOAT32 else FLOAT64


def is_whole_constant(node: ast.AST) -> bool:
    """Tell whether the exponent of a power is a constant whole number."""
    exponent = node.right if isinstance(node, ast.BinOp) else None
    return isinstance(exponent, ast.Constant) and isinstance(exponent.value, int)


def in_memory(kind: Kind) -> bool:
    """Tell whether arrays belong to a value."""
    return any(map(in_memory, kind.elements)) if isinstance(kind, Tuple) else isinstance(kind, (Array, Fixed))


def leaves(node: ast.stmt) -> bool:
    """Tell whether nothing behind a statement is reached."""
    if isinstance(node, ast.If):
        return bool(node.orelse) and leaves(node.body[-1]) and leaves(node.orelse[-1])
    endless = isinstance(node, ast.While) and isinstance(node.test, ast.Constant) and bool(node.test.value)
    return isinstance(node, ast.Return) or (endless and not any(isinstance(part, ast.Break) for part in ast.walk(node)))


def constant_int(node: ast.expr, space: dict[str, Any]) -> int | None:
    """Return a whole number that is known when deriving."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = constant_int(node.operand, space)
        return None if inner is None else -inner
    value = node.value if isinstance(node, ast.Constant) else space.get(node.id) if isinstance(node, ast.Name) else None
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def list_length(node: ast.expr, space: dict[str, Any]) -> int | None:
    """Return the length of `[x] * length`, None for anything else."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult) and isinstance(node.left, ast.List):
        return constant_int(node.right, space)
    return None


def is_range(node: ast.expr) -> bool:
    """Tell whether a loop goes over a range."""
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range"


def ordered_arguments(function: ast.FunctionDef, call: ast.Call) -> list[ast.expr]:
    """Return what a call gives a derived function, in the order of its arguments, defaults included."""
    names = [argument.arg for argument in function.args.args]
    known = set(names[len(call.args):])
    if len(call.args) > len(names) or not {k.arg for k in call.keywords} <= known:
        raise TypeError(f"{function.name} takes {', '.join(names) or 'nothing'}")
    given = dict(zip(names, call.args, strict=False)) | {k.arg: k.value for k in call.keywords}
    defaults = dict(zip(names[::-1], function.args.defaults[::-1], strict=False))
    missing = [name for name in names if name not in given and name not in defaults]
    if missing:
        raise TypeError(f"{', '.join(missing)} of {function.name} is missing")
    return [given.get(name) or defaults[name] for name in names]
