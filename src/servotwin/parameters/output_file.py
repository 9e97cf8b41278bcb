"""Writing a file whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Callable, Iterator
from pathlib import Path

from servotwin.errors import OutputError, OutputExistsError

_undoing: list[Callable[[], object]] = []  # of what is half written


@contextlib.contextmanager
def undone(undo: Callable[[], object]) -> Iterator[None]:
    """Run `undo` at the end of the block, however it ends, or by `undo_all` where the process ends within it.

    Examples
    --------
    >>> with undone(lambda: print("removed")):
    ...     2 + 2
    4
    removed
    """
    _undoing.append(undo)
    try:
        yield
    finally:
        undo()
        _undoing.remove(undo)


def undo_all() -> None:
    """Undo what is half written: the process ends here."""
    for undo in reversed(_undoing):
        with contextlib.suppress(Exception):
            undo()


def write_file(path: str | Path, content: bytes | str | Callable[[Path], object], *, overwrite: bool = False) -> None:
    """Write a temporary file beside `path`, then move it into place; on failure nothing has changed.

    Parameters
    ----------
    path : str or Path
    content : bytes, str or callable
        A text is written as UTF-8; a callable fills the temporary file, whose path it is given.
    overwrite : bool

    Raises
    ------
    OutputExistsError
        If `path` exists and `overwrite` is false.
    OutputError
        If it cannot be written, or a text is not valid Unicode.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> write_file(folder / "a.txt", b"text")
    >>> (folder / "a.txt").read_text()
    'text'
    """
    target = Path(path)
    if "\0" in str(target):
        raise OutputError(f"{str(target)!r} cannot be written (a path holds no NUL)")
    if isinstance(content, str):
        try:
            content = content.encode()
        except UnicodeEncodeError:
            raise OutputError(f"{path} cannot be written (a text in it is not valid Unicode)") from None
    try:
        if target.exists() and not overwrite:
            raise OutputExistsError(target)
        if target.is_dir():
            raise OutputError(f"{target} is a folder")
        if target.exists() and not target.is_file():
            raise OutputError(f"{target} is no regular file")  # a device must not be replaced by a file
        partial = target.with_name(f".partial-{secrets.token_hex(8)}{target.suffix}")
        with undone(lambda: partial.unlink(missing_ok=True)):
            partial.touch(0o600, exist_ok=False)
            if isinstance(content, bytes):
                partial.write_bytes(content)
            else:
                content(partial)
            partial.chmod(0o666 & ~_umask())
            os.replace(partial, target)
    except OSError as error:
        raise OutputError(f"{target} cannot be written ({error.strerror})") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
