"""What goes to standard output: text, tables and JSON, each written at once."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import shlex
import subprocess
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import typer
    from rich.console import RenderableType

_PIPE_WIDTH = 120  # characters of a line where no terminal says how wide it is


def emit(text: str) -> None:
    """Write a text and a line end to standard output.

    Raises
    ------
    OSError
        If that fails; it names standard output.

    Examples
    --------
    >>> emit("hello")
    hello
    """
    if sys.stdout is None:
        return
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except OSError as error:
        raise OSError(error.errno, error.strerror, "standard output") from None


def emit_help(context: typer.Context) -> None:
    """Write the help of a command."""
    text = context.get_help()  # empty where typer has written it already
    if text:
        emit(text)


def emit_json(data: Any) -> None:
    """Write one JSON document; a number that is not finite becomes null, and -0 becomes 0.

    Examples
    --------
    >>> emit_json({"a": float("nan"), "b": -0.0})
    {
      "a": null,
      "b": 0.0
    }
    """
    emit(json_text(data))


def json_text(data: Any) -> str:
    """Return one JSON document; a number that is not finite becomes null, and -0 becomes 0.

    Examples
    --------
    >>> json_text({"a": float("nan")}).split()
    ['{', '"a":', 'null', '}']
    """
    return json.dumps(_finite(data), indent=2, allow_nan=False)


def show(*parts: RenderableType) -> None:
    """Write tables and texts as `rich` draws them, as wide as the terminal.

    Examples
    --------
    >>> show("one", "two")
    one
    two
    """
    from rich.console import Console

    page = io.StringIO()
    terminal = sys.stdout is not None and sys.stdout.isatty()
    width = None if terminal or os.environ.get("COLUMNS", "").isdigit() else _PIPE_WIDTH
    console = Console(file=page, force_terminal=terminal, width=width, markup=False, highlight=False, emoji=False)
    for part in parts:
        console.print(part)
    emit("\n".join(line.rstrip() for line in page.getvalue().rstrip("\n").split("\n")))


@contextlib.contextmanager
def patience(what: str) -> Iterator[None]:
    """Show on a terminal that something lasts, once it has lasted for a second.

    Examples
    --------
    >>> with patience("adding"):
    ...     1 + 1
    2
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    import threading

    status: list[Any] = []

    def begin() -> None:
        from rich.console import Console

        status.append(Console(stderr=True, markup=False).status(f"{what} ..."))
        status[0].start()

    timer = threading.Timer(1.0, begin)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        for shown in status:
            shown.stop()


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {str(key): _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, float):
        return data + 0.0 if math.isfinite(data) else None
    return data


def typed(*words: object) -> str:
    """Return a command line as it is typed in a shell of this system.

    Examples
    --------
    >>> typed("servotwin", "fit", "my runs", "--servo", "x.toml").replace('"', "'")
    "servotwin fit 'my runs' --servo x.toml"
    """
    texts = [str(word) for word in words]
    return subprocess.list2cmdline(texts) if os.name == "nt" else shlex.join(texts)


def pairs(rows: Sequence[tuple[str, str]]) -> RenderableType:
    """Return labels and texts side by side.

    Examples
    --------
    >>> show(pairs([("final angle", "180.00 deg"), ("energy", "1 J")]))
      final angle  180.00 deg
      energy       1 J
    """
    from rich.table import Table

    drawn = Table.grid(padding=(0, 2))
    drawn.add_column(no_wrap=True, style="bold")
    drawn.add_column(overflow="fold")
    for label, text in rows:
        drawn.add_row("  " + label, text)
    return drawn


def table(header: Sequence[str], rows: Sequence[Sequence[str]], *, wraps: str = "") -> RenderableType:
    """Return a table without frame; only the column `wraps` may break its lines.

    Examples
    --------
    >>> show(table(("id", "torque"), [("a", "1 N m")]))
    id  torque
    a   1 N m
    """
    from rich.table import Table

    drawn = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    for name in header:
        drawn.add_column(name, no_wrap=name != wraps, overflow="fold")
    for row in rows:
        drawn.add_row(*row)
    return drawn
