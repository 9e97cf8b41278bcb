"""Functions of `physics.elementary` against 40 digits: at most two units in the last place off, everywhere."""

import ctypes
import math
import subprocess

import mpmath
import numpy as np
import pytest

from servotwin.physics import elementary
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.finding import compilers
from servotwin.simulation.compile.standalone import Standalone
from servotwin.simulation.compile.text.kinds import FLOAT64

MOST = 2.0  # units in the last place


@pytest.fixture(autouse=True)
def _digits():
    with mpmath.workdps(60):
        yield


def spread(low, high, n=500):
    """Return numbers of all sizes, of both signs."""
    rng = np.random.default_rng(1)
    return (rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(low, high, n)).tolist()


def even(low, high, n=500):
    return np.random.default_rng(2).uniform(low, high, n).tolist()


def off(found, exact):
    """Return by how many units in the last place a number is off; of those without all digits, by how many steps."""
    if exact == 0:
        return 0.0 if found == 0.0 else math.inf
    if mpmath.isinf(exact) or abs(exact) > mpmath.mpf(1.7976931348623157e308):
        return 0.0 if math.isinf(found) else math.inf
    unit = math.ulp(float(exact))
    return float(abs(mpmath.mpf(found) - exact) / unit)


QUARTERS = [k * math.pi / 2 for k in (1, 2, 3, 7, 355, 1e3, 22, 573204, 1e6, 1234567)]
FAR = [1.7e6, 1e9, 123456789.123, 987654321987.5, 1e12]
CASES = {
    "exp": even(-745, 709) + spread(-20, 0) + [-744.5, 709.78, 0.34657359, 0.3466],
    "expm1": even(-60, 709) + even(-1, 1) + spread(-20, 0) + [0.34657, 1.0397, 38.9, 39.5, 709.78],
    "log": [abs(x) for x in spread(-308, 308)] + even(0.5, 2.0) + [5e-324, 1e-310],
    "log1p": [abs(x) for x in spread(-20, 300)] + even(-0.999999, 2.0) + spread(-18, -1) + [-0.2929, 0.41422],
    "sin": even(-20, 20) + spread(-20, 6) + QUARTERS + FAR,
    "cos": even(-20, 20) + spread(-20, 6) + QUARTERS + FAR,
    "tanh": even(-25, 25) + spread(-20, 0) + [0.999999, 1.0, 21.9, 22.1],
    "atanh": even(-1, 1) + spread(-20, -0.0001) + [0.4999999, 0.5, 1 - 1e-16],
}


@pytest.mark.parametrize("name", CASES)
def test_the_last_digits(name):
    own, exact = getattr(elementary, name), getattr(mpmath, name)
    worst = max((off(own(x), exact(mpmath.mpf(x))), x) for x in CASES[name])
    assert worst[0] <= MOST, worst


def test_the_last_digits_of_angles():
    points = list(zip(spread(-3, 3), spread(-3, 3)[::-1], strict=True)) + [
        (y, x) for y in (0.0, 1.0, -1.0, 1e-300, 1e300) for x in (1.0, -1.0, 1e300, -1e-300, 2.0 * 0.6875)]
    worst = max((off(elementary.atan2(y, x), mpmath.atan2(mpmath.mpf(y), mpmath.mpf(x))), y, x) for y, x in points)
    assert worst[0] <= MOST, worst


def test_the_last_digits_of_powers():
    cases = [(abs(x), y) for x, y in zip(spread(-300, 300), even(-1, 1), strict=True)]
    cases += [(x, y) for x, y in zip(even(0.2, 8.0), even(-300, 300), strict=True)]
    cases += [(x, y) for x in (2.0, 0.1, 1.2247, 1.2248, 0.866, 0.867, 1.0000001) for y in (0.25, 1 / 7, -3.0, 4.0)]
    worst = max((off(elementary.power(x, y), mpmath.power(mpmath.mpf(x), mpmath.mpf(y))), x, y) for x, y in cases)
    assert worst[0] <= MOST, worst


def test_what_has_no_value_is_nan_and_what_leaves_the_range_is_inf():
    inf, nan = math.inf, math.nan
    for name, x, value in (
            ("exp", inf, inf), ("exp", -inf, 0.0), ("exp", nan, nan), ("expm1", inf, inf), ("expm1", -inf, -1.0),
            ("expm1", nan, nan), ("log", 0.0, -inf), ("log", -1.0, nan), ("log", inf, inf), ("log", nan, nan),
            ("log1p", -1.0, -inf), ("log1p", -2.0, nan), ("log1p", inf, inf), ("log1p", nan, nan), ("sin", inf, nan),
            ("sin", nan, nan), ("cos", -inf, nan), ("cos", nan, nan), ("sin", -0.0, -0.0), ("tanh", inf, 1.0),
            ("tanh", nan, nan), ("atanh", 1.0, inf), ("atanh", -1.0, -inf), ("atanh", 2.0, nan), ("atanh", nan, nan)):
        np.testing.assert_equal(getattr(elementary, name)(x), value, f"{name}({x})")
    for y in (0.0, -0.0, 1.0, -1.0, inf, -inf, nan):
        for x in (0.0, -0.0, 1.0, -1.0, inf, -inf, nan):
            np.testing.assert_equal(elementary.atan2(y, x), math.atan2(y, x), f"atan2({y}, {x})")
    for x in (0.0, 1.0, 4.0, 0.25, inf, nan):
        for y in (0.0, 0.5, -0.5, 1.5, nan):
            with np.errstate(all="ignore"):
                exact = float(np.power(x, y))
            np.testing.assert_equal(elementary.power(x, y), exact, f"power({x}, {y})")


# --- The same text in C of floats -------------------------------------------------------------------------------------

OF_TWO = ("atan2", "power")
IN_FLOATS = {
    "exp": even(-103, 88.7) + spread(-10, 0), "expm1": even(-30, 88.7) + even(-1, 1) + spread(-10, 0),
    "log": [abs(x) for x in spread(-37.9, 38)] + even(0.5, 2.0),
    "log1p": [abs(x) for x in spread(-10, 38)] + even(-0.99999, 2.0) + spread(-9, -1),
    "sin": even(-200, 200) + even(-2e4, 2e4) + spread(-10, 2),
    "cos": even(-200, 200) + even(-2e4, 2e4) + spread(-10, 2),
    "tanh": even(-12, 12) + spread(-10, 0), "atanh": even(-1, 1) + spread(-10, -0.001)}


@pytest.fixture(scope="module")
def floats(tmp_path_factory):
    """Return all functions in C of floats, each of an array or two."""
    names = (*IN_FLOATS, *OF_TWO)
    text = Standalone({}, floats=True)
    recipe = Recipe("elementary", tuple(f"servotwin.physics.elementary:{name}" for name in names), in_floats=True)
    found = text.add(recipe, {name: (FLOAT64,) * (1 + (name in OF_TWO)) for name in names})
    many = [f"void many_{name}(long n, const float *x, const float *y, float *z) {{ for (long k = 0; k < n; k++)"
            f" z[k] = {own}(x[k]{', y[k]' if name in OF_TWO else ''}); }}" for name, own in found.items()]
    folder = tmp_path_factory.mktemp("floats")
    (folder / "floats.c").write_text("\n".join([text.private, *many]))
    if not compilers():
        pytest.skip("no C compiler")
    made = str(folder / "floats.so")
    subprocess.run([*compilers()[0].command, "-std=c99", "-O2", "-w", "-shared", "-fPIC", "-o", made,
                    str(folder / "floats.c"), "-lm"], check=True)
    library = ctypes.CDLL(made)

    def call(name, x, y=()):
        x, y = np.array(x, np.float32), np.array(y, np.float32)
        z = np.empty_like(x)
        addresses = (ctypes.c_void_p(each.ctypes.data) for each in (x, y, z))
        getattr(library, f"many_{name}")(ctypes.c_long(len(x)), *addresses)
        return zip(x.tolist(), (y if len(y) else x).tolist(), z.tolist(), strict=True)

    return call


def off_float(found, exact):
    if abs(exact) > mpmath.mpf(float(np.finfo(np.float32).max)):
        return 0.0 if math.isinf(found) else math.inf
    return float(abs(mpmath.mpf(found) - exact) / float(np.spacing(np.float32(abs(float(exact))))))


@pytest.mark.parametrize("name", IN_FLOATS)
def test_the_last_digits_of_floats(name, floats):
    worst = max((off_float(z, getattr(mpmath, name)(mpmath.mpf(x))), x) for x, _, z in floats(name, IN_FLOATS[name]))
    assert worst[0] <= (2.5 if name == "atanh" else MOST), worst


def test_the_last_digits_of_floats_of_two(floats):
    x, y = [abs(each) for each in spread(-30, 30)] + even(0.2, 8.0), even(-1, 1) + even(-40, 40)
    for name, exact, a, b in (
            ("atan2", mpmath.atan2, spread(-3, 3), spread(-3, 3)[::-1]), ("power", mpmath.power, x, y)):
        worst = max((off_float(z, exact(mpmath.mpf(p), mpmath.mpf(q))), p, q) for p, q, z in floats(name, a, b))
        assert worst[0] <= MOST, (name, worst)


def test_floats_without_a_value_are_nan_and_those_beyond_the_range_inf(floats):
    inf, nan = math.inf, math.nan
    for name, x, value in (("exp", 89.0, inf), ("exp", -104.0, 0.0), ("exp", nan, nan), ("expm1", -inf, -1.0),
                           ("expm1", 89.0, inf), ("log", 0.0, -inf), ("log", -1.0, nan), ("log", 1e-40, -92.1034),
                           ("log1p", -1.0, -inf), ("log1p", -2.0, nan), ("sin", inf, nan), ("sin", 3e4, nan),
                           ("cos", nan, nan), ("tanh", inf, 1.0), ("atanh", 1.0, inf), ("atanh", 2.0, nan)):
        (_, _, found), = floats(name, [x])
        np.testing.assert_allclose(found, value, rtol=1e-5, err_msg=f"{name}({x})")
