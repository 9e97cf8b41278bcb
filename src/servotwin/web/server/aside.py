"""What takes longer than a turn, beside the benches: in a thread of its own, for so long and no longer."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import threading
from collections.abc import Callable
from functools import partial
from typing import TypeVar

from servotwin.errors import InputError

Found = TypeVar("Found")
LONGEST = 30.0
"""How long something may take, unless it is given more time [s]."""
EXPORTS = asyncio.Semaphore(2)
"""So many long ones at once, of all visitors."""


class _StoppedError(BaseException):
    """Nobody waits any more for what a thread computes."""


async def aside(what: str, work: Callable[[], Found], seconds: float | None = None) -> Found:
    """Return what a function returns, while the benches go on; it ends when nobody waits for it any more.

    The interpreter goes on within a function of Python at any time, so it can be stopped at any time: what it does is
    to have no effect but what it returns.

    Parameters
    ----------
    what : str
        For messages.
    work : callable
    seconds : float
        How long it may take [s]; `LONGEST` unless given.

    Raises
    ------
    InputError
        If it takes longer.

    Examples
    --------
    >>> asyncio.run(aside("sum", lambda: sum([1, 2])))
    3
    """
    loop, most = asyncio.get_running_loop(), LONGEST if seconds is None else seconds
    found: asyncio.Future[Found] = loop.create_future()
    thread = threading.Thread(target=_compute, args=(work, loop, found), name=what, daemon=True)
    thread.start()
    try:
        async with asyncio.timeout(most):
            return await asyncio.shield(found)
    except TimeoutError:
        raise InputError(what, got=f"more than {most:g} s of work", allowed="something shorter") from None
    finally:
        if not found.done() and thread.ident is not None:
            found.cancel()
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(_StoppedError))


def _compute(work: Callable[[], Found], loop: asyncio.AbstractEventLoop, found: asyncio.Future[Found]) -> None:
    with contextlib.suppress(_StoppedError, RuntimeError):  # stopped; or the loop is gone
        try:
            value = work()
        except Exception as error:
            loop.call_soon_threadsafe(_tell, found, partial(found.set_exception, error))
        else:
            loop.call_soon_threadsafe(_tell, found, partial(found.set_result, value))


def _tell(found: asyncio.Future[Found], tell: Callable[[], object]) -> None:
    if not found.done():
        tell()
