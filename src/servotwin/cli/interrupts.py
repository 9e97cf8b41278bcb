"""Ctrl-C, SIGTERM and a closed terminal: the process ends with 130, 143 or 129, one line, and nothing half written.

No exception is raised into running code: while modules are imported or kernels compiled it would come out as another
one, or be lost.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading

TYPE_CHECKING = False  # typing and dataclasses would take longer to load than all the rest of this
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import FrameType
    from typing import NoReturn

CODE = 130  # of a process that was interrupted
_HANGUP = getattr(signal, "SIGHUP", None)  # Windows has none
_CLEAR_LINE_SHOW_CURSOR = b"\r\x1b[2K\x1b[?25h"  # a bar may be there, which hides the cursor


class _State:
    """The effect of an interrupt at this moment."""

    def __init__(self) -> None:
        self.words: Sequence[str] = ()
        self.held = False  # it waits until a few files stand in their places
        self.waiting = False
        self.finishing = False  # the first one is noted: there is something to keep
        self.noted = False
        self.code = CODE
        self.terminals: list[int] = []  # streams that end there
        self.last_words: list[Callable[[], str | None]] = []


_state = _State()


def watch(words: Sequence[str]) -> None:
    """Let Ctrl-C, SIGTERM or a closed terminal end this process; where they are ignored, as by nohup, it stays so.

    Parameters
    ----------
    words : sequence of str
        The command line: with ``--json`` the line is an object on standard output too.
    """
    _state.words = words
    if threading.current_thread() is threading.main_thread():
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _interrupted)
        for number in (signal.SIGTERM, *([] if _HANGUP is None else [_HANGUP])):
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _interrupted)
            elif number == _HANGUP:
                signal.signal(number, lambda number, frame: _away_from_terminals())  # and continues
        _state.terminals = [stream for stream in (0, 1, 2) if os.isatty(stream)]


def leave(code: int) -> NoReturn:
    """End the process without taking apart what the system frees anyway: an interrupt meanwhile would come too late."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(code)


def code() -> int:
    """Return the exit code of a process that the signal ended which was noted: 128 and its number."""
    return _state.code


def noted() -> bool:
    """Return whether there was an interrupt that something was kept for."""
    return _state.noted


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Let an interrupt wait for the end of the block: several files are moved into place.

    Examples
    --------
    >>> with held():
    ...     2 + 2
    4
    """
    _state.held = True
    try:
        yield
    finally:
        _state.held = False
        if _state.waiting:
            _end()


@contextlib.contextmanager
def finishing() -> Iterator[Callable[[], None]]:
    """Give a function that raises after an interrupt; a second interrupt ends the process at once.

    Examples
    --------
    >>> with finishing() as check:
    ...     check()
    """
    _state.finishing = True
    try:
        yield _check
    finally:
        _state.finishing = False


@contextlib.contextmanager
def last_words(words: Callable[[], str | None]) -> Iterator[None]:
    """Say one line more where an interrupt ends the process within the block.

    Examples
    --------
    >>> with last_words(lambda: "half of it is there"):
    ...     2 + 2
    4
    """
    _state.last_words.append(words)
    try:
        yield
    finally:
        _state.last_words.remove(words)


def _check() -> None:
    if _state.noted:
        raise KeyboardInterrupt


def _interrupted(number: int, frame: FrameType | None) -> None:
    if not _state.noted:
        _state.code = 128 + number
    if number == _HANGUP:
        signal.signal(number, signal.SIG_IGN)  # shells send another one
        _away_from_terminals()
    if _state.held:
        _state.waiting = True
    elif _state.finishing and not _state.noted:
        _state.noted = True
        _write(2, "servotwin: interrupted; keeping the best so far (Ctrl-C again: end at once)\n")
    else:
        _end()


def _away_from_terminals() -> None:
    """Send nowhere what was for a terminal that is closed: an error of writing would end what there is to keep."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in _state.terminals:
        os.dup2(nowhere, stream)


def _end() -> NoReturn:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    files = sys.modules.get("servotwin.parameters.output_file")
    undo_all = getattr(files, "undo_all", None)  # absent before it is imported
    if undo_all is not None:
        undo_all()
    with contextlib.suppress(OSError, ValueError, AttributeError):
        if sys.stderr.isatty():
            os.write(2, _CLEAR_LINE_SHOW_CURSOR)
    said = [text for words in _state.last_words if (text := words())]
    if "--json" in _state.words:
        _write(1, '{"error": {"type": "KeyboardInterrupt", "message": "interrupted"}}\n')
    _write(2, "".join(f"servotwin: {text}\n" for text in [*said, "interrupted"]))
    os._exit(_state.code)


def _write(stream: int, text: str) -> None:
    """Write past Python's buffers, which the interrupted code may be filling."""
    with contextlib.suppress(OSError):
        os.write(stream, text.encode(errors="backslashreplace"))
