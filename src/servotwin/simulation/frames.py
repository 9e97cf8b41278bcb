"""Signals of many runs at the same times as tables of pandas and xarray."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from servotwin.errors import MissingExtraError
from servotwin.models.outputs import SIGNALS

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray


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
