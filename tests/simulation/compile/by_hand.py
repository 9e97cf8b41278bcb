"""Kernels written by hand, translated to C, compiled and called beside plain Python."""

import ast
import ctypes
import math
import struct
import subprocess

import numpy as np
import pytest

from servotwin.simulation.compile.finding import compilers
from servotwin.simulation.compile.library import Function
from servotwin.simulation.compile.text.derive import Derived, Recipe
from servotwin.simulation.compile.text.kinds import BOOL, FLOAT32, FLOAT64, INT8, INT32, INT64, Array, Record
from servotwin.simulation.compile.text.translate import translated

INNER = np.dtype((np.record, [("x", "f8"), ("row", "f8", (3,))]))
OUTER = np.dtype((np.record, [("n", "i8"), ("signs", "?", (4,)), ("y", "f4"), ("inner", INNER), ("table", "f8", (2,
    3))]))
PACKED = np.dtype((np.record, [("k", "i1"), ("x", "f8"), ("flag", "?"), ("y", "f4")]))
KINDS = {
    "float": FLOAT64, "int": INT64, "bool": BOOL, "floats": Array(FLOAT64, 1), "table": Array(FLOAT64, 2),
    "cube": Array(FLOAT64, 3), "ints": Array(INT64, 1), "bytes": Array(INT8, 1), "halves": Array(INT32, 1),
    "flags": Array(BOOL, 1), "singles": Array(FLOAT32, 1), "outers": Array(Record(OUTER), 1),
        "packed": Array(Record(PACKED), 1)}
"""What an annotation of an argument says."""
STRICT = ("-Wall", "-Wextra", "-Werror")


def derived(text, recipe=None):
    """Return handwritten text as if it had been derived; its annotations say what entries are called with."""
    functions, head = {}, ["import math", "import numpy as np", "_f = np.float64"]
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef):
            functions[node.name] = node
        else:
            head.append(ast.unparse(node))
    entries = {name: name for name in functions}
    return Derived(recipe or Recipe("by_hand", ()), functions, "\n".join(head), {}, frozenset(), frozenset(), entries)


def kinds_of(node):
    """Return the kinds of a function's arguments; None where they are not all said."""
    said = [argument.annotation for argument in node.args.args]
    return None if None in said else tuple(KINDS[ast.unparse(each)] for each in said)


def translate(text, recipe=None):
    """Return handwritten text in C."""
    own = derived(text, recipe)
    return translated(own, [(name, kinds) for name, node in own.functions.items()
                            if (kinds := kinds_of(node)) is not None])


class Both:
    """Handwritten functions, compiled and plain."""

    def __init__(self, text, folder, recipe=None, strict=True):
        if not compilers():
            pytest.skip("no C compiler")
        own, translation = derived(text, recipe), translate(text, recipe)
        source, library = folder / "by_hand.c", folder / "by_hand.so"
        source.write_text(translation.text)
        command = compilers()[0].library_command(source, library, own.recipe.vector, "x86-64-v2")
        done = subprocess.run([*(part for part in command if part != "-w" or not strict), *STRICT[:3 * strict]],
                              check=False, text=True, capture_output=True, env=compilers()[0].environment(folder))
        assert done.returncode == 0, done.stderr
        self._library = ctypes.CDLL(str(library))
        self._functions = {
            entry.name: Function(ctypes.cast(getattr(self._library, entry.symbol), ctypes.c_void_p).value,
                                 entry.arguments, entry.result) for entry in translation.entries}
        self._plain = {}
        exec(own.head, self._plain)
        for node in own.functions.values():
            for argument in node.args.args:
                argument.annotation = None
        exec(compile(ast.unparse(ast.Module(list(own.functions.values()), [])), "by hand", "exec"), self._plain)

    def compiled(self, name, *arguments):
        """Call the compiled function."""
        return self._functions[name](arguments)

    def plain(self, name, *arguments):
        """Call the plain function."""
        with np.errstate(all="ignore"):
            return self._plain[name](*arguments)

    def compare(self, name, *arguments):
        """Check that both return the same and leave the same in arrays."""
        first, second = ([each.copy() if isinstance(each, np.ndarray) else each for each in arguments] for _ in "12")
        found, wanted = self.compiled(name, *first), self.plain(name, *second)
        assert same(found, wanted), f"{name}{arguments}: {found!r}, in Python {wanted!r}"
        for a, b in zip(first, second, strict=True):
            assert not isinstance(a, np.ndarray) or a.tobytes() == b.tobytes(), f"{name}: {a}, in Python {b}"
        return found


def same(found, wanted):
    """Tell whether numbers are the same, bit by bit; of nan there is one."""
    if isinstance(found, tuple):
        return isinstance(wanted, tuple) and len(found) == len(wanted) and all(map(same, found, wanted))
    if isinstance(found, float):
        return (math.isnan(found) and math.isnan(wanted)) or struct.pack("d", found) == struct.pack("d", wanted)
    return found == wanted
