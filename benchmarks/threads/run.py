"""Lanes one a thread: what their text costs a GPU, as its assembler sees it, a processor beside lanes, and a GPU.

`ptxas -v` reads PTX without a GPU; it is in the package nvidia-cuda-nvcc (the extra `peers`), or in CUDA's own folder.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import servotwin as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

from servotwin.errors import ServotwinError
from servotwin.simulation.compile import threads
from servotwin.simulation.compile.threads import PULSES_BY_ARCS, PULSES_BY_LEGS, LaneText
from servotwin.simulation.lanes.cuda import Gpu
from servotwin.simulation.lanes.lane_threads import ThreadedLanes, text_of

LANES, FRAME = 512, 0.02
MANY, CALLS = (1 << 16, 1 << 20), 100
ARCHITECTURE = "sm_90"
FADES = {"friction.breakaway_ratio": 1.3, "friction.stribeck_speed": 3.0}
HEAT = {"thermal.winding_capacity": 1.5, "thermal.housing_capacity": 40.0, "thermal.winding_to_housing": 6.0,
        "thermal.housing_to_ambient": 12.0, "thermal.magnet_coefficient": -1.2e-3}
CASES = {  # what it is, its servo, model and other numbers, and the most registers that its kernel gets
    "plain servo, by arcs": ("hitec-hs-755hb", st.PulseServo, {}, 128),
    "friction that fades, by legs": ("hitec-hs-755hb", st.PulseServo, FADES, 168),
    "play and load friction, by legs": ("geekservo-2kg", st.PulseServo, {}, 168),
    "digital, play: STS3215": ("feetech-sts3215-12v", st.DigitalServo, {}, 168),
    "digital: XL330-M288": ("dynamixel-xl330-m288", st.DigitalServo, {}, 168),
    "  its supply gives 0.5 A": ("dynamixel-xl330-m288", st.DigitalServo, {"supply.current_limit": 0.5}, 168),
    "  its friction fades": ("dynamixel-xl330-m288", st.DigitalServo, FADES, 168),
    "  it warms up": ("dynamixel-xl330-m288", st.DigitalServo, HEAT, 168),
    "digital, warms up, play: STS3215": ("feetech-sts3215-12v", st.DigitalServo, HEAT, 168)}


def assembler() -> str | None:
    """Return the path of ptxas."""
    found = shutil.which("ptxas")
    if found is None:
        for package in ("nvidia.cu13", "nvidia.cuda_nvcc"):
            spec = find_spec(package) if find_spec("nvidia") else None
            for folder in spec.submodule_search_locations if spec and spec.submodule_search_locations else []:
                path = Path(folder) / "bin" / "ptxas"
                found = str(path) if path.exists() and os.access(path, os.X_OK) else found
    return found


def read(ptx: str, registers: int) -> tuple[dict[str, int], float]:
    """Return registers, bytes of stack and of spills of a kernel, and the time that the assembler takes [s]."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "lanes.ptx"
        source.write_text(ptx)
        start = time.perf_counter()
        said = subprocess.run([assembler(), "-v", f"-arch={ARCHITECTURE}", f"--maxrregcount={registers}", str(source),
                               "-o", str(source.with_suffix(".cubin"))], capture_output=True, text=True, check=True)
        taken = time.perf_counter() - start
    text = said.stdout + said.stderr
    part = text[text.index("Compiling entry function 'servotwin_advance'"):]
    patterns = {"registers": r"Used (\d+) registers", "stack": r"(\d+) bytes stack",
                "stores": r"(\d+) bytes spill stores", "loads": r"(\d+) bytes spill loads"}
    return {name: int(re.search(pattern, part).group(1)) for name, pattern in patterns.items()}, taken


def on_device(title: str, own: LaneText, registers: int) -> None:
    """Print what a text costs a GPU."""
    os.environ["SERVOTWIN_CACHE_DIR"] = tempfile.mkdtemp(prefix="servotwin-threads-")
    start = time.perf_counter()
    ptx = threads.ptx(own)
    first = time.perf_counter() - start
    seen, taken = read(ptx, registers)
    print(f"{title:34} {own.real.name:8} {len(ptx) / 1e3:6.0f} kB {seen['registers']:5} of {registers:<4}"
          f"{seen['stack']:6} B {seen['stores']:5} B {seen['loads']:5} B {ptx.count('.f64'):6} {first + taken:7.1f} s")


def on_processor(title: str, model: object) -> None:
    """Print the time of lanes one a thread beside that of lanes, one thread each, and by how much they differ."""
    sims = st.VectorSimulator(model, LANES, load=st.loads.Inertia(1e-3), threads=1)
    own = ThreadedLanes(sims._numbers)
    rng = np.random.default_rng(0)
    angles = rng.uniform(0.2, 1.0, (40, LANES))
    sims.reset(command_angle=angles[0])
    own.put(np.arange(LANES), sims._store.memories())
    commands = [sims._numbers.translate.command(None, each, None, None) for each in angles]

    def lanes() -> None:
        for each in angles:
            sims.advance(FRAME, command_angle=each)

    def threaded() -> None:
        for each in commands:
            own.advance(FRAME, each, 0.0)

    lanes(), threaded()
    off = np.abs(own.column("stand.y.q") - sims["output_angle"]).max()
    before, now = best(lanes, 5), best(threaded, 5)
    frames = len(angles) * LANES
    print(f"{title:34} {sims.kernels[0]:20} {1e6 * before / frames:8.3f} us {1e6 * now / frames:8.3f} us"
          f" {now / before:6.2f} {off:9.1e}")


def on_gpu(title: str, model: object, dtype: str, lanes: int) -> None:
    """Print servo-seconds a second on a GPU, one frame a call, and of how many lanes the bits are those here."""
    sims = st.VectorSimulator(model, lanes, load=st.loads.Inertia(1e-3))
    start = time.perf_counter()
    there = ThreadedLanes(sims._numbers, dtype, "cuda")
    ready = time.perf_counter() - start
    here, every, rng = ThreadedLanes(sims._numbers, dtype), np.arange(lanes), np.random.default_rng(0)
    commands = [there.array("command").gpu.array(np.asarray(sims._numbers.translate.command(
        None, rng.uniform(0.2, 1.0, lanes), None, None), here.text.real)) for _ in range(4)]
    torque = there.array("torque").gpu.array(np.zeros(lanes, here.text.real))
    for each in (there, here):
        each.put(every, sims._store.memories())
    for command in commands:
        there.advance(FRAME, command, torque)
        here.advance(FRAME, command.read(), 0.0)
    same = (there.array("reals").read() == here.array("reals")) | np.isnan(here.array("reals"))

    def frames() -> None:
        for k in range(CALLS):
            there.advance(FRAME, commands[k // 10 % 4], torque)
        assert there.left >= 0  # waits for all of it

    taken = best(frames, 3)
    print(f"{title:34} {dtype:8} {lanes:9} {CALLS * FRAME * lanes / taken:10.2e} {1e3 * taken / CALLS:9.3f} ms"
          f" {same.all(axis=0).sum():9} {ready:7.1f} s")


def main() -> None:
    """Print the tables."""
    models = {title: (kind(st.load_servo(name).replace(more)), most)
              for title, (name, kind, more, most) in CASES.items()}
    texts = {title: {dtype: text_of(st.VectorSimulator(model, 1, load=st.loads.Inertia(1e-3))._numbers, dtype)
                     for dtype in ("float32", "float64")} for title, (model, _) in models.items()}
    print(f"A text as PTX, read by ptxas for {ARCHITECTURE}; first use with an empty cache, both compilers")
    if assembler() is None:
        print("ptxas is not here (pip install nvidia-cuda-nvcc): this table is left out")
    else:
        print(f"{'':34} {'':8} {'PTX':>9} {'registers':>13} {'stack':>8} {'stores':>7} {'loads':>7} {'.f64':>6}"
              f" {'first use':>9}")
        for title, (_, most) in models.items():
            for own in texts[title].values():
                on_device(title, own, most)
                if own.way == PULSES_BY_ARCS:
                    on_device("  lanes that arcs leave", LaneText(PULSES_BY_LEGS, own.flags, own.floats), 168)
    print(f"\nThe same text on one core, {LANES} lanes, a frame of 20 ms, beside lanes on one thread (float64)")
    print(f"{'':34} {'lanes by':20} {'lanes':>11} {'threads':>11} {'ratio':>6} {'off (rad)':>9}")
    for title, (model, _) in models.items():
        on_processor(title, model)
    print("\nOn a GPU, a call for each frame, what lanes remember read and written")
    try:
        Gpu("cuda")
    except ServotwinError as error:
        print(f"{error}: this table is left out")
        return
    print(f"{'':34} {'':8} {'lanes':>9} {'servo-s/s':>10} {'a call':>12} {'same bits':>9} {'ready':>9}")
    for title, (model, _) in models.items():
        for dtype in ("float32", "float64"):
            for lanes in MANY:
                on_gpu(title, model, dtype, lanes)


if __name__ == "__main__":
    main()
