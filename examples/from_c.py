"""Six servos of a leg that a program in C leads: it sends pulses, goes on by a tick, and looks at angle and current.

The program gets an address, a struct and a header from `VectorSimulator.c_entry`, and Python is not asked in between.
"""

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import servotwin as st

PROGRAM = """
#include <math.h>
#include "servotwin.h"

/* Swing all servos for some ticks; leave their largest currents in `most`. */
int swing(servotwin_advance advance, servotwin_tick *tick, double *width, double *most, int64_t ticks) {
    for (int64_t k = 0; k < ticks; k++) {
        for (int64_t j = 0; j < tick->lanes; j++)
            width[j] = 1.5e-3 + 3e-4 * sin(6.2832 * (1e-3 * k - j / 6.0));
        int code = advance(tick);
        if (code != SERVOTWIN_DONE)
            return code;
        for (int64_t j = 0; j < tick->lanes; j++)
            most[j] = fmax(most[j], fabs(tick->armature_current[j]));
    }
    return SERVOTWIN_DONE;
}
"""
LANES, TICKS = 6, 5000

if shutil.which("cc") is None:
    print("from_c.py needs a C compiler: cc is not found")
    sys.exit()
sims = st.VectorSimulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), LANES, load=st.loads.Inertia(1e-3))
entry = sims.c_entry()
width, most, current, angle = np.full(LANES, 1.5e-3), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
tick = entry.tick(1e-3, pulse_width=width, armature_current=current, output_angle=angle)
with tempfile.TemporaryDirectory() as folder:
    entry.write_header(folder)
    Path(folder, "swing.c").write_text(PROGRAM)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "swing.c", "-o", "swing.so", "-lm"], cwd=folder, check=True)
    swing = ctypes.CDLL(str(Path(folder, "swing.so"))).swing
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (width, most)]
    start = time.perf_counter()
    code = swing(ctypes.c_void_p(entry.address), ctypes.byref(tick), *pointers, ctypes.c_int64(TICKS))
    taken = time.perf_counter() - start
print(f"returned {code}: {TICKS} ticks of {LANES} servos, {1e6 * taken / TICKS:.2f} us each")
print("largest currents [A]:", most.round(2).tolist(), " angles now [deg]:", np.degrees(angle).round().tolist())
