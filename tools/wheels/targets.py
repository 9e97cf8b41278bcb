"""What wheels are made for."""

import platform
import re
import sys
import sysconfig
from dataclasses import dataclass, replace

from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.finding import level, system

X86_LEVELS = ("x86-64-v2", "x86-64-v3", "x86-64-v4")
_FOR_LANES = "x86-64-v4"  # twice as many lanes in a vector; one lane after the other is as fast at the level below


@dataclass(frozen=True)
class Target:
    """Machines that the libraries of a wheel run on.

    Parameters
    ----------
    triple : str
        As zig names it; empty for the machine that compiles.
    suffix : str
        Of a library.
    levels : tuple of str
        Of processors.
    tag : str
        Of the wheel.
    """

    triple: str
    suffix: str
    levels: tuple[str, ...]
    tag: str

    def levels_for(self, recipe: Recipe) -> tuple[str, ...]:
        """Return the levels that a recipe gains from."""
        return tuple(level for level in self.levels if recipe.vector or level != _FOR_LANES)


TARGETS = {
    ("linux", "x86_64"): Target("x86_64-linux-gnu.2.17", ".so", X86_LEVELS, "manylinux_2_17_x86_64"),
    ("linux", "arm64"): Target("aarch64-linux-gnu.2.17", ".so", ("arm64",), "manylinux_2_17_aarch64"),
    ("linux-musl", "x86_64"): Target("x86_64-linux-musl", ".so", X86_LEVELS, "musllinux_1_2_x86_64"),
    ("linux-musl", "arm64"): Target("aarch64-linux-musl", ".so", ("arm64",), "musllinux_1_2_aarch64"),
    ("macos", "x86_64"): Target("x86_64-macos.11.0", ".dylib", X86_LEVELS, "macosx_11_0_x86_64"),
    ("macos", "arm64"): Target("aarch64-macos.11.0", ".dylib", ("arm64",), "macosx_11_0_arm64"),
    ("windows", "x86_64"): Target("x86_64-windows-gnu", ".dll", X86_LEVELS, "win_amd64"),
}


def host(by_zig: bool) -> Target:
    """Return the target of this machine; what another compiler makes on Linux needs the C library of this machine."""
    machine = {"amd64": "x86_64", "aarch64": "arm64"}.get(platform.machine().lower(), platform.machine().lower())
    known = TARGETS.get((system(), machine))
    tag = re.sub("[-.]", "_", sysconfig.get_platform())
    if known is None:
        return Target("", ".so", (level(),), tag)
    if by_zig:
        return known
    return replace(known, triple="", tag=tag if sys.platform == "linux" else known.tag)
