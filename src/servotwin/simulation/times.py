"""The instants at which a run shows what it did, as a call asks for them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError
from servotwin.units import is_finite

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
