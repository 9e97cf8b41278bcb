"""How a command that fits goes on after a signal, or the time that it was given: with the best so far."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Protocol

import typer

from servotwin.cli import interrupts


class _Fit(Protocol):
    @property
    def interrupted(self) -> bool: ...


@contextlib.contextmanager
def best_kept(*, shown: bool = True) -> Iterator[Callable[[float, str], None]]:
    """Give what shows the progress, and ends the search after an interrupt, with the best so far.

    Before the first step there is no best, and an interrupt ends the process.
    """
    from servotwin.identification.fitting import checks

    with checks.shown(shown) as show, contextlib.ExitStack() as stack:
        ends: list[Callable[[], None]] = []

        def tell(share: float, text: str) -> None:
            show(share, text)
            if share > 0.0 and not ends:
                ends.append(stack.enter_context(interrupts.finishing()))
            for check in ends:
                check()

        yield tell


def end_if_stopped(fit: _Fit, *, timed: bool) -> None:
    """End the command as an interrupt does, where one has stopped the fit; `timed` is whether its time was limited.

    Raises
    ------
    typer.Exit
    """
    if fit.interrupted and (not timed or interrupts.noted()):
        raise typer.Exit(interrupts.code())
