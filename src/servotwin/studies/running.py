"""Run the chunks of a plan wherever an executor takes them, and put what comes back into one table."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ServotwinError
from servotwin.simulation.many import own_threads, workers_of
from servotwin.simulation.remarks import COLUMNS
from servotwin.simulation.status import Status
from servotwin.studies.jobs import run_chunk

if TYPE_CHECKING:
    from servotwin.studies.folder import Folder
    from servotwin.studies.plan import Plan

Columns = dict[str, NDArray[Any]]

_AHEAD = 64  # chunks that wait at an executor whose size is not known
_NAMES = np.array([status.name for status in Status])


def table_names(plan: Plan) -> tuple[str, ...]:
    """Return the names of the columns of the table."""
    return ("lane", *plan.columns, *plan.followed, *plan.job.metrics, "status", "ended", *COLUMNS.values())


def run_plan(plan: Plan, folder: Folder | None, executor: Any, show: Callable[[int], object]) -> Columns:
    """Return the table of all lanes; chunks that the folder has are read, and others are written to it.

    Parameters
    ----------
    plan : Plan
    folder : Folder, optional
    executor : optional
        Anything with the `submit` of `concurrent.futures`; threads on all cores unless given.
    show : callable
        Is told how many lanes are done.
    """
    table: Columns = {"lane": np.arange(plan.lanes), **plan.columns, **plan.followed}
    table |= {name: np.empty(plan.lanes) for name in plan.job.metrics}
    table |= {"status": np.full(plan.lanes, Status.COMPLETED.name, _NAMES.dtype), "ended": np.empty(plan.lanes),
              **{name: np.empty(plan.lanes) for name in COLUMNS.values()}}
    names, missing, done = table_names(plan), [], 0
    for k in range(plan.chunks):
        if folder is None or not folder.has(k):
            missing.append(k)
            continue
        part = _slice(plan, k)
        for name, column in folder.read(k, names, part.stop - part.start).items():
            table[name][part] = column
        done += part.stop - part.start
        show(done)
    with closing(_finished(plan, missing, executor)) as running:
        for k, found in running:
            part = _slice(plan, k)
            for name, column in found.items():
                table[name][part] = column
            table["status"][part] = _NAMES[_place_of(found["status"])]
            if folder is not None:
                folder.write(k, {name: table[name][part] for name in names})
            done += part.stop - part.start
            show(done)
    return {name: table[name] for name in names}


def _place_of(codes: NDArray[np.int8]) -> NDArray[np.int64]:
    places = {status.code: k for k, status in enumerate(Status)}
    return np.array([places[code] for code in codes.tolist()])


def _slice(plan: Plan, k: int) -> slice:
    return slice(k * plan.chunk, min((k + 1) * plan.chunk, plan.lanes))


def _finished(plan: Plan, missing: list[int], given: Any) -> Generator[tuple[int, Mapping[str, Any]]]:
    """Run chunks, some ahead; return number and columns of each, in order."""
    executor = own_threads(os.getpid()) if given is None else given
    known = isinstance(getattr(executor, "_max_workers", None), int)
    ahead = 2 * workers_of(executor) if known else _AHEAD
    waiting, flying = deque(missing), deque[tuple[int, Any]]()
    try:
        while waiting or flying:
            while waiting and len(flying) < ahead:
                k = waiting.popleft()
                flying.append((k, executor.submit(run_chunk, plan.job, *plan.part(k))))
            k, future = flying.popleft()
            yield k, future.result()
    except ServotwinError:
        raise
    except Exception as error:
        if given is None:
            raise
        raise InputError("executor", got=f"{type(error).__name__}: {error}",
                         allowed="one that finishes every chunk; those that it has finished are kept") from None
    finally:
        for _, future in flying:  # only after an error or an interrupt are there any
            future.cancel()
