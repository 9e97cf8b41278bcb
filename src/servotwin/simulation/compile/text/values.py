"""Find the kinds of expressions in one derived function."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from servotwin.simulation.compile import c_types
from servotwin.simulation.compile.text.kind_rules import (
    WHOLE,
    comparable,
    constant_int,
    dimensions,
    field_kind,
    is_whole_constant,
    ordered_arguments,
    power,
    row,
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
    TranslationError,
    Tuple,
    of_value,
    told,
    united,
)


@dataclass(eq=False)
class Values:
    """A function as it is called with arguments of some kinds, and the kinds of its expressions.

    Attributes
    ----------
    kinds : dict
        Of its expressions, by node.
    calls : dict
        Functions that its calls of derived functions call, by node.
    local : dict
        Kinds of arguments and local variables, by name.
    owned : set of str
        Local variables that are lists of a constant length.
    result : kind or None
        None: it returns nothing.
    writes : bool
        Whether it changes a record or an array that was given to it.
    """

    module: Any
    node: ast.FunctionDef
    arguments: tuple[Kind, ...]
    kinds: dict[ast.AST, Kind | None] = field(default_factory=dict)
    calls: dict[ast.Call, Any] = field(default_factory=dict)
    local: dict[str, Any] = field(default_factory=dict)
    owned: set[str] = field(default_factory=set)
    result: Kind | None = None
    writes: bool = False

    def __post_init__(self) -> None:
        self.names = [argument.arg for argument in self.node.args.args]
        if self.node.args.vararg or self.node.args.kwarg or len(self.names) != len(self.arguments):
            raise self.refused(self.node, "arguments are named one by one")
        self.local |= dict(zip(self.names, self.arguments, strict=True))
        self.stored = {n.id for n in ast.walk(self.node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}

    @property
    def space(self) -> dict[str, Any]:
        """The values of the derived module."""
        space: dict[str, Any] = self.module.derived.space
        return space

    def refused(self, node: ast.AST, instead: str) -> TranslationError:
        """Return the error for a piece of text."""
        first = ast.unparse(node).splitlines()[0]
        return TranslationError(self.node.name, first, instead)

    def is_own(self, target: ast.expr) -> bool:
        """Tell whether a target is part of a list of this function."""
        root = self.root(target)
        return isinstance(root, ast.Name) and root.id in self.owned

    def is_constant(self, node: ast.expr) -> bool:
        """Tell whether a name is one of the derived module."""
        return isinstance(node, ast.Name) and node.id not in self.local and node.id not in self.stored

    @staticmethod
    def root(node: ast.expr) -> ast.expr:
        """Return what an attribute or an element belongs to in the end."""
        while isinstance(node, (ast.Subscript, ast.Attribute)):
            node = node.value
        return node

    # --- expressions --------------------------------------------------------------------------------------------------

    def of(self, node: ast.expr) -> Kind | None:
        """Return the kind of an expression; None where it is not known yet, or nothing."""
        handler = _EXPRESSIONS.get(type(node))
        if handler is None:
            raise self.refused(node, "a kernel has numbers, tuples, attributes, indices, arithmetic and calls; a list "
                                     "gets its room from outside")
        kind: Kind | None = handler(self, node)
        self.kinds[node] = kind
        return kind

    def _name(self, node: ast.Name) -> Kind | None:
        if node.id in self.local or node.id in self.stored:
            return self.local.get(node.id)
        if node.id not in self.space:
            raise self.refused(node, "there is no such name")
        return of_value(self.space[node.id])

    def _constant(self, node: ast.Constant) -> Kind | None:
        kind = of_value(node.value)
        if kind is None:
            raise self.refused(node, "the constants of a kernel are float64, int64 and truth values")
        return kind

    def _tuple(self, node: ast.Tuple) -> Kind | None:
        return self._tuple_of([self.of(element) for element in node.elts])

    @staticmethod
    def _tuple_of(kinds: Sequence[Kind | None], name: str = "", fields: tuple[str, ...] = ()) -> Kind | None:
        known = tuple(kind for kind in kinds if kind is not None)
        return Tuple(known, name, fields) if len(known) == len(kinds) else None

    def _attribute(self, node: ast.Attribute) -> Kind | None:
        if isinstance(node.value, ast.Name) and node.value.id == "math":
            if not isinstance(getattr(math, node.attr, None), float):
                raise self.refused(node, "of `math` there are functions, which are called, and numbers")
            return FLOAT64
        owner = self.of(node.value)
        if owner is None:
            return None
        if isinstance(owner, Tuple) and node.attr in owner.fields:
            return owner.elements[owner.fields.index(node.attr)]
        if isinstance(owner, Record) and node.attr in (owner.dtype.names or ()):
            return field_kind(owner, node.attr)
        if isinstance(owner, (Array, Fixed)) and node.attr == "size":
            return INT64
        if isinstance(owner, (Array, Fixed)) and node.attr == "shape":
            return Tuple((INT64,) * dimensions(owner))
        raise self.refused(node, f"{told(owner)} has no {node.attr}")

    def _subscript(self, node: ast.Subscript) -> Kind | None:
        owner, index = self.of(node.value), node.slice
        if isinstance(index, ast.Slice):
            return self._slice(node, owner, index)
        places = index.elts if isinstance(index, ast.Tuple) else [index]
        if any(isinstance(place, ast.Slice) for place in places) or (
                isinstance(index, ast.Constant) and isinstance(index.value, str)):
            raise self.refused(node, "an index is a whole number, or one slice of the first dimension")
        for place in places:
            self.whole(place)
        if owner is None:
            return None
        if isinstance(owner, Tuple):
            return self._of_tuple(node, owner, index)
        if isinstance(owner, (Array, Fixed)) and len(places) <= dimensions(owner):
            return row(owner, len(places))
        raise self.refused(node, f"{told(owner)} has no such element")

    def _of_tuple(self, node: ast.Subscript, owner: Tuple, index: ast.expr) -> Kind | None:
        place = constant_int(index, self.space if not self._is_local(index) else {})
        if place is not None:
            if not -len(owner.elements) <= place < len(owner.elements):
                raise self.refused(node, f"there are {len(owner.elements)} values")
            return owner.elements[place]
        if len(set(owner.elements)) != 1:
            raise self.refused(node, "only a tuple of values of one kind is indexed by a variable")
        return owner.elements[0]

    def _is_local(self, node: ast.expr) -> bool:
        return isinstance(node, ast.Name) and (node.id in self.local or node.id in self.stored)

    def _slice(self, node: ast.Subscript, owner: Kind | None, index: ast.Slice) -> Kind | None:
        if index.step is not None:
            raise self.refused(node, "a slice has no step")
        for bound in (index.lower, index.upper):
            if bound is not None:
                self.whole(bound)
        if owner is None:
            return None
        if isinstance(owner, Tuple):
            low, high = (constant_int(bound, {}) if bound is not None else None for bound in (index.lower, index.upper))
            if (low is None) != (index.lower is None) or (high is None) != (index.upper is None):
                raise self.refused(node, "the bounds of a tuple's slice are constants")
            return Tuple(owner.elements[low:high])
        if isinstance(owner, (Array, Fixed)):
            return owner if isinstance(owner, Array) else Array(owner.element, len(owner.shape))
        raise self.refused(node, f"{told(owner)} has no slices")

    def _binary(self, node: ast.BinOp) -> Kind | None:
        left = self.of(node.left)
        if isinstance(left, Tuple) and isinstance(node.op, ast.Mult):
            count = constant_int(node.right, self.space)
            if count is None:
                raise self.refused(node, "a tuple is repeated a constant number of times")
            return Tuple(left.elements * count)
        right = self.of(node.right)
        if isinstance(left, Tuple) and isinstance(right, Tuple) and isinstance(node.op, ast.Add):
            return Tuple(left.elements + right.elements)
        return self.arithmetic(node.op, left, right, node)

    def arithmetic(self, op: ast.operator, left: Kind | None, right: Kind | None, node: ast.AST) -> Kind | None:
        """Return the kind of what an operation makes of two numbers."""
        if left is None or right is None:
            return FLOAT64 if isinstance(op, ast.Div) and left is right is None else left or right
        if not (isinstance(left, Scalar) and isinstance(right, Scalar)):
            raise self.refused(node, f"arithmetic with {told(right if isinstance(left, Scalar) else left)}")
        if isinstance(op, (ast.BitAnd, ast.BitOr, ast.BitXor)) and left == right == BOOL:
            return BOOL
        kind = self.united(left, right, node)
        if isinstance(op, (ast.BitAnd, ast.BitOr, ast.BitXor, ast.LShift, ast.RShift)):
            if kind not in WHOLE:
                raise self.refused(node, "bits are those of whole numbers")
            return INT64
        if isinstance(op, ast.Pow) and kind in WHOLE and not is_whole_constant(node):
            raise self.refused(node, "a whole number has a constant power that is not negative: math.pow gives a float")
        if isinstance(op, (ast.Div, ast.Pow)):
            return power(kind, node) if isinstance(op, ast.Pow) else FLOAT64 if kind in WHOLE else kind
        if not isinstance(op, (ast.Add, ast.Sub, ast.Mult, ast.FloorDiv, ast.Mod)):
            raise self.refused(node, "there is no such operation in a kernel")
        return INT64 if kind in WHOLE else kind

    def _unary(self, node: ast.UnaryOp) -> Kind | None:
        if isinstance(node.op, ast.Not):
            self.truth(node.operand)
            return BOOL
        kind = self.of(node.operand)
        if kind is not None and not isinstance(kind, Scalar):
            raise self.refused(node, f"arithmetic with {told(kind)}")
        return INT64 if kind in WHOLE else kind

    def _boolean(self, node: ast.BoolOp) -> Kind | None:
        kinds = {self.of(value) for value in node.values} - {None, BOOL}
        if kinds:
            raise self.refused(node, f"it would be {told(kinds.pop())}: a conditional expression says which")
        return BOOL

    def _compare(self, node: ast.Compare) -> Kind | None:
        kinds = [self.of(node.left), *(self.of(each) for each in node.comparators)]
        for left, op, right in zip(kinds, node.ops, kinds[1:], strict=False):
            if left is None or right is None:
                continue
            if isinstance(op, (ast.Is, ast.IsNot)):
                raise self.refused(node, "numbers are equal, or not: == and !=")
            if isinstance(op, (ast.In, ast.NotIn)):
                if not isinstance(right, Tuple):
                    raise self.refused(node, "`in` asks for one of a tuple")
            elif isinstance(op, (ast.Eq, ast.NotEq)):
                if not comparable(left, right):
                    raise self.refused(node, f"{told(left)} is never {told(right)}")
            elif not (isinstance(left, Scalar) and isinstance(right, Scalar)):
                raise self.refused(node, "only numbers have an order")
        return BOOL

    def _conditional(self, node: ast.IfExp) -> Kind | None:
        self.truth(node.test)
        return self.united(self.of(node.body), self.of(node.orelse), node)

    def _call(self, node: ast.Call) -> Kind | None:
        if any(isinstance(argument, ast.Starred) for argument in node.args) or None in (k.arg for k in node.keywords):
            raise self.refused(node, "arguments are written one by one")
        if isinstance(node.func, ast.Attribute):
            if isinstance(node.func.value, ast.Name) and node.func.value.id == "math":
                return self._of_math(node, node.func.attr)
            if node.func.attr == "_replace":
                return self._replaced(node, node.func.value)
            raise self.refused(node, "there are no methods in a kernel but `_replace`")
        if not isinstance(node.func, ast.Name):
            raise self.refused(node, "a function is called by its name")
        name = node.func.id
        if name in self.module.derived.functions:
            return self._own_call(node, name)
        value = self.space.get(name)
        if isinstance(value, type) and hasattr(value, "_fields"):
            return self._named_tuple(node, value)
        primitive = self.module.derived.primitives.get(name)
        kinds = [self.of(argument) for argument in node.args]
        if primitive is not None:
            return self._primitive(node, primitive, kinds)
        return self._built_in(node, name, kinds)

    def _own_call(self, node: ast.Call, name: str) -> Kind | None:
        try:
            ordered = ordered_arguments(self.module.derived.functions[name], node)
        except TypeError as error:
            raise self.refused(node, str(error)) from None
        kinds = [self.of(argument) for argument in ordered]
        known = tuple(kind for kind in kinds if kind is not None)
        if len(known) < len(kinds):
            return None
        called = self.module.specialised(name, known)
        self.calls[node] = called
        if called.writes and any(
                isinstance(kind, (Record, Array, Fixed, Tuple)) and not self.is_own(argument)
                for argument, kind in zip(ordered, known, strict=True)):
            self.writes = True
        for argument, kind in zip(ordered, known, strict=True):
            if called.writes and isinstance(kind, Array) and self.is_constant(self.root(argument)):
                raise self.refused(node, "constants of a module are not written to")
        result: Kind | None = called.result
        return result

    def _named_tuple(self, node: ast.Call, kind: Any) -> Kind | None:
        values = dict(zip(kind._fields, node.args, strict=False)) | {k.arg: k.value for k in node.keywords}
        found = [self.of(values[name]) if name in values else of_value(kind._field_defaults[name])
                 for name in kind._fields]
        return self._tuple_of(found, kind.__name__, kind._fields)

    def _replaced(self, node: ast.Call, owner: ast.expr) -> Kind | None:
        """Return the kind of a named tuple some of whose fields are others."""
        kind, values = self.of(owner), {k.arg: self.of(k.value) for k in node.keywords}
        if kind is None or None in values.values():
            return None
        if not isinstance(kind, Tuple) or not kind.fields or node.args or not values.keys() <= {*kind.fields}:
            raise self.refused(node, f"{told(kind)} has no such fields")
        found = [values.get(name, element) for name, element in zip(kind.fields, kind.elements, strict=True)]
        return self._tuple_of(found, kind.name, kind.fields)

    def _primitive(self, node: ast.Call, name: str, kinds: Sequence[Kind | None]) -> Kind | None:
        function = c_types.PRIMITIVES[name]
        self.writes = self.writes or function.writes
        if function.result is not None:
            return function.result
        if len(kinds) == 1 and isinstance(kinds[0], Record):
            return kinds[0]
        return None if name in c_types.VOID else self._widest(kinds)

    def _widest(self, kinds: Sequence[Kind | None]) -> Kind:
        return FLOAT32 if FLOAT32 in kinds and FLOAT64 not in kinds else FLOAT64

    def _of_math(self, node: ast.Call, name: str) -> Kind | None:
        kinds = [self.of(argument) for argument in node.args]
        if name not in (*c_types.MATH, *c_types.ROUNDED, *c_types.TRUTHS):
            raise self.refused(node, f"math.{name} has no line in c_functions.MATH")
        self._arguments(node, kinds, 2 if name in c_types.OF_TWO else 1)
        if name in c_types.TRUTHS:
            return BOOL
        return INT64 if name in c_types.ROUNDED else self._widest(kinds)

    def _arguments(self, node: ast.Call, kinds: Sequence[Kind | None], count: int) -> None:
        """Refuse a call of a function of numbers with anything else."""
        if node.keywords or len(kinds) != count or not all(kind is None or isinstance(kind, Scalar) for kind in kinds):
            raise self.refused(node, f"it takes {'one number' if count == 1 else 'two numbers'}")

    def _built_in(self, node: ast.Call, name: str, kinds: Sequence[Kind | None]) -> Kind | None:
        (first, *_) = kinds or [None]
        if name in ("int", "round", "float", "_f", "bool", "abs"):
            self._arguments(node, kinds, 1)
        if name == "len" and (len(kinds) != 1 or isinstance(first, (Scalar, Record))):
            raise self.refused(node, "tuples and arrays have a length")
        if name in ("int", "round", "len"):
            return INT64
        if name in ("float", "_f"):
            return FLOAT32 if name == "_f" and self.module.derived.recipe.single else FLOAT64
        if name == "bool":
            return BOOL
        if name == "abs":
            return INT64 if first in WHOLE else first
        if name in ("min", "max"):
            values = first.elements if len(kinds) == 1 and isinstance(first, Tuple) else kinds
            if node.keywords or len(values) < 2 or not all(kind is None or isinstance(kind, Scalar) for kind in values):
                raise self.refused(node, "it takes numbers, or a tuple of them")
            widest: Kind | None = None
            for kind in values:
                widest = self.united(widest, kind, node)
            return widest
        raise self.refused(node, f"there is no function {name} in a kernel")

    # --- checks -------------------------------------------------------------------------------------------------------

    def united(self, a: Kind | None, b: Kind | None, node: ast.AST) -> Kind | None:
        """Return the kind of what may be of either."""
        try:
            return united(a, b)
        except TypeError as error:
            raise self.refused(node, f"it is {error}: one kind for each variable") from None

    def truth(self, node: ast.expr) -> None:
        """Look at a condition, which a number may be too."""
        if isinstance(node, ast.BoolOp):
            for value in node.values:
                self.truth(value)
            self.kinds[node] = BOOL
            return
        kind = self.of(node)
        if kind is not None and not isinstance(kind, Scalar):
            raise self.refused(node, f"{told(kind)} is neither true nor false")

    def whole(self, node: ast.expr) -> None:
        """Look at an index."""
        kind = self.of(node)
        if kind is not None and kind not in WHOLE:
            raise self.refused(node, f"{told(kind)} is no index")


_EXPRESSIONS: dict[type[ast.expr], Callable[[Values, Any], Kind | None]] = {
    ast.Name: Values._name, ast.Constant: Values._constant, ast.Tuple: Values._tuple,
    ast.Attribute: Values._attribute, ast.Subscript: Values._subscript, ast.BinOp: Values._binary,
    ast.UnaryOp: Values._unary, ast.BoolOp: Values._boolean, ast.Compare: Values._compare,
    ast.IfExp: Values._conditional, ast.Call: Values._call}
