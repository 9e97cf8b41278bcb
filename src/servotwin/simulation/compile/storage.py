"""Keep derived modules in the user's cache, so that they are compiled once."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

_STAMP = 946684800  # numba takes a changed time of the file for a changed file


def cache_folder() -> Path:
    """Return where compiled kernels are kept: SERVOTWIN_CACHE_DIR, or the platform's folder for such things."""
    named = os.environ.get("SERVOTWIN_CACHE_DIR")
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "servotwin"


def key_of(*texts: str) -> str:
    """Return a short name for these texts."""
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def is_stored(name: str) -> bool:
    """Tell whether a derived module is in the cache, compiled."""
    return any((cache_folder() / "__pycache__").glob(f"{name}.*.nbi"))


def stored(name: str, text: Callable[[], str]) -> tuple[Path, bool]:
    """Return the file of a derived module and whether it was there already; without a cache, a temporary one.

    `text` derives it; the name says all that it depends on, so that a file of this name is the same.
    """
    try:
        return _written(cache_folder(), name, text)
    except OSError as error:
        sys.stderr.write(f"servotwin: the kernels cannot be kept in {cache_folder()} ({error.strerror}); "
                         "set SERVOTWIN_CACHE_DIR to a folder that can be written\n")
        return _written(Path(tempfile.mkdtemp(prefix="servotwin-")), name, text)


def _written(folder: Path, name: str, text: Callable[[], str]) -> tuple[Path, bool]:
    path = folder / f"{name}.py"
    folder.mkdir(parents=True, exist_ok=True)
    compiled = folder / "__pycache__"
    compiled.mkdir(exist_ok=True)
    if not os.access(compiled, os.W_OK):
        raise PermissionError(13, "Permission denied", str(compiled))
    if path.exists():
        return path, any(compiled.glob(f"{name}.*.nbi"))
    handle, temporary = tempfile.mkstemp(suffix=".tmp", dir=folder)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text())
    os.utime(temporary, (_STAMP, _STAMP))  # two processes that write at once write the same file
    os.replace(temporary, path)
    return path, False


def loaded(path: Path) -> ModuleType:
    """Import a derived module from its file."""
    spec = spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:  # pragma: no cover - a .py file always has a loader
        raise ImportError(f"{path} cannot be imported")
    module = module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module
