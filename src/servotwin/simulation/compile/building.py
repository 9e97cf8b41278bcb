"""Build and find the libraries of recipes: in the package, in the user's cache, by the compiler at hand.

Two keys save work. The text of the sources names the text in C that was printed from them, so that nothing is derived
again; this text, the compiler, its flags and the level of the processor name the library, so that an edited comment
compiles nothing.
"""

from __future__ import annotations

import atexit
import contextlib
import inspect
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from servotwin import physics
from servotwin.models import engine, terms
from servotwin.simulation.compile.compilers import Compiler, compilers, flags, level, levels, system
from servotwin.simulation.compile.derive import Recipe, derive
from servotwin.simulation.compile.signatures import signatures
from servotwin.simulation.compile.storage import cache_folder, key_of
from servotwin.simulation.compile.translate import Translation, translated

_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_LONGEST = 600.0  # s that a compiler may take
problems: list[str] = []  # why there is no library, as far as this process has found out
WAY_OUT = ("install a C compiler (gcc or clang) or the package ziglang (pip install 'servotwin[compile]'); "
           "SERVOTWIN_CC names another one")


@dataclass(frozen=True)
class Built:
    """A library of a recipe, and what it gives back.

    Parameters
    ----------
    path : Path
    functions : tuple of (str, str)
        Name and result (see `translate.Entry`) of the function of each entry of `signatures`, in that order.
    """

    path: Path
    functions: tuple[tuple[str, str], ...]


@cache
def sources() -> tuple[str, ...]:
    """Return the text of everything from which C is printed; to read it is quicker than to derive."""
    files = sorted(Path(__file__).parent.glob("*.[ph]*"))
    for package in (physics, terms, engine):
        files += sorted(Path(package.__path__[0]).glob("*.py"))
    return tuple(file.read_text(encoding="utf-8") for file in files)


@cache
def source_key() -> str:
    """Return a short name for all that kernels depend on, a recipe apart."""
    return key_of(*sources())


def is_ready(recipe: Recipe) -> bool:
    """Tell whether a recipe can be used without deriving or compiling it."""
    return _shipped(recipe) is not None or _known(recipe) is not None


def built(recipe: Recipe) -> Iterator[Built]:
    """Return libraries of a recipe, the one to be tried first; made, where there is none, when it is asked for.

    If one cannot be loaded, the next one is asked for: it was made for another C library, say, or is no library at all.
    """
    useless: set[Path] = set()
    for find in (_shipped, _known):
        found = find(recipe)
        if found is not None:
            yield found
            useless.add(found.path)
    if not compilers():
        named = os.environ.get("SERVOTWIN_CC")
        problems.append(f"SERVOTWIN_CC names no program ({named})" if named else "no C compiler")
        return
    for folder in _folders():
        found = _made(recipe, folder, useless)
        if found is not None:
            yield found
            return


# --- what is known ----------------------------------------------------------------------------------------------------


def index_name(recipe: Recipe) -> str:
    """Return the name of the file that says what was printed of these sources."""
    homes = {entry.split(":")[0] for entry in recipe.entries}
    others = [inspect.getsource(import_module(home)) for home in sorted(homes) if not home.startswith("servotwin.")]
    return f"{recipe.name}-{key_of(source_key(), repr(recipe), *others)}.json"


def index(translation: Translation) -> dict[str, Any]:
    """Return what this file says."""
    functions = [[entry.symbol, entry.result] for entry in translation.entries]
    return {"text": key_of(translation.text), "functions": functions}


def _read(path: Path) -> dict[str, Any] | None:
    """Return what an index says; None where it is missing, or was not written by us."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return said if isinstance(said, dict) and isinstance(said.get("text"), str) and _are_functions(
        said.get("functions")) else None


def _are_functions(said: Any) -> bool:
    return isinstance(said, list) and all(
        isinstance(one, list) and len(one) == 2 and all(isinstance(part, str) for part in one) for one in said)


def shipped_folder() -> Path:
    """Return where a wheel has its libraries."""
    return Path(__file__).with_name("shipped")


def _shipped(recipe: Recipe) -> Built | None:
    """Return the library that came with the package, for the highest level that this processor has."""
    said = _read(shipped_folder() / index_name(recipe))
    if said is None:
        return None
    for name in levels():
        path = shipped_folder() / f"{recipe.name}-{name}{_SUFFIX}"
        if path.exists():
            return Built(path, _functions(said))
    return None


def _known(recipe: Recipe) -> Built | None:
    """Return the library in the cache."""
    said = _read(cache_folder() / index_name(recipe))
    if said is None:
        return None
    for compiler in compilers():
        path = cache_folder() / _library(recipe, said["text"], compiler)
        if path.exists():
            return Built(path, _functions(said))
    left = sorted(cache_folder().glob(f"{_stem(recipe, said['text'])}-*{_SUFFIX}"))  # of a compiler that is gone
    return Built(left[0], _functions(said)) if left and not compilers() else None


def _stem(recipe: Recipe, text: str) -> str:
    return f"{recipe.name}-{key_of(text, level(), system())}"


def _library(recipe: Recipe, text: str, compiler: Compiler) -> str:
    """Return the name of the library that a compiler makes of a text, which goes by its hash."""
    own = key_of(compiler.identity, *compiler.command, *flags(recipe.vector, level()))
    return f"{_stem(recipe, text)}-{own}{_SUFFIX}"


def _functions(said: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    return tuple((name, result) for name, result in said["functions"])


# --- what is made -----------------------------------------------------------------------------------------------------


def _folders() -> Iterator[Path]:
    """Return where libraries may be written: the cache, else a folder for this process."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            yield folder
            return
        reason = "Permission denied"
    except OSError as error:
        reason = error.strerror or str(error)
    sys.stderr.write(f"servotwin: the kernels cannot be kept in {folder} ({reason}); set SERVOTWIN_CACHE_DIR to a "
                     "folder that can be written\n")
    yield _temporary()


@cache
def _temporary() -> Path:
    folder = tempfile.mkdtemp(prefix="servotwin-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _made(recipe: Recipe, folder: Path, useless: set[Path]) -> Built | None:
    """Print a recipe and compile it, also where there is a library of no use; None where no compiler does."""
    translation = printed(recipe)
    text, said = key_of(translation.text), index(translation)
    for compiler in compilers():
        path = folder / _library(recipe, text, compiler)
        try:
            with _alone(path):
                there = path.exists() and path not in useless
                problem = None if there else _compiled(recipe, translation.text, compiler, path)
            if problem is None:
                write(folder / index_name(recipe), json.dumps(said))
                return Built(path, _functions(said))
        except OSError as error:
            problem = str(error)
        problems.append(f"{' '.join(compiler.command)} cannot compile the kernels ({problem})")
    return None


def printed(recipe: Recipe) -> Translation:
    """Return a recipe in C."""
    return translated(derive(recipe), signatures(recipe))


def _compiled(recipe: Recipe, text: str, compiler: Compiler, path: Path) -> str | None:
    """Compile a text aside, and put the library in its place; return what is wrong, if anything."""
    _tell()
    with tempfile.TemporaryDirectory(prefix=".making-", dir=path.parent, ignore_cleanup_errors=True) as aside:
        source, library = Path(aside) / f"{recipe.name}.c", Path(aside) / f"made{_SUFFIX}"
        source.write_text(text, encoding="utf-8")
        said = Path(aside) / "said.txt"
        try:
            command = compiler.library_command(source, library, recipe.vector, level())
            ended = _run(command, compiler.environment(), said)
        except subprocess.TimeoutExpired:
            return f"it took more than {_LONGEST:g} s"
        if ended != 0 or not library.exists():
            all_lines = said.read_text(encoding="utf-8", errors="replace").splitlines()
            lines = [line for line in all_lines if "error" in line] or [line for line in all_lines if line.strip()]
            return lines[0].strip() if lines else f"it ended with {ended}" if ended else "it made no library"
        with contextlib.suppress(PermissionError):  # Windows: another process has made it, and loaded it already
            os.replace(library, path)
    return None


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
def _tell() -> None:
    sys.stderr.write("servotwin: compiling kernels for this machine, once\n")
    sys.stderr.flush()


def write(path: Path, text: str) -> None:
    """Write a file at once, so that nobody reads half of it."""
    handle, aside = tempfile.mkstemp(suffix=".tmp", dir=path.parent)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(aside, path)


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock, which the operating system takes away from a process that ends; without locks, go on without."""
    try:
        file = path.with_suffix(".lock").open("w")
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
