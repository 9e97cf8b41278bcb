"""A servo as it is to sines of a finite size: friction, deadband and limit as gains that depend on the amplitude."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.linear.balance import Balance, Turn
from servotwin.linear.frequency_response import frequency_response
from servotwin.linear.loops import check_size
from servotwin.linear.transfer_function import check_model
from servotwin.loads import as_load
from servotwin.models import AveragedServo, AveragedServoInductive, BoundedServo, PulseServo, mid_travel
from servotwin.units import is_finite

if TYPE_CHECKING:
    import control
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.models import Model

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Error(NamedTuple):
    """How far off a response is.

    Parameters
    ----------
    gain : ndarray, shape (F,)
        Its magnitude over that of what it is compared with, less 1; nan where nothing moves.
    phase : ndarray, shape (F,)
        By what its phase is larger; nan where nothing moves [rad].
    """

    gain: Array
    phase: Array


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Linearised:
    """A mean-voltage servo under a commanded angle that goes as a sine of a finite size about a mean.

    Parameters
    ----------
    model : AveragedServo, AveragedServoInductive or BoundedServo
    load : Load
    angle : float
        Mean of the commanded angle [rad].
    amplitude : float
        Of the commanded angle [rad].

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> small, large = (linearise(model, amplitude=a) for a in (0.3, 1.2))
    >>> bool(abs(small.response(20.0)) > abs(large.response(20.0)))  # the supply limits large ones
    True
    """

    model: Model
    load: Load
    angle: float
    amplitude: float
    _turns: dict[float, Turn | None] = field(default_factory=dict, init=False)

    def __repr__(self) -> str:
        return f"Linearised({self.model!r}, {self.amplitude:g} rad about {self.angle:g} rad)"

    def response(self, frequencies: ArrayLike) -> Complex:
        """Return the first harmonic of the output angle over that of the commanded angle, 0 where nothing moves.

        Parameters
        ----------
        frequencies : array_like
            ω [rad/s].

        Returns
        -------
        ndarray of complex, shape of `frequencies`

        Raises
        ------
        InputError
            If a frequency is not a finite positive number.
        """
        p = self.model.pack(self.load).sensor.p
        turns = [self._turn(w) for w in _checked(frequencies)]
        found = np.array([0j if turn is None else p * turn.angle.first / turn.command for turn in turns])
        return found.reshape(np.shape(frequencies))

    def error(self, frequencies: ArrayLike) -> Error:
        """Return how far off simulated sines of the same model the response is, in gain and in phase.

        Harmonics are left out of it, of friction and of the limit; they turn the phase more than they change the gain.

        Parameters
        ----------
        frequencies : array_like, shape (F,)
            ω, increasing [rad/s].

        Raises
        ------
        InputError
            If a frequency is not a finite positive number, or they do not increase.

        Examples
        --------
        >>> import servotwin as st
        >>> off = linearise(st.BoundedServo(st.load_servo("hitec-hs-755hb")), amplitude=0.6).error([12.0])
        >>> bool(abs(off.gain[0]) < 0.1), bool(abs(off.phase[0]) < 0.1)
        (True, True)
        """
        omega = np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
        found = self.response(omega)
        truth = frequency_response(self.model, omega, amplitude=self.amplitude, mean=self.angle,
                                   load=self.load).response[0]
        with np.errstate(all="ignore"):
            ratio = np.where((found == 0.0) | (truth == 0.0), np.nan, found / truth)
        return Error(np.abs(ratio) - 1.0, np.angle(ratio))

    def sticks(self, frequencies: ArrayLike) -> NDArray[np.bool_]:
        """Return where the shaft stands for a while at its ends, or always; the sine is none there."""
        turns = [self._turn(w) for w in _checked(frequencies)]
        return np.array([turn is None or turn.sticks for turn in turns]).reshape(np.shape(frequencies))

    def system(self, frequency: float) -> control.StateSpace:
        """Return the linear system that answers a sine of this frequency [rad/s] and amplitude as the servo does.

        Friction is a viscous one, springs and pendulums one stiffness, deadband and limit one gain.

        Raises
        ------
        InputError
            If the frequency is not a finite positive number, or nothing moves there.

        Examples
        --------
        >>> import servotwin as st
        >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
        >>> seen = linearise(model, amplitude=0.3)
        >>> system = seen.system(12.0)
        >>> bool(np.isclose(system(12j), seen.response(12.0)))
        True
        """
        import control

        omega = _checked(frequency)[0]
        turn = self._turn(omega)
        if turn is None:
            raise InputError("frequency", got=f"{omega:g} rad/s, at which {self.amplitude:g} rad move nothing",
                             allowed="a larger amplitude")
        n = self.model.pack(self.load)
        size = turn.angle.first.real
        b, k = n.shaft.b + turn.friction.imag / (omega * size), turn.restoring.real / size
        gain = (turn.voltage.first / turn.error.first).real * n.sensor.p
        K, K_b, R, L, J = n.motor.K, n.motor.K_b, n.motor.R, n.motor.L, n.shaft.J
        if L == 0.0:
            A = [[0.0, 1.0], [-(k + K / R * gain) / J, -(b + K * K_b / R) / J]]
            B, names = [[0.0], [K / R * gain / J]], ["output_angle", "output_speed"]
        else:
            A = [[0.0, 1.0, 0.0], [-k / J, -b / J, K / J], [-gain / L, -K_b / L, -R / L]]
            B, names = [[0.0], [0.0], [gain / L]], ["output_angle", "output_speed", "armature_current"]
        found: Any = control.StateSpace(A, B, np.eye(len(A))[:1], [[0.0]], states=names, inputs=["command_angle"],
                                        outputs=["output_angle"], name=type(self.model).__name__)
        return found

    def _turn(self, omega: float) -> Turn | None:
        if omega not in self._turns:
            numbers = self.model.pack(self.load)
            p, b_o = numbers.sensor.p, numbers.sensor.b_o
            self._turns[omega] = Balance(numbers, self.load, p * self.angle + b_o).turn(omega, p * self.amplitude)
        return self._turns[omega]


def linearise(model: Model, load: Load | Part | None = None, *, amplitude: float,
              angle: float | None = None) -> Linearised:
    """Replace friction, deadband and limit by their describing functions for a commanded sine of one size.

    Parameters
    ----------
    model : AveragedServo, AveragedServoInductive, BoundedServo or PulseServo
        Of a pulse servo the mean of its pulses is taken, which sticks where single pulses still move it.
    load : Load, optional
        Nothing unless given.
    amplitude : float
        Of the commanded angle [rad].
    angle : float, optional
        About which it goes; the middle of the travel unless given [rad].

    Returns
    -------
    Linearised

    Raises
    ------
    InputError
        If the model is another, a number is not possible, the sine leaves the travel or asks for pulses that the servo
        refuses, or the load changes with time.
    """
    check_model(model, None, linear=False)
    mean = model.averaged() if isinstance(model, PulseServo) else model
    if not isinstance(mean, AveragedServo | AveragedServoInductive | BoundedServo):
        raise InputError("model to linearise", got=model, allowed="a mean-voltage servo, or a PulseServo for its mean; "
                         "transfer_function and sampled take the others")
    if not (is_finite(amplitude) and amplitude > 0.0):
        raise InputError("amplitude", got=amplitude, allowed="a finite positive number [rad]")
    centre = mid_travel(model) if angle is None else angle
    check_size(model, "command_angle", centre, amplitude)
    load = as_load(load)
    if load.recorded:
        raise InputError("load to linearise", got="a torque recorded over time", allowed="one that stays as it is")
    return Linearised(model=mean, load=load, angle=float(centre), amplitude=float(amplitude))


def _checked(frequencies: ArrayLike) -> list[float]:
    omega = np.ravel(np.asarray(frequencies, dtype=np.float64))
    if not np.all(np.isfinite(omega) & (omega > 0.0)):
        raise InputError("frequency", got=float(omega[~(np.isfinite(omega) & (omega > 0.0))][0]),
                         allowed="a finite positive number [rad/s]")
    return [float(w) for w in omega]
