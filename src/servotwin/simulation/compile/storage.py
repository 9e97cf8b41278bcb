"""Where compiled kernels are kept, and under which names."""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path


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


def write(path: Path, text: str) -> None:
    """Write a file at once, so that nobody reads half of it."""
    import tempfile  # only who writes needs it

    handle, aside = tempfile.mkstemp(suffix=".tmp", dir=path.parent)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(aside, path)
