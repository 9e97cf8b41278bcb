"""Build the library of a recipe, by the compiler at hand, into the user's cache."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import IO, Any

from servotwin.simulation.compile.finding import (
    SUFFIX,
    Built,
    Compiler,
    compilers,
    functions_of,
    index_name,
    level,
    library_name,
    problems,
)
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.signatures import signatures
from servotwin.simulation.compile.storage import is_there, key_of, writable_folder, write
from servotwin.simulation.compile.text.derive import derive
from servotwin.simulation.compile.text.translate import Translation, translated

_LONGEST = 600.0  # s that a compiler may take


def made(recipe: Recipe, useless: set[Path]) -> Iterator[Built]:
    """Make the library of a recipe, also where there is one of no use; return nothing where no compiler does."""
    if not compilers():
        named = os.environ.get("SERVOTWIN_CC")
        problems.append(f"SERVOTWIN_CC names no program ({named})" if named else "no C compiler")
        return
    found = _made(recipe, writable_folder(), useless)
    if found is not None:
        yield found


def index(translation: Translation) -> dict[str, Any]:
    """Return what this file says."""
    functions = [[entry.symbol, entry.result] for entry in translation.entries]
    return {"text": key_of(translation.text), "functions": functions}


def _made(recipe: Recipe, folder: Path, useless: set[Path]) -> Built | None:
    """Print a recipe and compile it, also where there is a library of no use; None where no compiler does."""
    translation = printed(recipe)
    text, said = key_of(translation.text), index(translation)
    for compiler in compilers():
        path = folder / library_name(recipe, text, compiler)
        try:
            with alone(path):
                there = path not in useless and is_there(path)
                problem = None if there else compiled(recipe, translation.text, compiler, path)
            if problem is None:
                write(folder / index_name(recipe), json.dumps(said))
                return Built(path, functions_of(said))
        except OSError as error:
            problem = str(error)
        problems.append(f"{' '.join(compiler.command)} cannot compile the kernels ({problem})")
    return None


def printed(recipe: Recipe) -> Translation:
    """Return a recipe in C."""
    return translated(derive(recipe), signatures(recipe))


def compiled(recipe: Recipe, text: str, compiler: Compiler, path: Path) -> str | None:
    """Compile a text aside, and put the library in its place; return what is wrong, if anything."""
    tell()
    with tempfile.TemporaryDirectory(prefix=".making-", dir=path.parent, ignore_cleanup_errors=True) as aside:
        source, library = Path(aside) / f"{recipe.name}.c", Path(aside) / f"made{SUFFIX}"
        source.write_text(text, encoding="utf-8")
        command = compiler.library_command(source, library, recipe.vector, level())
        problem = ran(command, compiler.environment(path.parent), Path(aside) / "said.txt", library)
        if problem is not None:
            return problem
        library.chmod(0o700)  # a wide umask would let others write it
        with contextlib.suppress(PermissionError):  # Windows: another process has made it, and loaded it already
            os.replace(library, path)
    return None


def ran(command: list[str], environment: dict[str, str], said: Path, made: Path) -> str | None:
    """Run a compiler that makes a file; return what is wrong, if anything."""
    try:
        ended = _run(command, environment, said)
    except subprocess.TimeoutExpired:
        return f"it took more than {_LONGEST:g} s"
    if ended == 0 and made.exists():
        return None
    all_lines = said.read_text(encoding="utf-8", errors="replace").splitlines()
    lines = [line for line in all_lines if "error" in line] or [line for line in all_lines if line.strip()]
    return lines[0].strip() if lines else f"it ended with {ended}" if ended else "it made no file"


def _run(command: list[str], environment: dict[str, str], said: Path) -> int:
    """Run a compiler in the folder of what it says; those that it has started end with it, by force if need be.

    A pipe would be waited for as long as one of them holds it.
    """
    with said.open("w") as file, subprocess.Popen(command, cwd=said.parent, env=environment, stdin=subprocess.DEVNULL,
                                                  stdout=file, stderr=file, start_new_session=True) as process:
        try:
            return process.wait(_LONGEST)
        except BaseException:
            with contextlib.suppress(OSError):
                if sys.platform == "win32":
                    process.kill()
                else:
                    os.killpg(process.pid, signal.SIGKILL)
            raise


@cache
def tell() -> None:
    """Say, once, that something is compiled."""
    sys.stderr.write("servotwin: compiling kernels for this machine, once\n")
    sys.stderr.flush()


@contextlib.contextmanager
def alone(path: Path) -> Iterator[None]:
    """Hold a lock, which the operating system takes away from a process that ends; without locks, continue without."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
    try:
        file = os.fdopen(os.open(path.with_suffix(".lock"), flags, 0o600), "r+")
    except OSError:
        yield
        return
    with file:
        with contextlib.suppress(OSError):
            _lock(file)
        yield


def _lock(file: IO[str]) -> None:
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX)
