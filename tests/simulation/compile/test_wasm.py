"""Kernels in WebAssembly do what they do natively, bit by bit, where both have the same functions of libm."""

import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.compile import finding
from servotwin.simulation.compile.building import printed
from servotwin.simulation.compile.library import Function
from servotwin.simulation.compile.text.kinds import Array, Tuple, words_of
from servotwin.simulation.lanes import forms, whole_runs

HARNESS = Path(__file__).with_name("harness")
TARGETS = ("wasm32-wasi", "x86_64-linux-musl")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(
    find_spec("ziglang") is None or shutil.which("node") is None or sys.platform != "linux",
    reason="needs ziglang, node and Linux")]


def arrays_of(kind, argument, place=0):
    """Return the arrays of an argument, each with the place of its address in the words."""
    if isinstance(kind, Tuple):
        found = []
        for inner, each in zip(kind.elements, argument, strict=True):
            found += arrays_of(inner, each, place)
            place += words_of(inner)
        return found
    return [(place, argument)] if isinstance(kind, Array) else []


def written_down(function, arguments):
    """Return a call as `replay.c` reads it, and its arrays."""
    arrays, place = [], 0
    for kind, argument in zip(function.kinds, arguments, strict=True):
        arrays += arrays_of(kind, argument, place)
        place += words_of(kind)
    words = function.words(arguments)
    parts = [np.array([len(words), len(arrays)], np.int64).tobytes(), words.tobytes()]
    for where, array in arrays:
        parts += [np.array([where, array.nbytes], np.int64).tobytes(), array.tobytes()]
    return b"".join(parts), arrays


@pytest.fixture(scope="module")
def calls():
    """Return calls of `runs` in a run of a few servos: name, what goes in, what comes out of this process."""
    found, call = [], Function.__call__
    names = {}
    kernels = whole_runs.kernels(forms.RUNS)
    for name in ("start", "go_on"):
        for function in getattr(kernels, name).functions:
            names[function] = name

    def noting(self, arguments):
        if self not in names:
            return call(self, arguments)
        before, arrays = written_down(self, arguments)
        result = call(self, arguments)
        after = b"".join(array.tobytes() for _, array in arrays) + np.int64(result or 1).tobytes()
        found.append((names[self], before, after))
        return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Function, "__call__", noting)
        servo = st.load_servo("hitec-hs-755hb")
        st.simulate_many(st.PulseServo(servo), st.signals.step(10.0, 50.0, at=0.02, unit="deg"), duration=0.3,
                         load=st.loads.Recorded([0.0, 1.0], [0.0, 0.05]), output_step=0.01,
                         parameters={"motor.armature_resistance": [2.8, 3.2, 3.6]})
    assert {name for name, *_ in found} == {"start", "go_on"}
    return found


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """Return a program for each target and entry."""
    folder = tmp_path_factory.mktemp("programs")
    (folder / "kernels.c").write_text(printed(forms.RUNS).text)
    found = {}
    for target in TARGETS:
        for name in ("start", "go_on"):
            found[target, name] = program = folder / f"{target}-{name}"
            command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-std=c99", "-O2", "-w",
                       "-ffp-contract=off", "-fwrapv", "-fno-strict-aliasing", "-fno-sanitize=undefined",
                       f"-DKERNEL=servotwin_{name}", "-o", str(program), str(folder / "kernels.c"),
                       str(HARNESS / "replay.c"), "-lm"]
            subprocess.run(command, check=True, env=finding.Compiler((), "").environment(folder))
    return found


def replayed(program, target, before):
    runner = ("node", "--no-warnings", str(HARNESS / "run.mjs")) if target == TARGETS[0] else ()
    return subprocess.run([*runner, str(program)], input=before, check=True, capture_output=True).stdout


def test_wasm_gives_the_same_bits(calls, programs):
    moved = 0
    for name, before, after in calls:
        wasm, native = (replayed(programs[target, name], target, before) for target in TARGETS)
        assert wasm == native
        assert len(wasm) == len(after)
        moved += wasm != before[-len(wasm):]
    assert moved == len(calls)


def test_this_process_gives_them_too_but_for_its_libm(calls, programs):
    """Its functions of libm are the system's, whose last bits differ from those in wasm."""
    for name, before, after in calls:
        wasm = replayed(programs[TARGETS[0], name], TARGETS[0], before)
        ours, theirs = (np.frombuffer(each, np.float64) for each in (after, wasm))
        np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-12)
