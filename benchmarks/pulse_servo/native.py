"""The C peers: compiled by gcc into a temporary folder and called by ctypes."""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from fleet import COLUMNS, FRAME, Fleet, columns

HERE = Path(__file__).resolve().parent
# Thread jumping is an optimisation that leaves branches in the loop over the lanes, which then is not vectorised.
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-fno-math-errno", "-fno-trapping-math",
         "-fno-thread-jumps", "-fopenmp", "-shared", "-fPIC")


class Native:
    """The functions of `pulse.c` and `peak.c` in one precision."""

    def __init__(self, dtype: str) -> None:
        if shutil.which("gcc") is None:
            raise ImportError("gcc")
        self.dtype = np.dtype(dtype)
        single = ("-DSINGLE",) if dtype == "float32" else ()
        with tempfile.TemporaryDirectory() as folder:  # a loaded library stays without its file
            self._pulse, self._peak = (self._load(name, folder, single) for name in ("pulse", "peak"))
        self._peak.peak.restype = ctypes.c_double

    @staticmethod
    def _load(name: str, folder: str, single: tuple[str, ...]) -> ctypes.CDLL:
        out = f"{folder}/{name}.so"
        subprocess.run(["gcc", *FLAGS, *single, str(HERE / f"{name}.c"), "-o", out], check=True)
        return ctypes.CDLL(out)

    def prepare(self, fleet: Fleet, frames: int) -> "Prepared":
        """Lay out the fleet as the C code reads it."""
        x = columns(fleet)
        return Prepared(self, np.array([x[name] for name in COLUMNS], self.dtype),
                        np.ascontiguousarray(fleet.pulses(frames), self.dtype), fleet.angle.astype(self.dtype))

    def multiply_adds(self, threads: int) -> float:
        """Run independent multiply-adds for about 0.05 s; return the number of operations."""
        return float(self._peak.peak(ctypes.c_long(10_000_000), threads, ctypes.c_double(1e-3)))


class Prepared:
    """A fleet in the arrays of `pulse.c`."""

    def __init__(self, native: Native, table: np.ndarray, pulses: np.ndarray, angle: np.ndarray) -> None:
        self.native, self.table, self.pulses, self.start = native, table, pulses, angle

    def run(self, threads: int = 2) -> np.ndarray:
        """Return the angles at the end [rad]."""
        angle, speed = self.start.copy(), np.empty_like(self.start)
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in (self.table, self.pulses, angle, speed)]
        frames, lanes = self.pulses.shape
        self.native._pulse.run(ctypes.c_long(lanes), ctypes.c_long(frames), ctypes.c_double(FRAME), *pointers, threads)
        return angle
