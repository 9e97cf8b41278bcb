"""A servo as it is to sines of a finite size: friction, deadband and limit as gains that depend on the amplitude."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from servotwin import physics
from servotwin.errors import InputError
from servotwin.linear.frequency_response import frequency_response
from servotwin.linear.transfer_function import check_model, check_size
from servotwin.loads import Load, as_load
from servotwin.models import AveragedServo, AveragedServoInductive, BoundedServo, PulseServo, mid_travel
from servotwin.models.terms import friction
from servotwin.models.terms.numbers import Numbers
from servotwin.units import is_finite

if TYPE_CHECKING:
    import control
    from numpy.typing import ArrayLike

    from servotwin.loads import Part
    from servotwin.models import Model


# --- Harmonic balance of a mean-voltage servo -------------------------------------------------------------------------

# The output is taken for a sine, q = q_0 + a sin θ. The torque of friction, springs and pendulums then has a mean and
# a first harmonic, and so has the voltage that it takes; the error whose mean and first harmonic make that voltage,
# through deadband and limit, gives the command. Deadband, limit and friction are thus replaced by their describing
# functions, the limit and the deadband with a bias (Gelb & Vander Velde, Multiple-Input Describing Functions, 1968,
# ch. 2 and 3).

Array = NDArray[np.float64]

_ROUND = 2.0 * math.pi * (np.arange(512) + 0.5) / 512  # phases of the output: none falls on a reversal
_SIN, _COS = np.sin(_ROUND), np.cos(_ROUND)
_SIZES = np.geomspace(1e-4, 4.0, 90)  # of the command's amplitude, among which that of the output is looked for
_MOST = 1e6  # of the error over its deadband and limit
_NOTHING = 1e-12  # V
_HIGHEST = 15  # harmonic that counts where the shaft turns back
_DOUBLINGS = 40  # of a mean error that is looked for


class Harmonic(NamedTuple):
    """Mean, and first harmonic as the complex amplitude of sin θ, of something that goes round."""

    mean: float
    first: complex


class Turn(NamedTuple):
    """A balance at one frequency.

    Parameters
    ----------
    angle : Harmonic
        Of the output; the phase is counted from it [rad].
    error : Harmonic
        v_e [V]
    voltage : Harmonic
        v_a [V]
    friction : complex
        First harmonic of the torque that friction takes [N m].
    restoring : complex
        That of springs and pendulums [N m].
    command : complex
        First harmonic of v_c [V].
    sticks : bool
        Whether the shaft would stand where it turns back.
    """

    angle: Harmonic
    error: Harmonic
    voltage: Harmonic
    friction: complex
    restoring: complex
    command: complex
    sticks: bool


def harmonic(values: Array) -> Harmonic:
    """Return mean and first harmonic of values at the phases."""
    return Harmonic(float(values.mean()), complex(2.0 * np.mean(values * _SIN), 2.0 * np.mean(values * _COS)))


@dataclass(frozen=True, eq=False)
class Balance:
    """The loop of a mean-voltage servo, whose output goes as a sine.

    Parameters
    ----------
    numbers : Numbers
    load : Load
    centre : float
        Mean of the control voltage v_c [V].
    """

    numbers: Numbers
    load: Load
    centre: float

    def turn(self, omega: float, command: float) -> Turn | None:
        """Return the balance under a sine of v_c of an amplitude [V]; None where none makes the servo move."""
        p = self.numbers.sensor.p
        sizes = (command / p * _SIZES).tolist()

        def beyond(size: float) -> float:
            found = self._of(omega, size)
            return math.inf if found is None else abs(found.command) - command

        first = next((k for k, size in enumerate(sizes) if beyond(size) > 0.0), 0)
        if first == 0:
            return None
        low, high = sizes[first - 1], sizes[first]
        while high - low > 1e-9 * high:  # beyond may be infinite
            middle = 0.5 * (low + high)
            low, high = (middle, high) if beyond(middle) <= 0.0 else (low, middle)
        return self._of(omega, low)

    def _of(self, omega: float, size: float) -> Turn | None:
        """Return the balance whose output has an amplitude [rad]; None where no voltage is enough."""
        n = self.numbers
        p, b_o = n.sensor.p, n.sensor.b_o
        rubbed = harmonic(self._friction(omega * size * _COS))

        def at(e_0: float) -> tuple[Turn | None, float]:
            """Return the balance with a mean error, and by how much its mean voltage is too large."""
            q_0 = (self.centre - e_0 - b_o) / p
            pulled = harmonic(self._restoring(q_0 + size * _SIN))
            s = 1j * omega
            torque = (n.shaft.J * s * s + n.shaft.b * s) * size + rubbed.first + pulled.first
            first = (n.motor.R + s * n.motor.L) / n.motor.K * torque + n.motor.K_b * s * size
            needed = Harmonic(n.motor.R / n.motor.K * (rubbed.mean + pulled.mean), first)
            E = self._error(abs(first), e_0)
            if math.isnan(E):
                return None, math.nan
            error = Harmonic(e_0, first / abs(first) * E)
            found = Turn(Harmonic(q_0, size), error, needed, rubbed.first, pulled.first, error.first + p * size, False)
            return found, float(self._voltage(e_0 + E * _SIN).mean()) - needed.mean

        found, excess = at(0.0)
        if found is None:
            return None
        if abs(excess) > _NOTHING:
            step = max(n.follower.half_deadband, abs(found.error.first), abs(excess) / n.follower.gain)
            other = _bracket(lambda e_0: at(e_0)[1], excess, step)
            if math.isnan(other):
                return None
            e_0 = float(brentq(lambda e: at(e)[1], min(0.0, other), max(0.0, other), xtol=1e-10))
            found = at(e_0)[0]
        return None if found is None else found._replace(sticks=self._sticks(omega, found))

    def _voltage(self, error: Array) -> Array:
        """Return v_a [V] of errors v_e [V]: deadband, gain, limit."""
        follower = self.numbers.follower
        beyond = np.sign(error) * np.maximum(np.abs(error) - follower.half_deadband, 0.0)
        return np.asarray(np.clip(follower.gain * beyond, -follower.V_max, follower.V_max))

    def _error(self, voltage: float, mean: float) -> float:
        """Return the amplitude of the error [V] whose voltage has a first harmonic [V]; nan where none has."""
        def beyond(size: float) -> float:
            return harmonic(self._voltage(mean + size * _SIN)).first.real - voltage

        follower = self.numbers.follower
        high = follower.half_deadband + abs(mean) + 2.0 * voltage / follower.gain
        while beyond(high) < 0.0:
            high *= 2.0
            if high > _MOST * (follower.half_deadband + abs(mean) + voltage / follower.gain):
                return math.nan
        return float(brentq(beyond, 0.0, high, xtol=1e-13 * high + 1e-300, rtol=1e-10))

    def _friction(self, speed: Array) -> Array:
        """Return the torque that dry friction of gear and load takes [N m] at speeds [rad/s]."""
        n = self.numbers
        dry = n.friction
        own = (physics.smoothed_coulomb_torque(speed, dry.F_forward, dry.F_backward, dry.kappa)
               if friction.smoothed(dry) else np.where(speed > 0.0, dry.F_forward, -dry.F_backward))
        return np.asarray(own + n.load.coulomb * np.sign(speed))

    def _restoring(self, angle: Array) -> Array:
        """Return the torque of springs, pendulums and constant torques against +q [N m]."""
        return self.load.external_torque(0.0, angle)

    def _sticks(self, omega: float, turn: Turn) -> bool:
        """Tell whether friction holds the shaft where it turns back, or makes it turn back more than twice a turn.

        There the push of motor and load counts, which the next harmonics of the motion change.
        """
        n = self.numbers
        if friction.smoothed(n.friction):
            return False
        angle, speed = self._motion(omega, turn)
        control = self.centre + (turn.command.real * _SIN + turn.command.imag * _COS)
        error = control - n.sensor.p * angle - n.sensor.b_o
        push = n.motor.K / n.motor.R * self._voltage(error) - self._restoring(angle)
        turns = np.flatnonzero(np.sign(speed) != np.sign(np.roll(speed, -1)))
        for k in turns.tolist():
            side = math.copysign(1.0, speed[k])  # it comes this way, and has to go back
            F = n.friction.F_backward if side > 0.0 else n.friction.F_forward
            if -side * float(push[k]) <= F * n.friction.breakaway + n.load.coulomb:
                return True
        return len(turns) > 2

    def _motion(self, omega: float, turn: Turn) -> tuple[Array, Array]:
        """Return angle and speed with the harmonics that voltage, friction and load of the sine make."""
        n, size = self.numbers, turn.angle.first.real
        angle, speed = turn.angle.mean + size * _SIN, omega * size * _COS
        torque = (n.motor.K / n.motor.R * self._voltage(turn.error.mean + turn.error.first.real * _SIN
                                                        + turn.error.first.imag * _COS)
                  - self._friction(speed) - self._restoring(angle))
        spectrum = np.fft.rfft(torque)
        order = np.arange(len(spectrum))
        s = 1j * omega * order
        plant = s * (n.shaft.J * s + n.shaft.b + n.motor.K * n.motor.K_b / n.motor.R)
        higher = (order > 1) & (order <= _HIGHEST)
        more = np.where(higher, spectrum / np.where(higher, plant, 1.0), 0.0)
        return angle + np.fft.irfft(more, len(_ROUND)), speed + np.fft.irfft(s * more, len(_ROUND))


def _bracket(excess_at: Callable[[float], float], excess: float, step: float) -> float:
    """Return a mean error [V] at which the excess has the other sign than at 0; nan where none has."""
    way = -math.copysign(step, excess)
    for _ in range(_DOUBLINGS):
        found = excess_at(way)
        if math.isnan(found):
            return math.nan
        if found * excess <= 0.0:
            return way
        way *= 2.0
    return math.nan


# --- A servo as it is to sines of a finite size: friction, deadband and limit as gains that depend on the -------------

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
