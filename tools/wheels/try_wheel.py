"""Try a wheel where there is no compiler: `try_wheel.py WHEEL`.

It is installed into an environment of its own, which has the packages of this one but those that compile, and programs
of its own alone in PATH. What it does there is tried for each level of processors that this machine can run; the cache
of compiled kernels has to stay empty.
"""

import os
import subprocess
import sys
import sysconfig
import tempfile
import venv
from pathlib import Path

from servotwin.simulation.compile.finding import levels

ROOT = Path(__file__).resolve().parents[2]
COMPILING = ("ziglang", "numba", "llvmlite")
CHECKS = ("tools/wheels/checks.py", "tests/simulation/test_kernels.py")
MOST_FILLED = 0.030  # s, as in benchmarks/compile


class Environment:
    """An environment in a folder, with all packages of this one but those that compile, and servotwin."""

    def __init__(self, folder: Path) -> None:
        self.cache, self.work = folder / "cache", folder / "work"
        for each in (self.cache, self.work):
            each.mkdir()
        venv.create(folder / "venv", with_pip=True)
        self._bin = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
        own = {"base": str(folder / "venv"), "platbase": str(folder / "venv")}
        self.packages = Path(sysconfig.get_path("purelib", vars=own))
        links = folder / "links"
        links.mkdir()
        for entry in Path(sysconfig.get_path("purelib")).iterdir():
            name = entry.name.lower()
            if not name.startswith((*COMPILING, "servotwin", "__editable__", "pip", "__pycache__")):
                (links / entry.name).symlink_to(entry)
        (self.packages / "of_developers.pth").write_text(str(links), encoding="utf-8")

    def run(self, *arguments: str, cwd: Path | None = None) -> None:
        """Run Python with its own programs alone; stop here if it fails."""
        kept = {name: value for name, value in os.environ.items()
                if name not in ("PYTHONPATH", "SERVOTWIN_CC", "SERVOTWIN_BACKEND", "CC")}
        done = subprocess.run([str(self._bin / "python"), *arguments], check=False, cwd=cwd or self.work, env=kept | {
            "PATH": str(self._bin), "SERVOTWIN_CACHE_DIR": str(self.cache), "PYTHONDONTWRITEBYTECODE": "1"})
        if done.returncode != 0:
            sys.exit(f"try_wheel.py: {' '.join(arguments)} failed")

    def check(self) -> None:
        """Run the checks, and see that nothing was compiled."""
        self.run("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *CHECKS, cwd=ROOT)
        self.see_that_nothing_was_compiled()

    def see_that_nothing_was_compiled(self) -> None:
        """Stop here if the cache holds anything."""
        left = sorted(path.name for path in self.cache.iterdir())
        if left:
            sys.exit(f"try_wheel.py: in the cache of compiled kernels there is {', '.join(left)}")


def main() -> None:
    """Install a wheel and try it."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    wheel = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(prefix="servotwin-try-") as name:
        clean = Environment(Path(name))
        clean.run("-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-deps", "--no-index", str(wheel))
        shipped = clean.packages / "servotwin" / "simulation" / "compile" / "shipped"
        clean.run("-m", "servotwin", "paper", "--out", "paper-report")
        for level in levels():
            print(f"-- {level}", flush=True)
            clean.check()
            print("first call of a process, and without its second [s of CPU]:", flush=True)
            clean.run(str(ROOT / "benchmarks" / "compile" / "measure.py"), "first", "all together")
            print(f"  the bar: without its second {MOST_FILLED:.3f}", flush=True)
            for library in shipped.glob(f"*-{level}.*"):
                library.unlink()  # so the next round takes those of the level below
    print(f"{wheel.name} does all of this without a compiler")


if __name__ == "__main__":
    main()
