"""What `frequency_response` gives back: a complex gain for every amplitude and frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    import control

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
