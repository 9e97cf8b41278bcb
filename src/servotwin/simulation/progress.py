"""How far something is that lasts, a bar or a plain line on stderr, and whoever does its pieces of work."""

from __future__ import annotations

import contextlib
import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from functools import cache
from typing import Any

from servotwin.errors import InputError, ServotwinError

# --- Progress on stderr -----------------------------------------------------------------------------------------------

Progress = bool | Callable[[int, int], object]
_PATIENCE = 1.0  # s before the bar appears
_BETWEEN = 10.0  # s between lines where there is no terminal


def lines(what: str, clock: Callable[[], float] = time.monotonic) -> Callable[[float, str], None]:
    """Return a function that is called with the share done and a text, and writes a line to stderr every 10 s.

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
    """Give a function that is called with how many lanes are done.

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


# --- Executors of pieces of work --------------------------------------------------------------------------------------

_MANY = 32  # workers of an executor that does not say
_TRIES = 4  # of a piece whose worker is lost: more, and it is the piece that ends the worker


def memory_limit() -> float:
    """Return how much memory this process may use [bytes]; inf where that is not known."""
    sizes = [math.inf]
    try:
        sizes.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not on Windows
        pass
    try:
        with open("/sys/fs/cgroup/memory.max", encoding="ascii") as file:  # the limit of a container
            sizes.append(float(file.read()))
    except (OSError, ValueError):
        pass
    return min(sizes)


def workers_of(executor: Any) -> int:
    """Return how many jobs run at once: what the executor says, else the cores of this process."""
    own = getattr(executor, "_max_workers", None)
    if isinstance(own, int) and own > 0:
        return own
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def own_threads(process: int) -> ThreadPoolExecutor:
    """Return the threads of this process, kept from call to call; a forked child has none of its parent's."""
    return ThreadPoolExecutor(workers_of(None), thread_name_prefix="servotwin")


class Here:
    """An executor that does the work when it is handed in, in the thread that hands it in.

    It is for work that is one of many pieces already: that may not wait for the threads that it runs in.

    Examples
    --------
    >>> Here().submit(abs, -1).result()
    1
    """

    _max_workers = 1

    def submit(self, work: Callable[..., Any], /, *arguments: Any) -> Future[Any]:
        """Return the finished work."""
        future: Future[Any] = Future()
        future.set_result(work(*arguments))
        return future


HERE = Here()


class Crew:
    """An executor of pieces of work that outlives the loss of one.

    A pool of processes of which one was killed can do nothing more. A fresh pool of as many takes its place, and what
    was lost is done again; the executor that was given stays as it is, and is not shut down. A piece that it fails at,
    or loses, is handed in again.

    Parameters
    ----------
    executor : optional
        Anything with the `submit` of `concurrent.futures`; threads on all cores unless given.

    Raises
    ------
    InputError
        If it has no `submit`.

    Examples
    --------
    >>> with Crew() as crew:
    ...     list(crew.done(max, [(1, 2), (5, 3)]))
    [2, 5]
    """

    def __init__(self, executor: Any = None) -> None:
        if executor is not None and (isinstance(executor, type) or not callable(getattr(executor, "submit", None))):
            raise InputError("executor", got=executor, allowed="one with a submit method, as in concurrent.futures")
        self._given = executor
        self._fresh: ProcessPoolExecutor | None = None

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, *ended: object) -> None:
        if self._fresh is not None:
            self._fresh.shutdown(cancel_futures=True)

    @property
    def is_here(self) -> bool:
        """Whether the threads of this process do the work."""
        return self._given is None

    @property
    def workers(self) -> int:
        """How many pieces are done at once: as many as there are cores, or what an executor says; else many."""
        known = self.is_here or isinstance(getattr(self._given, "_max_workers", None), int)
        return workers_of(self._given) if known else _MANY

    def done(self, work: Callable[..., Any], pieces: Iterable[tuple[Any, ...]], *,
             finishing: str = "piece of work") -> Generator[Any]:
        """Do the work of each piece, some ahead, and return what comes of it in the order of the pieces.

        Parameters
        ----------
        work : callable
            Of the items of a piece; picklable where the executor asks for that.
        pieces : iterable of tuple
        finishing : str
            Name of the pieces that an executor has to finish, in words.

        Raises
        ------
        InputError
            If the executor that was given fails. Errors of the work itself pass through.
        """
        try:
            with closing(self._in_order(work, iter(pieces))) as running:
                yield from running
        except ServotwinError:
            raise
        except Exception as error:
            if self.is_here:
                raise
            raise InputError("executor", got=f"{type(error).__name__}: {error}",
                             allowed=f"one that finishes every {finishing}") from None

    def _in_order(self, work: Callable[..., Any], waiting: Iterator[tuple[Any, ...]]) -> Generator[Any]:
        flying, tries = deque[tuple[tuple[Any, ...], Any]](), 0
        try:
            while True:
                while len(flying) < 2 * self.workers and (piece := next(waiting, None)) is not None:
                    flying.append((piece, self._submit(work, piece)))
                if not flying:
                    return
                try:
                    result = flying[0][1].result()
                except BrokenProcessPool:
                    tries += 1
                    if tries >= _TRIES:
                        raise
                    self._renew()
                    flying = deque((piece, self._again(work, piece, future)) for piece, future in flying)
                    continue
                except Exception as error:  # a cluster may lose what was finished by a worker that was killed
                    tries += 1
                    if self.is_here or isinstance(error, ServotwinError) or tries >= _TRIES:
                        raise
                    flying[0] = flying[0][0], self._submit(work, flying[0][0])
                    continue
                flying.popleft()
                tries = 0
                yield result
        finally:
            for _, future in flying:  # only after an error or an interrupt are there any
                future.cancel()

    def _submit(self, work: Callable[..., Any], piece: tuple[Any, ...]) -> Any:
        try:
            return self._at_work.submit(work, *piece)
        except BrokenProcessPool:
            self._renew()
            return self._at_work.submit(work, *piece)

    @property
    def _at_work(self) -> Any:
        return self._fresh or (own_threads(os.getpid()) if self._given is None else self._given)

    def _again(self, work: Callable[..., Any], piece: tuple[Any, ...], future: Any) -> Any:
        """Return what a piece was finished as before its pool broke, or hand it in again."""
        kept = future.done() and not future.cancelled() and future.exception() is None
        return future if kept else self._submit(work, piece)

    def _renew(self) -> None:
        """Start a pool like the one that is broken."""
        old: Any = self._at_work
        self._fresh = ProcessPoolExecutor(
            workers_of(old), mp_context=getattr(old, "_mp_context", None),
            initializer=getattr(old, "_initializer", None), initargs=getattr(old, "_initargs", ()))
