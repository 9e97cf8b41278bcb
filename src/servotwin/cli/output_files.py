"""Output files: checked before anything is computed, written beside their place, then moved into it together."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from servotwin.cli.interrupts import held
from servotwin.errors import OutputError, OutputExistsError
from servotwin.parameters.output_file import undone


@dataclass(frozen=True, kw_only=True)
class Target:
    """A file to be written.

    Parameters
    ----------
    option : str
        The option that names it, such as ``"--out"``.
    path : Path
        As the user gave it.
    endings : tuple of str
        Endings that its name may have, such as ``(".csv",)``.
    page : int
        Of the picture, whose first page is 1.
    """

    option: str
    path: Path
    endings: tuple[str, ...]
    page: int = 1

    @property
    def place(self) -> Path:
        """Where it really goes: links are followed, so that they stay links."""
        try:
            return self.path.resolve()
        except (OSError, RuntimeError, ValueError) as error:
            raise OutputError(f"{self.option} {self.path} cannot be written ({_reason(error)})") from None


def page_name(name: str, page: int) -> str:
    """Return the name of the file on which a page of a picture stands.

    Examples
    --------
    >>> [page_name("tracking.png", page) for page in (1, 2, 3)]
    ['tracking.png', 'tracking-2.png', 'tracking-3.png']
    """
    stem, dot, ending = name.rpartition(".")
    return name if page == 1 else f"{stem}-{page}{dot}{ending}"


def check_targets(targets: Sequence[Target], *, force: bool, inputs: Sequence[Path] = ()) -> None:
    """Raise unless every file can be written, no two are the same, and none is an input.

    Parameters
    ----------
    targets : sequence of Target
    force : bool
        Whether files that exist may be replaced.
    inputs : sequence of Path
        Files that are read.

    Raises
    ------
    OutputExistsError
        If a file exists and `force` is false.
    OutputError
        In all other cases.

    Examples
    --------
    >>> check_targets([Target(option="--out", path=Path("run.txt"), endings=(".csv",))], force=False)
    Traceback (most recent call last):
    ...
    servotwin.errors.OutputError: --out: got 'run.txt', allowed: a name that ends in .csv
    """
    taken = {_identity(path): f"the input {path}" for path in inputs}
    for target in targets:
        name = f"{target.option} {target.path}"
        other = taken.setdefault(_identity(target.place), name)
        if other != name:
            raise OutputError(f"{name} is the same file as {other}")
        if target.path.suffix.lower() not in target.endings:
            raise OutputError(target.option, got=str(target.path),
                              allowed="a name that ends in " + ", ".join(target.endings))
        _check_place(target, force=force)


@contextlib.contextmanager
def staged(targets: Sequence[Target], *, force: bool) -> Iterator[list[Path]]:
    """Give a path to write to for each target; at the end all move into place, or, after an error, none does.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> target = Target(option="--out", path=folder / "a.csv", endings=(".csv",))
    >>> with staged([target], force=False) as paths:
    ...     _ = paths[0].write_text("time_s")
    >>> [path.name for path in folder.iterdir()]
    ['a.csv']
    """
    with contextlib.ExitStack() as stack:
        places = [target.place for target in targets]
        drafts = []
        for target, place in zip(targets, places, strict=True):
            folder = place.parent / f".servotwin-{secrets.token_hex(8)}"
            stack.enter_context(undone(partial(shutil.rmtree, folder, ignore_errors=True)))
            with _naming(target):
                folder.mkdir(0o700)
            drafts.append(folder / place.name)
        try:
            yield drafts
        except OutputError as error:
            what = error.what
            for target, draft in zip(targets, drafts, strict=True):
                what = what.replace(str(draft), f"{target.option} {target.path}")
            raise OutputError(what, got=error.got, allowed=error.allowed) from None
        for target, place in zip(targets, places, strict=True):
            if place.exists() and not force:  # it came into being meanwhile
                raise OutputExistsError(target.path)
        with held():
            for target, draft, place in zip(targets, drafts, places, strict=True):
                with _naming(target):
                    draft.replace(place)


def _check_place(target: Target, *, force: bool) -> None:
    place = target.place
    with _naming(target):
        if place.is_dir():
            raise OutputError(f"{target.option} {target.path} is a folder")
        if os.path.lexists(place) and not place.is_file():
            raise OutputError(f"{target.option} {target.path} is no regular file")
        if place.exists() and not force:
            raise OutputExistsError(target.path)
        if not place.parent.exists():
            raise OutputError(f"{target.option} {target.path}: the folder {target.path.parent} does not exist")
        if not place.parent.is_dir():
            raise OutputError(f"{target.option} {target.path}: {target.path.parent} is no folder")
        # Permissions do not tell (root, read-only file systems): try.
        probe = place.with_name(f".servotwin-{secrets.token_hex(8)}.partial")
        with undone(lambda: probe.unlink(missing_ok=True)):
            probe.touch(0o600, exist_ok=False)


@contextlib.contextmanager
def _naming(target: Target) -> Iterator[None]:
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{target.option} {target.path} cannot be written ({_reason(error)})") from None
    except ValueError as error:
        if isinstance(error, OutputExistsError):
            raise
        raise OutputError(f"{target.option} {str(target.path)!r} cannot be written ({error})") from None


def _reason(error: BaseException) -> str:
    return getattr(error, "strerror", None) or str(error)


def _identity(path: Path) -> tuple[object, ...]:
    """Return what two names of one file have in common."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return (path.absolute() if not path.parent.exists() else path.resolve(),)
    return (found.st_dev, found.st_ino)


Writers = Mapping[str, Callable[[Path], object]]
"""Writers of files, by the file's name."""


def write_files(targets: Sequence[Target], writers: Writers, *, force: bool,
                draw: Callable[[Mapping[str, Path]], object] | None = None) -> None:
    """Write files, all of them or after an error none.

    Parameters
    ----------
    targets : sequence of Target
        Each has its writer by its name, or `draw` writes it.
    writers : mapping of str to callable
    force : bool
        Whether files that are there may be replaced.
    draw : callable, optional
        Writes what takes longest, into the places that it is given by name; shows progress itself.
    """
    from servotwin.cli.terminal import patience

    with staged(targets, force=force) as drafts:
        places = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        with patience("drawing"):
            for name, writer in writers.items():
                writer(places[name])
        if draw is not None:
            draw(places)


def text_of(text: str | Callable[[], str]) -> Callable[[Path], object]:
    """Return the writer of a text, or of one that is made then."""
    return lambda path: path.write_bytes((text if isinstance(text, str) else text()).encode())


def json_of(found: Any) -> Callable[[Path], object]:
    """Return the writer of data as JSON."""
    from servotwin.cli.terminal import json_text

    return text_of(lambda: json_text(found) + "\n")
