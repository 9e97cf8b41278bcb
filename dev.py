#!/usr/bin/env python3
"""Everything that a developer does, from a fresh clone on: `python3 dev.py TASK`.

It needs nothing but Python 3.11 or newer: it makes a virtual environment in .venv, installs the package with pinned
versions, and runs the task in it.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
BIN = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
STAMP = ENVIRONMENT / "installed"

TASKS = {
    "setup": "make .venv and install servotwin with all tools",
    "paper": "set up what it needs, then write the report of the paper to paper-report/ (main job)",
    "kernels": "set up, then compile the kernels that are named, or all, before somebody waits for them",
    "test": "set up, then run the quick tests (4 minutes, two more in a fresh clone); --long: the longer ones as well",
    "validation": "set up, then run the slow tests: validation and coverage, browser; --long: all that test leaves out",
    "explore": "set up, then run the random tests from another seed on, which is printed or given",
    "mutate": "set up, then plant so many bugs, one at a time, and note in tests/mutants.json which tests see them",
    "sanitize": "set up, then run kernels with what gcc checks of memory and arithmetic (or the tests that are named)",
    "check": "set up, then lint, types, import rules",
    "examples": "set up, then run every script of examples/",
    "docs": "set up, then build the documentation to docs/_build/",
    "bench": "set up, then print the benchmark tables",
    "page": "set up, then write the bench as one file to page/index.html (or the folder that is named)",
    "wheel": "set up, then make the wheel for this machine in dist/, and try it where nothing compiles; --all: for all",
}


def run(*command: str) -> None:
    """Run a program of the environment in the repository's root; stop here if it fails."""
    program, *arguments = command
    done = subprocess.run([str(BIN / program), *arguments], cwd=ROOT, check=False)
    if done.returncode != 0:
        sys.exit(done.returncode)


def setup(extra: str = "dev") -> None:
    """Make the environment and install an extra of the package, unless that was done for these very requirements.

    Byte code is written when a module is first imported: of most that is installed no test imports anything.
    """
    wanted = hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in ("pyproject.toml", "constraints.txt")))
    wanted.update(f"{sys.version_info[:2]} {ROOT}".encode())
    stamps = [f"{wanted.hexdigest()} {name}" for name in dict.fromkeys((extra, "dev"))]  # the latter has all
    if STAMP.exists() and STAMP.read_text() in stamps:
        return
    print("Setting up .venv (about a minute, once) ...", flush=True)
    if not (BIN / ("python.exe" if os.name == "nt" else "python")).exists():
        try:
            venv.create(ENVIRONMENT, with_pip=True)
        except (subprocess.CalledProcessError, OSError, ImportError):
            sys.exit("dev.py: this Python cannot make virtual environments (on Debian: apt install python3-venv)")
    install(extra)
    if not any(map(shutil.which, ("clang", "gcc", "cc"))):
        install("compile")
    STAMP.write_text(stamps[0])


def install(extra: str) -> None:
    """Install the package with one of its extras, in pinned versions."""
    run("python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile",
        "--constraint", "constraints.txt", "--editable", f".[{extra}]")


def kernels(arguments: list[str]) -> None:
    """Compile kernels, two at a time, largest first."""
    run("python", "tests/kernels.py", *arguments)


def pytest(arguments: list[str], marks: str, budgets: str) -> None:
    """Run tests on two processes: those with marks, or what is named by a path, `-k` or `-m`."""
    command = ["python", "-m", "pytest", "-n", "2", "--dist", "worksteal"]
    named = [ROOT / a.split("::")[0] for a in arguments]
    if {"-k", "-m"} & {*arguments} or any(path.exists() and path.is_relative_to(ROOT) for path in named):
        run(*command, *arguments)
    else:
        kernels(["--for", budgets])
        run(*command, "-m", marks, "--budgets", budgets, *arguments)


def test(arguments: list[str]) -> None:
    """Run the quick tests, with `--long` those that are longer too."""
    rest = [a for a in arguments if a != "--long"]
    pytest(rest, *(("not slow", "long") if "--long" in arguments else ("not slow and not long", "quick")))


def validation(arguments: list[str]) -> None:
    """Run the slow tests, with `--long` those that `test` without that leaves out, too."""
    rest = [a for a in arguments if a != "--long"]
    pytest(rest, *(("slow or long", "rest") if "--long" in arguments else ("slow", "slow")))


def explore(arguments: list[str]) -> None:
    """Run the tests that draw at random from another seed on; one that fails is to become a fixed one."""
    seed, *rest = arguments or [str(time.time_ns() % 1_000_000)]
    if not seed.isdecimal():
        sys.exit(f"dev.py: got {seed}, allowed: explore [SEED], a whole number")
    print(f"seed {seed}", flush=True)
    run("python", "-m", "pytest", "-n", "2", "--dist", "worksteal", "-m", "", "--seed", seed, *rest)


def mutate(arguments: list[str]) -> None:
    """Plant bugs, and note which tests see them."""
    run("python", "tests/mutate.py", *arguments)


def sanitize(arguments: list[str]) -> None:
    """Run tests with kernels that end the process where they read or write what is not theirs, or overflow (gcc)."""
    found = subprocess.run(["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    os.environ |= {
        "SERVOTWIN_CC": str(ROOT / "tests/simulation/compile/harness/sanitizing-cc"),
        "SERVOTWIN_CACHE_DIR": os.environ.get("SERVOTWIN_CACHE_DIR", str(ROOT / ".venv" / "sanitized")),
        "LD_PRELOAD": found.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0"}
    run("python", "-m", "pytest", "-n", "0", *(arguments or ["tests/simulation/test_recorded_numbers.py"]))


def check(arguments: list[str]) -> None:
    """Lint, types and import rules."""
    run("ruff", "check", "--no-cache", ".")  # a cached verdict does not see that a new folder changed what is ours
    run("mypy")
    run("lint-imports")


def examples(arguments: list[str]) -> None:
    """Run every example, pictures and files into a folder of their own."""
    out = ROOT / "examples" / "out"
    out.mkdir(exist_ok=True)
    for script in sorted((ROOT / "examples").glob("*.py")):
        print(f"-- {script.name}", flush=True)
        done = subprocess.run([str(BIN / "python"), str(script)], cwd=out, check=False)
        if done.returncode != 0:
            sys.exit(done.returncode)


def page(arguments: list[str]) -> None:
    """Write the bench as one file into a folder."""
    folder = Path(arguments[0]) if arguments else ROOT / "page"
    folder.mkdir(parents=True, exist_ok=True)
    run("servotwin", "web", "--export", str(folder / "index.html"), "--force")


def wheel(arguments: list[str]) -> None:
    """Make the wheel for this machine and try it; with `--all` make those for all machines, and try none."""
    install("wheels,compile")
    shutil.rmtree(ROOT / "dist", ignore_errors=True)
    run("python", "tools/wheels/make.py", *arguments)
    if "--all" not in arguments:
        run("python", "tools/wheels/try_wheel.py", *map(str, (ROOT / "dist").glob("*.whl")))


def main(arguments: list[str]) -> None:
    """Set up, then do one task."""
    if tuple(map(int, sys.version.split(".")[:2])) < (3, 11):  # said in one line, not by pip
        sys.exit(f"dev.py: servotwin needs Python 3.11 or newer, this is {sys.version.split()[0]}")
    task = arguments[0] if arguments else ""
    if task not in TASKS:
        print("usage: python3 dev.py TASK\n\n" + "\n".join(f"  {name:11} {what}" for name, what in TASKS.items()))
        sys.exit(0 if task in ("-h", "--help") else 2)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else each process compiles some hundred modules anew
    setup("robots" if task == "paper" else "dev")
    rest = arguments[1:]
    if task == "paper":
        run("servotwin", "paper", *(rest or ["--out", "paper-report", "--force"]))
    elif task == "docs":
        run("python", "-m", "sphinx", "-W", "-q", "-b", "html", "docs", "docs/_build/html", *rest)
        print("docs/_build/html/index.html")
    elif task == "bench":
        install("peers,compile")  # clang of one version, which the numbers are said for
        for script in sorted((ROOT / "benchmarks").glob("*/run.py")):
            run("python", str(script), *rest)
    elif task != "setup":
        {"kernels": kernels, "test": test, "validation": validation, "explore": explore, "mutate": mutate,
         "sanitize": sanitize, "check": check, "examples": examples, "page": page, "wheel": wheel}[task](rest)


if __name__ == "__main__":
    main(sys.argv[1:])
