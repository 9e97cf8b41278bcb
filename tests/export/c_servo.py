"""An exported servo, compiled and called from Python."""

import ctypes
import re
import subprocess
from pathlib import Path

import numpy as np

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
SIZES = """#include "NAME.h"
int64_t size_of_state(void);
int64_t size_of_state(void) { return (int64_t)sizeof(NAME_state); }
"""


class CServo:
    """The functions of an exported servo.

    Parameters
    ----------
    code : CCode
    folder : Path
        Of the texts and the library.
    compiler, flags : str, sequence of str
    """

    def __init__(self, code, folder, compiler="cc", flags=("-O2",)):
        code.write(folder, overwrite=True)
        (Path(folder) / "sizes.c").write_text(SIZES.replace("NAME", code.name))
        library = Path(folder) / f"{code.name}.so"
        subprocess.run([compiler, *STRICT, *flags, "-fPIC", "-shared", "-o", str(library),
                        str(Path(folder) / f"{code.name}.c"), str(Path(folder) / "sizes.c"), "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))
        self._library.size_of_state.restype = ctypes.c_int64
        struct = code.header.split("/* Signals (SI)")[1].split("}")[0]
        self.names = re.findall(r"double (\w+);", struct)
        events = code.header.split("/* What happens, of an event. */")[1].split("};")[0]
        self.events = {int(number): word for word, number in re.findall(rf"{code.name.upper()}_(\w+) = (\d+)", events)}
        own = ctypes.addressof(ctypes.c_char.in_dll(self._library, f"{code.name}_table"))
        self._numbers = np.ctypeslib.as_array((ctypes.c_double * (len(code.table) + 2)).from_address(own)).copy()
        assert self._numbers[:-2].tolist() == list(code.table)
        self.state = np.zeros(self._library.size_of_state(), np.uint8)
        self._code = code
        address, number = ctypes.c_void_p, ctypes.c_double
        self.start_at = self._function("init", address, address, number, ctypes.c_int64)
        self.advance_to = self._function("advance", address, address, number, number, number, address)
        self.observe_at = self._function("observe", address, address, number, number, address)
        self.time_of = self._function("time", address, result=number)
        self.command_of = self._function("command", address, number, result=number)

    def _function(self, name, *arguments, result=ctypes.c_int):
        function = getattr(self._library, f"{self._code.name}_{name}")
        function.argtypes, function.restype = arguments, result
        return function

    def make(self, given):
        """Make the table of parameters; return what the function says."""
        given = np.array(given, np.float64)
        return self._function("make", ctypes.c_void_p, ctypes.c_void_p)(self.table, given.ctypes.data)

    @property
    def numbers(self):
        return self._numbers[:len(self._code.table)].tolist()

    @property
    def table(self):
        return self._numbers.ctypes.data

    def like(self, table):
        """Take the numbers of another servo, whose code would be the same."""
        self._numbers[:len(table)] = table

    def start(self, command, seed=0):
        return self.start_at(self.state.ctypes.data, self.table, command, seed)

    def advance(self, until, command, torque=0.0, events=None):
        return self.advance_to(self.state.ctypes.data, self.table, until, command, torque,
                               None if events is None else events.address)

    def observe(self, command, torque=0.0):
        signals = np.full(len(self.names), np.nan)
        status = self.observe_at(self.state.ctypes.data, self.table, command, torque, signals.ctypes.data)
        return dict(zip(self.names, signals.tolist(), strict=True)) if status == 0 else status

    @property
    def time(self):
        return self.time_of(self.state.ctypes.data)

    def command(self, angle):
        return self.command_of(self.table, angle)


class Events:
    """Room for what happens."""

    def __init__(self, room=1000):
        self.rows = np.zeros(room, [("time", "f8"), ("angle", "f8"), ("kind", "i8")])
        self._struct = np.array([self.rows.ctypes.data, room, 0], np.int64)

    @property
    def address(self):
        return self._struct.ctypes.data

    @property
    def count(self):
        return int(self._struct[2])
