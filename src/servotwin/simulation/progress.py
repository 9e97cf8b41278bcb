"""What tells on stderr how far something is that lasts: a bar on a terminal, else a plain line now and then."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = bool | Callable[[int, int], object]

_PATIENCE = 1.0  # s before the bar appears
_BETWEEN = 10.0  # s between lines where there is no terminal


def lines(what: str, clock: Callable[[], float] = time.monotonic) -> Callable[[float, str], None]:
    """Return a function that is told the share done and what goes on, and writes a line to stderr every 10 s.

    Parameters
    ----------
    what : str
        Begins each line.
    clock : callable
        Tells the time [s].

    Examples
    --------
    >>> times = iter((0.0, 4.0, 12.0))
    >>> tell = lines("fit", clock=lambda: next(times))
    >>> with contextlib.redirect_stderr(sys.stdout):
    ...     tell(0.1, "start 1 of 3")
    ...     tell(0.4, "all logs")
    fit: 40 %, all logs, about 18 s left
    """
    began = last = clock()

    def tell(share: float, text: str) -> None:
        nonlocal last
        now = clock()
        if now - last < _BETWEEN or sys.stderr is None:
            return
        last = now
        left = f", about {duration_left(now - began, share)} left" if share > 0.0 else ""
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(f"{what}: {100.0 * share:.0f} %{', ' if text else ''}{text}{left}\n")
            sys.stderr.flush()

    return tell


def duration_left(gone: float, share: float) -> str:
    """Return in words what is left where a share of the time is gone, which is so much [s].

    Examples
    --------
    >>> duration_left(10.0, 0.25), duration_left(300.0, 0.5)
    ('30 s', '5 min')
    """
    seconds = gone * (1.0 / share - 1.0)
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"


def on_terminal() -> bool:
    """Return whether stderr is a terminal, which a bar can be drawn on."""
    return sys.stderr is not None and sys.stderr.isatty()


@contextmanager
def shown(progress: Progress, total: int, what: str) -> Iterator[Callable[[int], None]]:
    """Give a function that is told how many lanes are done.

    Parameters
    ----------
    progress : bool or callable
        True shows a bar, or lines where stderr is no terminal; a callable is called with the lanes that are done and
        all of them.
    total : int
        All lanes.
    what : str
        The label of the bar.

    Examples
    --------
    >>> with shown(lambda done, total: print(done, "of", total), 10, "simulating") as show:
    ...     show(4)
    4 of 10
    """
    if callable(progress):
        yield lambda done: (progress(done, total), None)[1]
        return
    if not progress or sys.stderr is None:
        yield lambda done: None
        return
    if not on_terminal():
        tell = lines(what)
        yield lambda done: tell(done / max(total, 1), "")
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    bar = Bar(console=Console(file=sys.stderr), transient=True)
    task, began = bar.add_task(what, total=total), time.monotonic()

    def show(done: int) -> None:
        bar.update(task, completed=done)
        if not bar.live.is_started and time.monotonic() - began >= _PATIENCE:
            bar.start()

    try:
        yield show
    finally:
        if bar.live.is_started:
            bar.stop()
