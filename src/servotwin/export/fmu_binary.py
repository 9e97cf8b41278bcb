"""The library of an FMU, made by the compiler at hand for this machine, and for others where zig is there."""

from __future__ import annotations

import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from servotwin.errors import InputError
from servotwin.simulation.compile.finding import compilers

_FLAGS = ("-std=c99", "-O2", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno",
          "-fno-trapping-math", "-s")


class Platform(NamedTuple):
    """A system: its folders in FMI 2.0 and 3.0, the ending of libraries, and zig's name of it."""

    older: str
    newer: str
    ending: str
    target: str


PLATFORMS = (
    Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
    Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
    Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu"),
    Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
    Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
)
_SYSTEMS = {"linux": "linux", "win32": "windows", "darwin": "darwin"}
_MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}


def binaries(version: str, name: str, files: Mapping[str, str], sources: Sequence[str]) -> dict[str, bytes]:
    """Return libraries by their paths in an FMU.

    Parameters
    ----------
    version : {"2.0", "3.0"}
    name : str
    files : mapping of str to str
        Texts by their names.
    sources : sequence of str
        Those that are compiled.

    Raises
    ------
    InputError
        If there is no compiler, or it refuses.
    """
    made = {}
    with tempfile.TemporaryDirectory(prefix="servotwin-fmu-") as folder:
        for file, text in files.items():
            (Path(folder) / file).write_text(text, encoding="utf-8")
        for system, command in _commands():
            library = Path(folder) / f"{name}{system.ending}"
            paths = [str(Path(folder) / each) for each in sources]
            _compile([*command, *_FLAGS, *(() if system.ending == ".dll" else ("-fPIC",)), "-I", folder, "-o",
                      str(library), *paths, "-lm"])
            place = system.older if version == "2.0" else system.newer
            made[f"binaries/{place}/{library.name}"] = library.read_bytes()
    return made


def _commands() -> list[tuple[Platform, Sequence[str]]]:
    """Return the systems that libraries are made for, and how the compiler of each is called."""
    there = compilers()
    zig = next((each for each in there if "ziglang" in each.command), None)
    if zig is not None:
        return [(system, (*zig.command, "-target", system.target)) for system in PLATFORMS]
    newer = f"{_MACHINES.get(platform.machine().lower())}-{_SYSTEMS.get(sys.platform)}"
    own = next((system for system in PLATFORMS if system.newer == newer), None)
    if own is None or not there:
        raise InputError("export fmu", got="no compiler of C" if own else f"{sys.platform} {platform.machine()}",
                         allowed="clang, gcc or the package ziglang; or sources alone (--sources)")
    return [(own, there[0].command)]


def _compile(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = next(iter(done.stderr.strip().splitlines()), "nothing")
        raise InputError("export fmu", got=f"a compiler that refuses: {said}", allowed="one that takes C99")
