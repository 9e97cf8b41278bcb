"""The compiler of C at hand, and how it is asked for a library."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from servotwin.simulation.compile.storage import distrust, temporary_folder

_GENERAL = ("-std=c99", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math",
            "-fwrapv", "-fno-strict-aliasing", "-fopenmp-simd", "-w")
_X86 = {  # what the levels of the x86-64 psABI have beyond the lower ones; gcc knows their names from version 11 on
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
