"""The answer of a model to sines of a finite size, simulated: what no transfer function knows."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import signals
from servotwin.errors import InputError
from servotwin.linear.response import FrequencyResponse
from servotwin.linear.transfer_function import INPUT_UNITS, check_frames, input_name, is_motor, slowest_decay
from servotwin.loads import as_load
from servotwin.models import Model, PulseServo, PulseServoInductive
from servotwin.simulation import simulate, simulate_many
from servotwin.simulation.lane_inputs import LAWS
from servotwin.units import is_finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.signals import Signal

Array = NDArray[np.float64]

_NEUTRAL = 1.5e-3  # s, the pulse in the middle of what transmitters send
_SAMPLES = 64  # of a period
_PER_FRAME = 16.618  # samples of a frame: incommensurable, so that no ripple of the frames looks like the sine
_FRAMES = 50  # that are evaluated at least: sine and frames beat
_MOST_SAMPLES = 5_000_000
_LEFT = math.log(1e5)  # what is left of the transient when evaluation begins: 1e-5
_SETTLED = 1e-3  # a larger change between the halves asks for a longer run


class _Window(NamedTuple):
    """From when to when a run is evaluated [s], whole periods, and at how many times."""

    start: float
    length: float
    samples: int

    @property
    def times(self) -> Array:
        return self.start + self.length * np.arange(self.samples) / self.samples


def frequency_response(model: Model, frequencies: ArrayLike, *, amplitude: ArrayLike, mean: float | None = None,
                       input: str | None = None, output: str | None = None, load: Load | Part | None = None,
                       frame_period: float | None = None, seed: int = 0) -> FrequencyResponse:
    """Simulate sines until they are steady, and return the fundamental of the answer over that of the command.

    Everything that the model knows takes part: deadband, friction, saturation, single pulses. So the answer depends
    on the amplitude; for small sines and without deadband and friction it is that of `transfer_function`.

    Parameters
    ----------
    model : Model
    frequencies : array_like, shape (F,)
        ω, positive and increasing, for a pulse servo below half the frame rate, π/T_f [rad/s].
    amplitude : float or array_like, shape (A,)
        Of the command's sine, positive, in the SI unit of the input.
    mean : float, optional
        About which the sine goes, in the same unit. Unless given: the middle of the travel; where the servo gives
        none, a pulse of 1.5 ms; 0 for motors.
    input : str, optional
        `command_angle` [rad], `pulse_width` [s] or `command_voltage` [V] of a servo, `armature_voltage` [V] of a
        motor. Unless given: the angle, the armature voltage.
    output : str, optional
        Any signal of the model. Unless given: the angle of its own state.
    load : Load, optional
        Nothing unless given.
    frame_period : float, optional
        T_f of a pulse servo [s]; the servo's own unless given.
    seed : int
        Seed of the first amplitude's noise; the others count up from it.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    InputError
        If a frequency or an amplitude is not a finite positive number, frequencies do not increase or lie beyond
        half the frame rate, or the sine leaves the travel or asks for pulses that the servo refuses.
    UnknownNameError
        If the model has no such input or output.

    Warns
    -----
    UserWarning
        If a run ended early; its response is nan.

    Notes
    -----
    The run begins at rest at the mean. It is evaluated from one period on, or later, until the slowest pole of the
    small-signal loop has decayed to 1e-5; for at least four whole periods and 50 frames, and long enough to tell the
    sine from its mirror image at the frame rate less its own. The fundamental is that of a Fourier integral under a
    Hann window, which is a weighted least-squares fit. Where the two halves differ by more than 1e-3 the run is made
    once more, four times as long; `change` says what is left.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> seen = frequency_response(model, [3.0, 12.0, 48.0], amplitude=np.radians([5.0, 40.0]))
    >>> bool(seen.gain[1, 1] < seen.gain[0, 1])  # the supply ends
    True
    """
    if not isinstance(model, Model):
        raise InputError("model", got=model, allowed="a model of a servo, such as PulseServo(load_servo(...))")
    check_frames(model, frame_period)
    if frame_period is not None:
        model = type(model)(model.servo.replace({"electronics.frame_period": frame_period}))
    omega = _frequencies(model, frequencies)
    sizes = _positive("amplitude", np.atleast_1d(_array("amplitude", amplitude)))
    name = input_name(model, input) if input else "armature_voltage" if is_motor(model) else "command_angle"
    centre = _mean(model, name, mean)
    for size in sizes.tolist():
        _check_size(model, name, centre, size)
    load, seen = as_load(load), output or model.layout[0]
    parts = [_at(model, load, w, sizes, name, centre, seen, seed) for w in omega.tolist()]
    response, distortion, change = (np.stack([part[k] for part in parts], axis=1) for k in range(3))
    if not np.all(np.isfinite(response)):
        warnings.warn(f"{model.servo.name}: {np.count_nonzero(np.isnan(response))} of {response.size} runs ended "
                      "early; their response is nan", stacklevel=2)
    return FrequencyResponse(input=name, output=seen, frequency=omega, amplitude=sizes, mean=centre,
                             response=response, distortion=distortion.real, change=change.real)


def _at(model: Model, load: Load, omega: float, sizes: Array, name: str, mean: float, output: str,
        seed: int) -> tuple[NDArray[np.complex128], Array, Array]:
    """Return response, distortion and change of all amplitudes at one frequency."""
    settling = _LEFT / slowest_decay(model, load)
    commands = [signals.sine(mean=mean, amplitude=size, frequency=omega / (2.0 * math.pi), unit=INPUT_UNITS[name])
                for size in sizes.tolist()]
    for longer in (1, 4):
        window = _window(model, omega, settling, longer)
        found = _evaluated(omega, sizes, window, _run(model, load, commands, output, window, seed))
        if np.all(found[2] < _SETTLED):
            break
    return found


def _run(model: Model, load: Load, commands: list[Signal], output: str, window: _Window, seed: int) -> Array:
    """Return the output at the times of the window, a row for each command."""
    times, end = window.times, window.start + window.length
    if type(model) in LAWS:
        return simulate_many(model, commands, duration=end, load=load, output_times=times, outputs=(output,),
                             seeds=seed + np.arange(len(commands)))[output].astype(np.float64)
    return np.array([simulate(model, command, duration=end, load=load, output_times=times)[output]
                     for command in commands])


def _evaluated(omega: float, sizes: Array, window: _Window,
               values: Array) -> tuple[NDArray[np.complex128], Array, Array]:
    times = window.times
    turning = np.exp(-1j * omega * times)
    half = window.samples // 2
    whole, first, second = (_fundamental(values[:, part], turning[part]) for part in (
        slice(None), slice(None, half), slice(half, None)))
    size = np.maximum(np.abs(whole), np.finfo(float).tiny)
    rest = values - values.mean(axis=1, keepdims=True) - (whole[:, np.newaxis] * turning.conj()).real
    distortion = np.sqrt(2.0 * np.mean(rest**2, axis=1)) / size
    return whole / (-1j * sizes), distortion, np.abs(second - first) / size  # a sine is the real part of −i e^{iωt}


def _fundamental(values: Array, turning: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return Y, of which the real part of Y e^{iωt} is the fundamental, over whole periods (at least two)."""
    count = len(turning)
    hann = 1.0 - np.cos(2.0 * math.pi * np.arange(count) / count)
    found: NDArray[np.complex128] = 2.0 / count * (values @ (hann * turning))
    return found


def _window(model: Model, omega: float, settling: float, longer: int) -> _Window:
    period = 2.0 * math.pi / omega
    least, rate = 4.0 * period, _SAMPLES / period
    if isinstance(model, PulseServo | PulseServoInductive):
        T_f = model.frame_period
        mirror = max(1.0 / T_f - 2.0 / period, 1e-3 / T_f)  # from the sine to its image [Hz]
        least, rate = max(least, 5.0 / mirror, _FRAMES * T_f), max(rate, _PER_FRAME / T_f)
    length = 2.0 * math.ceil(0.5 * longer * least / period - 1e-9) * period
    samples = 2 * math.ceil(0.5 * rate * length)
    if samples > _MOST_SAMPLES:
        raise InputError("frequency", got=f"{omega:g} rad/s, a run of {length:.3g} s",
                         allowed=f"at least {omega * samples / _MOST_SAMPLES:.2g} rad/s")
    return _Window(longer * math.ceil(max(settling, period) / period) * period, length, samples)


def _frequencies(model: Model, frequencies: ArrayLike) -> Array:
    omega = _positive("frequency", _array("frequencies", frequencies))
    if np.any(np.diff(omega) <= 0.0):
        k = int(np.argmax(np.diff(omega) <= 0.0))
        raise InputError(f"frequency {k + 1}", got=float(omega[k + 1]), allowed=f"more than the one before, {omega[k]:g}")
    if isinstance(model, PulseServo | PulseServoInductive) and omega[-1] >= math.pi / model.frame_period:
        raise InputError("frequency", got=f"{omega[-1]:g} rad/s",
                         allowed=f"less than {math.pi / model.frame_period:.4g} rad/s, half the frame rate")
    return omega


def _array(what: str, values: ArrayLike) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(what, got=values, allowed="numbers") from None
    if array.ndim > 1 or (what == "frequencies" and array.ndim == 0) or array.size == 0:
        raise InputError(what, got=f"an array of shape {array.shape}", allowed="a list of at least one number")
    return array


def _positive(what: str, values: Array) -> Array:
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
    if bad.size:
        raise InputError(what, got=float(values[bad[0]]), allowed="a finite positive number (SI)")
    return values


def _mean(model: Model, name: str, mean: float | None) -> float:
    """Return the mean of the sine; the middle of the travel unless given."""
    if mean is not None:
        if not is_finite(mean):
            raise InputError("mean", got=mean, allowed="a finite number (SI)")
        return float(mean)
    if is_motor(model):
        return 0.0
    lower, upper = (model.servo.get(f"stops.{end}_angle") for end in ("lower", "upper"))
    if isinstance(lower, float) and isinstance(upper, float):
        drive = model.command(signals.constant(0.5 * (lower + upper), unit="rad")).table[0].value
    else:
        drive = model.command(signals.constant(_NEUTRAL, unit="s")).table[0].value
    return float(model.command_signal(name, np.array([drive]))[0])


def _check_size(model: Model, name: str, mean: float, size: float) -> None:
    """Raise InputError if the sine leaves the travel, or asks for pulses that the servo refuses."""
    if is_motor(model):
        return
    ends = np.array([model.command(signals.constant(value, unit=INPUT_UNITS[name])).table[0].value
                     for value in (mean - size, mean + size)])
    for signal, limits, what in (
            ("command_angle", ("stops.lower_angle", "stops.upper_angle"), "the travel"),
            ("pulse_width", ("electronics.pulse_width_min", "electronics.pulse_width_max"), "the pulses accepted")):
        reached = np.sort(model.command_signal(signal, ends))
        low, high = (model.servo.get(limit) for limit in limits)
        low, high = -math.inf if low is None else low, math.inf if high is None else high
        if reached[0] < low - 1e-9 or reached[1] > high + 1e-9:
            raise InputError(
                f"amplitude {size:g} about {mean:g}", got=f"{signal} {reached[0]:.6g} to {reached[1]:.6g}",
                allowed=f"{low:.6g} to {high:.6g}, {what} of {model.servo.name} (SI)")
