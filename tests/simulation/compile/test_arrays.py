"""Arrays, records and lists of kernels: in C they are read and written as NumPy's are."""

import numpy as np
import pytest

from simulation.compile.by_hand import OUTER, PACKED, Both

TEXT = '''
TABLE = np.array((0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5, 9.5, 10.5, 11.5, 12.5))
LAST, SECOND = -1, -2
def sizes(x: floats, t: table, c: cube):
    m, n = t.shape
    return (len(x), len(t), len(c), x.size, t.size, c.size, m, n, c.shape[2], t.shape, len(c[0]), c[0].shape)
def at_the_end(x: floats, t: table): return (x[-1], x[-2], t[-1, 0], t[0, -2], t[-1][-1], x[LAST], t[SECOND, LAST],
    x[len(x) - 1])
def elements(x: floats, t: table, c: cube, i: int):
    row = t[i]
    plane = c[i]
    return (x[i], t[i, 1], t[i][2], row[0], c[i, 0, 1], c[i][1][0], c[i, 1][1], plane[0, 1], plane[1][0], len(row))
def sliced(x: floats, low: int, high: int):
    part = x[low:high]
    total = 0.0
    for k in range(len(part)):
        total = total * 3 + part[k]
    return (len(part), total, len(x[low:]), len(x[:high]), len(x[:]), len(x[-2:]), len(x[:-1]), len(x[low:high][1:]))
def sliced_rows(t: table, low: int, high: int):
    part = t[low:high]
    total = 0.0
    for k in range(len(part)):
        total = total * 3 + part[k, 1]
    return (len(part), part.size, total, len(t[1][low:high]))
def looped(x: floats, n: ints, t: table, f: flags):
    total = 0.0
    for a in x:
        total = total * 2 + a
    for k in n:
        total = total * 2 + k
    for row in t:
        total = total * 2 + row[1]
        for a in row[1:]:
            total += a
    for a in t[1]:
        total -= a
    for flag in f:
        if flag:
            total += 1000
    return total
def rebound(x: floats, y: floats):
    total = 0.0
    for a in x:
        total = total * 2 + a
        x = y
    return total + x[0]
def constants(k: int):
    total = 0.0
    for a in TABLE:
        total += a
    return (TABLE[k], TABLE[-1], len(TABLE), TABLE[k:][1], total)
def written(x: floats, t: table, n: ints, b: bytes, h: halves, f: flags, s: singles, k: int):
    x[0], x[1] = x[1], x[0]
    x[-1] = k
    t[1] = t[0]
    t[2] = k
    t[0][1:] = 7.5
    t[0][0] += 3
    n[k] = n[0] * 3 + True
    n[1] -= 5
    b[0] = -100
    b[1] += 3
    b[2] = b[0] | 4
    h[0] = 2000000000
    h[1] = k
    f[0] = k > 100
    f[1] |= k > 0
    s[0] = 0.1
    s[1] = x[1] * 3
    s[2] = s[0] * k
    return int(b[0]) * int(h[0]) * 8
def shifted(x: floats, y: floats):
    x[1:] = x[:-1]
    y[:-1] = y[1:]
    x[0:2] = y[1:3]
def of_32_bits(s: singles):
    return (s[0] * s[1] + s[2], -s[0] / s[1], min(s[0], s[1]), abs(s[1]), s[0] < s[1], round(s[1]), int(s[1]),
        float(s[0]) / 3)
def of_small_whole(b: bytes, h: halves):
    return (int(b[0]) * int(b[1]) * 1000000, int(h[0]) ** 2, -b[0], ~h[0], b[0] // 7, h[1] % 5, abs(b[0]),
        int(b[0]) << 40, max(b[0], h[0]))
def filled(n: int):
    square = [0.0] * 5
    whole = [n] * 3
    for k in range(5):
        square[k] = k * k + n
        square[k] += 0.5
    whole[-1] = 9
    total = 0.0
    for k in range(3):
        again = [1] * 2
        again[0] += k
        total += again[0] + 10 * again[1]
    return (square[4], square[-5], whole[0], whole[2], len(square), total + summed(square), summed(square[1:3]))
def summed(x):
    total = 0.0
    for a in x:
        total += a
    return total
def set_first(x, value):
    x[0] = value
def through_calls(x: floats, n: ints):
    set_first(x, 4.5)
    set_first(x[1:], 5.5)
    set_first(n, 3)
    own = [1.0] * 2
    set_first(own, 2.5)
    return (own[0], own[1], summed(x))
def records(o: outers, k: int):
    one = o[k]
    row = one.inner.row
    return (one.n, one.signs[2], one.y, one.inner.x, one.inner.row[1], row[-1], one.table[1, 2], one.table[0][1],
        o[-1].n, len(o), len(row),
            len(o[1:]), one.table.shape)
def records_written(o: outers, k: int):
    one = o[k]
    one.n = 5
    one.n += k
    one.signs[2] = not one.signs[2]
    one.y = 0.1
    one.y += 1
    one.inner.x = one.n + 0.5
    one.inner.row[1] *= 2
    one.inner.row[2], one.inner.row[0] = one.inner.row[0], 3
    one.table[1, 2] = 8
    one.table[0] = 1.5
    one.inner.row = one.table[1]
    o[0].inner = one.inner
    o[0].inner.row[1:] = 4
def record_copied(o: outers):
    o[1] = o[0]
    o[0].n = 77
    for one in o:
        one.n += 1
def swapped_fields(o: outers):
    o[0].n, o[1].n = o[1].n, o[0].n
    o[0].inner.x, o[0].y = o[0].y, o[0].inner.x
def of_odd_size(p: packed):
    p[1].x, p[1].y, p[1].flag = p[0].x * 2, p[0].y, p[0].k > 3
    p[2] = p[0]
    p[0].k += 2
    return (p[1].x, p[-1].k, p[0].flag)
def change(one):
    one.n += 1
    return one.n
def in_their_order(o: outers):
    first = change(o[0])
    second = o[0].n + first
    a, b = change(o[0]), o[0].n
    c = 3 if o[0].n > 100 and change(o[0]) > 0 else change(o[1])
    return (first, second, a, b, c)
'''
VALUES = np.array([1.5, -2.0, 0.25, 4.0, 5.0])
TABLE = np.arange(12.0).reshape(3, 4) + 0.5
CUBE = np.arange(12.0).reshape(3, 2, 2) * 1.5
WHOLE = np.array([3, -4, 5, 6, 7])
SMALL, HALVES = np.array([-100, 100, 3], np.int8), np.array([2000000000, -7, 3], np.int32)
FLAGS, SINGLES = np.array([True, False, True]), np.array([0.1, -2.7, 3.0], np.float32)
OUTERS = np.zeros(3, OUTER)
OUTERS["n"], OUTERS["y"], OUTERS["inner"]["row"] = [1, 2, 3], [0.5, 1.5, 2.5], np.arange(9.0).reshape(3, 3)
OUTERS["table"], OUTERS["inner"]["x"] = np.arange(18.0).reshape(3, 2, 3), [9.0, 8.0, 7.0]
ODD = np.array([(5, 1.5, True, 0.1), (0, 0, False, 0), (0, 0, False, 0)], PACKED)
BOUNDS = [(low, high) for low in (-9, -2, 0, 1, 4, 5, 9) for high in (-9, -1, 0, 2, 5, 9)]
CASES = {
    "sizes": [(VALUES, TABLE, CUBE)], "at_the_end": [(VALUES, TABLE)],
    "elements": [(VALUES, TABLE, CUBE, k) for k in range(3)], "sliced": [(VALUES, *bounds) for bounds in BOUNDS],
    "sliced_rows": [(TABLE, *bounds) for bounds in BOUNDS], "looped": [(VALUES, WHOLE, TABLE, FLAGS)],
    "rebound": [(VALUES, VALUES[::-1].copy())], "constants": [(0,), (11,)],
    "written": [(VALUES, TABLE, WHOLE, SMALL, HALVES, FLAGS, SINGLES, k) for k in (0, 2)],
    "shifted": [(VALUES, WHOLE * 1.5)], "of_32_bits": [(SINGLES,)], "of_small_whole": [(SMALL, HALVES)],
    "filled": [(0,), (3,)], "through_calls": [(VALUES, WHOLE)], "records": [(OUTERS, k) for k in range(3)],
    "records_written": [(OUTERS, 1), (OUTERS, 2)], "record_copied": [(OUTERS,)], "of_odd_size": [(ODD,)],
        "swapped_fields": [(OUTERS,)],
    "in_their_order": [(OUTERS,)]}


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    return Both(TEXT, tmp_path_factory.mktemp("arrays"))


@pytest.mark.parametrize("name", CASES)
def test_c_reads_and_writes_as_numpy_does(both, name):
    for arguments in CASES[name]:
        both.compare(name, *arguments)
