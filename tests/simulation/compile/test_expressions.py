"""Random expressions: C works out what Python works out, bit by bit.

What chooses between a float and a whole number is left out: in C it is a float, and 0.0 has a sign, which 0 has not.
"""

import ast
import math

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

from simulation.compile.by_hand import Both, same

TREES = 40  # in a text, which is compiled at once
BIG = 2**52  # whole numbers beyond it are not told apart as floats
NUMBERS = {
    "float": st.floats(allow_subnormal=True) | st.sampled_from([0.0, -0.0, 0.5, 1.5, -2.5, 1e300, float("inf"),
        float("nan")]),
    "int": st.integers(-100, 100) | st.integers(-2**40, 2**40) | st.sampled_from([0, 1, -1, 63, 64, 2**31 - 1, -2**31]),
    "bool": st.booleans()}
ARGUMENTS = (("a", "float"), ("b", "float"), ("m", "int"), ("n", "int"), ("c", "bool"), ("d", "bool"))


def literal(value):
    text = repr(value)
    if text in ("inf", "-inf", "nan"):
        return f"(-math.{text[1:]})" if text[0] == "-" else f"math.{text}"
    return f"({text})" if text[0] == "-" else text


def leaves(kind):
    names = [name for name, own in ARGUMENTS if own == kind]
    return st.sampled_from(names) | st.sampled_from(names) | NUMBERS[kind].map(literal)


def grown(floats, ints, bools):
    """Return expressions of each kind over such ones."""
    numbers = floats | ints | bools
    whole = ints | bools
    small = st.integers(0, 20).map(str)
    order = st.sampled_from(["<", "<=", ">", ">=", "==", "!="])
    real = st.one_of(
        st.builds("({} {} {})".format, floats, st.sampled_from("+-*/") | st.sampled_from(["//", "%"]), numbers),
        st.builds("({} / {})".format, whole, whole), st.builds("(-{})".format, floats), st.builds("abs({})".format,
            floats),
        st.builds("{}({}, {}, {})".format, st.sampled_from(["min", "max"]), floats, floats, floats),
        st.builds("({} if {} else {})".format, floats, bools, floats), st.builds("float({})".format, numbers),
        st.builds("math.copysign({}, {})".format, floats, floats), st.builds("(({}, {})[{} & 1])".format, floats,
            floats, ints))
    integer = st.one_of(
        st.builds("({} {} {})".format, whole, st.sampled_from(["+", "-", "*", "//", "%"]), ints),
        st.builds("({} {} {})".format, ints, st.sampled_from("&|^"), whole), st.builds("(~{})".format, whole),
        st.builds("({} {} {})".format, ints, st.sampled_from(["<<", ">>"]), small), st.builds("(-{})".format, whole),
        st.builds("({} >> ({} & 127))".format, ints, ints), st.builds("({} ** {})".format, whole,
            st.sampled_from("0123456")),
        st.builds("abs({})".format, ints), st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), ints, whole),
        st.builds("({} if {} else {})".format, ints, bools, whole),
        st.builds("{}({})".format, st.sampled_from(["int", "round", "math.floor", "math.ceil"]), numbers))
    truth = st.one_of(
        st.builds("({} {} {})".format, numbers, order, numbers), st.builds("(not {})".format, numbers),
        st.builds("({} {} {} {} {})".format, numbers, order.filter(lambda o: o[0] in "<>"), numbers,
                  order.filter(lambda o: o[0] in "<>"), numbers),
        st.builds("({} {} {})".format, bools, st.sampled_from(["and", "or", "&", "|", "^"]), bools),
        st.builds("({} {} ({}, {}))".format, ints, st.sampled_from(["in", "not in"]), ints, whole),
        st.builds("bool({})".format, numbers), st.builds("math.isfinite({})".format, floats))
    return floats | real, ints | integer, bools | truth


def trees():
    found = leaves("float"), leaves("int"), leaves("bool")
    for _ in range(2):
        found = grown(*found)
    return st.one_of(*found)


class Sizes(ast.NodeTransformer):
    """Lets every part of an expression say how large it is, so that none leaves 64 bits unnoticed."""

    def visit(self, node):
        node = self.generic_visit(node)
        return ast.Call(ast.Name("_seen", ast.Load()), [node], []) if isinstance(
            node, ast.BinOp | ast.UnaryOp | ast.IfExp | ast.Call) else node


def seen(value):
    if isinstance(value, int) and not -BIG < value < BIG:
        raise OverflowError
    return value


def carefully(expression, values):
    """Return the value in Python; an error where a whole number becomes too large for any comparison with floats."""
    tree = ast.fix_missing_locations(Sizes().visit(ast.parse(expression, mode="eval")))
    return eval(compile(tree, "expression", "eval"), {"math": math, "_seen": seen}, dict(values))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Generating overly large repr")
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(trees(), min_size=TREES, max_size=TREES, unique=True),
       st.lists(st.tuples(*(NUMBERS[kind] for _, kind in ARGUMENTS)), min_size=8, max_size=8))
def test_c_works_out_random_expressions_as_python_does(tmp_path_factory, expressions, values):
    check(tmp_path_factory.mktemp("expressions"), expressions, values)


def check(folder, expressions, values):
    head = ", ".join(f"{name}: {kind}" for name, kind in ARGUMENTS)
    both = Both("\n".join(f"def f{k}({head}): return {one}" for k, one in enumerate(expressions)), folder, strict=False)
    for k, expression in enumerate(expressions):
        for arguments in values:
            try:
                wanted = carefully(expression, zip((name for name, _ in ARGUMENTS), arguments, strict=True))
            except (ArithmeticError, ValueError):
                continue
            found = both.compiled(f"f{k}", *arguments)
            assert same(found, float(wanted) if isinstance(found, float) else wanted), f"{expression} of {arguments}"
