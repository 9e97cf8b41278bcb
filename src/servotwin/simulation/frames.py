"""The times of outputs, and signals of many runs at the same times as tables of pandas and xarray."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError, MissingExtraError
from servotwin.models.outputs import SIGNALS
from servotwin.units import is_finite

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray


# --- Signals of many runs at the same times as tables of pandas and xarray --------------------------------------------

def dataframe(axis: str, labels: Sequence[Any], time: NDArray[np.float64], signals: Mapping[str, NDArray[Any]],
              si_units: Mapping[str, str]) -> pd.DataFrame:
    """Return signals, shape (B, T), as a pandas DataFrame with a row for each label of the axis and time.

    Raises
    ------
    MissingExtraError
        Without pandas.
    """
    try:
        import pandas as pd
    except ImportError:
        raise MissingExtraError("pandas", "data") from None
    frame = pd.DataFrame({name: values.ravel() for name, values in signals.items()},
                         index=pd.MultiIndex.from_product([labels, time], names=[axis, "time"]))
    frame.attrs["units"] = dict(si_units)
    return frame


def dataset(axis: str, labels: Sequence[Any], time: NDArray[np.float64], signals: Mapping[str, NDArray[Any]], *,
            more: Mapping[str, Any], coords: Mapping[str, Any], attrs: Mapping[str, str]) -> xr.Dataset:
    """Return signals, shape (B, T), as an xarray Dataset over the axis and `time`, with units.

    Parameters
    ----------
    axis : str
        Name of the first dimension.
    labels : sequence
        Along it.
    time : ndarray, shape (T,)
    signals : mapping of str to ndarray, shape (B, T)
    more, coords, attrs : mapping
        Further variables, coordinates and attributes, as xarray takes them.

    Raises
    ------
    MissingExtraError
        Without xarray.
    """
    try:
        import xarray as xr
    except ImportError:
        raise MissingExtraError("xarray", "data") from None
    data = {name: ((axis, "time"), values, {"units": SIGNALS[name].unit, "long_name": SIGNALS[name].meaning})
            for name, values in signals.items()}
    return xr.Dataset(data | dict(more), coords={axis: labels, "time": ("time", time, {"units": "s"}), **coords},
                      attrs=dict(attrs))


# --- The instants at which a run shows what it did, as a call asks for them -------------------------------------------

_MOST_SAMPLES = 20_000_000


def times_asked(duration: float, output_step: float | None, output_times: ArrayLike | None) -> NDArray[np.float64]:
    """Return the output times [s] that a call asks for, or raise InputError."""
    if output_times is not None:
        if output_step is not None:
            raise InputError("output_step and output_times", allowed="one of them")
        try:
            times = np.asarray(output_times, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise InputError("output_times", got=output_times, allowed="numbers of seconds") from None
        inside = times.ndim == 1 and times.size > 0 and bool(np.isfinite(times).all())
        if not inside or times.min() < 0.0 or times.max() > duration or (np.diff(times) < 0.0).any():
            raise InputError("output_times", got=output_times,
                             allowed=f"finite times that do not decrease, from 0 to {duration:g} s")
        return times
    step = 1e-3 if output_step is None else output_step
    if not (is_finite(step) and step > 0.0):
        raise InputError("output_step", got=step, allowed="a positive number of seconds")
    if duration / step > _MOST_SAMPLES:
        raise InputError("duration / output_step", got=f"{duration / step:.3g} outputs",
                         allowed=f"at most {_MOST_SAMPLES}: take a larger output_step")
    count = math.floor(duration / step * (1.0 + 1e-12))
    times = np.asarray(np.arange(count + 1) * step, dtype=np.float64)
    times[-1] = min(times[-1], duration)
    if duration - times[-1] > 1e-9 * step:
        times = np.append(times, duration)
    else:
        times[-1] = duration
    return times
