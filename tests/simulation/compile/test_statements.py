"""Statements, variables, loops, tuples and calls of kernels: in C they do what they do in Python."""

import math

import pytest

from simulation.compile.by_hand import Both

TEXT = '''
from typing import NamedTuple
class Pair(NamedTuple):
    x: float
    n: int = 4
class Nest(NamedTuple):
    pair: Pair
    other: Pair = Pair(0.5, 2)
    k: int = 7
WEIGHTS = (0.5, 0.25, 0.125)
NESTED = ((1.0, 2), (3.0, 4))
LAST = -1

def swapped(a: int, b: int):
    a, b = b, a
    return (a, b)
def rotated(a: float, b: float, c: float):
    a, b, c = c, a, b
    a, b = a + b, a - b
    return (a, b, c)
def chained(a: float):
    b = c = a + 1
    d = e, f = (a, 2)
    return (b, c, d, e, f)
def unpacked(a: float, n: int):
    (x, (y, z)), (w,) = ((a, (n, a * 2)), (n + 1,))
    nested = ((a, n), (n, a))
    (p, q), r = nested
    return (x, y, z, w, p, q, r)
def named(a: float, n: int):
    pair = Pair(n=n, x=a)
    nest = Nest(Pair(a))
    x, k = pair
    far = Nest(k=n, pair=pair, other=Pair(x=1.0))
    return (pair.x, pair.n, nest.pair.n, nest.other, nest.k, far, pair[0], pair[-1], x, k, pair == Pair(a, n))
def replaced(a: float):
    pair = Pair(a)
    if a > 1:
        pair = Pair(a * 2, 9)
    return pair
def by_place(k: int):
    own = (1.5, 2.5, 3.5)
    return (WEIGHTS[k], own[k], WEIGHTS[LAST], (k, 2, 3)[k], NESTED[k % 2], NESTED[1][0], len(own), own[1:], own[-1])
def joined(a: float):
    return ((a, 1.0) + (2.0,), (a,) * 3, (0,) * 2)

def counted(n: int):
    total = 0
    for k in range(n):
        total += k * k
    return (total, k)
def steps(n: int):
    a = b = c = d = 0
    for i in range(n, 0, -1):
        a = a * 3 + i
    for i in range(0, n, 3):
        b = b * 3 + i
    for i in range(n, -n, -4):
        c = c * 5 + i
    for i in range(5, 5):
        d += 1
    return (a, b, c, d, i)
def bounds_change(n: int):
    count = 0
    for i in range(n):
        n = n - 1
        count += i
    return (count, n, i)
def counter_changes(n: int):
    found = 0
    for i in range(n):
        found = found * 10 + i
        i = i + 5
        found += i
    return (found, i)
def nested_in_one_name(n: int):
    found = 0
    for i in range(n):
        for i in range(i + 2):
            found = found * 3 + i
        found = found * 7 + i
    return (found, i)
def own_bound(i: int):
    found = 0
    for i in range(i, i + 3):
        found = found * 10 + i
    return (found, i)
def twice_in_one_name(n: int):
    a = 0
    for i in range(n):
        a += i
    for i in range(2 * n):
        a += 10 * i
    return a
def left(n: int):
    found = 0
    for i in range(n):
        if i == 2:
            continue
        for j in range(i):
            if j == 3:
                break
            found += i * j
        if i == 6:
            break
        found += 100
    return (found, i)
def over_tuples(a: float):
    total = 0.0
    for weight in WEIGHTS:
        total += weight * a
    for x in (a, 1, 2.5):
        total = total * 3 + x
    for x, k in ((a, 1), (2.0, 3)):
        total = total * x + k
    for p, (q, r) in ((1, (2, a)), (3, (4, a))):
        total += p * q * r
    return total
def while_it_lasts(n: int):
    rounds = 0
    while n != 1 and rounds < 100:
        n = n // 2 if n % 2 == 0 else 3 * n + 1
        rounds += 1
    while True:
        rounds += 1
        if rounds % 7 == 0:
            break
    return rounds
def early(a: float):
    if a < 0:
        return -1
    for k in range(5):
        if a < k:
            return k
    if a > 100:
        return 100
    else:
        return 50
def in_branches(a: float):
    if a > 0:
        x = a * 2
        y = x + 1
    elif a < -5:
        x, y = a, 3
    else:
        x = 0
        y = x - a
    return (x, y)
def kept_from_round_to_round(n: int):
    total = 0
    for i in range(n):
        if i == 0:
            last = 5
        else:
            total = total * 3 + last
            last = i
    return total
def kept_behind_a_branch(n: int):
    out = 0.0
    for i in range(n):
        if i % 3 == 0:
            fresh = i * 1.5
        out = out * 0.5 + fresh
    return out
def kept_in_inner_loops(n: int):
    found = 0
    for i in range(n):
        j = 0
        while j < 3:
            if j == 0:
                first = i + 1
            if j == 1:
                found += first
            found = found * 2 + j
            j += 1
            found += first
    return (found, first, j)
def kept_in_a_while(n: int):
    k = 0
    seen = 0
    while k < n:
        if k > 2:
            seen = seen * 5 + before
        before = k * k
        k += 1
    return seen
def made_anew(n: int):
    out = 0
    for i in range(n):
        part = 0
        for j in range(i):
            part += j
            square = part * part
            out += square
        out += part
    return out
def widened(n: int):
    x = 0
    for i in range(n):
        x = x + 0.5
    y = n
    y /= 4
    z = True
    z += 2
    return (x, y, z)
def argument_widened(n: int, a: float):
    n = n + 0.5
    a = 3
    return (n, a)
def shortened(a: int, b: float, c: bool):
    a += 3
    a -= 1
    a *= 5
    a |= 64
    a &= ~1
    a ^= 3
    b += a
    b -= 0.5
    b *= 2
    b /= 3
    c &= a > 0
    c |= False
    return (a, b, c)
def helper(x, y=2.0, z=-0.0): return x * y + z
def of_kinds(a: float, n: int, c: bool):
    return (helper(a), helper(n), helper(c), helper(n, n), helper(n, y=n, z=n), helper(z=a, x=n), helper(a, 3))
def ignored(a: float, n: int):
    helper(a)
    _ = helper(n)
    unused = n + 1
    _, kept = (a, n)
    pass
    return kept
def whole_half(n): return n // 2
def f(x): return x
def f_2(x): return x + 100
def names_alike(a: float, n: int, c: bool): return (f(a), f_2(a), f(n), f_2(n), f(c))
def truths(a: float, n: int):
    if n and a > 0 or not n:
        return True
    return a != a
def nothing_returned(out: floats):
    if out[0] > 3:
        return
    out[0] = 7
def only_a_pass():
    pass

def c_words(double: float, register: int, auto: bool):
    static, void, volatile, signed, struct, short = double + 1, register, auto, 4, 5, 6
    int64_t, uint64_t, INT64_C, bool_, INFINITY, NAN, NULL = 1, 2, 3, 4, 5, 6, 7
    return (double, register, auto, static, void, volatile, signed, struct, short, int64_t + uint64_t + INT64_C,
            bool_, INFINITY, NAN, NULL, math.inf, -math.nan)
def c_functions(exp: float, log: float, I: float, y0: float, index: int):
    floor, pow, fabs, memcpy, fmod, sqrt = exp + 1, log, I, y0, 2.0, 9.0
    return (math.exp(exp), math.log(log), I, y0, index, floor, pow ** 0.5, abs(fabs), memcpy % fmod, math.sqrt(sqrt),
        7.5 // 2)
def header_words(whole: float, words: int, w: int, clamped: float, two_power: int, PACKED: int, FLOOR: float):
    word_of, float_of, floor_div, llabs = 1, 2, 3, -4
    return (int(whole), words // 2, w % 3, int(clamped), two_power, PACKED, math.floor(FLOOR), word_of, float_of,
        floor_div, abs(llabs))
def own_words(n: int, a: float):
    i_end, at_1, over_1, value_1, value_2, n_given, double_ = int(n), 2, 3, 4, 5, 6, 7
    record, table, is_in, in_order = 8, 9, 10, 11
    power_2, min_double, tuple_2, as_tuple_2, helper_2, row_1 = 12, 13, 14, 15, 16, 17
    total = 0
    double = 1
    for i in range(i_end):
        total += i + i_end
    for x in (at_1, over_1):
        total += x
    value_1, value_2 = value_2, value_1
    n = n + 0.5
    return (total, value_1, value_2, n, n_given, double, double_, record, WEIGHTS[n_given - 5], table, a ** 2, power_2,
            min(a, 2.0), min_double, (a, a)[tuple_2 - 14], as_tuple_2, helper(n), helper_2, n_given in (1, 6), is_in,
            1 < a < 2, in_order, row_1)
'''
CASES = {
    "swapped": [(1, 2)], "rotated": [(1.0, 2.0, 3.5)], "chained": [(1.5,)], "unpacked": [(1.5, 3)], "named": [(2.5, 3)],
    "replaced": [(0.5,), (2.0,)], "by_place": [(0,), (1,), (2,)], "joined": [(2.5,)], "counted": [(1,), (9,)],
    "steps": [(1,), (7,), (12,)], "bounds_change": [(1,), (6,)], "counter_changes": [(1,), (4,)],
    "nested_in_one_name": [(1,), (4,)], "own_bound": [(0,), (-2,)], "twice_in_one_name": [(0,), (5,)],
    "left": [(1,), (5,), (12,)], "over_tuples": [(1.5,), (-0.3,)], "while_it_lasts": [(1,), (27,), (97,)],
    "early": [(-1.0,), (0.5,), (3.0,), (50.0,), (500.0,), (math.nan,)], "in_branches": [(1.0,), (-1.0,), (-9.0,)],
    "kept_from_round_to_round": [(0,), (1,), (6,)], "kept_behind_a_branch": [(0,), (8,)],
        "kept_in_inner_loops": [(1,), (5,)],
    "kept_in_a_while": [(2,), (9,)], "made_anew": [(0,), (6,)], "widened": [(0,), (5,)], "argument_widened": [(3, 1.5)],
    "shortened": [(5, 0.25, True), (-9, 1e9, False)], "of_kinds": [(1.5, 3, True)], "ignored": [(1.5, 3)],
    "names_alike": [(0.5, 2, True)], "truths": [(1.0, 2), (-1.0, 2), (1.0, 0), (math.nan, 1)], "only_a_pass": [()],
    "c_words": [(1.5, 2, True)], "c_functions": [(0.3, 2.0, -3.0, 7.5, 4)], "header_words": [(2.5, 7, 8, -3.5, 1, 2,
        -1.5)],
    "own_words": [(4, 1.5)]}


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    return Both(TEXT, tmp_path_factory.mktemp("statements"))


@pytest.mark.parametrize("name", CASES)
def test_c_does_what_python_does(both, name):
    for arguments in CASES[name]:
        both.compare(name, *arguments)
