"""Writing a file whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from servotwin.errors import OutputError, OutputExistsError


def write_file(path: str | Path, write: Callable[[Path], object], *, overwrite: bool = False) -> None:
    """Let `write` fill a temporary file beside `path`, then move it into place; on failure nothing has changed.

    Raises
    ------
    OutputExistsError
        If `path` exists and `overwrite` is false.
    OutputError
        If it cannot be written.

    Examples
    --------
    >>> folder = Path(tempfile.mkdtemp())
    >>> write_file(folder / "a.txt", lambda path: path.write_text("text"))
    >>> (folder / "a.txt").read_text()
    'text'
    """
    target = Path(path)
    if "\0" in str(target):
        raise OutputError(f"{str(target)!r} cannot be written (a path holds no NUL)")
    try:
        if target.exists() and not overwrite:
            raise OutputExistsError(target)
        if target.is_dir():
            raise OutputError(f"{target} is a folder")
        if target.exists() and not target.is_file():
            raise OutputError(f"{target} is no regular file")  # a device must not be replaced by a file
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=".partial-", suffix=target.suffix)
    except OSError as error:
        raise OutputError(f"{target} cannot be written ({error.strerror})") from None
    partial = Path(name)
    try:
        os.close(handle)
        write(partial)
        partial.chmod(0o666 & ~_umask())
        os.replace(partial, target)
    except OSError as error:
        raise OutputError(f"{target} cannot be written ({error.strerror})") from None
    finally:
        partial.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
