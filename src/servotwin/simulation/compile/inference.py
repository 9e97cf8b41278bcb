"""Find the kinds of all values in derived functions, from those of an entry's arguments on.

A function is looked at once for each combination of kinds that it is called with. Its local variables have one kind
each, which is found by going through its statements until nothing changes any more.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from servotwin.simulation.compile import c_functions
from servotwin.simulation.compile.derive import Derived
from servotwin.simulation.compile.kinds import (
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
    TranslationError,
    Tuple,
    of_dtype,
    of_value,
    told,
    united,
)

_ROUNDS = 12  # more than any kernel needs until its kinds are settled
_WHOLE = (INT64, INT32, INT8, BOOL)


class Module:
    """The functions of a derived text, and what they have been called with."""

    def __init__(self, derived: Derived) -> None:
        self.derived = derived
        self.known: dict[tuple[str, tuple[Kind, ...]], Specialised] = {}

    def specialised(self, name: str, arguments: tuple[Kind, ...]) -> Specialised:
        """Return a function with the kinds of all that is in it."""
        key = (name, arguments)
        if key not in self.known:
            self.known[key] = Specialised(self, self.derived.functions[name], arguments)
            self.known[key].settle()
        return self.known[key]


@dataclass(eq=False)
class Specialised:
    """A function as it is called with arguments of some kinds.

    Attributes
    ----------
    kinds : dict
        Of its expressions, by node.
    calls : dict
        What its calls of derived functions call, by node.
    local : dict
        Kinds of arguments and local variables, by name.
    owned : set of str
        Local variables that are lists of a constant length.
    result : kind or None
        None: it returns nothing.
    writes : bool
        Whether it changes a record or an array that was given to it.
    """

    module: Module
    node: ast.FunctionDef
    arguments: tuple[Kind, ...]
    kinds: dict[ast.AST, Kind | None] = field(default_factory=dict)
    calls: dict[ast.Call, Specialised] = field(default_factory=dict)
    local: dict[str, Any] = field(default_factory=dict)
    owned: set[str] = field(default_factory=set)
    result: Kind | None = None
    writes: bool = False

    def __post_init__(self) -> None:
        self.names = [argument.arg for argument in self.node.args.args]
        self.local |= dict(zip(self.names, self.arguments, strict=True))
        self.stored = {n.id for n in ast.walk(self.node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}

    @property
    def space(self) -> dict[str, Any]:
        """What the derived module has besides functions."""
        return self.module.derived.space

    def settle(self) -> None:
        """Find all kinds."""
        for _ in range(_ROUNDS):
            before = (dict(self.local), self.result, self.writes)
            self.calls.clear()
            self._block(self.node.body)
            if before == (self.local, self.result, self.writes):
                return
        raise self.refused(self.node, "the kinds of its variables do not settle")

    def refused(self, node: ast.AST, instead: str) -> TranslationError:
        """Return the error for a piece of text."""
        first = ast.unparse(node).splitlines()[0]
        return TranslationError(self.node.name, first, instead)

    # --- statements ---------------------------------------------------------------------------------------------------

    def _block(self, body: Sequence[ast.stmt]) -> None:
        for statement in body:
            handler = _STATEMENTS.get(type(statement))
            if handler is None:
                raise self.refused(statement, "a kernel has assignments, if, for, while, break, continue and return")
            handler(self, statement)

    def _return(self, node: ast.Return) -> None:
        if node.value is not None and not (isinstance(node.value, ast.Constant) and node.value.value is None):
            self.result = self._united(self.result, self.of(node.value), node)

    def _expression(self, node: ast.Expr) -> None:
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
        ((target,), (element,)) = node.targets, node.value.left.elts
        kind = self.of(element)
        if not isinstance(target, ast.Name):
            raise self.refused(node, "a list of a constant length has a name of its own")
        self.owned.add(target.id)
        if kind is not None:
            self.local[target.id] = Fixed(kind, (length,))

    def _augmented(self, node: ast.AugAssign) -> None:
        left, right = self.of(node.target), self.of(node.value)
        self._put(node.target, self._arithmetic(node.op, left, right, node), node.value)

    def _put(self, target: ast.expr, kind: Kind | None, value: ast.expr) -> None:
        """Note that a value of a kind gets to a target."""
        if isinstance(target, ast.Name):
            if target.id != "_":
                self.local[target.id] = self._united(self.local.get(target.id), kind, target)
        elif isinstance(target, ast.Tuple):
            for place, element in enumerate(target.elts):
                part = value.elts[place] if isinstance(value, ast.Tuple) else value
                self._put(element, self._element(kind, place, len(target.elts), target), part)
        else:
            self.writes = self.writes or not self._is_own(target)
            there = self.of(target)
            if kind is not None and there is not None and not fits(kind, there):
                raise self.refused(target, f"it gets {told(kind)}, and holds {told(there)}")

    def _is_own(self, target: ast.expr) -> bool:
        """Tell whether a target is part of a list of this function."""
        while isinstance(target, (ast.Subscript, ast.Attribute)):
            target = target.value
        return isinstance(target, ast.Name) and target.id in self.owned

    def _element(self, kind: Kind | None, place: int, count: int, node: ast.AST) -> Kind | None:
        if kind is None:
            return None
        if isinstance(kind, Tuple):
            if len(kind.elements) != count:
                raise self.refused(node, f"there are {len(kind.elements)} values")
            return kind.elements[place]
        if isinstance(kind, (Array, Fixed)):
            return _row(kind, 1)
        raise self.refused(node, f"{told(kind)} is no tuple")

    def _if(self, node: ast.If) -> None:
        self._truth(node.test)
        self._block(node.body)
        self._block(node.orelse)

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.refused(node, "a loop of a kernel has no else")
        self._truth(node.test)
        self._block(node.body)

    def _for(self, node: Any) -> None:
        if node.orelse:
            raise self.refused(node, "a loop of a kernel has no else")
        if is_range(node.iter):
            for bound in node.iter.args:
                self._whole(bound)
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
                each = self._united(each, element, node)
            return each
        if isinstance(over, (Array, Fixed)):
            return _row(over, 1)
        raise self.refused(node, "a loop goes over a range, a tuple or an array")

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
        return of_value(node.value)

    def _tuple(self, node: ast.Tuple) -> Kind | None:
        return self._tuple_of([self.of(element) for element in node.elts])

    @staticmethod
    def _tuple_of(kinds: Sequence[Kind | None], name: str = "", fields: tuple[str, ...] = ()) -> Kind | None:
        known = tuple(kind for kind in kinds if kind is not None)
        return Tuple(known, name, fields) if len(known) == len(kinds) else None

    def _attribute(self, node: ast.Attribute) -> Kind | None:
        if isinstance(node.value, ast.Name) and node.value.id == "math":
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
            self._whole(place)
        if owner is None:
            return None
        if isinstance(owner, Tuple):
            return self._of_tuple(node, owner, index)
        if isinstance(owner, (Array, Fixed)) and len(places) <= dimensions(owner):
            return _row(owner, len(places))
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
                self._whole(bound)
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
        return self._arithmetic(node.op, left, right, node)

    def _arithmetic(self, op: ast.operator, left: Kind | None, right: Kind | None, node: ast.AST) -> Kind | None:
        if left is None or right is None:
            return FLOAT64 if isinstance(op, ast.Div) and left is right is None else left or right
        if not (isinstance(left, Scalar) and isinstance(right, Scalar)):
            raise self.refused(node, f"arithmetic with {told(right if isinstance(left, Scalar) else left)}")
        if isinstance(op, (ast.BitAnd, ast.BitOr, ast.BitXor)) and left == right == BOOL:
            return BOOL
        kind = self._united(left, right, node)
        if isinstance(op, (ast.BitAnd, ast.BitOr, ast.BitXor, ast.LShift, ast.RShift)):
            if kind not in _WHOLE:
                raise self.refused(node, "bits are those of whole numbers")
            return INT64
        if isinstance(op, (ast.Div, ast.Pow)):
            return _power(kind, node) if isinstance(op, ast.Pow) else FLOAT64 if kind in _WHOLE else kind
        if not isinstance(op, (ast.Add, ast.Sub, ast.Mult, ast.FloorDiv, ast.Mod)):
            raise self.refused(node, "there is no such operation in a kernel")
        return INT64 if kind in _WHOLE else kind

    def _unary(self, node: ast.UnaryOp) -> Kind | None:
        if isinstance(node.op, ast.Not):
            self._truth(node.operand)
            return BOOL
        kind = self.of(node.operand)
        if kind is not None and not isinstance(kind, Scalar):
            raise self.refused(node, f"arithmetic with {told(kind)}")
        return INT64 if kind in _WHOLE else kind

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
        self._truth(node.test)
        return self._united(self.of(node.body), self.of(node.orelse), node)

    def _call(self, node: ast.Call) -> Kind | None:
        if any(isinstance(argument, ast.Starred) for argument in node.args) or None in (k.arg for k in node.keywords):
            raise self.refused(node, "arguments are written one by one")
        if isinstance(node.func, ast.Attribute):
            if isinstance(node.func.value, ast.Name) and node.func.value.id == "math":
                return self._of_math(node, node.func.attr)
            raise self.refused(node, "there are no methods in a kernel")
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
        ordered = ordered_arguments(self.module.derived.functions[name], node)
        kinds = [self.of(argument) for argument in ordered]
        known = tuple(kind for kind in kinds if kind is not None)
        if len(known) < len(kinds):
            return None
        called = self.module.specialised(name, known)
        self.calls[node] = called
        if called.writes and any(
                isinstance(kind, (Record, Array, Fixed, Tuple)) and not self._is_own(argument)
                for argument, kind in zip(ordered, known, strict=True)):
            self.writes = True
        return called.result

    def _named_tuple(self, node: ast.Call, kind: Any) -> Kind | None:
        values = dict(zip(kind._fields, node.args, strict=False)) | {k.arg: k.value for k in node.keywords}
        found = [self.of(values[name]) if name in values else of_value(kind._field_defaults[name])
                 for name in kind._fields]
        return self._tuple_of(found, kind.__name__, kind._fields)

    def _primitive(self, node: ast.Call, name: str, kinds: Sequence[Kind | None]) -> Kind | None:
        function = c_functions.PRIMITIVES[name]
        self.writes = self.writes or function.writes
        if function.result is not None:
            return function.result
        if name in c_functions.VOID:
            return None
        return self._widest(kinds)

    def _widest(self, kinds: Sequence[Kind | None]) -> Kind:
        return FLOAT32 if FLOAT32 in kinds and FLOAT64 not in kinds else FLOAT64

    def _of_math(self, node: ast.Call, name: str) -> Kind | None:
        kinds = [self.of(argument) for argument in node.args]
        if name in c_functions.TRUTHS:
            return BOOL
        if name in c_functions.ROUNDED:
            return INT64
        if name in c_functions.MATH:
            return self._widest(kinds)
        raise self.refused(node, f"math.{name} has no line in c_functions.MATH")

    def _built_in(self, node: ast.Call, name: str, kinds: Sequence[Kind | None]) -> Kind | None:
        (first, *_) = kinds or [None]
        if name in ("int", "round", "len"):
            return INT64
        if name in ("float", "_f"):
            return FLOAT32 if name == "_f" and self.module.derived.recipe.single else FLOAT64
        if name == "bool":
            return BOOL
        if name == "abs":
            return INT64 if first in _WHOLE else first
        if name in ("min", "max"):
            values = first.elements if len(kinds) == 1 and isinstance(first, Tuple) else kinds
            widest: Kind | None = None
            for kind in values:
                widest = self._united(widest, kind, node)
            return widest
        raise self.refused(node, f"there is no function {name} in a kernel")

    # --- checks -------------------------------------------------------------------------------------------------------

    def _united(self, a: Kind | None, b: Kind | None, node: ast.AST) -> Kind | None:
        try:
            return united(a, b)
        except TypeError as error:
            raise self.refused(node, f"it is {error}: one kind for each variable") from None

    def _truth(self, node: ast.expr) -> None:
        """Look at a condition, which a number may be too."""
        if isinstance(node, ast.BoolOp):
            for value in node.values:
                self._truth(value)
            self.kinds[node] = BOOL
            return
        kind = self.of(node)
        if kind is not None and not isinstance(kind, Scalar):
            raise self.refused(node, f"{told(kind)} is neither true nor false")

    def _whole(self, node: ast.expr) -> None:
        kind = self.of(node)
        if kind is not None and kind not in _WHOLE:
            raise self.refused(node, f"{told(kind)} is no index")


def fits(kind: Kind, there: Kind) -> bool:
    """Tell whether a value of a kind may be put where another one is."""
    if isinstance(there, (Array, Fixed)) and isinstance(kind, Scalar):
        return True  # x[:] = 0.0
    try:
        both = united(kind, there)
    except TypeError:
        return False
    return both == there or not (isinstance(there, Scalar) and there in _WHOLE and both not in _WHOLE)


def comparable(a: Kind, b: Kind) -> bool:
    """Tell whether two values may be equal."""
    if isinstance(a, Tuple) and isinstance(b, Tuple):
        return len(a.elements) == len(b.elements) and all(map(comparable, a.elements, b.elements))
    return isinstance(a, Scalar) and isinstance(b, Scalar)


def dimensions(kind: Array | Fixed) -> int:
    """Return how many dimensions an array has."""
    return kind.dimensions if isinstance(kind, Array) else len(kind.shape)


def _row(kind: Array | Fixed, places: int) -> Kind:
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


def _power(kind: Kind | None, node: ast.AST) -> Kind | None:
    exponent = node.right if isinstance(node, ast.BinOp) else None
    whole = isinstance(exponent, ast.Constant) and isinstance(exponent.value, int)
    return kind if whole and kind not in _WHOLE else INT64 if whole else FLOAT32 if kind == FLOAT32 else FLOAT64


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
    given = dict(zip(names, call.args, strict=False)) | {k.arg: k.value for k in call.keywords}
    defaults = dict(zip(names[::-1], function.args.defaults[::-1], strict=False))
    return [given.get(name) or defaults[name] for name in names]


_STATEMENTS: dict[type[ast.stmt], Callable[[Specialised, Any], None]] = {
    ast.Pass: lambda own, node: None, ast.Break: lambda own, node: None, ast.Continue: lambda own, node: None,
    ast.Return: Specialised._return, ast.Expr: Specialised._expression, ast.Assign: Specialised._assign,
    ast.AugAssign: Specialised._augmented, ast.If: Specialised._if, ast.While: Specialised._while,
    ast.For: Specialised._for}
_EXPRESSIONS: dict[type[ast.expr], Callable[[Specialised, Any], Kind | None]] = {
    ast.Name: Specialised._name, ast.Constant: Specialised._constant, ast.Tuple: Specialised._tuple,
    ast.Attribute: Specialised._attribute, ast.Subscript: Specialised._subscript, ast.BinOp: Specialised._binary,
    ast.UnaryOp: Specialised._unary, ast.BoolOp: Specialised._boolean, ast.Compare: Specialised._compare,
    ast.IfExp: Specialised._conditional, ast.Call: Specialised._call}
