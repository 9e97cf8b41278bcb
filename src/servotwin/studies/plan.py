"""A study before it runs: everything checked, every number drawn, and all that defines it as one mapping."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import parameters
from servotwin.errors import InputError, ParameterError, UnknownNameError
from servotwin.loads import Load, as_load
from servotwin.parameters.groups import AT_LEAST_ONE, FRACTION, NOT_NEGATIVE, POSITIVE
from servotwin.simulation.lanes.inputs import _PARTS, LOAD_NAMES, check_name, lanes_of
from servotwin.simulation.lanes.packing import Chunk, Commands, groups
from servotwin.simulation.progress import memory_limit
from servotwin.studies.joint import DIMENSIONS, TINY, Together
from servotwin.studies.kinds import ENDS, Distribution, Truncated, distribution_of
from servotwin.studies.lane_metrics import Job, checked_metrics, decision_times, output_times, step_time
from servotwin.units import is_finite, si_unit

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.signals import Signal


# --- Numbers that can be varied: of a dotted name, the dimension, the physical range and the nominal value ------------

_RANGES = {POSITIVE: (TINY, math.inf), NOT_NEGATIVE: (0.0, math.inf), AT_LEAST_ONE: (1.0, math.inf),
           FRACTION: (0.0, 1.0)}
_PLACES_OF_JOINTS = ("sheet.", "calibration.", "output_")
_OF_LOAD = {
    "load.inertia": "inertia", "load.viscous_friction": "torque per speed", "load.torque": "torque",
    "load.coulomb_torque": "torque", "load.pendulum.mass": "mass", "load.pendulum.length": "length",
    "load.pendulum.inertia": "inertia", "load.pendulum.hanging_angle": "angle",
    "load.pendulum.gravity": "acceleration", "load.spring.stiffness": "torque per angle",
    "load.spring.rest_angle": "angle", "load.flexible.stiffness": "torque per angle",
    "load.flexible.inertia": "inertia", "load.flexible.damping": "torque per speed",
    "load.flexible.viscous_friction": "torque per speed", "load.flexible.mass": "mass",
    "load.flexible.length": "length", "load.flexible.hanging_angle": "angle", "load.flexible.gravity": "acceleration",
}


class Parameter(NamedTuple):
    """A number or word of servo or load that may differ from lane to lane.

    Parameters
    ----------
    name : str
        Dotted.
    dimension : str
        Of `servotwin.units`; "word" for words.
    lower, upper : float
        Least and largest possible value (SI).
    allowed : str
        The range in words.
    nominal : float, str or None
        Value of the servo or the load (SI); None where it says nothing.
    """

    name: str
    dimension: str
    lower: float
    upper: float
    allowed: str
    nominal: float | str | None


def dimension_of(name: str) -> str:
    """Return the dimension (of `servotwin.units`) of a dotted name; "word" for words.

    Examples
    --------
    >>> dimension_of("motor.armature_resistance"), dimension_of("load.pendulum.mass")
    ('resistance', 'mass')
    >>> dimension_of("sheet.stall_torque")
    'torque'
    """
    if name in DIMENSIONS:
        return DIMENSIONS[name]
    if name in _OF_LOAD:
        return _OF_LOAD[name]
    return parameters.dimension_of(name)


def parameter(name: str, model: Model, load: Load) -> Parameter:
    """Return what is known of a dotted name, or of a number that others follow from.

    Raises
    ------
    UnknownNameError, ParameterError, LoadError
        If there is no such number, the model does not read it, or it is a table.
    """
    if name in LOAD_NAMES:
        return _of_load(name, load)
    if name not in (*model.requires, *model.optional):
        together = Together(model)
        if name.startswith(_PLACES_OF_JOINTS):
            return _of_joint(name, together, model)
        if name not in together.unread:
            check_name(model, name)
    group, _, key = name.partition(".")
    metadata = parameters.GROUPS[group].__dataclass_fields__[key].metadata
    rule, dimension, nominal = metadata["rule"], dimension_of(name), model.servo.get(name)
    if rule == "table" or isinstance(nominal, tuple):
        raise ParameterError(f"vary {name}", got="a table", allowed="a number or a word")
    if isinstance(rule, tuple):
        return Parameter(name, dimension, -math.inf, math.inf, " or ".join(rule), nominal)
    lower, upper = _RANGES.get(rule, (-math.inf, math.inf))
    return Parameter(name, dimension, lower, upper, f"{rule} [{si_unit(dimension)}]", nominal)


def _of_joint(name: str, together: Together, model: Model) -> Parameter:
    if name not in DIMENSIONS:
        raise UnknownNameError("number to draw", name, DIMENSIONS)
    if name not in together.coordinates:
        raise ParameterError(f"vary {name}", got=f"a number from which nothing of {model.servo.name!r} follows",
                             allowed=", ".join(together.coordinates) or "parameters of servo and load")
    one = together.coordinates[name]
    rule = POSITIVE if one.lower > 0.0 else NOT_NEGATIVE
    allowed = f"{rule}{'' if math.isinf(one.upper) else f', at most {one.upper:g}'} [{si_unit(one.dimension)}]"
    return Parameter(name, one.dimension, one.lower, one.upper, allowed, one.nominal)


def _of_load(name: str, load: Load) -> Parameter:
    _, *part, key = name.split(".")
    owner: Any = getattr(load, part[0]) if part else load
    kind = _PARTS[part[0]] if part else type(load)
    lower = TINY if key in getattr(kind, "positive", ()) else 0.0 if key in kind.not_negative else -math.inf
    allowed = "a finite positive number" if lower > 0.0 else "a finite number" + " of at least 0" * (lower == 0.0)
    nominal = owner.moment_of_inertia if part and key == "inertia" else getattr(owner, key)
    return Parameter(name, _OF_LOAD[name], lower, math.inf, f"{allowed} [{si_unit(_OF_LOAD[name])}]", nominal)


# --- The parameters of all lanes: drawn from distributions, or taken from a table of draws ----------------------------

Column = NDArray[Any]

SAMPLINGS = ("latin-hypercube", "sobol", "random")
_INSIDE = 2.0**-53  # a probability is never 0 or 1, where quantiles are infinite


def distributions_of(vary: Mapping[str, Distribution | str], model: Model, load: Load, *,
                     truncate: bool) -> dict[str, Distribution]:
    """Return the distribution of each parameter, about its nominal value, sorted by name.

    Raises
    ------
    InputError
        Or one of its kinds, if a name or a distribution is not possible.
    """
    found = {}
    for name in sorted(vary):
        known = parameter(name, model, load)
        try:
            found[name] = _absolute(vary[name], known, truncate=truncate)
        except InputError as error:
            raise ParameterError(f"vary {name}: {error.what}", got=error.got, allowed=error.allowed) from None
    return found


def _absolute(given: Distribution | str, known: Parameter, *, truncate: bool) -> Distribution:
    found = distribution_of(given, known.dimension) if isinstance(given, str) else given
    if not isinstance(found, Distribution):
        raise InputError("distribution", got=given, allowed='one of st.distributions, or words such as "normal:10%"')
    if known.dimension == "word":
        wrong = [option for option in found.ends if option not in known.allowed.split(" or ")]
        if wrong:
            raise InputError("choice", got=wrong[0], allowed=known.allowed)
        return found
    if any(isinstance(end, str) for end in found.ends):
        raise InputError("choice", got=found.ends[0], allowed=known.allowed)
    if found.needs_nominal:
        if not isinstance(known.nominal, float):
            raise InputError("a spread about the nominal value", got="no nominal value",
                             allowed="an absolute distribution, such as normal:3ohm±0.3ohm")
        found = found.about(known.nominal)
    below = found.cdf(math.nextafter(known.lower, -math.inf)) if math.isfinite(known.lower) else 0.0
    if truncate and (below > 0.0 or found.cdf(known.upper) < 1.0):
        return Truncated(found, known.lower, known.upper)
    return found


def drawn(distributions: Mapping[str, Distribution], lanes: int, seed: int, sampling: str) -> dict[str, Column]:
    """Return the values of all lanes by name, each of shape (lanes,).

    Each name has random numbers of its own, found from the seed and the name; so what is drawn for one parameter does
    not depend on the others, except with "sobol", whose points fill the space of all parameters together.
    """
    points = _probabilities(tuple(distributions), lanes, seed, sampling)
    return {name: distribution.quantile(np.clip(points[name], _INSIDE, 1.0 - _INSIDE))
            for name, distribution in distributions.items()}


class Draw:
    """Parameters of servos that differ from lane to lane, as `simulate_many` takes them: checked once, drawn often.

    Parameters
    ----------
    vary : mapping of str to Distribution or str
        By dotted names, about what the model says; what is beyond the physical range is never drawn.
    model : Model

    Raises
    ------
    InputError
        Or one of its kinds, if a name or a distribution is not possible.
    """

    def __init__(self, vary: Mapping[str, Distribution | str], model: Model) -> None:
        load = as_load(None)
        self._distributions = distributions_of(vary, model, load, truncate=True)
        self._known = [parameter(name, model, load) for name in self._distributions]
        self._together = Together(model)

    def lanes(self, lanes: int, seed: int) -> dict[str, Column]:
        """Return the parameters of so many lanes that follow from what is drawn.

        Raises
        ------
        ParameterError
            If one leaves its range; names parameter and lane.
        """
        columns = drawn(self._distributions, lanes, seed, "random")
        for known in self._known:
            _check_range(columns[known.name], known, advice="")
        return {**self._together.read(columns), **self._together.follow(columns)}


def drawn_parameters(vary: Mapping[str, Distribution | str], model: Model, lanes: int, seed: int) -> dict[str, Column]:
    """Return servos that are drawn, within ranges, as `parameters` of `simulate_many`, or `variants`, take them.

    Parameters
    ----------
    vary : mapping of str to Distribution or str
        By dotted name, as of `sweep`; what follows from a number that is drawn is drawn with it.
    model : Model
    lanes : int
        How many servos.
    seed : int

    Returns
    -------
    dict of str to ndarray, shape (lanes,)
        Values (SI) by dotted name.

    Raises
    ------
    InputError
        Or one of its kinds, if a name or a distribution is not possible.
    """
    return Draw(vary, model).lanes(lanes, seed)


def noise_seeds(lanes: int, seed: int) -> NDArray[np.int64]:
    """Return the seed of each lane's noise; lane k has the same whatever the number of lanes."""
    return _stream(seed, "noise").integers(2**63, size=lanes, dtype=np.int64)


def _probabilities(names: tuple[str, ...], lanes: int, seed: int, sampling: str) -> dict[str, NDArray[np.float64]]:
    from scipy.stats import qmc

    if not names:
        return {}
    if sampling == "sobol":
        engine = qmc.Sobol(len(names), rng=_stream(seed, "sobol"))
        points = engine.random_base2(math.ceil(math.log2(lanes)))[:lanes]
        return {name: points[:, k] for k, name in enumerate(names)}
    if sampling == "random":
        return {name: _stream(seed, name).random(lanes) for name in names}
    return {name: qmc.LatinHypercube(1, rng=_stream(seed, name)).random(lanes)[:, 0] for name in names}


def _stream(seed: int, name: str) -> np.random.Generator:
    """Return random numbers of their own for each seed and name; the first of them do not depend on how many follow."""
    digest = hashlib.sha256(f"{seed} {name}".encode()).digest()
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(int.from_bytes(digest, "little"))))


def checked_table(draws: Mapping[str, Any], model: Model, load: Load) -> dict[str, Column]:
    """Return the columns of a table of draws, sorted by name.

    Raises
    ------
    InputError
        Or one of its kinds, if a name is not known, or the columns are no lists of numbers or words of one length.
    """
    if not isinstance(draws, Mapping):
        raise InputError("draws", got=type(draws).__name__, allowed="a mapping of dotted names to lists of values")
    found = {}
    for name in sorted(draws):
        known = parameter(name, model, load)
        column = np.asarray(draws[name])
        kinds = "U" if known.dimension == "word" else "iuf"
        if column.ndim != 1 or column.size == 0 or column.dtype.kind not in kinds:
            raise ParameterError(f"draws of {name}", got=draws[name], allowed=f"a list, each of it {known.allowed}")
        found[name] = column if kinds == "U" else column.astype(np.float64)
    lengths = {name: len(column) for name, column in found.items()}
    if len(set(lengths.values())) > 1:
        raise InputError("draws", got=", ".join(f"{name}: {n}" for name, n in lengths.items()),
                         allowed="columns of one length")
    return found


def check_ranges(columns: Mapping[str, Column], model: Model, load: Load, *, advice: str) -> None:
    """Raise ParameterError that names parameter and lane where a value leaves the physical range."""
    for name, column in columns.items():
        _check_range(column, parameter(name, model, load), advice=advice)


def _check_range(column: Column, known: Parameter, *, advice: str) -> None:
    if column.dtype.kind != "f":
        return
    good = np.isfinite(column) & (column >= known.lower) & (column <= known.upper)
    if not good.all():
        lane = int(np.argmin(good))
        raise ParameterError(f"{known.name} of lane {lane}", got=float(column[lane]), allowed=known.allowed + advice)


# --- A study before it runs -------------------------------------------------------------------------------------------


_USUAL_LANES = 1000
_CHUNK_NUMBERS = 2**20  # of one signal in a chunk
_MOST_CHUNK, _LEAST_CHUNK = 8192, 64  # lanes of a chunk
_LEAST_CHUNKS = 16  # so that many cores have something to do
_MOST_TIMES = 2**22  # samples of a lane
_ADVICE = "; truncate=True (--truncate) draws inside the range"


@dataclass(frozen=True, eq=False)
class Plan:
    """A study that can run.

    Parameters
    ----------
    job : Job
        Job that all chunks share.
    columns : mapping of str to ndarray, shape (lanes,)
        Drawn values, of all lanes, by dotted name (SI).
    followed : mapping of str to ndarray, shape (lanes,)
        Parameters that follow from it, by dotted name (SI).
    together : Together
        How they follow.
    seeds : ndarray of int64, shape (lanes,)
        Of each lane's noise.
    ends : mapping of str to tuple
        Of each parameter, its 5 % and 95 % value, or all options.
    nominal : mapping of str to float or str
        Value of each parameter while another one is moved.
    chunk : int
        Lanes that are worked on, and written, together.
    definition : mapping
        All that defines the study, ready for JSON.
    """

    job: Job
    columns: Mapping[str, Column]
    followed: Mapping[str, Column]
    together: Together
    seeds: NDArray[np.int64]
    ends: Mapping[str, tuple[Any, ...]]
    nominal: Mapping[str, Any]
    chunk: int
    definition: Mapping[str, Any]

    @property
    def lanes(self) -> int:
        """How many lanes there are."""
        return len(self.seeds)

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return math.ceil(self.lanes / self.chunk)

    def part(self, k: int) -> tuple[dict[str, Column], NDArray[np.int64]]:
        """Return parameters and seeds of a chunk."""
        which = slice(k * self.chunk, (k + 1) * self.chunk)
        columns = {**self.together.read(self.columns), **self.followed}
        return {name: column[which] for name, column in columns.items()}, self.seeds[which]

    def one_at_a_time(self) -> tuple[dict[str, Column], NDArray[np.int64]]:
        """Return the lanes of the tornado: the nominal one, then each end of each parameter in turn."""
        moved: list[tuple[str, Any]] = [(name, end) for name, ends in self.ends.items() for end in ends]
        columns = {name: np.array([self.nominal[name], *(
            end if which == name else self.nominal[name] for which, end in moved)]) for name in self.columns}
        parameters = {**self.together.read(columns), **self.together.follow(columns)}
        return parameters, np.repeat(self.seeds[:1], len(moved) + 1)


def planned(model: Model, command: Signal, *, duration: float, vary: Mapping[str, Distribution | str] | None,
            draws: Mapping[str, Any] | None, lanes: int | None, load: Any, seed: int, sampling: str, truncate: bool,
            metrics: Sequence[str] | None, output_step: float, chunk: int | None) -> Plan:
    """Check everything, draw everything, and return the plan.

    Raises
    ------
    InputError
        Or one of its kinds.
    """
    _check_scalars(duration=duration, output_step=output_step, seed=seed, sampling=sampling, chunk=chunk, lanes=lanes)
    if not isinstance(vary or {}, Mapping):
        raise InputError("vary", got=type(vary).__name__, allowed="a mapping of dotted names to distributions")
    lanes_of(model, command, load, None, None, None)
    job = _job(model, command, as_load(load), duration, metrics, output_step)
    drawing, advice = vary or {}, "" if truncate else _ADVICE
    table = checked_table(draws or {}, model, job.load)
    count = _count(lanes, drawing, table)
    _check_memory(count, len(drawing) + len(table) + len(job.metrics) + 3)
    distributions = distributions_of(drawing, model, job.load, truncate=truncate)
    columns = dict(sorted({**drawn(distributions, count, seed, sampling),
                           **{name: column[:count] for name, column in table.items()}}.items()))
    size = chunk or _chunk_size(count, len(job.times))
    check_ranges(columns, model, job.load, advice=advice)
    together = Together(model)
    followed = together.follow(columns)
    plan = Plan(
        job=job, columns=columns, followed=followed, together=together, seeds=noise_seeds(count, seed), chunk=size,
        ends=_ends(columns, distributions),
        nominal=_nominal(columns, model, job.load), definition={
            **_of_job(job), "output_step": float(output_step), "lanes": count, "seed": int(seed),
            "sampling": sampling, "truncate": bool(truncate), "chunk": size,
            "vary": {name: _described(drawing[name]) for name in sorted(drawing)}, "draws": sorted(table),
            "follow": list(followed), "parameters_sha256": _digest({**columns, **followed})})
    _check_lanes(job, {**together.read(columns), **followed}, plan.seeds, advice=advice)
    try:
        _check_lanes(job, *plan.one_at_a_time(), advice="")
    except InputError as error:
        raise InputError(f"one at a time: {error.what}", got=error.got, allowed=error.allowed) from None
    return plan


def _job(model: Model, command: Signal, load: Load, duration: float, metrics: Sequence[str] | None,
         output_step: float) -> Job:
    if duration / output_step > _MOST_TIMES:
        raise InputError("duration / output_step", got=f"{duration / output_step:.3g} samples",
                         allowed=f"at most {_MOST_TIMES} of a lane")
    names, start = checked_metrics(metrics, model, command, duration), step_time(command)
    times = output_times(duration, output_step, start, decision_times(model, command, duration))
    return Job(model=model, command=command, load=load, duration=float(duration), start=start, times=times,
               metrics=names)


def _chunk_size(lanes: int, times: int) -> int:
    """Return how many lanes are worked on together: the same on every machine, so that it can continue elsewhere."""
    usual = min(_CHUNK_NUMBERS // times, max(_LEAST_CHUNK, lanes // _LEAST_CHUNKS), _MOST_CHUNK)
    return 1 << (max(1, usual).bit_length() - 1)


def _check_scalars(*, duration: object, output_step: object, seed: object, sampling: object, chunk: object,
                   lanes: object) -> None:
    for name, value in (("duration", duration), ("output_step", output_step)):
        if not (is_finite(value) and value > 0.0):
            raise InputError(name, got=value, allowed="a positive number of seconds")
    for name, value, least in (("lanes", lanes, 1), ("chunk", chunk, 1), ("seed", seed, 0)):
        if value is None and name != "seed":
            continue
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value < 2**63:
            raise InputError(name, got=value, allowed=f"a whole number of at least {least}")
    if sampling not in SAMPLINGS:
        raise InputError("sampling", got=sampling, allowed=", ".join(SAMPLINGS))


def _count(lanes: int | None, drawing: Mapping[str, Any], table: Mapping[str, Column]) -> int:
    twice = [name for name in drawing if name in table]
    if twice:
        raise InputError(f"vary {twice[0]}", got="a distribution and a column of draws", allowed="one of them")
    if not (drawing or table):
        raise InputError("vary", got="nothing", allowed="at least one parameter that differs from lane to lane")
    rows = len(next(iter(table.values()))) if table else None
    if rows is None:
        return _USUAL_LANES if lanes is None else int(lanes)
    if lanes is not None and lanes > rows:
        raise InputError("lanes", got=lanes, allowed=f"at most {rows}, the rows of the draws")
    return rows if lanes is None else int(lanes)


def _check_memory(lanes: int, columns: int) -> None:
    size, memory = 3.0 * 8.0 * lanes * columns, memory_limit()
    if size > 0.8 * memory:
        raise InputError("lanes", got=f"{lanes}, which take {size / 1e9:.3g} GB",
                         allowed=f"what fits into memory ({memory / 1e9:.3g} GB)")


def _ends(columns: Mapping[str, Column], distributions: Mapping[str, Distribution]) -> dict[str, tuple[Any, ...]]:
    found: dict[str, tuple[Any, ...]] = {}
    for name, column in columns.items():
        if name in distributions:
            found[name] = distributions[name].ends
        elif column.dtype.kind == "U":
            found[name] = tuple(np.unique(column).tolist())
        else:
            found[name] = tuple(np.quantile(column, ENDS, method="inverted_cdf").tolist())
    return found


def _nominal(columns: Mapping[str, Column], model: Model, load: Load) -> dict[str, Any]:
    """Return what servo and load say, or, where they say nothing, the middle one of the draws."""
    found = {}
    for name, column in columns.items():
        known = parameter(name, model, load).nominal
        found[name] = np.sort(column)[(len(column) - 1) // 2].item() if known is None else known
    return found


def _check_lanes(job: Job, columns: Mapping[str, Column], seeds: NDArray[np.int64], *, advice: str) -> None:
    """Raise where a lane cannot run; names the lane."""
    check_ranges(columns, job.model, job.load, advice=advice)
    lanes = lanes_of(job.model, job.command, job.load, columns, None, seeds)
    commands = Commands(lanes)
    for group in groups(lanes, commands):
        Chunk(lanes, commands, group).check(job.duration)


def _of_job(job: Job) -> dict[str, Any]:
    servo, command = job.model.servo, job.command
    load: dict[str, Any] = {name: value for name, value in asdict(job.load).items() if value}
    return {
        "model": type(job.model).__name__, "servo": servo.name,
        "parameters": {name: _plain(servo.get(name)) for name in servo.names()},
        "command": {"unit": command.unit, "initial": command.initial, "frame_period": command.frame_period,
                    "edges": _plain(command.edges), "silences": str(command.silences),
                    "pieces": [list(piece) for piece in command.pieces.table]},
        "load": json.loads(json.dumps(load, default=_plain)), "duration": job.duration,
        "metrics": list(job.metrics),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(x) for x in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _described(given: Distribution | str) -> Any:
    return given if isinstance(given, str) else given.described()


def _digest(columns: Mapping[str, Column]) -> str:
    """Return the fingerprint of all parameters: they are the same to the last bit, or it differs."""
    found = hashlib.sha256()
    for name, column in columns.items():
        found.update(name.encode())
        found.update(np.ascontiguousarray(column).tobytes())
    return found.hexdigest()
