"""`sweep`: a servo whose parameters are not known exactly, or differ from one to the next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.simulation.progress import Crew, Progress, shown
from servotwin.simulation.remarks import COLUMNS, warn_of
from servotwin.simulation.start import Status
from servotwin.studies.kinds import Distribution
from servotwin.studies.lane_metrics import run_chunk
from servotwin.studies.plan import planned
from servotwin.studies.study import Folder, Study

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.signals import Signal
    from servotwin.studies.plan import Plan


# --- Run the chunks of a plan wherever an executor takes them, and put what comes back into one table -----------------

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
        Called with how many lanes are done.
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
            places = {status.code: k for k, status in enumerate(Status)}
            table["status"][part] = _NAMES[[places[code] for code in found["status"].tolist()]]
            if folder is not None:
                folder.write(k, {name: table[name][part] for name in names})
            done += part.stop - part.start
            show(done)
    return {name: table[name] for name in names}


def _slice(plan: Plan, k: int) -> slice:
    return slice(k * plan.chunk, min((k + 1) * plan.chunk, plan.lanes))


# --- `sweep`: a servo whose parameters are not known exactly, or differ from one to the next --------------------------

def sweep(
    model: Model, command: Signal, *, duration: float, vary: Mapping[str, Distribution | str] | None = None,
    draws: Mapping[str, Any] | None = None, lanes: int | None = None, load: Any = None, seed: int = 0,
    sampling: str = "latin-hypercube", truncate: bool = False, metrics: Sequence[str] | None = None,
    output_step: float = 0.01, executor: Any = None, directory: str | Path | None = None, resume: bool = False,
    file_format: str = "csv", chunk: int | None = None, progress: Progress = False,
) -> Study:
    """Simulate many servos with parameters that are drawn, and keep a few metrics of each.

    Parameters
    ----------
    model : PulseServo or BoundedServo
        The nominal servo.
    command : Signal
        The same for all lanes; an angle becomes a pulse by each lane's own calibration.
    duration : float
        Positive [s].
    vary : mapping of str to Distribution or str, optional
        Distribution by dotted name of servo or load: one of `distributions`, or words such as ``"normal:10%"`` and
        ``"uniform:4us..8us"``. They are independent of each other. A number that several parameters follow from,
        such as ``"sheet.no_load_speed"`` or ``"output_torque_constant"``, is one of the names that `stated` gives.
    draws : mapping of str to array, shape (n,), optional
        Values (SI) that were drawn elsewhere, by dotted name; lane k takes the k-th of each.
    lanes : int, optional
        How many servos; 1000, or as many as there are draws, unless given.
    load : Load, optional
        Nothing unless given.
    seed : int
        Of all that is random.
    sampling : str
        "latin-hypercube", "sobol" or "random".
    truncate : bool
        Whether distributions are cut off at the physical range; otherwise a draw outside is an error.
    metrics : sequence of str, optional
        Names in `METRICS`, or ``end_`` and the name of a signal; those usual for the command unless given.
    output_step : float
        How often the metrics look at the solution [s]; besides they look at a step and four times after each pulse.
    executor : optional
        Anything with the `submit` of `concurrent.futures`, such as a client of dask; threads on all cores unless
        given. It is not shut down. Results do not depend on it.
    directory : str or Path, optional
        Folder that the study is written to, chunk by chunk.
    resume : bool
        Whether a study that the folder holds unfinished is continued.
    file_format : str
        Of the lanes in the folder: "csv" or "parquet".
    chunk : int, optional
        Lanes of a chunk; chosen from the numbers of lanes and samples unless given. Results do not depend on it.
    progress : bool or callable
        True shows a bar on stderr; a callable is called with the lanes that are done and all of them.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        Or one of its kinds, on bad input, before anything runs; names parameter and lane.
    OutputError
        If the folder cannot be written; what is finished is kept.

    Warns
    -----
    UserWarning
        As `simulate` does, once for all lanes.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> study = st.sweep(model, st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0, lanes=64,
    ...                  vary={"motor.torque_constant": "normal:10%", "load.inertia": "uniform:0..2e-3"})
    >>> study.tornado("rise_time").bars[0].name
    'motor.torque_constant'
    """
    Crew(executor)  # raises what is wrong with it before anything runs
    if not (isinstance(progress, bool) or callable(progress)):
        raise InputError("progress", got=progress, allowed="True, False or a function of the lanes done and of all")
    plan = planned(model, command, duration=duration, vary=vary, draws=draws, lanes=lanes, load=load, seed=seed,
                   sampling=sampling, truncate=truncate, metrics=metrics, output_step=output_step, chunk=chunk)
    warn_of(model.servo, [command], duration, voltages=plan.columns.get("supply.open_circuit_voltage"))
    folder = None
    if directory is not None:
        folder = Folder(directory, plan.definition, file_format=file_format, resume=resume)
    moved = run_chunk(plan.job, *plan.one_at_a_time())
    with shown(progress, plan.lanes, "sweep") as show:
        table = run_plan(plan, folder, executor, show)
    study = Study(plan=plan, table=table, moved={name: moved[name] for name in plan.job.metrics})
    if folder is not None:
        folder.write_summary(study.summary())
    for column in table.values():
        column.setflags(write=False)
    return study
