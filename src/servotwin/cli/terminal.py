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
from functools import partial
from typing import TYPE_CHECKING, Any

from servotwin.cli.layout import pair_lines, table_lines, text_lines
from servotwin.text import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import typer
    from rich.console import Console, ConsoleOptions, RenderableType

    from servotwin.cli.layout import Line

_PIPE_WIDTH = 120  # characters of a line where no terminal says how wide it is


def emit(text: str) -> None:
    """Write a text and a line end to standard output; what a terminal would obey stands in it as Python writes it.

    Raises
    ------
    OSError
        If that fails; it names standard output.

    Examples
    --------
    >>> emit("hello")
    hello
    """
    _write(shown(text))


def _write(text: str) -> None:
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
    return json.dumps(_finite(data), indent=2, allow_nan=False).replace("\x7f", "\\u007f")


def show(*parts: RenderableType) -> None:
    """Write tables and texts, no wider than the terminal.

    Examples
    --------
    >>> show("one", "two")
    one
    two
    """
    terminal = sys.stdout is not None and sys.stdout.isatty()
    width = None if terminal or os.environ.get("COLUMNS", "").isdigit() else _PIPE_WIDTH
    _write(drawn(parts, width, terminal=terminal))


def drawn(parts: Sequence[RenderableType], width: int | None, *, terminal: bool = False) -> str:
    r"""Return tables and texts as they are drawn in a width, that of the terminal unless given.

    Examples
    --------
    >>> drawn(["a word, and more of them"], 20)
    'a word, and more of\nthem'
    """
    from rich.console import Console

    page = io.StringIO()
    console = Console(file=page, force_terminal=terminal, width=width, markup=False, highlight=False, emoji=False)
    for part in parts:
        console.print(_Drawn(partial(text_lines, shown(part))) if isinstance(part, str) else part, crop=False)
    return "\n".join(line.rstrip() for line in page.getvalue().rstrip("\n").split("\n"))


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


class _Drawn:
    """Lines that are laid out when the width of the terminal is known."""

    def __init__(self, lines: Callable[[int], list[Line]]) -> None:
        self.lines = lines

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[RenderableType]:
        """Give each line to `rich`, which draws the bold part of it where the terminal can."""
        from rich.text import Text

        for line in self.lines(options.max_width):
            drawn = Text(line.text, no_wrap=True, overflow="ignore")
            drawn.stylize("bold", 0, line.bold)
            yield drawn


def pairs(rows: Sequence[tuple[str, str]]) -> RenderableType:
    """Return labels and texts side by side.

    Examples
    --------
    >>> show(pairs([("final angle", "180.00 deg"), ("energy", "1 J")]))
      final angle  180.00 deg
      energy       1 J
    """
    return _Drawn(partial(pair_lines, [(shown(label), shown(text)) for label, text in rows]))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> RenderableType:
    """Return a table without frame, of which no number is cut however narrow the terminal: `layout` says how.

    Examples
    --------
    >>> show(table(("id", "torque"), [("a", "1 N m")]))
    id  torque
    a   1 N m
    """
    return _Drawn(partial(table_lines, header, [[shown(cell) for cell in row] for row in rows]))
