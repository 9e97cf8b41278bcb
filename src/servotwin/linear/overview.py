"""All linear views of a servo beside each other, over the same frequencies."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.linear.frequency_response import frequency_response
from servotwin.linear.linearise import linearise
from servotwin.linear.sampled import SampledServo, mid_pulse, sampled
from servotwin.linear.transfer_function import state_space
from servotwin.loads import as_load
from servotwin.models import (
    AveragedServo,
    AveragedServoInductive,
    BoundedServo,
    DigitalServo,
    Model,
    PulseServo,
    PulseServoInductive,
)

if TYPE_CHECKING:
    import control

    from servotwin.linear.frequency_response import FrequencyResponse
    from servotwin.loads import Load, Part

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_POINTS = 16  # frequencies
_SPAN = (0.05, 2.5)  # of the bandwidth, the first and the last of them
_USUAL = (1.0, 60.0)  # rad/s
_LAST = 0.98  # of half the rate of frames
_DESCRIBED = (AveragedServo, AveragedServoInductive, BoundedServo, PulseServo)


@dataclass(frozen=True, kw_only=True)
class Sines:
    """The response of a servo to commanded sines of one size.

    Parameters
    ----------
    amplitude : float
        [rad]
    described : ndarray of complex, shape (F,), or None
        By describing functions of the mean voltage, later by half a frame and the decision of a servo that has frames;
        None where the model has none.
    sticks : ndarray of bool, shape (F,)
        Where they say that the shaft stands for a while.
    bandwidth : float
        Of the simulated sines, 3 dB below 1; nan where they begin below it [rad/s].
    """

    amplitude: float
    described: Complex | None
    sticks: NDArray[np.bool_]
    bandwidth: float


@dataclass(frozen=True, kw_only=True)
class Overview:
    """Linear views of a servo.

    Parameters
    ----------
    model : Model
    load : Load
    frequency : ndarray, shape (F,)
        [rad/s]
    mean : ndarray of complex, shape (F,), or None
        Angle over commanded angle of the mean of the voltage; None for a digital servo.
    natural : tuple of float or None
        ω_n [rad/s] and ζ of that loop's slowest pair of poles.
    loops : mapping of float to SampledServo
        The sampled loop by the time between decisions [s]; empty for a servo that follows at all times.
    simulated : FrequencyResponse
    sines : tuple of Sines
        For each amplitude that was simulated.
    """

    model: Model
    load: Load
    frequency: Array
    mean: Complex | None
    natural: tuple[float, float] | None
    loops: dict[float, SampledServo]
    simulated: FrequencyResponse
    sines: tuple[Sines, ...]


def overview(model: Model, load: Load | Part | None = None, *, amplitudes: Sequence[float],
             frame_periods: Sequence[float] = (), angle: float | None = None) -> Overview:
    """Return transfer function, sampled loops, describing functions and simulated sines of a servo.

    Parameters
    ----------
    model : Model
        Of a servo.
    load : Load, optional
        Nothing unless given.
    amplitudes : sequence of float
        Of the sines that are simulated [rad].
    frame_periods : sequence of float
        T_f of further sampled loops, of a pulse servo [s].
    angle : float, optional
        About which the servo moves; the middle of the travel unless given [rad].

    Raises
    ------
    InputError
        If the model is a motor, or frames are asked of one that has none.

    Examples
    --------
    >>> import servotwin as st
    >>> seen = overview(st.BoundedServo(st.load_servo("hitec-hs-755hb")), amplitudes=[0.3])
    >>> seen.simulated.gain.shape, seen.loops
    ((1, 16), {})
    """
    load = as_load(load)
    has_frames = isinstance(model, PulseServo | PulseServoInductive)
    if frame_periods and not has_frames:
        raise InputError("frame periods", got=", ".join(f"{1e3 * T:g} ms" for T in frame_periods),
                         allowed=f"none: {type(model).__name__} has no frames that decide")
    loops = _loops(model, load, angle, frame_periods) if has_frames or isinstance(model, DigitalServo) else {}
    mean = None if isinstance(model, DigitalServo) else _mean(model, load, angle)
    omega = _frequencies(model, mean, next(iter(loops.values()), None))
    simulated = frequency_response(model, omega, amplitude=amplitudes, mean=angle, input="command_angle", load=load)
    reference = simulated.bandwidth(reference=1.0)
    sines = tuple(_sines(model, load, size, angle, omega, float(width), _lag(model, angle))
                  for size, width in zip(simulated.amplitude.tolist(), reference, strict=True))
    return Overview(model=model, load=load, frequency=omega, mean=None if mean is None else _response(mean, omega),
                    natural=None if mean is None else _natural(mean), loops=loops, simulated=simulated, sines=sines)


def _loops(model: Model, load: Load, angle: float | None, frame_periods: Sequence[float]) -> dict[float, SampledServo]:
    """Return the sampled loops by their period; none where a digital servo's bridge leaves no linear one, said."""
    try:
        own = sampled(model, load, angle=angle)
    except InputError as error:
        if not isinstance(model, DigitalServo) or model.endless:
            raise
        warnings.warn(str(error), stacklevel=3)
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # said once, of its own frames
        return {own.period: own} | {T: sampled(model, load, angle=angle, frame_period=T) for T in frame_periods}


def _mean(model: Model, load: Load, angle: float | None) -> control.StateSpace:
    """Return the loop of the mean voltage."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the sampled loop says the same
        system: Any = state_space(model, load, input="command_angle", angle=angle)["output_angle", "command_angle"]
    return system


def _response(system: control.StateSpace, omega: Array) -> Complex:
    return np.asarray(system(1j * omega), np.complex128).reshape(np.shape(omega))


def _natural(system: control.StateSpace) -> tuple[float, float]:
    frequencies, damping, _ = system.damp()
    k = int(np.argmin(frequencies))
    return float(frequencies[k]), float(damping[k])


def _frequencies(model: Model, mean: control.StateSpace | None, loop: SampledServo | None) -> Array:
    """Return frequencies about the bandwidth of the mean or the loop, or where servos usually have theirs [rad/s]."""
    seen: Callable[[Array], Complex]
    if mean is not None:
        seen, most = partial(_response, mean), 1e4
    elif loop is not None:
        seen, most = loop.response, loop.half_rate
    else:
        return np.geomspace(*_USUAL, _POINTS)
    top = math.inf if not isinstance(model, PulseServo | PulseServoInductive) else math.pi / model.frame_period
    fine = np.geomspace(1e-2, most * (1.0 - 1e-9), 2000)
    below = np.flatnonzero(np.abs(seen(fine)) < math.sqrt(0.5))
    bandwidth = float(fine[below[0]]) if below.size else float(fine[-1]) / _SPAN[1]
    return np.geomspace(_SPAN[0] * bandwidth, min(_SPAN[1] * bandwidth, _LAST * top), _POINTS)


def _sines(model: Model, load: Load, size: float, angle: float | None, omega: Array, bandwidth: float,
           lag: float) -> Sines:
    if not isinstance(model, _DESCRIBED) or load.recorded or load.flexibles:
        return Sines(amplitude=size, described=None, sticks=np.zeros(len(omega), bool), bandwidth=bandwidth)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = linearise(model, load, amplitude=size, angle=angle)
    return Sines(amplitude=size, described=found.response(omega) * np.exp(-1j * omega * lag),
                 sticks=found.sticks(omega), bandwidth=bandwidth)


def _lag(model: Model, angle: float | None) -> float:
    """Return by how much frames make a servo later than the mean of its voltage is [s].

    A command waits for its frame, half of one in the mean, and is decided upon when its pulse ends; the loop itself is
    left as it is, for half a frame of delay in it is worse than none (docs/theory/sampled).
    """
    if not isinstance(model, PulseServo | PulseServoInductive):
        return 0.0
    return 0.5 * model.frame_period + mid_pulse(model, angle)
