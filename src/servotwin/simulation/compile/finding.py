"""Find the libraries of recipes, in the package or in the user's cache, and the compiler that makes others.

Two keys save work. The text of the sources names the text in C that was printed from them, so that nothing is derived
again; this text, the compiler, its flags and the level of the processor name the library, so that an edited comment
compiles nothing.
"""

from __future__ import annotations

import inspect
import json
import os
import platform
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from servotwin import physics
from servotwin.models import engine, state, terms
from servotwin.simulation.compile.recipe import Recipe
from servotwin.simulation.compile.storage import distrust, is_there, kept_folder, key_of, temporary_folder

# --- The compiler of C at hand, and how it is asked for a library -----------------------------------------------------

_GENERAL = ("-std=c99", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math",
            "-fwrapv", "-fno-strict-aliasing", "-fopenmp-simd", "-w")
_X86 = {  # what the levels of the x86-64 psABI have beyond the lower ones; gcc has their names from version 11 on
    "x86-64-v2": ("-mcx16", "-msahf", "-mpopcnt", "-msse3", "-mssse3", "-msse4.1", "-msse4.2"),
    "x86-64-v3": ("-mavx", "-mavx2", "-mbmi", "-mbmi2", "-mf16c", "-mfma", "-mlzcnt", "-mmovbe"),
    "x86-64-v4": ("-mavx512f", "-mavx512bw", "-mavx512cd", "-mavx512dq", "-mavx512vl"),
}
_NEEDS = {"x86-64-v3": ("AVX2", "FMA3", "F16C"), "x86-64-v4": ("AVX512_SKX",)}  # numpy's names for them


@dataclass(frozen=True)
class Compiler:
    """A compiler of C.

    Parameters
    ----------
    command : tuple of str
        That calls it.
    identity : str
        Changes when it does.
    """

    command: tuple[str, ...]
    identity: str

    def environment(self, folder: Path) -> dict[str, str]:
        """Return the environment variables that it gets: zig keeps what it makes in a folder, beside our libraries."""
        kept = folder / "zig"
        kept = kept if distrust(kept) is None else temporary_folder()
        own = {f"ZIG_{kind}_CACHE_DIR": str(kept) for kind in ("LOCAL", "GLOBAL")}
        return own | os.environ

    def library_command(self, source: Path, library: Path, vector: bool, level: str) -> list[str]:
        """Return the command that makes a library of a text in C."""
        return [*self.command, *flags(vector, level), "-o", str(library), str(source), "-lm"]


def flags(vector: bool, level: str) -> tuple[str, ...]:
    """Return how a text is compiled for a level of processors."""
    own: tuple[str, ...] = ()
    if level in _X86:
        names = [name for name in _X86 if vector or name != "x86-64-v4"]  # alone, its wide registers cost a tenth
        level = level if level in names else names[-1]
        own = tuple(flag for name in names[:names.index(level) + 1] for flag in _X86[name])
    position = () if sys.platform == "win32" else ("-fPIC",)
    return ("-O3" if vector else "-O2", *_GENERAL, *position, *own)


@cache
def compilers() -> tuple[Compiler, ...]:
    """Return the compilers at hand, the one to be taken first.

    These are `SERVOTWIN_CC`, clang, zig (the package ziglang), gcc and cc. Another folder in PATH, or another
    `SERVOTWIN_CC`, counts in the next process.
    """
    named = os.environ.get("SERVOTWIN_CC")
    if named:
        return tuple(filter(None, [_program(named)]))
    return tuple(filter(None, [_program("clang"), _zig(), _program("gcc"), _program("cc")]))


def _program(name: str) -> Compiler | None:
    path = shutil.which(name)
    if path is None:
        return None
    real = Path(path).resolve()
    about = real.stat()
    return Compiler((path,), f"{real} {about.st_size} {about.st_mtime_ns}")


def _zig() -> Compiler | None:
    """Return the compiler of the package ziglang, which brings clang along."""
    if find_spec("ziglang") is None:
        return None
    from importlib.metadata import PackageNotFoundError, version  # which takes as long as all else

    try:
        own = version("ziglang")
    except PackageNotFoundError:
        return None
    return Compiler((sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=undefined", "-Wl,-s"), f"zig {own}")


@cache
def level() -> str:
    """Return the highest level of processors that libraries are made for and this one has."""
    machine = platform.machine().lower()
    if machine not in ("x86_64", "amd64"):
        return {"aarch64": "arm64"}.get(machine, machine)
    has = features()
    found = "x86-64-v2"
    for name, needed in _NEEDS.items():
        if not all(has.get(each, False) for each in needed):
            break
        found = name
    return found


def levels() -> tuple[str, ...]:
    """Return the levels of libraries that this processor runs, the highest first."""
    names = tuple(_X86)
    return names[names.index(level())::-1] if level() in names else (level(),)


def features() -> dict[str, bool]:
    """Return what numpy says of the processor."""
    own: dict[str, bool] = np._core._multiarray_umath.__cpu_features__  # type: ignore[attr-defined]
    return own


@cache
def system() -> str:
    """Return a short name of the operating system and its C library."""
    if sys.platform != "linux":
        return {"win32": "windows", "darwin": "macos"}.get(sys.platform, sys.platform)
    return "linux" if platform.libc_ver()[0] == "glibc" else "linux-musl"


# --- Find the libraries of recipes: in the package, or in the user's cache --------------------------------------------

problems: list[str] = []  # why there is no library, as far as this process has found out
WAY_OUT = ("install a C compiler (gcc or clang) or the package ziglang (pip install 'servotwin[compile]'); "
           "SERVOTWIN_CC names another one")
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


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
    here = Path(__file__).parent
    files = sorted([*here.glob("*.py"), *here.joinpath("text").glob("*.[ph]*")])
    for package in (physics, state, terms, engine):
        files += sorted(Path(package.__path__[0]).rglob("*.py"))
    return tuple(file.read_text(encoding="utf-8") for file in files)


@cache
def source_key() -> str:
    """Return a short name for all that kernels depend on, a recipe apart."""
    return key_of(*sources())


def is_ready(recipe: Recipe) -> bool:
    """Tell whether a recipe can be used without deriving or compiling it."""
    return bool(_shipped(recipe) or _known(recipe))


def built(recipe: Recipe) -> Iterator[Built]:
    """Return libraries of a recipe, the one to be tried first; made, where there is none, when it is asked for.

    If one cannot be loaded, the next one is asked for: it was made for another C library, say, or is no library at all.
    """
    useless: set[Path] = set()
    for found in (*_shipped(recipe), *_known(recipe)):
        yield found
        useless.add(found.path)
    from servotwin.simulation.compile.building import made  # what is there already needs nothing of that

    yield from made(recipe, useless)


def index_name(recipe: Recipe) -> str:
    """Return the name of the file that says what was printed of these sources."""
    homes = {entry.split(":")[0] for entry in recipe.entries}
    others = [inspect.getsource(import_module(home)) for home in sorted(homes) if not home.startswith("servotwin.")]
    return f"{recipe.name}-{key_of(source_key(), repr(recipe), *others)}.json"


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


def _shipped(recipe: Recipe) -> list[Built]:
    """Return the libraries that came with the package, that for the highest level of this processor first."""
    said = _read(shipped_folder() / index_name(recipe))
    paths = (shipped_folder() / f"{recipe.name}-{name}{SUFFIX}" for name in levels()) if said is not None else ()
    return [Built(path, functions_of(said)) for path in paths if said is not None and path.exists()]


def _known(recipe: Recipe) -> list[Built]:
    """Return the library in the cache; that of a compiler that is gone only where there is none at all."""
    folder = kept_folder()
    index = folder / index_name(recipe)
    said = _read(index) if is_there(index) else None
    if said is None:
        return []
    paths = [folder / library_name(recipe, said["text"], compiler) for compiler in compilers()]
    if not paths:
        paths = sorted(folder.glob(f"{_stem(recipe, said['text'])}-*{SUFFIX}"))
    return [Built(path, functions_of(said)) for path in paths if is_there(path)][:1]


def _stem(recipe: Recipe, text: str) -> str:
    return f"{recipe.name}-{key_of(text, level(), system())}"


def library_name(recipe: Recipe, text: str, compiler: Compiler) -> str:
    """Return the name of the library that a compiler makes of a text, which goes by its hash."""
    own = key_of(compiler.identity, *compiler.command, *flags(recipe.vector, level()))
    return f"{_stem(recipe, text)}-{own}{SUFFIX}"


def functions_of(said: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return what an index says of the functions of a library, as `Built` has it."""
    return tuple((name, result) for name, result in said["functions"])
