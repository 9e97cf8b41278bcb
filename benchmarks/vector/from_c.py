"""What a tick costs where a program in C calls the entry of a `VectorSimulator`."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from common import best

import servotwin as st

PROGRAM = """
#include "servotwin.h"

int run(servotwin_advance advance, servotwin_tick *tick, double *width, int64_t ticks) {
    int bad = 0;
    for (int64_t k = 0; k < ticks; k++) {
        if (k % 200 == 0)
            for (int64_t lane = 0; lane < tick->lanes; lane++)
                width[lane] = k / 200 % 2 ? 1.7e-3 : 1.2e-3;
        bad |= advance(tick);
    }
    return bad;
}
"""
TICKS = 4000
SHAFT, TORQUE = ("output_angle", "output_speed"), ("output_angle", "load_torque", "armature_current")
IMPOSED = {"set_output_speed": 0.0, "set_load_inertia": 1e-3}
ASKED = {"no signal": ((), {}), "shaft": (SHAFT, {}),  # what goes out, what is imposed
         "torque, current": (TORQUE, {}), "the same, imposed": (TORQUE, IMPOSED)}
ROWS = ((1, "plain", "no signal"), (1, "plain", "shaft"), (1, "plain", "torque, current"),
        (1, "plain", "the same, imposed"), (6, "plain", "shaft"), (6, "plain", "the same, imposed"),
        (128, "plain", "shaft"), (1, "play", "shaft"), (6, "play", "the same, imposed"))

Loop = Callable[[st.VectorSimulator, dict[str, np.ndarray]], float]


def in_c(folder: Path) -> Loop:
    """Return what times a tick of 1 ms in a loop that a C compiler has made [s]."""
    st.VectorSimulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), 1).c_entry().write_header(folder)
    (folder / "loop.c").write_text(PROGRAM)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "loop.c", "-o", "loop.so"], cwd=folder, check=True)
    run = ctypes.CDLL(str(folder / "loop.so")).run
    run.argtypes = (*[ctypes.c_void_p] * 3, ctypes.c_int64)

    def timed(sims: st.VectorSimulator, arrays: dict[str, np.ndarray]) -> float:
        entry = sims.c_entry()
        tick = entry.tick(1e-3, **arrays)
        given = entry.address, ctypes.addressof(tick), arrays["pulse_width"].ctypes.data, TICKS
        assert run(*given) == 0
        return best(lambda: run(*given), 7) / TICKS
    return timed


def table(models: dict[str, st.PulseServo], python: float, peer: float | None) -> None:
    """Print what ticks of 1 ms cost, beside Python's of one lane and `mj_step` [s]."""
    print(f"{'a tick of 1 ms, from compiled code':36} {'us':>9} {'us a lane':>10} {'mj_step over it':>16}")

    def row(name: str, lanes: int, time: float) -> None:
        ratio = "" if peer is None else f"{peer * lanes / time:15.1f}x"
        print(f"{name:36} {1e6 * time:9.3f} {1e6 * time / lanes:10.4f} {ratio}")
    row("Python's advance, 1 lane", 1, python)
    if shutil.which("cc") is None:
        print("from C: left out, because cc is not found")
        return
    with tempfile.TemporaryDirectory() as folder:
        loop = in_c(Path(folder))
        for lanes, whose, what in ROWS:
            sims, (out, imposed) = st.VectorSimulator(models[whose], lanes), ASKED[what]
            arrays = {"pulse_width": np.full(lanes, 1.2e-3), **{signal: np.zeros(lanes) for signal in out},
                      **{member: np.full(lanes, value) for member, value in imposed.items()}}
            row(f"{lanes} {whose}: {what}", lanes, loop(sims, arrays))
