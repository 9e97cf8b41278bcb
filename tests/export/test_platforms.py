"""An exported servo has the same digits on all platforms, and what is no number traps on none."""

import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

from export.c_servo import STRICT
from export.structures import STRUCTURES, model_of
from servotwin import export

HERE = Path(__file__).parent
RUN = HERE.parent / "simulation" / "compile" / "harness" / "run.mjs"
PROGRAM = HERE / "harness" / "digits.c"
CHECKED = ("-O1", "-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
BOARD = ("-mcpu=cortex-m4", "-mthumb", "--specs=rdimon.specs", "-nostartfiles",
         "-T", str(HERE / "harness" / "cortex_m4.ld"), str(HERE / "harness" / "cortex_m4.c"))
EMULATED = ("qemu-system-arm", "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none",
            "-semihosting-config", "enable=on,target=native", "-kernel")
PLATFORMS = {  # what compiles, and what runs it
    "clang": (("clang", *STRICT, "-O2"), ()),
    "gcc, with fused products and sums": (("gcc", "-std=gnu99", "-O3", "-march=native"), ()),
    "clang, with fused products and sums": (("clang", "-std=gnu99", "-O3", "-march=native"), ()),
    "with all checks of memory and arithmetic": (("gcc", *STRICT, *CHECKED), ()),
    "arm64": (("aarch64-linux-gnu-gcc", "-std=gnu99", "-O2", "-static"), ("qemu-aarch64",)),
    "wasm": (("clang", "--target=wasm32-wasi", "-std=c99", "-O2"), ("node", "--no-warnings", str(RUN))),
    "a Cortex-M4": (("arm-none-eabi-gcc", *BOARD, "-std=gnu99", "-O2"), EMULATED),
}
SOME = ("plain", "worn", "backlash", "flexible", "warm", "everything", "bounded", "averaged", "on a bus",
        "digital, worn")  # what all others have is in one of them
IN_FLOATS = ("worn", "on a bus")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")]


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Return a function that returns the folder of a structure as C, and what its program tells as gcc compiles it."""

    @cache
    def of(name, dtype="float64"):
        folder = tmp_path_factory.mktemp("platforms")
        export.c(model_of(name, 0), STRUCTURES[name].load, name="servo", dtype=dtype).write(folder)
        return folder, lines_of(folder, ("gcc", *STRICT, "-O2"), ())

    return of


def lines_of(folder, compiler, runner):
    """Return what the program tells."""
    program = folder / "program"
    texts = str(folder / "servo.c"), str(PROGRAM)
    subprocess.run([*compiler, "-o", str(program), *texts, "-I", str(folder), "-lm"], check=True)
    return subprocess.run([*runner, str(program)], capture_output=True, text=True, check=True).stdout.splitlines()


def compiles(compiler, folder):
    """Tell whether a compiler makes a program at all."""
    if shutil.which(compiler[0]) is None:
        return False
    (folder / "none.c").write_text("#include <math.h>\n#include <stdio.h>\nint main(void) { return puts(\"\") < 0; }\n")
    return subprocess.run([*compiler, "-o", str(folder / "none"), str(folder / "none.c"), "-lm"], capture_output=True,
                          check=False).returncode == 0


@pytest.mark.parametrize("platform", PLATFORMS)
def test_all_digits_are_the_same(platform, told, tmp_path):
    compiler, runner = PLATFORMS[platform]
    if not compiles(compiler, tmp_path) or (runner and shutil.which(runner[0]) is None):
        pytest.skip(f"needs {compiler[0]}{' with ' + runner[0] if runner else ''}, for {platform}")
    for name, dtype in [(name, "float64") for name in SOME] + [(name, "float32") for name in IN_FLOATS]:
        folder, expected = told(name, dtype)
        assert len(expected) == 400
        assert lines_of(folder, compiler, runner) == expected, (name, dtype)
