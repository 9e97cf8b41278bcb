"""The firmware as it is shipped, in simavr."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from board_talk import run_board

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SHIPPED = ROOT / "src/servotwin/bench/firmware/servotwin-bench.hex"


@pytest.fixture(scope="session")
def shipped():
    return SHIPPED


@pytest.fixture(scope="session")
def make(tmp_path_factory):
    """Build the firmware in a folder of its own; takes definitions for the compiler, returns the hex."""
    if not (shutil.which("avr-gcc") and shutil.which("make")):
        pytest.skip("no avr-gcc or make (Debian: gcc-avr, avr-libc, make)")

    def build(defines=""):
        folder = tmp_path_factory.mktemp("firmware") / "copy"
        shutil.copytree(ROOT / "firmware", folder, ignore=shutil.ignore_patterns("build"))
        protocol = ROOT / "src/servotwin/bench/wire/protocol.toml"
        done = subprocess.run(["make", f"PROTOCOL={protocol}", f"PYTHON={sys.executable}", f"DEFINES={defines}"],
                              cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return folder / "build/servotwin-bench.hex", done.stdout

    return build


@pytest.fixture(scope="session")
def simavr(tmp_path_factory):
    """Compile the harness on libsimavr and return its path."""
    if not (shutil.which("gcc") and Path("/usr/include/simavr/sim_avr.h").exists()):
        pytest.skip("no gcc or libsimavr (Debian: gcc, libsimavr-dev, libelf-dev)")
    program = tmp_path_factory.mktemp("simavr") / "edges"
    subprocess.run(["gcc", "-O2", "-o", program, HERE / "edges.c", "-lsimavr", "-lelf"], check=True)
    return program


@pytest.fixture
def board(simavr, tmp_path):
    """Run a script on the board for some seconds; returns what it did."""
    def run(script, seconds, firmware=SHIPPED):
        return run_board([str(simavr)], firmware, script, seconds, tmp_path)

    return run


@pytest.fixture(scope="session")
def avr8js():
    """Install avr8js in the user's cache and return the command of its harness."""
    if not (shutil.which("node") and shutil.which("npm")):
        pytest.skip("no node or npm (Debian: nodejs, npm)")
    wanted = (HERE / "package.json").read_text()
    version = json.loads(wanted)["dependencies"]["avr8js"]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "servotwin-tests" / f"avr8js-{version}"
    if not (folder / "node_modules/avr8js/package.json").exists():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "package.json").write_text(wanted)
        done = subprocess.run(["npm", "install", "--no-audit", "--no-fund", "--no-package-lock"], cwd=folder,
                              capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"npm could not install avr8js {version}: {done.stderr.strip().splitlines()[-1:]}")
    return ["env", f"AVR8JS={folder}", "node", str(HERE / "edges.mjs")]
