"""What is installed: versions, extras, compilers and the folder of compiled kernels, and what to install."""

from __future__ import annotations

import os
import platform
import re
from importlib import metadata
from typing import TYPE_CHECKING, Any

from servotwin.cli.terminal import pairs, table

if TYPE_CHECKING:
    from rich.console import RenderableType

_NOT_FOR_USERS = {"all", "dev", "docs", "test", "test-web", "lint", "wheels", "peers"}
_FOR = {
    "data": "results as pandas and xarray, datasets of LeRobot", "sweep": "workers of a dask scheduler",
    "robots": "MuJoCo, Gymnasium, robot", "video": "angles from videos", "bench": "boards and servos on a bus",
    "web": "the bench in a browser", "mpc": "predictive control", "compile": "a compiler, where there is none",
    "learn": "policies", "export": "checks of exported models",
}


def facts() -> dict[str, Any]:
    """Return what is installed, ready for JSON.

    Examples
    --------
    >>> found = facts()
    >>> found["servotwin"], found["backend"] in ("c", "plain"), "data" in found["extras"]
    ('0.1.0', True, True)
    """
    from servotwin import __version__
    from servotwin.simulation.compile import backend, finding

    found = [compiler.command for compiler in finding.compilers()]
    shipped = [*finding.shipped_folder().glob("*")]
    plain = backend.is_plain() or not (found or shipped)
    return {
        "servotwin": __version__, "python": platform.python_version(), "system": platform.platform(),
        "processors": os.cpu_count(), "level": finding.level(),
        "packages": {name: _version(name) for name in ("numpy", "scipy", "matplotlib", "control")},
        "backend": "plain" if plain else "c", "compilers": [" ".join(command) for command in found],
        "shipped_kernels": len(shipped), "cache": _cache(), "extras": _extras(),
    }


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _cache() -> dict[str, Any]:
    """Return where compiled kernels are kept, why they are not loaded from there, how many, and their size [bytes]."""
    from servotwin.simulation.compile import storage

    folder = storage.cache_folder()
    files = [path for path in folder.glob("*") if path.is_file()] if folder.is_dir() else []
    return {"folder": str(folder), "distrust": storage.distrust(folder), "files": len(files),
            "bytes": sum(path.stat().st_size for path in files)}


def _extras() -> dict[str, list[str]]:
    """Return the packages that each extra lacks."""
    lacking: dict[str, list[str]] = {}
    for text in metadata.requires("servotwin") or []:
        extra = re.search(r"extra == ['\"]([^'\"]+)['\"]", text)
        if extra is None or extra[1] in _NOT_FOR_USERS:
            continue
        name = re.match(r"[A-Za-z0-9._-]+", text)
        missing = lacking.setdefault(extra[1], [])
        if name is not None and _version(name[0]) is None:
            missing.append(name[0])
    return lacking


def parts(found: dict[str, Any]) -> list[RenderableType]:
    """Return what is installed as it is shown."""
    packages = ", ".join(f"{name} {version or 'missing'}" for name, version in found["packages"].items())
    cache = found["cache"]
    rows = [
        ("servotwin", f"{found['servotwin']}, Python {found['python']}, {found['system']}"),
        ("packages", packages),
        ("processor", f"{found['processors']} cores, {found['level']}"),
        ("kernels", _kernels(found)),
        ("compiler", found["compilers"][0] if found["compilers"] else "none"),
        ("cache", f"{cache['folder']}, {cache['files']} files, {cache['bytes'] / 1e6:.1f} MB"
         + (f"; not used, for {cache['distrust']}" if cache["distrust"] else "")),
    ]
    extras = [(name, "yes" if not lacking else "no", _FOR.get(name, ""),
               f'pip install "servotwin[{name}]"' if lacking else "") for name, lacking in found["extras"].items()]
    return [pairs(rows), "", table(("extra", "here", "for", "to have it"), extras)]


def _kernels(found: dict[str, Any]) -> str:
    if found["backend"] == "plain":
        return ("in plain Python, slow where many servos run" if os.environ.get("SERVOTWIN_BACKEND") == "plain" else
                'in plain Python, for there is no compiler: pip install "servotwin[compile]"')
    many = found["shipped_kernels"]
    return f"compiled (C), {f'{many} files came with the package' if many else 'when needed'}"
