"""Where compiled kernels are kept, under which names, and whether what lies there may be loaded or run.

A loaded library may do all that this user may. On POSIX it has to be a file that belongs to this user or root and that
nobody else may write, in a folder of which the same holds; else it is made anew, in a folder of this process's own.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
from functools import cache
from pathlib import Path

from servotwin.errors import one_line


def cache_folder() -> Path:
    """Return where compiled kernels are kept: SERVOTWIN_CACHE_DIR, or the platform's folder for such things."""
    named = os.environ.get("SERVOTWIN_CACHE_DIR")
    if named:
        return Path(named).absolute()  # compilers run elsewhere
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base).absolute() / "servotwin"


def kept_folder() -> Path:
    """Return the folder that kernels are loaded from: the cache, or this process's own where others may write that."""
    folder = cache_folder()
    reason = distrust(folder)
    return folder if reason is None else _instead(folder, reason)


def writable_folder() -> Path:
    """Return the folder that kernels are written into: the cache, made for this user alone, or this process's own."""
    folder = cache_folder()
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            folder.mkdir(0o700)
        reason = distrust(folder) or (None if os.access(folder, os.W_OK | os.X_OK) else "Permission denied")
        reason = reason if folder.is_dir() else "Not a directory"
    except OSError as error:
        reason = error.strerror or str(error)
    return folder if reason is None else _instead(folder, reason)


def distrust(path: Path) -> str | None:
    """Return why a folder or file must not be loaded from; None where nothing speaks against it, or there is none.

    Windows is not asked: the usual folder is the user's there.
    """
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            for about in (path.lstat(), path.stat()):  # who may put another link in its place, and what it leads to
                if about.st_uid not in (os.geteuid(), 0):
                    return "it belongs to another user"
                if not stat.S_ISLNK(about.st_mode) and about.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                    return "others may write it, until chmod go-w"
    return None


def is_there(path: Path) -> bool:
    """Tell whether there is a file that may be loaded or run; of one that may not it is said once why."""
    try:
        if not path.is_file():
            return False
    except OSError:  # in a folder that this user may not look into
        return False
    reason = distrust(path)
    if reason is not None:
        _say(f"{path} is made anew, for {reason}")
    return reason is None


@cache
def _say(line: str) -> None:
    sys.stderr.write(f"servotwin: {one_line(line)}\n")


@cache
def _instead(folder: Path, reason: str) -> Path:
    _say(f"the kernels cannot be kept in {folder} ({reason}); set SERVOTWIN_CACHE_DIR to a private folder")
    return temporary_folder()


@cache
def temporary_folder() -> Path:
    """Return a folder of this process's own, which goes with it."""
    import atexit
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="servotwin-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


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
