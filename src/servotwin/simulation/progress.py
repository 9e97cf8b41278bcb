"""A bar on stderr for what lasts, once it has lasted for a second."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = bool | Callable[[int, int], object]

_PATIENCE = 1.0  # s before the bar appears


@contextmanager
def shown(progress: Progress, total: int, what: str) -> Iterator[Callable[[int], None]]:
    """Give a function that is told how many lanes are done.

    Parameters
    ----------
    progress : bool or callable
        True shows a bar; a callable is called with the lanes that are done and all of them.
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
