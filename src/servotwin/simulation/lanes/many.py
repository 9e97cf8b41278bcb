"""`simulate_many`: many servos at once, lane by lane, on all cores or wherever an executor takes them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.models.engine.memory import ACCURACY
from servotwin.simulation.frames import times_asked
from servotwin.simulation.lanes.batch import Batch, Failure
from servotwin.simulation.lanes.forms import goes_together
from servotwin.simulation.lanes.inputs import LaneInputs, framed, lanes_of
from servotwin.simulation.lanes.packed import Asked, Raw, Work
from servotwin.simulation.lanes.packing import Chunk, Commands, groups
from servotwin.simulation.lanes.whole_runs import run as run_lanes
from servotwin.simulation.progress import Crew, Progress, memory_limit, shown
from servotwin.simulation.remarks import lane_remarks, warn_of
from servotwin.simulation.start import Status, accuracy_of
from servotwin.units import is_finite, is_masked

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, DTypeLike

    from servotwin import loads
    from servotwin.models import Model
    from servotwin.signals import Signal

    _Load = loads.Load | loads.Part | None

_MOST_LANES = 65536  # of a chunk
_LEAST_LANES = 256  # fewer do not pay for the way to a worker
_CHUNK_BYTES = 16e6  # of a chunk's raw fields
_SMALL = 1e7  # bytes of outputs that any machine has
_CHUNK_FRAMES = 2e7  # of a chunk's lanes together: seconds, and an interrupt waits no longer

Indices = NDArray[np.int64]


def simulate_many(
    model: Model, command: Signal | Sequence[Signal], *, duration: float,
    load: _Load | Sequence[_Load] = None, parameters: Mapping[str, Any] | None = None,
    output_step: float | None = None, output_times: ArrayLike | None = None,
    outputs: Sequence[str] = ("output_angle",), initial: Mapping[str, ArrayLike] | None = None,
    dtype: DTypeLike = "float64", seeds: ArrayLike | None = None, executor: Any = None, chunk: int | None = None,
    progress: Progress = False, accuracy: float = ACCURACY, watch_supply: bool = False,
) -> Batch:
    """Simulate many servos (lanes) from t = 0 to `duration`.

    A value that differs from lane to lane is an array, or a sequence, of one length B; all are zipped, and a single
    value holds for all lanes. `grid` makes arrays of all combinations.

    Parameters
    ----------
    model : Model
    command : Signal or sequence of Signal
    duration : float
        Positive [s].
    load : Load or sequence of Load, optional
        Nothing unless given.
    parameters : mapping, optional
        Number or array (SI) by dotted name, of the servo ("electronics.stretcher_gain") or of the load
        ("load.inertia", "load.pendulum.mass").
    output_step, output_times
        As in `simulate`; the same for all lanes.
    outputs : sequence of str
        Names of the signals that are computed and kept.
    initial : mapping, optional
        Initial values by state name (SI), each a number or an array.
    dtype : str
        "float64", or "float32": half the memory, often faster, and angles good to about 1e-5 rad.
    seeds : int or array of int, optional
        Of each lane's noise; the number of the lane unless given.
    executor : optional
        Anything with the `submit` of `concurrent.futures.Executor`; threads on all cores unless given. It is not shut
        down; a pool of which a process was killed is replaced. Results do not depend on it.
    chunk : int, optional
        Lanes that go to a worker at once; chosen so that memory stays bounded unless given. Results do not depend on
        it.
    progress : bool or callable
        True shows a bar on stderr; a callable is called with the lanes that are done and all of them.
    accuracy : float
        As in `simulate` [rad].
    watch_supply : bool
        Whether `Batch.lowest_voltage` is kept, for which lanes go from event to event: it takes six times as long.

    Returns
    -------
    Batch

    Raises
    ------
    InputError
        On bad input, before anything runs; names lane and parameter. Or if the executor fails. A lane that ends early
        says so in `Batch.status`, is nan from there on, and harms no other.

    Warns
    -----
    UserWarning
        As `simulate` does, once for all lanes.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> batch = st.simulate_many(model, st.signals.step(0.0, 60.0, unit="deg"), duration=1.0, output_times=[1.0],
    ...                          parameters={"load.torque": np.linspace(0.0, 0.3, 4)})
    >>> batch["output_angle"].shape
    (4, 1)
    """
    lanes = lanes_of(model, command, load, parameters, initial, seeds)
    if is_finite(duration) and duration > 0.0:
        warn_of(lanes.model.servo, lanes.commands, duration,
                voltages=lanes.numbers.get("supply.open_circuit_voltage"), known=lanes.headers)
    return simulate_lanes(lanes, duration=duration, output_step=output_step, output_times=output_times,
                          outputs=outputs, dtype=dtype, executor=executor, chunk=chunk, progress=progress,
                          accuracy=accuracy, watched=bool(watch_supply))


def simulate_lanes(
    lanes: LaneInputs, *, duration: float, output_step: float | None = None, output_times: ArrayLike | None = None,
    outputs: Sequence[str] = ("output_angle",), dtype: DTypeLike = "float64", executor: Any = None,
    chunk: int | None = None, progress: Progress = False, accuracy: float = ACCURACY, nearly: bool = False,
    watched: bool = False,
) -> Batch:
    """Return what `simulate_many` does of lanes that were zipped before, without warnings.

    With `nearly`, a spring or a pendulum of a digital servo counts with its torque in the middle of each tick. Least
    voltages of supplies that are `watched` are kept.
    """
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("duration", got=duration, allowed="a positive number of seconds")
    crew = Crew(executor)
    if not (isinstance(progress, bool) or callable(progress)):
        raise InputError("progress", got=progress, allowed="True, False or a function of the lanes done and of all")
    times = np.array(times_asked(duration, output_step, output_times))  # a copy: it becomes read-only
    names = _outputs(lanes.model, lanes.loads, outputs)
    asked = Asked(float(duration), times, names, real_type(dtype), accuracy_of(accuracy), nearly, watched)
    lanes = framed(lanes, asked.duration)
    commands = Commands(lanes)
    packs = _packs(lanes, commands, asked, chunk, crew.workers)
    signals = _space(lanes, asked)
    done = 0
    status, ended = np.zeros(lanes.count, dtype=np.int8), np.full(lanes.count, asked.duration)
    refused, marks, kernel = np.empty(lanes.count), *np.empty((2, lanes.count), dtype=np.int8)
    lowest = np.empty((lanes.count, 2))
    with crew, shown(progress, lanes.count, "simulate_many") as show, closing(_run(packs, asked, crew)) as running:
        for which, raw, values in running:
            place: Any = which
            if which[-1] - which[0] == len(which) - 1:
                place = slice(which[0], which[-1] + 1)  # written faster than a list of lanes
            with np.errstate(over="ignore"):  # beyond float32 it is inf
                for name, column in values.items():
                    signals[name][place] = column
            status[place], ended[place] = raw.status, raw.ended
            refused[place], marks[place], kernel[place] = raw.refused, raw.marks, raw.kernel
            lowest[place] = raw.lowest
            done += len(which)
            show(done)
    arrays: list[NDArray[Any]] = [times, status, *signals.values()]
    for array in arrays:
        array.setflags(write=False)
    failures = tuple(Failure(int(lane), float(ended[lane]), Status.of_code(int(status[lane])).message)
                     for lane in np.flatnonzero(status))
    return Batch(time=times, status=status, failures=failures, remarks=lane_remarks(refused, marks, asked.duration),
                 duration=asked.duration, signals=signals, lanes=lanes, run_by=kernel, lowest=lowest)


def grid(values: Mapping[str, ArrayLike] | None = None, /, **more: ArrayLike) -> dict[str, NDArray[Any]]:
    """Return all combinations of some values, as one array per name; the first name varies slowest.

    Parameters
    ----------
    values : mapping of str to array, shape (n,)
        By dotted name.
    **more
        The same, for names without a dot.

    Examples
    --------
    >>> grid({"electronics.stretcher_gain": [60.0, 120.0], "load.inertia": [0.0, 1e-3]})["load.inertia"].tolist()
    [0.0, 0.001, 0.0, 0.001]
    """
    if values is not None and not isinstance(values, Mapping):
        raise InputError("grid", got=values, allowed="a mapping of names to lists of values")
    twice = [name for name in more if name in (values or {})]
    if twice:
        raise InputError(f"grid: {twice[0]}", got="two lists", allowed="one list of values for each name")
    axes = {name: _axis(name, axis) for name, axis in {**(values or {}), **more}.items()}
    total = math.prod(axis.size for axis in axes.values())
    if total * sum(axis.itemsize for axis in axes.values()) > 0.8 * memory_limit():
        raise InputError("grid", got=f"{total:.3g} combinations", allowed="what fits into memory: take fewer values")
    found, after = {}, total
    for name, axis in axes.items():
        after //= axis.size
        found[name] = np.tile(np.repeat(axis, after), total // (after * axis.size))
    return found


def _axis(name: str, values: ArrayLike) -> NDArray[Any]:
    try:
        axis = np.atleast_1d(np.asarray(values))
    except ValueError:  # rows of unequal lengths
        axis = np.empty((0, 0))
    if axis.ndim != 1 or axis.size == 0 or is_masked(values):
        raise InputError(f"grid: {name}", got=values, allowed="a list of at least one value, none of them masked")
    return axis


def _outputs(model: Model, bodies: Sequence[loads.Load], outputs: Sequence[str]) -> tuple[str, ...]:
    available = model.signals_with(*bodies)
    names = (outputs,) if isinstance(outputs, str) else outputs
    try:
        asked = dict.fromkeys(names)
    except TypeError:
        raise InputError("outputs", got=outputs, allowed="names of signals") from None
    for name in asked:
        if name != "time" and name not in available:
            raise UnknownNameError(f"signal of {type(model).__name__}", name, ("time", *available))
    asked.pop("time", None)  # it is always there
    if not asked:
        raise InputError("outputs", got=outputs, allowed="at least one of " + ", ".join(available))
    return tuple(asked)


def real_type(dtype: DTypeLike) -> str:
    """Return the name of a type of numbers, or raise InputError."""
    try:
        name = "" if dtype is None else np.dtype(dtype).name
    except TypeError:
        name = ""
    if name not in ("float64", "float32"):
        raise InputError("dtype", got=dtype, allowed='"float64" or "float32"')
    return name


def _space(lanes: LaneInputs, asked: Asked) -> dict[str, NDArray[Any]]:
    """Return the arrays of the outputs, if the machine has the memory."""
    shape = (lanes.count, len(asked.times))
    size = len(asked.outputs) * math.prod(shape) * np.dtype(asked.dtype).itemsize
    memory = memory_limit() if size > _SMALL else math.inf
    try:
        if size > 0.8 * memory:
            raise MemoryError
        return {name: np.empty(shape, dtype=asked.dtype) for name in asked.outputs}
    except MemoryError:
        room = f" ({memory / 1e9:.3g} GB)" if math.isfinite(memory) else ""
        raise InputError(
            "outputs x lanes x times", got=f"{len(asked.outputs)} x {shape[0]} x {shape[1]}, {size / 1e9:.3g} GB",
            allowed=f"what fits into memory{room}: take fewer of them, or float32") from None


class _Pack(NamedTuple):
    """Lanes of one structure that are packed together, the raw fields that they need, and how many run at once."""

    lanes: Chunk
    fields: tuple[str, ...]
    size: int


def _packs(lanes: LaneInputs, commands: Commands, asked: Asked, chunk: int | None, workers: int) -> list[_Pack]:
    """Check every lane, and return them in packs."""
    if chunk is not None and (isinstance(chunk, bool) or not isinstance(chunk, int | np.integer) or chunk < 1):
        raise InputError("chunk", got=chunk, allowed="a whole number of lanes, at least 1")
    found: list[_Pack] = []
    for group in groups(lanes, commands):
        whole = Chunk(lanes, commands, group)
        whole.check(asked.duration)
        fields = whole.fields(asked)
        frames = float(np.max(whole.frames(asked.duration)))
        parts = workers if goes_together(whole.numbers, whole.chip is not None) else 2 * workers
        size = chunk or _chunk_size(len(group), len(asked.times) * len(fields), frames, parts)
        most = max(size, _MOST_LANES)
        found += [_Pack(whole.part(k, k + most), fields, size) for k in range(0, len(group), most)]
    return found


def _chunk_size(lanes: int, numbers_per_lane: int, frames_per_lane: float, parts: int) -> int:
    """Return how many lanes go to a worker at once: in so many parts, none too large for memory or too long."""
    for_all = math.ceil(lanes / parts)
    in_memory = max(1, int(_CHUNK_BYTES / (8 * numbers_per_lane)))
    in_time = max(1, int(_CHUNK_FRAMES / max(frames_per_lane, 1.0)))
    return min(max(for_all, _LEAST_LANES), in_memory, in_time, _MOST_LANES)


def _run(packs: list[_Pack], asked: Asked,
         crew: Crew) -> Generator[tuple[Indices, Raw, dict[str, NDArray[np.float64]]]]:
    """Run all lanes, a few chunks at a time; return lanes, raw fields and outputs of each chunk."""
    flying = deque[Chunk]()

    def pieces() -> Iterator[tuple[Work]]:
        for piece, work in _chunks(packs, asked):
            flying.append(piece)
            yield (work,)

    with closing(crew.done(run_lanes, pieces(), finishing="chunk of lanes")) as running:
        for raw in running:
            piece = flying.popleft()
            yield piece.which, raw, piece.outputs(asked, raw)


def _chunks(packs: list[_Pack], asked: Asked) -> Iterator[tuple[Chunk, Work]]:
    """Return all chunks with their work, one after the other."""
    for pack in packs:
        work = Work(pack.lanes.packed(asked.accuracy), asked, pack.fields)
        for start in range(0, work.packed.size, pack.size):
            yield pack.lanes.part(start, start + pack.size), work.part(start, start + pack.size)
