"""Lanes on a GPU: by the driver where there is one, else by a stand-in for it whose kernels are the same text's.

The stand-in keeps "the device" in this memory, and counts what a driver would have to keep.
"""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from servotwin.errors import InputError, ServotwinError
from servotwin.simulation.compile import threads
from servotwin.simulation.lanes import cuda
from servotwin.simulation.lanes.cuda import Gpu, stream_of
from servotwin.simulation.lanes.lane_threads import ThreadedLanes
from simulation.test_lane_threads import CASES, made, on_device

SOURCE = Path(__file__).with_name("stand_in_driver.c")
FIELDS = ("version", "devices", "major", "minor", "contexts", "bytes", "launches", "registers")
needs_compilers = pytest.mark.skipif(shutil.which("cc") is None or not on_device(),
                                     reason="no C compiler, or none for PTX")
pytestmark = needs_compilers


class StandIn:
    """The stand-in's library, and what it counts, by name."""

    def __init__(self, path):
        self.library = ctypes.CDLL(str(path))
        self.library.stand_in_state.restype = ctypes.POINTER(ctypes.c_int64)
        self._state = self.library.stand_in_state()

    def __getitem__(self, name):
        return self._state[FIELDS.index(name)]

    def set(self, **values):
        for name, value in values.items():
            self._state[FIELDS.index(name)] = value


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    path = tmp_path_factory.mktemp("driver") / "libcuda.so.1"
    subprocess.run(["cc", "-std=gnu99", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o", str(path), str(SOURCE),
                    "-ldl"], check=True)
    return path


@pytest.fixture
def driver(built, monkeypatch):
    """The stand-in as a new driver of CUDA 13 with a GPU."""
    monkeypatch.setattr(cuda, "LIBRARIES", (str(built),))
    cuda._driver.cache_clear()
    found = StandIn(built)
    found.set(version=13000, devices=1, major=8, minor=0, contexts=0, launches=0)
    yield found
    assert found["contexts"] == 0  # whatever went wrong
    cuda._driver.cache_clear()


def on_gpu(driver, sims, dtype="float64"):
    """Return lanes on "cuda", whose modules are libraries of their texts, and the same lanes here."""
    here = ThreadedLanes(sims._numbers, dtype)
    for text in here._texts:
        driver.library.stand_in_library(threads.library(text)._name.encode())
    there = ThreadedLanes(sims._numbers, dtype, "cuda")
    for each in (here, there):
        each.put(np.arange(len(sims)), sims._store.memories())
    return here, there


@pytest.mark.parametrize(("case", "dtype"), [
    ("arcs", "float64"), pytest.param("legs", "float64", marks=pytest.mark.slow),
    pytest.param("goals", "float32", marks=pytest.mark.slow)])
def test_lanes_there_are_those_here(driver, case, dtype):
    sims, low, high, rng = made(case, 150)
    before, lanes = driver["bytes"], np.arange(150)
    here, there = on_gpu(driver, sims, dtype)
    assert driver["registers"] == 168
    held, launches, left = driver["bytes"], driver["launches"], 0
    for k in range(12):
        command = sims._numbers.translate.command(None, rng.uniform(low, high, 150), None, None)
        speeds, mask = rng.uniform(-25.0, 25.0, 150), rng.random(150) < 0.3
        for each in (here, there):
            each.advance((0.0137, 0.11)[k % 2], command, 0.01)
            if k % 4 == 2:
                each.impose(speed=speeds, inertia=np.full(150, 1e-3), mask=mask)
            if k % 4 == 3:
                each.begin(mask=mask)
                each.put(lanes[k:k + 40], each.memories(lanes[k:k + 40]))
        left += here.left
        assert there.left == here.left
    assert driver["launches"] - launches == (24 if case == "arcs" else 12) + 12 + 6  # told, and imposed
    assert there.look().read().tobytes() == here.look().tobytes()
    assert (left > 0) == (case == "arcs")
    for name in ("reals", "wholes", "rings", "status", "numbers", *(["arcs"] if case == "arcs" else [])):
        assert there.array(name).read().tobytes() == here.array(name).tobytes(), name
    assert there.time.tolist() == here.time.tolist()
    assert driver["bytes"] == held > before  # nothing is allocated on the way
    assert there.text.way == CASES[case][3]
    del there, each
    assert driver["bytes"] == before


class Guest:
    """An array of another library, in memory that the stand-in shares; `numpy` knows no streams."""

    def __init__(self, array, device=3):
        self.array, self.device, self.streams = array, device, []

    def __dlpack_device__(self):
        return self.device, 0

    def __dlpack__(self, *, stream=None):
        self.streams.append(stream)
        return self.array.__dlpack__()


@pytest.fixture
def shared(driver, monkeypatch):
    """The stand-in, whose arrays are called those of a processor that a GPU reads too, so that `numpy` takes them."""
    monkeypatch.setattr(cuda, "KDL_CUDA", 3)
    return driver


def test_arrays_go_to_and_fro_in_place(shared):
    sims, *_ = made("arcs", 20)
    here, there = on_gpu(shared, sims)
    command, guests = sims._store.command.copy(), (Guest(sims._store.command), Guest(np.full(20, 0.02)))
    held = shared["bytes"]
    seen = np.from_dlpack(there.column("stand.y.q"))
    there.put_on(7)
    there.advance(0.05, *guests)
    assert there.column("stand.y.q").stream == 7
    here.advance(0.05, command, 0.02)
    assert [guest.streams for guest in guests] == [[7], [7]]
    assert np.array_equal(seen, here.column("stand.y.q"))
    guests[0].array += 1e-4  # what stands there when a call is made is what counts
    here.advance(0.05, command + 1e-4, 0.02)
    there.advance(0.05, guests[0], 0.02)
    assert np.array_equal(seen, here.column("stand.y.q"))
    assert shared["bytes"] == held
    assert there.column("stand.y.q").__cuda_array_interface__["data"][0] == seen.ctypes.data
    there.column("stand.y.q").write(np.zeros(20))
    assert not seen.any()
    capsule = there.column("stand.y.q").__dlpack__(stream=3)
    del capsule  # nobody has taken it
    reals = there.array("reals").nbytes
    del there
    assert shared["bytes"] == reals  # `seen` keeps them
    del seen
    assert shared["bytes"] == 0
    assert not cuda._given


@pytest.mark.parametrize(("values", "words"), [
    (Guest(np.zeros(20, np.float32)), "^command: got 'an array of float32', allowed: one of float64$"),
    (Guest(np.zeros(20, np.uint16)), "^command: got 'an array of uint16', allowed: one of float64$"),
    (Guest(np.zeros(19)), r"^command: got 'an array of shape \(19,\)', allowed: a dense one of shape \(20,\)$"),
    (Guest(np.zeros(40)[::2]), r"^command: got 'an array of shape \(20,\), not dense', allowed: a dense one")])
def test_a_guest_that_does_not_fit_is_refused_before_anything_moves(shared, values, words):
    sims, *_ = made("arcs", 20)
    _, there = on_gpu(shared, sims)
    before = there.array("reals").read()
    with pytest.raises(InputError, match=words):
        there.advance(0.02, values, 0.0)
    assert there.array("reals").read().tobytes() == before.tobytes()


def test_a_guest_on_another_device_is_refused(shared, monkeypatch):
    sims, *_ = made("arcs", 20)
    _, there = on_gpu(shared, sims)
    monkeypatch.setattr(Guest, "__dlpack_device__", lambda self: (3, 3))
    with pytest.raises(InputError, match=r"^command: got 'an array on another device', allowed: one on cuda:0$"):
        there.advance(0.02, Guest(np.zeros(20)), 0.0)


class Stream:
    def __init__(self, **names):
        self.__dict__.update(names)

    def __cuda_stream__(self):
        return 0, 11


def test_streams_of_other_libraries_are_known():
    torch_like, cupy_like = type("S", (), {"cuda_stream": 5})(), type("S", (), {"ptr": 6})()
    assert [stream_of(one) for one in (None, 0, 3, Stream(), torch_like, cupy_like)] == [0, 0, 3, 11, 5, 6]
    for wrong in (True, 1.0, "main", object()):
        with pytest.raises(InputError, match=r"^stream: got .*, allowed: the handle of one"):
            stream_of(wrong)


@pytest.mark.parametrize(("changes", "device", "words"), [
    ({"version": 10020}, "cuda", r"got 'cuda, by a driver of CUDA 10\.2', allowed: cpu, or a driver of CUDA 11\.0"),
    ({"devices": 0}, "cuda", "got 'cuda', allowed: cpu$"),
    ({"devices": 2}, "cuda:2", "got 'cuda:2', allowed: cpu, cuda:0, cuda:1$"),
    ({"major": 7, "minor": 5}, "cuda:0", r"got 'cuda:0, of compute capability 7\.5', allowed: cpu, or .* 8\.0 or"),
    ({}, 0, "got 0, allowed: cpu, cuda or"), ({}, "gpu", "got 'gpu', allowed: cpu, cuda or cuda: and a number$"),
    ({}, "cuda:", "got 'cuda:', allowed: cpu, cuda or"), ({}, "cuda:-1", "got 'cuda:-1', allowed: cpu, cuda or")])
def test_devices_that_do_not_do_are_refused_in_a_line(driver, changes, device, words):
    driver.set(**changes)
    with pytest.raises(InputError, match=f"^device: {words}"):
        Gpu(device)


def test_without_a_driver_or_with_another_library_of_that_name(monkeypatch, tmp_path):
    cuda._driver.cache_clear()
    monkeypatch.setattr(cuda, "LIBRARIES", (str(tmp_path / "libcuda.so.1"),))
    with pytest.raises(InputError, match=r"^device: got 'cuda, without a driver of NVIDIA on this computer', allowed"):
        Gpu("cuda")
    (tmp_path / "other.c").write_text("int cuInit(unsigned flags) { return (int)flags; }\n")
    assert compiled_alone(tmp_path / "other.c", tmp_path / "libcuda.so.1") == 0
    with pytest.raises(InputError, match=r"^device: got 'cuda, by a driver without cuDriverGetVersion', allowed: cpu"):
        Gpu("cuda")
    cuda._driver.cache_clear()


def compiled_alone(source, library):
    return subprocess.run(["cc", "-shared", "-fPIC", "-o", str(library), str(source)], check=False).returncode


def test_what_the_driver_does_not_do_is_said_in_a_line(driver):
    gpu = Gpu("cuda")
    with pytest.raises(ServotwinError, match=r"^cuda: cuModuleLoadDataEx: .* invalid ptxas fatal: no PTX of 7\.0$"):
        gpu.kernels(".version 9.9", ["servotwin_advance"], 128)
    array = gpu.array(np.zeros(3))
    array.stream = -1
    with pytest.raises(ServotwinError, match=r"^cuda: cuStreamSynchronize: invalid argument$"):
        array.read()


def real_gpu():
    """Return whether a driver and a GPU are here that run the kernels."""
    cuda._driver.cache_clear()
    try:
        Gpu("cuda")
    except ServotwinError:
        return False
    return True


@pytest.mark.skipif(not real_gpu(), reason="no GPU")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", [case for case in CASES if case != "pulses"])
def test_a_gpu_has_the_same_bits(case, dtype):
    cuda._driver.cache_clear()
    sims, low, high, rng = made(case, 300)
    here, there = (ThreadedLanes(sims._numbers, dtype, device) for device in ("cpu", "cuda"))
    for each in (here, there):
        each.put(np.arange(300), sims._store.memories())
    for _ in range(50):
        command = sims._numbers.translate.command(None, rng.uniform(low, high, 300), None, None)
        for each in (here, there):
            each.advance(0.02, command, 0.01)
    for name in ("reals", "wholes", "rings", "status"):
        assert there.array(name).read().tobytes() == here.array(name).tobytes(), name
