"""Arithmetic of kernels: what C makes of numbers is what Python makes of them, bit by bit."""

import itertools
import math

import pytest

from simulation.compile.by_hand import Both, same

NAN, INF, LOWEST = math.nan, math.inf, -2**63
TEXT = '''
MANY, FEW, SMALL = 100000, 3, -2
def floor_of(a: int, b: int): return a // b
def rest_of(a: int, b: int): return a % b
def floor_of_floats(a: float, b: float): return a // b
def rest_of_floats(a: float, b: float): return a % b
def mixed(a: int, b: float): return (a + b, a - b, a * b, a // b, a % b, b // 3, b % 3)
def quotient(a: int, b: int): return a / b
def of_truths(a: bool, b: bool): return (a + b, a - b, a * b, a & b, a | b, a ^ b, -a, ~a, +a, a + 1.5, abs(a), int(a))
def bits(a: int, b: int): return (a & b, a | b, a ^ b, ~a, a & -b)
def to_the_left(a: int, b: int): return a << b
def to_the_right(a: int, b: int): return a >> b
def constants(a: int): return (2147483647 + 1 + a, -2147483647 - 2, MANY * MANY,
    (5 if a > 0 else 2147483647) + 2147483647,
                               -MANY * MANY, 65536 * 65536 * a, 1 << 40, MANY * MANY * 1.0, len((a, a)) + 2147483647)
def powers(a: int): return (a ** 0, a ** 1, a ** 2, a ** 3, a ** 4, a ** 5, a ** 7, (a ** 5) % 7)
def powers_of_floats(a: float): return (a ** 0, a ** 1, a ** 2, a ** 5, a ** 0.5, a ** 1.5)
def below(a: float, b: float): return (a < b, a <= b, a > b, a >= b, a == b, a != b, not a < b)
def between(a: float, b: float, c: float): return (a < b < c, a <= b <= c, a > b >= c, a < b > c, not a <= b < c)
def between_whole(a: int, b: float, c: int): return (a < b < c, a <= b <= c)
def one_of(a: int, b: float): return (a in (1, 2, 5), a not in (1, 2), b in (1.0, 2.5), b in (1, 2), a in (1.0, 2.5))
def pair_in(a: int, b: float): return ((a, b) in ((1, 2.0), (3, 4.0)), (a, b) == (1, 2), (a, b) != (1, 2.0), a in ())
def least(a: float, b: float): return (min(a, b), min(b, a), min(a, b, 0.0), min((a, b, -0.0)), min(1, a))
def most(a: float, b: float): return (max(a, b), max(b, a), max(a, b, 0.0), max((a, b, -0.0)), max(a, True))
def extremes_whole(a: int, b: int): return (min(a, b), max(a, b), min(a, b, 3), max((a, b, -3)))
def size(a: float, b: int): return (abs(a), abs(b), abs(-a), -abs(b))
def to_even(a: float): return round(a)
def whole(a: float): return int(a)
def down(a: float): return math.floor(a)
def up(a: float): return math.ceil(a)
def whole_of_whole(a: int): return (round(a), int(a), math.floor(a), math.ceil(a), float(a), bool(a))
def truth(a: float, b: int): return (bool(a), bool(b), not a, not b, 1 if a else 0, 1 if b else 0)
def nothing(a: float): return (-a, 0.0 * a, -0.0, a + -0.0, math.copysign(1.0, -a if a == a else 1.0))
def chosen(a: int, b: float): return a if b > 0 else b
def said(a: float): return (math.isfinite(a), math.isnan(a), math.isinf(a), math.pi * 2, math.inf, -math.inf, math.nan)
def literals(): return (1e-310, 5e-324, 1.7976931348623157e308, 0.1, 1e22, 123456789012345678, -9223372036854775807,
    1e400)
def last_places(a: int): return (9007199254740993 + a, a * 3 // 2)
'''
WHOLE = (0, 1, -1, 2, 3, -3, 7, -7, 2**31, -2**31 - 1, 2**40 + 1, -2**52)
FLOATS = (0.0, -0.0, 1.0, -1.0, 0.1, -0.1, 0.5, 1.5, 2.5, -2.5, 3.0, -7.25, 1e-310, 1e16, 1e300, -1e300, INF, -INF, NAN)
SMALL_WHOLE = (-7, -2, -1, 0, 1, 2, 3, 10)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    return Both(TEXT, tmp_path_factory.mktemp("numbers"))


def pairs(values):
    return list(itertools.product(values, values))


CASES = {
    "floor_of": pairs(WHOLE), "rest_of": pairs(WHOLE), "floor_of_floats": pairs(FLOATS),
    "rest_of_floats": pairs(FLOATS), "mixed": [(a, b) for a in WHOLE for b in FLOATS], "quotient": pairs(WHOLE),
    "of_truths": pairs((True, False)), "bits": pairs(WHOLE),
    "to_the_left": [(a, b) for a in (0, 1, -1, 5, -5) for b in (0, 1, 7, 31, 32, 40)],
    "to_the_right": [(a, b) for a in WHOLE for b in (0, 1, 7, 32, 62, 63, 64, 100)],
    "constants": [(1,), (0,)], "powers": [(a,) for a in SMALL_WHOLE], "powers_of_floats": [(a,) for a in (0.5, 2.0,
        4.0, 0.0)],
    "below": pairs(FLOATS), "between": list(itertools.product(FLOATS[::3], FLOATS[::2], FLOATS[1::3])),
    "between_whole": [(1, 1.5, 2), (1, 2.0, 2), (1, NAN, 2), (-5, -5.0, -5)],
    "one_of": [(a, b) for a in (1, 2, 3, 5) for b in (1.0, 2.5, 2.0, NAN)], "pair_in": [(1, 2.0), (3, 4.0), (1, 4.0)],
    "least": pairs(FLOATS), "most": pairs(FLOATS), "extremes_whole": pairs((-4, 0, 3, 9)),
    "size": [(a, b) for a in FLOATS for b in (-3, 0, 5)],
    "to_even": [(a,) for a in (0.5, 1.5, 2.5, -0.5, -1.5, 2.4999, 1e15 + 0.5, -3.7, 4503599627370497.5)],
    "whole": [(a,) for a in FLOATS], "down": [(a,) for a in FLOATS], "up": [(a,) for a in FLOATS],
    "whole_of_whole": [(a,) for a in (0, 1, -5, 2**53 + 1)], "truth": [(a, b) for a in FLOATS for b in (0, 2, 256)],
    "nothing": [(a,) for a in FLOATS], "chosen": [(3, 1.0), (3, -1.5)], "said": [(a,) for a in FLOATS],
        "literals": [()],
    "last_places": [(0,), (5,)]}


@pytest.mark.parametrize("name", CASES)
def test_c_calculates_as_python_does(both, name):
    compared = 0
    for arguments in CASES[name]:
        try:
            wanted = both.plain(name, *arguments)
        except (ArithmeticError, ValueError):
            continue  # what C returns instead is told below
        if not (isinstance(wanted, int) and not -2**63 <= wanted < 2**63):
            assert same(both.compiled(name, *arguments), wanted), f"{name}{arguments}"
            compared += 1
    assert compared > len(CASES[name]) // 2


@pytest.mark.parametrize(("name", "arguments", "instead"), [
    *((name, (number,), LOWEST) for name in ("whole", "down", "up", "to_even") for number in (NAN, INF, -INF, 1e300,
        -1e300)),
    ("floor_of", (5, 0), 0), ("floor_of", (-5, 0), 0), ("floor_of", (0, 0), 0), ("rest_of", (5, 0), 0),
    ("floor_of", (LOWEST, -1), LOWEST), ("rest_of", (LOWEST, -1), 0), ("quotient", (5, 0), INF), ("quotient", (-5, 0),
        -INF),
    ("quotient", (0, 0), NAN), ("rest_of_floats", (5.0, 0.0), NAN)])
def test_what_has_no_result_in_python_has_a_certain_one_in_c(both, name, arguments, instead):
    assert same(both.compiled(name, *arguments), instead)
