"""The entry point: run a command, and turn whatever goes wrong into one line and an exit code."""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
from functools import cache

from servotwin.cli import interrupts

TYPE_CHECKING = False  # as in interrupts: Ctrl-C is watched as soon as can be
if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import TextIO

    from typer import Typer
    from typer.core import TyperGroup

TRACEBACK = "SERVOTWIN_TRACEBACK"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Words after `servotwin`. Without them those of the process are run, and the process ends here: after the last
        line, or by Ctrl-C at any time before.

    Returns
    -------
    int
        0: done; 2: bad input or an output that cannot be written; 130, 143 or 129: interrupted, by Ctrl-C, SIGTERM or
        a closed terminal; 1: a validation above its --max-error, or a mistake of servotwin.

    Examples
    --------
    >>> main(["--version"])
    servotwin 0.1.0
    0
    """
    if arguments is not None:
        return _ran(list(arguments))
    words = sys.argv[1:]
    interrupts.watch(words)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: more threads of numpy's only wait
    interrupts.leave(_ran(words))


def _ran(words: Sequence[str]) -> int:
    try:
        for stream in (sys.stdout, sys.stderr):
            if hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="backslashreplace")  # a name may hold what the terminal cannot show
        with _one_line_warnings():
            code = _run(words)
        if sys.stdout is not None:
            sys.stdout.flush()
        return interrupts.code() if interrupts.noted() else code
    except KeyboardInterrupt as error:
        return _failed(error, words)
    except SystemExit:  # how rich, which draws the help, reacts to a broken pipe
        return _failed(BrokenPipeError(), words)
    except Exception as error:
        if os.environ.get(TRACEBACK):
            raise
        return _failed(error, words)


@cache
def _command(app: Typer) -> TyperGroup:
    """Return all commands with their options, which takes as long as to import them."""
    from typer.main import get_command

    return get_command(app)  # type: ignore[return-value]


def _run(words: Sequence[str]) -> int:
    import typer

    from servotwin.cli import commands

    command = _command(commands.app)
    try:
        # Not command(...): that would print errors in its own way, and treat a broken pipe as one of ours.
        with command.make_context("servotwin", list(words)) as context:
            command.invoke(context)
    except typer.Exit as ended:
        return int(ended.exit_code)
    return 0


def _failed(error: BaseException, words: Sequence[str]) -> int:
    from servotwin.cli.failure import describe

    failure = describe(error)
    if isinstance(error, BrokenPipeError) or not _flushed():
        _discard_stdout()
    elif "--json" in words:
        _try_write(sys.stdout, failure.to_json())
    kind = "" if failure.code == interrupts.CODE else "error: "
    _try_write(sys.stderr, f"servotwin: {kind}{failure.message}")
    return failure.code


def _try_write(stream: TextIO | None, line: str) -> None:
    with contextlib.suppress(OSError, ValueError):
        if stream is not None:
            stream.write(line + "\n")
            stream.flush()


def _flushed() -> bool:
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError):
        return False
    return True


def _discard_stdout() -> None:
    """Send what is still buffered nowhere, or the interpreter would complain about it on its way out."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


@contextlib.contextmanager
def _one_line_warnings() -> Iterator[None]:
    from servotwin.cli.failure import one_line

    said: set[str] = set()

    def show(message: Warning | str, category: type[Warning], filename: str, lineno: int,
             file: TextIO | None = None, line: str | None = None) -> None:
        text = one_line(str(message))
        if text not in said:  # several runs of one command would repeat it
            said.add(text)
            _try_write(sys.stderr, f"servotwin: warning: {text}")

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        yield
