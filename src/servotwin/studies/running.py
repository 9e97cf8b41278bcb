"""Run the chunks of a plan wherever an executor takes them, and put what comes back into one table."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.simulation.progress import Crew
from servotwin.simulation.remarks import COLUMNS
from servotwin.simulation.start import Status
from servotwin.studies.jobs import run_chunk

if TYPE_CHECKING:
    from servotwin.studies.folder import Folder
    from servotwin.studies.plan import Plan

Columns = dict[str, NDArray[Any]]

_FINISHING = "chunk; those that it has finished are kept"
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
    with Crew(executor) as crew, closing(crew.done(
            run_chunk, ((plan.job, *plan.part(k)) for k in missing), finishing=_FINISHING)) as running:
        for k, found in zip(missing, running, strict=True):
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
