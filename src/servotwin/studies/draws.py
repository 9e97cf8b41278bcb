"""The parameters of all lanes: drawn from distributions, or taken from a table of draws."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ParameterError
from servotwin.studies.kinds import Distribution, Truncated
from servotwin.studies.names import Parameter, parameter
from servotwin.studies.words import distribution_of

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model

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
        known = parameter(name, model, load)
        if column.dtype.kind != "f":
            continue
        good = np.isfinite(column) & (column >= known.lower) & (column <= known.upper)
        if not good.all():
            lane = int(np.argmin(good))
            raise ParameterError(f"{name} of lane {lane}", got=float(column[lane]), allowed=known.allowed + advice)
