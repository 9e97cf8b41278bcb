"""The answer of a model to sines of a finite size, simulated: what no transfer function has."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import signals
from servotwin.errors import InputError
from servotwin.linear.transfer_function import INPUT_UNITS, check_model, check_size, input_name, is_motor, slowest_decay
from servotwin.loads import as_load
from servotwin.models import PulseServo, PulseServoInductive, mid_travel
from servotwin.simulation import simulate_many
from servotwin.units import is_finite, is_masked

if TYPE_CHECKING:
    import control
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.models import Model


# --- The result of `frequency_response`: a complex gain for every amplitude and frequency -----------------------------

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FrequencyResponse:
    """The steady answer of a model to sines, for A amplitudes and F frequencies.

    Parameters
    ----------
    input, output : str
        Names of the signals.
    frequency : ndarray, shape (F,)
        ω, increasing, as python-control counts it [rad/s].
    amplitude : ndarray, shape (A,)
        Of the input's sine, in the SI unit of the input.
    mean : float
        Of the input, in its SI unit.
    response : ndarray of complex, shape (A, F)
        Fundamental of the output over that of the input, in SI units of both; nan where a run ended early.
    distortion : ndarray, shape (A, F)
        Rms of all in the output that is neither mean nor fundamental, over the rms of the fundamental [1].
    change : ndarray, shape (A, F)
        How far the two halves of the evaluated time differ in `response`, over its magnitude [1]: what is left of
        the transient, or of noise.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> seen = st.linear.frequency_response(model, [5.0, 20.0, 50.0], amplitude=[0.1, 0.5])
    >>> seen
    FrequencyResponse(command_angle -> output_angle, 2 amplitudes, 3 frequencies)
    >>> seen.response.shape
    (2, 3)
    """

    input: str
    output: str
    frequency: Array
    amplitude: Array
    mean: float
    response: NDArray[np.complex128]
    distortion: Array
    change: Array

    def __post_init__(self) -> None:
        for name in ("frequency", "amplitude", "response", "distortion", "change"):
            getattr(self, name).setflags(write=False)

    def __repr__(self) -> str:
        counts = (f"{len(values)} {name if len(values) == 1 else many}" for values, name, many in (
            (self.amplitude, "amplitude", "amplitudes"), (self.frequency, "frequency", "frequencies")))
        return f"FrequencyResponse({self.input} -> {self.output}, {', '.join(counts)})"

    @property
    def gain(self) -> Array:
        """Magnitude of the response, shape (A, F)."""
        return np.abs(self.response)

    @property
    def phase(self) -> Array:
        """Phase of the response without jumps along the frequencies, shape (A, F) [rad]."""
        return np.unwrap(np.angle(self.response), axis=1)

    def bandwidth(self, *, drop: float = 3.0, reference: float | None = None) -> Array:
        """Return the first frequency at which the gain has dropped, for every amplitude.

        Parameters
        ----------
        drop : float
            By how much [dB].
        reference : float, optional
            The gain from which it has dropped; that at the lowest frequency unless given.

        Returns
        -------
        ndarray, shape (A,)
            Logarithmic between the frequencies; inf where the gain stays above, nan where it is below from the
            lowest frequency on or the servo does not move there at all [rad/s].

        Raises
        ------
        InputError
            If a number is not positive.

        Examples
        --------
        >>> import servotwin as st
        >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
        >>> seen = st.linear.frequency_response(model, np.geomspace(2.0, 60.0, 20), amplitude=[0.2, 1.0])
        >>> bool(seen.bandwidth()[1] < seen.bandwidth()[0])
        True
        """
        for name, value in (("drop", drop), ("reference", 1.0 if reference is None else reference)):
            if not (is_finite(value) and value > 0.0):
                raise InputError(f"bandwidth({name})", got=value, allowed="a positive number")
        levels = (self.gain[:, 0] if reference is None else np.full(len(self.amplitude), reference))
        return np.array([_crossing(self.frequency, gain, level * 10.0 ** (-drop / 20.0))
                         for gain, level in zip(self.gain, levels, strict=True)])

    def system(self, index: int = 0) -> control.FrequencyResponseData:
        """Return the response at one amplitude, by its index, as a named python-control system.

        Raises
        ------
        InputError
            If there is no such amplitude.

        Examples
        --------
        >>> import servotwin as st
        >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
        >>> st.linear.frequency_response(model, [5.0, 20.0], amplitude=0.1).system().output_labels
        ['output_angle']
        """
        import control

        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(self.amplitude):
            raise InputError("system(index)", got=index, allowed=f"0 to {len(self.amplitude) - 1}")
        found: Any = control.FrequencyResponseData(
            self.response[index], self.frequency, inputs=[self.input], outputs=[self.output])
        return found


def _crossing(frequency: Array, gain: Array, level: float) -> float:
    """Return where a gain first falls below a level, on lines of log gain over log frequency."""
    if not np.all(np.isfinite(gain)) or not gain[0] > level > 0.0:
        return np.nan
    below = np.flatnonzero(gain < level)
    if below.size == 0:
        return np.inf
    k = int(below[0])
    if gain[k] == 0.0:
        return float(frequency[k])
    share = np.log(gain[k - 1] / level) / np.log(gain[k - 1] / gain[k])
    return float(frequency[k - 1] * (frequency[k] / frequency[k - 1]) ** share)


# --- The answer of a model to sines of a finite size, simulated: what no transfer function has ------------------------

Complex = NDArray[np.complex128]

_SAMPLES = 64  # of a period
_PER_FRAME = 16.618  # samples of a frame: incommensurable, so that no ripple of the frames looks like the sine
_FRAMES = 50  # that are evaluated at least: sine and frames beat
_MOST_SAMPLES = 5_000_000
_LEFT = math.log(1e5)  # what is left of the transient when evaluation begins: 1e-5
_ROUNDING = 1e-12  # a smaller motion is none
_CHUNKS = 8  # lanes are few and long
_SETTLED = 1e-3  # a larger change between the halves asks for a longer run


class _Window(NamedTuple):
    """From when on a run is evaluated [s], for how many periods, and at how many times."""

    start: float
    periods: int
    period: float
    samples: int

    @property
    def length(self) -> float:
        return self.periods * self.period

    @property
    def times(self) -> Array:
        return self.start + self.length * np.arange(self.samples) / self.samples


class _Task(NamedTuple):
    """The common part of all runs."""

    model: Model
    load: Load
    input: str
    mean: float
    output: str
    seed: int


def frequency_response(model: Model, frequencies: ArrayLike, *, amplitude: ArrayLike, mean: float | None = None,
                       input: str | None = None, output: str | None = None, load: Load | Part | None = None,
                       frame_period: float | None = None, seed: int = 0) -> FrequencyResponse:
    """Simulate sines until they are steady, and return the fundamental of the answer over that of the command.

    Everything that the model has takes part: deadband, friction, saturation, single pulses. So the answer depends
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
    small-signal loop has decayed to 1e-5; for at least two whole periods and 50 frames, and long enough to tell the
    sine from its mirror image at the frame rate less its own. The fundamental is that of a Fourier sum under a Hann
    window, a weighted least-squares fit. Where the two halves differ by more than 1e-3 the run is made
    once more, four times as long; `change` says what is left.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> seen = frequency_response(model, [3.0, 12.0, 48.0], amplitude=np.radians([15.0, 40.0]))
    >>> bool(seen.gain[1, 1] < seen.gain[0, 1])  # the supply ends
    True
    """
    check_model(model, frame_period, linear=False)
    if model.endless:
        raise InputError(f"frequency response of {model.servo.name}", got="potentiometer.fixed_angle",
                         allowed="a servo that follows its command with an angle; `transfer_function` has its speed")
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise InputError("seed", got=seed, allowed="a whole number")
    if frame_period is not None:
        model = type(model)(model.servo.replace({"electronics.frame_period": frame_period}))
    omega = _frequencies(model, frequencies)
    sizes = _positive("amplitude", np.atleast_1d(_array("amplitude", amplitude)))
    name = input_name(model, input) if input else "armature_voltage" if is_motor(model) else "command_angle"
    centre = _mean(model, name, mean)
    for size in sizes.tolist():
        check_size(model, name, centre, size)
    task = _Task(model, as_load(load), name, centre, output or model.layout[0], seed)
    parts = [_at(task, w, sizes) for w in omega.tolist()]
    response, distortion, change = (np.stack([part[k] for part in parts], axis=1) for k in range(3))
    if not np.all(np.isfinite(response)):
        warnings.warn(f"{model.servo.name}: {np.count_nonzero(np.isnan(response))} of {response.size} runs ended "
                      "early; their response is nan", stacklevel=2)
    return FrequencyResponse(input=name, output=task.output, frequency=omega, amplitude=sizes, mean=centre,
                             response=response, distortion=distortion.real, change=change.real)


def _at(task: _Task, omega: float, sizes: Array) -> Complex:
    """Return response, distortion and change of all amplitudes at one frequency, shape (3, A)."""
    settling = _LEFT / slowest_decay(task.model, task.load)
    found = _evaluated(task, omega, sizes, 0, _window(task.model, omega, settling, 1))
    late = np.flatnonzero(found[2].real > _SETTLED)
    for k in late.tolist():
        found[:, k:k + 1] = _evaluated(task, omega, sizes[k:k + 1], k, _window(task.model, omega, settling, 4))
    return found


def _evaluated(task: _Task, omega: float, sizes: Array, first: int, window: _Window) -> Complex:
    """Return response, distortion and change of some amplitudes; `first` is the number of the first of them."""
    values, turning = _run(task, omega, sizes, first, window), np.exp(-1j * omega * window.times)
    half, periods = window.samples // 2, window.periods
    whole = _fundamental(values, turning, periods)
    before, after = (_fundamental(values[:, part], turning[part], periods // 2)
                     for part in (slice(None, half), slice(half, None)))
    still = np.ptp(values, axis=1) <= _ROUNDING * np.maximum(np.abs(values).max(axis=1), sizes)
    values -= values.mean(axis=1, keepdims=True)
    rest = values - (whole[:, np.newaxis] * turning.conj()).real
    size = np.where(still, np.inf, np.abs(whole))
    distortion, change = np.sqrt(2.0 * np.mean(rest**2, axis=1)) / size, np.abs(after - before) / size
    return np.array([np.where(still, 0.0, whole) / (-1j * sizes), distortion, change])  # sin ωt is Re(−i e^{iωt})


def _run(task: _Task, omega: float, sizes: Array, first: int, window: _Window) -> Array:
    """Return the output at the times of the window, a row for each amplitude."""
    commands = [signals.sine(mean=task.mean, amplitude=size, frequency=omega / (2.0 * math.pi),
                             unit=INPUT_UNITS[task.input]) for size in sizes.tolist()]
    times, end, seeds = window.times, window.start + window.length, task.seed + first + np.arange(len(sizes))
    batch = simulate_many(task.model, commands, duration=end, load=task.load, output_times=times,
                          outputs=(task.output,), seeds=seeds, chunk=math.ceil(len(sizes) / _CHUNKS))
    return batch[task.output].astype(np.float64)


def _fundamental(values: Array, turning: Complex, periods: int) -> Complex:
    """Return Y, of which the real part of Y e^{iωt} is the fundamental, over whole periods."""
    count = len(turning)
    weight = np.full(count, 2.0 / count)
    if periods > 1:  # Hann, which needs two
        weight *= 1.0 - np.cos(2.0 * math.pi * np.arange(count) / count)
    return np.asarray(values @ (weight * turning.real) + 1j * (values @ (weight * turning.imag)))


def _window(model: Model, omega: float, settling: float, longer: int) -> _Window:
    period = 2.0 * math.pi / omega
    least, rate = 2.0 * period, _SAMPLES / period
    if isinstance(model, PulseServo | PulseServoInductive):
        T_f = model.frame_period
        mirror = max(1.0 / T_f - 2.0 / period, 1e-3 / T_f)  # from the sine to its image [Hz]
        least, rate = max(least, 5.0 / mirror, _FRAMES * T_f), max(rate, _PER_FRAME / T_f)
    periods = 2 * math.ceil(0.5 * longer * least / period - 1e-9)
    samples = 2 * math.ceil(0.5 * rate * periods * period)
    if samples > _MOST_SAMPLES:
        raise InputError("frequency", got=f"{omega:g} rad/s, a run of {periods * period:.3g} s",
                         allowed=f"at least {omega * samples / _MOST_SAMPLES:.2g} rad/s")
    return _Window(longer * math.ceil(max(settling, period) / period) * period, periods, period, samples)


def _frequencies(model: Model, frequencies: ArrayLike) -> Array:
    omega = _positive("frequency", _array("frequencies", frequencies))
    if np.any(np.diff(omega) <= 0.0):
        k = int(np.argmax(np.diff(omega) <= 0.0))
        raise InputError(f"frequency {k + 1}", got=float(omega[k + 1]),
                         allowed=f"more than {omega[k]:g} rad/s, the one before")
    if isinstance(model, PulseServo | PulseServoInductive) and omega[-1] >= math.pi / model.frame_period:
        raise InputError("frequency", got=f"{omega[-1]:g} rad/s",
                         allowed=f"less than {math.pi / model.frame_period:.4g} rad/s, half the frame rate")
    return omega


def _array(what: str, values: ArrayLike) -> Array:
    if is_masked(values):  # what the mask hides would count
        raise InputError(what, got="a masked array", allowed="numbers, none of them masked")
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
    drive = model.command(signals.constant(mid_travel(model), unit="rad")).table[0].value
    return float(model.command_signal(name, np.array([drive]))[0])
