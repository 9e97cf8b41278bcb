"""All recipes: their text is plain C99, no compiler complains of it, and what compilers check finds nothing in it."""

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from servotwin.simulation.compile.building import printed
from servotwin.simulation.compile.c_types import identifier
from servotwin.simulation.compile.text.translate import header
from servotwin.simulation.recipes import all_recipes

RECIPES = {recipe.name: recipe for recipe in all_recipes()}
STRICT = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fopenmp-simd", "-ffp-contract=off", "-c")
ROOT = Path(__file__).parents[3]
HARNESS = Path(__file__).with_name("harness")
COMPILERS = {"gcc": ("gcc",), "clang of zig": (sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=undefined")}


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", RECIPES)
def test_no_compiler_complains(name, compiler, tmp_path):
    if (shutil.which("gcc") if compiler == "gcc" else find_spec("ziglang")) is None:
        pytest.skip(f"no {compiler}")
    text = printed(RECIPES[name]).text
    (tmp_path / "kernels.c").write_text(text)
    caches = {f"ZIG_{kind}_CACHE_DIR": str(tmp_path / "zig") for kind in ("LOCAL", "GLOBAL")}
    done = subprocess.run([*COMPILERS[compiler], *STRICT, "-o", str(tmp_path / "kernels.o"),
        str(tmp_path / "kernels.c")],
                          check=False, capture_output=True, text=True, env=caches | os.environ)
    assert done.returncode == 0, done.stderr
    assert not done.stderr


@pytest.mark.long(but="ending")
@pytest.mark.parametrize("name", ["runs", "side_by_side_float32", "ending", "drivers"])
def test_what_compilers_add_to_c99_stands_in_the_header_alone(name):
    text = printed(RECIPES[name]).text
    before, own = text.split(header())
    assert "\n" not in before.strip()
    assert not re.search(r"__attribute|__builtin|\b__\w+__\b|\basm\b|\btypeof\b|^\s*#|\(\{", own, re.MULTILINE)


def test_no_variable_has_a_name_of_the_header():
    """Functions, macros and types there keep their names, whatever a kernel calls its variables."""
    names = set(re.findall(r"^#define (\w+)", header(), re.MULTILINE))
    names |= set(re.findall(r"^(?:SMALL|INLINED) \w+ (\w+)\(", header(), re.MULTILINE))
    names |= set(re.findall(r"\} (\w+);$", header(), re.MULTILINE)) | set(re.findall(r"\b(told_\d)\(", header()))
    assert len(names) > 40
    assert not [name for name in names if identifier(name) == name]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None or not sys.platform.startswith("linux"), reason="needs gcc on Linux")
def test_checks_of_memory_and_arithmetic_find_nothing(tmp_path):
    """What was recorded of all recipes, with kernels that end the process at the first fault."""
    done = sanitized("-q", str(ROOT / "tests/simulation/test_recorded_numbers.py"), "-k", "recorded", folder=tmp_path)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert " passed" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None or not sys.platform.startswith("linux"), reason="needs gcc on Linux")
@pytest.mark.parametrize(("body", "fault"), [
    ("return x[n]", "AddressSanitizer"), ("x[n] = 1.0\n    return x[0]", "AddressSanitizer")])
def test_such_checks_find_what_is_wrong(body, fault, tmp_path):
    script = tmp_path / "test_wrong.py"
    script.write_text(
        "import sys\nimport numpy as np\n"
        f"sys.path.insert(0, {str(ROOT / 'tests')!r})\n"
        "from simulation.compile.by_hand import Both\n"
        "from pathlib import Path\n"
        f"both = Both({f'def f(x: floats, n: int):{chr(10)}    {body}'!r}, Path({str(tmp_path)!r}))\n"
        "both.compiled('f', np.zeros(4), 5)\n")
    done = subprocess.run([sys.executable, str(script)], check=False, capture_output=True, text=True,
                          env=checking(tmp_path))
    assert done.returncode != 0
    assert fault in done.stderr


def checking(folder):
    """Return the environment in which kernels are checked."""
    library = subprocess.run(["gcc", "-print-file-name=libasan.so"], check=True, capture_output=True, text=True)
    return os.environ | {"SERVOTWIN_CC": str(HARNESS / "sanitizing-cc"), "SERVOTWIN_CACHE_DIR": str(folder),
                         "LD_PRELOAD": library.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0",
                         "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def sanitized(*arguments, folder):
    """Run tests with kernels that are checked, as `dev.py sanitize` does."""
    return subprocess.run([sys.executable, "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", *arguments],
        check=False,
                          capture_output=True, text=True, cwd=ROOT, env=checking(folder))
