"""The harness is compiled where it runs: libsimavr is under the GPL, so nothing that is linked to it is shipped."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from importlib.resources import as_file, files
from pathlib import Path

from servotwin.errors import BenchError
from servotwin.simulation.compile.storage import is_there, kept_folder, key_of, writable_folder

_SOURCES = ("harness.c", "pipes.h", "foresight.h")
LIBRARIES = ("-lsimavr", "-lelf")
_COMPILERS = ("cc", "gcc", "clang")
_PACKAGES = "sudo apt install gcc libsimavr-dev libelf-dev"


def harness() -> Path:
    """Return the compiled harness, which is kept in the user's cache.

    Raises
    ------
    BenchError
        If there is no C compiler, or simavr is not installed.
    """
    with as_file(files("servotwin.bench.emulator")) as folder:
        texts = [(folder / name).read_text(encoding="utf-8") for name in _SOURCES]
        name = f"harness-{key_of(*texts, *LIBRARIES)}"
        kept = kept_folder() / name
        if is_there(kept):
            return kept
        own = writable_folder() / name  # another one where the cache can only be read
        return own if is_there(own) else _made(own, folder / _SOURCES[0])


def _made(path: Path, source: Path) -> Path:
    handle, aside = tempfile.mkstemp(prefix=path.name, dir=path.parent)
    os.close(handle)
    made = Path(aside)
    try:
        _compile(source, aside)
        made.chmod(0o700)  # a wide umask would let others write it
        made.replace(path)  # two processes that compile at once make the same
    finally:
        made.unlink(missing_ok=True)
    return path


def _compile(source: Path, target: str) -> None:
    compiler = next((found for found in map(shutil.which, _COMPILERS) if found), None)
    if compiler is None:
        raise BenchError("emulator", f"there is no C compiler to build it with ({_PACKAGES})")
    done = subprocess.run([compiler, "-O2", "-o", target, str(source), *LIBRARIES], capture_output=True, text=True,
                          check=False)
    if done.returncode == 0:
        return
    said = done.stderr
    if "simavr" in said or "-lelf" in said or "libelf" in said:
        raise BenchError("emulator", f"simavr is not installed ({_PACKAGES})")
    last = next((line for line in said.splitlines() if "error" in line), "no reason given")
    raise BenchError("emulator", f"{compiler} cannot build it: {last.strip()} ({_PACKAGES})")
