"""What has no form in C is refused before a compiler sees it: the error says where, and what to write instead."""

import time

import pytest

from servotwin.simulation.compile import building
from servotwin.simulation.compile.text.kinds import TranslationError
from simulation.compile.by_hand import translate

BEFORE = '''
TABLE = np.array((0.5, 1.5, 2.5))
from typing import NamedTuple
class Pair(NamedTuple):
    x: float
    n: int = 4
def plus(x, y=1): return x + y
def change(x):
    x[0] += 1
    return x[0]
def bump(one):
    one.n += 1
    return one.n
def nothing(x):
    x[0] = 1
'''
# What is written, in a function of these arguments; the line that is named; what the error says to write instead
CASES = {
    "list comprehension": ("x: float", "y = [k * x for k in range(3)]", "[k * x for k in range(3)]",
        "a list gets its room"),
    "generator": ("x: float", "return sum(k * x for k in range(3))", "(k * x for k in range(3))", "gets its room"),
    "list": ("x: float", "y = [x, x]", "[x, x]", "gets its room"),
    "dict": ("x: float", "y = {1: x}", "{1: x}", "a kernel has numbers"),
    "set": ("x: float", "y = {x}", "{x}", "a kernel has numbers"),
    "string": ("x: float", "y = 'a'", "'a'", "constants of a kernel"),
    "None": ("x: float", "y = None", "None", "constants of a kernel"),
    "complex number": ("x: float", "y = 1j", "1j", "constants of a kernel"),
    "too many digits": ("x: float", "y = 9223372036854775808", "9223372036854775808", "constants of a kernel"),
    "f-string": ("x: float", "y = f'{x}'", "f'{x}'", "a kernel has numbers"),
    "index by name": ("o: outers", "return o['n'][0]", "o['n']", "an index is a whole number"),
    "method": ("x: floats", "return x.sum()", "x.sum()", "no methods"),
    "NumPy's function": ("x: floats", "return np.sqrt(x[0])", "np.sqrt(x[0])", "no methods"),
    "try": ("x: float", "try:\n    y = x\nexcept ValueError:\n    y = 0.0", "try:", "a kernel has assignments"),
    "with": ("x: float", "with x:\n    pass", "with x:", "a kernel has assignments"),
    "raise": ("x: float", "raise ValueError", "raise ValueError", "a kernel has assignments"),
    "assert": ("x: float", "assert x > 0", "assert x > 0", "a kernel has assignments"),
    "del": ("x: float", "del x", "del x", "a kernel has assignments"),
    "global": ("x: float", "global y", "global y", "a kernel has assignments"),
    "yield": ("x: float", "yield x", "yield x", "a kernel has numbers"),
    "match": ("n: int", "match n:\n    case 1:\n        pass", "match n:", "a kernel has assignments"),
    "lambda": ("x: float", "f = lambda y: y", "lambda y: y", "a kernel has numbers"),
    "nested function": ("x: float", "def inner(y): return y\nreturn inner(x)", "def inner(y):",
        "a kernel has assignments"),
    "walrus": ("x: float", "return (y := x)", "(y := x)", "a kernel has numbers"),
    "recursion": ("n: int", "return f(n - 1) if n > 0 else 0", "f(", "a loop takes its place"),
    "star in a call": ("x: float", "t = (x, x)\nreturn plus(*t)", "plus(*t)", "one by one"),
    "two stars in a call": ("x: float", "return plus(**x)", "plus(**x)", "one by one"),
    "star in a target": ("x: float", "a, *b = (x, x)", "*b", "a kernel has numbers"),
    "star argument": ("*x: float", "return 1", "def f(*x", "named one by one"),
    "too many arguments": ("x: float", "return plus(x, x, x)", "plus(x, x, x)", "plus takes x, y"),
    "an argument twice": ("x: float", "return plus(x, x=x)", "plus(x, x=x)", "plus takes x, y"),
    "a missing argument": ("x: float", "return plus(y=x)", "plus(y=x)", "x of plus is missing"),
    "an unknown argument": ("x: float", "return plus(x, z=x)", "plus(x, z=x)", "plus takes x, y"),
    "unknown name": ("x: float", "return other", "other", "no such name"),
    "unknown function": ("x: float", "return sum((x, x))", "sum((x, x))", "no function sum"),
    "unknown function of math": ("x: float", "return math.gamma(x)", "math.gamma(x)", "c_functions.MATH"),
    "math's function as a value": ("x: float", "y = math.sin", "math.sin", "which are called"),
    "logarithm to a base": ("x: float", "return math.log(x, 2.0)", "math.log(x, 2.0)", "it takes one number"),
    "round to places": ("x: float", "return round(x, 2)", "round(x, 2)", "it takes one number"),
    "min with a key": ("x: float", "return min(x, 1.0, key=x)", "min(x, 1.0, key=x)", "it takes numbers"),
    "min of an array": ("x: floats", "return min(x)", "min(x)", "it takes numbers"),
    "length of a number": ("x: float", "return len(x)", "len(x)", "have a length"),
    "variable of two kinds": ("x: float", "y = x\ny = (x, x)", "y", "one kind for each variable"),
    "tuples of two lengths": ("x: float", "y = (x, x)\ny = (x, x, x)", "y", "one kind for each variable"),
    "results of two kinds": ("x: float", "if x > 0:\n    return x\nreturn (x, x)", "return (x, x)", "one kind"),
    "choice of two kinds": ("x: float", "y = x if x > 0 else (x, x)", "x if x > 0 else (x, x)", "one kind"),
    "slice with a step": ("x: floats", "y = x[::2]", "x[::2]", "a slice has no step"),
    "slice of the second dimension": ("t: table", "y = t[0, 1:]", "t[0, 1:]", "one slice of the first dimension"),
    "float as an index": ("x: floats, a: float", "return x[a]", "a", "is no index"),
    "float as a bound": ("a: float", "for k in range(a):\n    pass", "a", "is no index"),
    "step that varies": ("n: int", "for k in range(0, 9, n):\n    pass", "for k in range(0, 9, n):", "is a constant"),
    "too many indices": ("x: floats", "return x[0, 0]", "x[0, 0]", "no such element"),
    "tuple beyond its end": ("x: float", "return (x, x)[2]", "(x, x)[2]", "there are 2 values"),
    "too few targets": ("x: float", "a, b = (x, x, x)", "(a, b)", "there are 3 values"),
    "or on numbers": ("x: float", "return x or 1.0", "x or 1.0", "a conditional expression"),
    "and on numbers": ("n: int", "y = n and n + 1", "n and n + 1", "a conditional expression"),
    "tuple as a condition": ("x: float", "if (x, x):\n    pass", "(x, x)", "neither true nor false"),
    "array as a condition": ("x: floats", "while x:\n    pass", "x", "neither true nor false"),
    "is": ("n: int", "return n is 3", "n is 3", "=="),
    "in an array": ("x: floats", "return 1.0 in x", "1.0 in x", "one of a tuple"),
    "order of tuples": ("x: float", "return (x, 1) < (x, 2)", "(x, 1) < (x, 2)", "only numbers have an order"),
    "tuple equal to a number": ("x: float", "return (x, 1) == x", "(x, 1) == x", "is never"),
    "long chain": ("x: float", "return 0 < x < 1 < 2", "0 < x < 1 < 2", "two comparisons"),
    "chain that ends with an index": ("x: floats, k: int", "return 0 <= k < x[k]", "0 <= k < x[k]", "with `and`"),
    "constant written to": ("x: float", "TABLE[0] = x", "TABLE[0]", "not written to"),
    "constant changed by a call": ("x: float", "change(TABLE)", "change(TABLE)", "not written to"),
    "tuple written to": ("x: float", "t = (x, x)\nt[0] = x", "t[0]", "made anew"),
    "named tuple written to": ("x: float", "p = Pair(x)\np.x = 3.0", "p.x", "made anew"),
    "tuple of kinds by variable": ("x: float, n: int", "return (x, (x, x))[n]", "(x, (x, x))[n]", "of one kind"),
    "slice of a tuple by variable": ("x: float, n: int", "y = (x, x, x)[n:]", "(x, x, x)[n:]", "are constants"),
    "power of two variables": ("n: int, m: int", "return n ** m", "n ** m", "constant power"),
    "matrix product": ("x: float", "return x @ x", "x @ x", "arithmetic|no such operation"),
    "bits of a float": ("x: float", "return x & 1", "x & 1", "bits are those of whole numbers"),
    "sum of arrays": ("x: floats", "y = x + x", "x + x", "arithmetic with"),
    "augmented floor division": ("n: int", "n //= 2\nreturn n", "n //= 2", "written out"),
    "float into whole numbers": ("n: ints", "n[0] = 0.5", "n[0]", "it gets a float64, and holds"),
    "else of a loop": ("n: int", "for k in range(n):\n    pass\nelse:\n    n = 1", "for k in range(n):", "no else"),
    "loop over a number": ("n: int", "for k in n:\n    pass", "for k in n:", "a range, a tuple or an array"),
    "two calls that write": ("x: floats", "return change(x) + change(x)", "change(x) + change(x)",
        "a statement of its own"),
    "a call that writes beside an index": ("x: floats", "return x[0] + change(x)", "x[0] + change(x)",
        "a statement of its own"),
    "a call that writes beside a field": ("o: outers", "return (o[0].n, bump(o[0]))", "(o[0].n, bump(o[0]))",
        "of its own"),
    "a call that writes in an index": ("x: floats, n: ints", "x[change(n)] = 1.0", "x[change(n)]", "of its own"),
    "a call that writes at the end of a chain": ("x: floats", "return 1 < 2 < change(x)", "1 < 2 < change(x)",
        "with `and`"),
    "a call that writes what is added to": ("x: floats", "x[0] += change(x)", "x[0] += change(x)", "of its own"),
    "a call that writes, repeated": ("x: floats", "return (change(x),) * 2", "(change(x),)", "of its own"),
    "value of what returns nothing": ("x: floats", "y = nothing(x)", "y = nothing(x)", "there is no value"),
    "a way without a result": ("x: float", "if x > 0:\n    return x", "if x > 0:", "ends with a return"),
    "a return without a value": ("x: float", "if x > 0:\n    return\nreturn x", "return", "everywhere, or nowhere"),
    "array returned by an entry": ("x: floats", "return x", "an array of 1 dimensions", "an entry returns numbers"),
    "list returned": ("x: float", "y = [x] * 3\nreturn y", "return y", "a list ends with its function"),
    "list of a variable length": ("n: int", "y = [0.0] * n", "[0.0]", "gets its room"),
    "two lists in one name": ("x: float", "y = [x] * 3\ny = [x] * 4\nreturn y[0]", "y = [x] * 4", "has another name"),
    "two names of a list": ("x: float", "y = z = [x] * 3\nreturn y[0]", "y = z = [x] * 3", "a name of its own"),
    "table filled at once": ("t: table", "t[:] = 0.0", "t[:]", "a row is stored at once"),
}


@pytest.mark.parametrize("name", CASES)
def test_what_has_no_form_is_refused(name, monkeypatch):
    monkeypatch.setattr(building, "compiled", None)
    arguments, body, line, instead = CASES[name]
    inner = "\n".join(f"    {each}" for each in body.splitlines())
    start = time.process_time()
    with pytest.raises(TranslationError, match=instead) as caught:
        translate(f"{BEFORE}\ndef f({arguments}):\n{inner}\n")
    assert time.process_time() - start < 1.0
    assert line in caught.value.line
    assert caught.value.function in ("f", "") or name == "recursion"


def test_functions_that_call_each_other_are_refused():
    text = "def g(n): return f(n - 1)\ndef f(n: int): return g(n) if n > 0 else 0"
    with pytest.raises(TranslationError, match="does not call itself"):
        translate(text)
