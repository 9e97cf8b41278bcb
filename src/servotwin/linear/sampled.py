"""The loop of a servo that decides now and then: a pulse servo every frame, a digital one every tick."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from servotwin import signals
from servotwin.errors import InputError
from servotwin.linear.transfer_function import Plant, check_model, plant_of
from servotwin.loads import as_load
from servotwin.models import DigitalServo, PulseServo, PulseServoInductive, mid_travel
from servotwin.models.terms.firmware import Firmware
from servotwin.units import is_finite

if TYPE_CHECKING:
    import control
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.models import Model


# --- Properties of every sampled loop ---------------------------------------------------------------------------------


class Law(Protocol):
    """A loop that is linear, and the same again after some decisions."""

    @property
    def period(self) -> float:
        """From a decision to the next [s]."""

    @property
    def ticks(self) -> int:
        """After how many decisions it is the same again."""

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return the loop, cut where it decides, for errors of an amplitude [rad]; shape of `omega` [rad/s]."""

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output over a command's of an amplitude [rad]; shape of `omega` [rad/s]."""

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop until it is the same again, its gain `gain` times its own."""


# --- A linear system over a time in which its input does not change ---------------------------------------------------


class Step(NamedTuple):
    """x(t + T) = transition x(t) + gain u."""

    transition: Array
    gain: Array


def step_of(A: Array, B: Array, time: float) -> Step:
    """Return the step of ẋ = A x + B u over a time [s] (Van Loan, IEEE Trans. Autom. Control 23 (1978), 395).

    Examples
    --------
    >>> step = step_of(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([0.0, 2.0]), 3.0)
    >>> step.transition.tolist(), step.gain.tolist()
    ([[1.0, 3.0], [0.0, 1.0]], [9.0, 6.0])
    """
    n = len(B)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = A * time, B * time
    found = expm(whole)
    return Step(found[:n, :n], found[:n, n])


# --- The loop of a pulse servo at its frames: each decision is one burst of full voltage, as long as the --------------

# Behind the end of the pulses, d after the edge, the bridge drives for t_on = K s_µ |e|. A short burst is an impulse of
# voltage, of area A k_s T_f p e. One that is not short begins with its first volt and ends with its last, so it comes
# later in the mean than an impulse, the more so the larger the error; for an error that goes as E sin θ from frame to
# frame, its describing function is (4/πE) ∫ f(E sin θ) sin θ dθ over a quarter of a turn, of what one burst does (Gelb
# & Vander Velde, Multiple-Input Describing Functions, 1968, ch. 2). At E → 0 that is the impulse.

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_NODES, _WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(24)[0] + 1.0) * 0.5 * math.pi,
                    np.polynomial.legendre.leggauss(24)[1] * 0.25 * math.pi)  # over a quarter of a turn
_ERRORS = np.geomspace(1e-3, 30.0, 60)  # of the command's amplitude, among which that of the error is looked for


@dataclass(frozen=True, kw_only=True, eq=False)
class Bursts:
    """The law at every frame, and its effect on the plant.

    Parameters
    ----------
    plant : Plant
    period : float
        T_f [s]
    delay : float
        d, from the edge to the end of its pulse [s].
    spread : float
        By how much the later of the two pulses ends later, of the error: ½ s_µ [s/rad].
    stretch : float
        K s_µ: for how long the bridge drives, of the error [s/rad].
    voltage : float
        Behind R_a while it drives [V].
    """

    plant: Plant
    period: float
    delay: float
    spread: float
    stretch: float
    voltage: float

    @property
    def ticks(self) -> int:
        """Every frame is the same."""
        return 1

    @property
    def transition(self) -> Array:
        """Of the plant from edge to edge, shape (n, n)."""
        return step_of(self.plant.A, self.plant.B, self.period).transition

    def jump(self, error: float = 0.0) -> Array:
        """Return what a frame's burst leaves in the plant at the next edge, per error of an amplitude [rad]."""
        A, B = self.plant.A, self.plant.B
        if error == 0.0:
            found: Array = expm(A * (self.period - self.delay)) @ B * self.voltage * self.stretch
            return found
        found = np.zeros(len(B))
        for e, length, start, share in self._bursts(error):
            left = self.period - start - length
            found += share / e * self.voltage * (expm(A * left) @ step_of(A, B, length).gain)
        return found

    def spectrum(self, omega: float, error: float = 0.0) -> complex:
        """Return the fundamental of the voltage over that of the error, whose samples have an amplitude [V/rad]."""
        if error == 0.0:
            return complex(self.voltage * self.stretch / self.period * np.exp(-1j * omega * self.delay))
        found = 0j
        for e, length, start, share in self._bursts(error):
            found += share / e * (np.exp(-1j * omega * start) * (1.0 - np.exp(-1j * omega * length)) / (1j * omega))
        return complex(self.voltage / self.period * found)

    def _bursts(self, error: float) -> list[tuple[float, float, float, float]]:
        """Return error, length, start and weight of the bursts over a quarter of a turn of the error's phase."""
        sizes = error * np.sin(_NODES)
        shares = 4.0 / math.pi * np.sin(_NODES) ** 2 * _WEIGHTS
        return [(e, min(self.stretch * e, self.period), self.delay + self.spread * e, share)
                for e, share in zip(sizes.tolist(), shares.tolist(), strict=True)]

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return L*, angle at the edges over error, shape of `omega`."""
        z = np.exp(1j * np.asarray(omega) * self.period)[..., np.newaxis, np.newaxis] * np.eye(len(self.plant.B))
        moved = np.linalg.solve(z - self.transition, self.jump(error)[:, np.newaxis])[..., 0]
        return np.asarray(moved @ self.plant.angle, np.complex128)

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output angle over a commanded angle's, shape of `omega`."""
        found = [self._at(w, self._error(w, amplitude)) for w in np.ravel(omega).tolist()]
        return np.array(found).reshape(np.shape(omega))

    def _at(self, omega: float, error: float) -> complex:
        if math.isnan(error):
            return complex(math.nan, math.nan)
        one = np.array([omega])
        return complex((self.plant.response(one) * self.spectrum(omega, error)
                        / (1.0 + self.open_loop(one, error)))[0])

    def _error(self, omega: float, amplitude: float) -> float:
        """Return the amplitude of the error under a commanded sine: where E |1 + L*(E)| is that of the command."""
        if amplitude == 0.0:
            return 0.0

        def beyond(error: float) -> float:
            return error * abs(1.0 + complex(self.open_loop(np.array([omega]), error)[0])) - amplitude

        sizes = (amplitude * _ERRORS).tolist()
        above = next((k for k, size in enumerate(sizes) if beyond(size) > 0.0), 0)
        if above == 0:
            return math.nan
        return float(brentq(beyond, sizes[above - 1], sizes[above], rtol=1e-9))

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop over a frame, its gain `gain` times its own."""
        return self.transition - gain * np.outer(self.jump(), self.plant.angle)


# --- The loop of a digital servo at its ticks: P, I and D of what it measures, each duty held for a tick --------------

# The derivative is renewed every m-th tick and held between, so the loop is the same again after m ticks, not after
# one: its fundamental is taken over m of them. Counts, dead zone, limits and profile are left out.

_SAME = 1e-9  # of a tick


class _Tick(NamedTuple):
    """`z' = transition z + drive d + told r`, and the duty `u = law z + direct r` on which the program decides."""

    transition: Array
    drive: Array
    told: Array
    law: Array
    direct: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Ticks:
    """The law at every tick, and its effect on the plant.

    Parameters
    ----------
    plant : Plant
    firmware : Firmware
    voltage : float
        Of the bridge at a duty of 1 [V].
    command : (float, float)
        Delay of the command [s], and for how long it is held [s].
    """

    plant: Plant
    firmware: Firmware
    voltage: float
    command: tuple[float, float]

    @property
    def period(self) -> float:
        """T_c [s]."""
        return self.firmware.T_c

    @property
    def ticks(self) -> int:
        """After how many ticks the loop is the same again."""
        return round(self.firmware.m) if self.firmware.k_d > 0.0 else 1

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return minus the fundamental of the duty decided over that of the duty applied, shape of `omega`."""
        return -self._fundamental(np.asarray(omega), closed=False)

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output angle over a commanded angle's, shape of `omega`."""
        omega = np.asarray(omega, dtype=np.float64)
        delay, held = self.command
        told = np.exp(-1j * omega * (delay + 0.5 * held)) * np.sinc(omega * held / (2.0 * np.pi))
        applied = np.exp(-1j * omega * (self.firmware.T_d + 0.5 * self.period)) * np.sinc(
            omega * self.period / (2.0 * np.pi))
        found: Complex = (self.plant.response(omega) * self.voltage * applied * told
                          * self._fundamental(omega, closed=True))
        return found

    def _fundamental(self, omega: Array, *, closed: bool) -> Complex:
        """Return the fundamental of the duty decided, over a command's or, with the loop open, over a duty's."""
        ticks = self._all
        size, flat = len(ticks[0].drive), np.ravel(omega)
        turn = np.exp(1j * flat * self.period)
        z, moved = np.zeros((len(flat), size), complex), np.broadcast_to(np.eye(size), (len(flat), size, size))
        steps = [(t.transition + np.outer(t.drive, t.law), t.told + t.drive * t.direct) if closed else
                 (t.transition, t.drive) for t in ticks]
        for k, (transition, told) in enumerate(steps):  # from nothing; then what has to be there for it to continue
            z, moved = z @ transition.T + np.outer(turn**k, told), transition @ moved
        z = np.linalg.solve(turn[:, None, None] ** len(ticks) * np.eye(size) - moved, z[..., None])[..., 0]
        duty: Complex = np.zeros(len(flat), np.complex128)
        for k, (tick, (transition, told)) in enumerate(zip(ticks, steps, strict=True)):
            duty += (z @ tick.law) * turn**-k + (tick.direct if closed else 0.0)
            z = z @ transition.T + np.outer(turn**k, told)
        return (duty / len(ticks)).reshape(np.shape(omega))

    def over_a_turn(self) -> tuple[Array, Array]:
        """Return the closed loop until it is the same again, under an angle r held meanwhile: z' = A z + B r."""
        A, B = np.eye(len(self._all[0].drive)), np.zeros(len(self._all[0].drive))
        for tick in self._all:
            closed = tick.transition + np.outer(tick.drive, tick.law)
            A, B = closed @ A, closed @ B + tick.told + tick.drive * tick.direct
        return A, B

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop until it is the same again, its gain `gain` times its own."""
        found = np.eye(len(self._all[0].drive))
        for tick in self._all:
            found = (tick.transition + gain * np.outer(tick.drive, tick.law)) @ found
        return found

    @cached_property
    def _all(self) -> list[_Tick]:
        """The ticks until the loop is the same again: the first one renews the derivative."""
        return [self._tick(renews=self.firmware.k_d > 0.0), *[self._tick(renews=False)] * (self.ticks - 1)]

    def _tick(self, *, renews: bool) -> _Tick:
        fw, plant, n = self.firmware, self.plant, len(self.plant.B)
        late = int((fw.T_d + _SAME * fw.T_c) // fw.T_c)  # whole ticks by which a duty comes late
        rest = max(fw.T_d - late * fw.T_c, 0.0)
        y_at, D_at, x_at, J_at, first = n, n + 1, n + 2, n + 3, n + 4
        size = first + late + 1  # duties that wait: of the latest tick first
        unit = np.eye(size + 2)
        r, d = unit[size], unit[size + 1]
        q = np.concatenate([plant.angle, np.zeros(size + 2 - n)])
        y = (1.0 - fw.weight) * unit[y_at] + fw.weight * q
        e = r - y
        x = -y if fw.of_measurement > 0.0 else e
        D = fw.k_d * (x - unit[x_at]) / (fw.m * fw.T_c) if renews else unit[D_at] * (fw.k_d > 0.0)
        integrates = fw.k_i > 0.0 and fw.at_rest == 0.0
        J = unit[J_at] + fw.k_i * fw.T_c * e if integrates else 0.0 * e
        u = fw.k_p * e + J + D
        waiting = [d, *unit[first:size]]
        before, after = step_of(plant.A, plant.B, rest), step_of(plant.A, plant.B, fw.T_c - rest)
        state = np.zeros((n, size + 2))
        state[:, :n] = after.transition @ before.transition
        state += self.voltage * (np.outer(after.transition @ before.gain, waiting[late + 1])
                                 + np.outer(after.gain, waiting[late]))
        then = x if renews else unit[x_at] * (fw.k_d > 0.0)
        new = np.vstack([state, y, D, then, J, *waiting[:late + 1]])
        return _Tick(new[:, :size], new[:, size + 1], new[:, size], u[:size], float(u[size]))


# --- The loop of a servo that decides now and then: a pulse servo every frame, a digital one every tick ---------------


_FINEST = 600  # frequencies at which margins are looked for
_LOWEST = 1e-3  # of half the rate, the first of them
_NOTHING = 1e-9  # a pole at z = 0 is a delay
_LEFT_OUT = ("firmware.acceleration_limit", "firmware.speed_limit", "firmware.duty_slew")
_ONE_WAY = ("coast", "diode")


class Margins(NamedTuple):
    """How far a loop is from being unstable.

    Parameters
    ----------
    gain : float
        By what its gain may grow; inf where by anything [1].
    phase : float
        Phase that it may lose at its crossover; nan where there is none [rad].
    crossover : float
        Frequency at which its gain is 1 [rad/s].
    delay : float
        Further delay that it may have: phase over crossover [s].
    """

    gain: float
    phase: float
    crossover: float
    delay: float


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SampledServo:
    """The small-signal loop of a servo as it is sampled, friction, deadband and play apart.

    Parameters
    ----------
    model : PulseServo, PulseServoInductive or DigitalServo
    law : Law
        Law of the decisions, and of their effect on the plant.

    Examples
    --------
    >>> import servotwin as st
    >>> seen = st.linear.sampled(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> seen.period, seen.stable, round(float(np.degrees(seen.margins.phase)))
    (0.02, True, 70)
    """

    model: Model
    law: Law

    def __repr__(self) -> str:
        return f"SampledServo({self.model!r}, every {1e3 * self.period:g} ms)"

    @property
    def period(self) -> float:
        """From a decision to the next: T_f of a pulse servo, T_c of a digital one [s]."""
        return self.law.period

    @property
    def half_rate(self) -> float:
        """Half of the rate of decisions, π/T: beyond it a sine looks like a slower one [rad/s]."""
        return math.pi / self.period

    def response(self, frequencies: ArrayLike, *, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output angle over that of a commanded angle.

        Parameters
        ----------
        frequencies : array_like
            ω [rad/s].
        amplitude : float
            Of the command; what it adds is that bursts of a pulse servo take time. Digital servos: 0 [rad].

        Returns
        -------
        ndarray of complex, shape of `frequencies`
            nan where no error of any size balances.

        Raises
        ------
        InputError
            If frequencies are not positive and below half the rate, or an amplitude is not possible.

        Examples
        --------
        >>> import servotwin as st
        >>> seen = st.linear.sampled(st.PulseServo(st.load_servo("hitec-hs-755hb")))
        >>> np.abs(seen.response([1.0, 20.0])).round(3)
        array([1.   , 0.824])
        >>> np.abs(seen.response([1.0, 20.0], amplitude=np.radians(5.0))).round(3)
        array([1.   , 0.845])
        """
        omega = self._checked(frequencies)
        if not is_finite(amplitude) or amplitude < 0.0:
            raise InputError("amplitude", got=amplitude, allowed="a finite number of at least 0 [rad]")
        if amplitude > 0.0 and isinstance(self.law, Ticks):
            raise InputError("amplitude of a digital servo", got=amplitude, allowed="0: its ticks are linear, up to "
                             "their limits; frequency_response simulates sines of a finite size")
        return self.law.closed_loop(omega, amplitude)

    def open_loop(self, frequencies: ArrayLike) -> Complex:
        """Return the loop L*(jω), cut where the servo decides; in the shape of the frequencies [rad/s]."""
        return self.law.open_loop(self._checked(frequencies))

    def _checked(self, frequencies: ArrayLike) -> Array:
        omega = np.asarray(frequencies, dtype=np.float64)
        bad = ~(np.isfinite(omega) & (omega > 0.0) & (omega < self.half_rate))
        if np.any(bad):
            raise InputError("frequency", got=float(omega[bad].ravel()[0]),
                             allowed=f"positive and below half the rate, {self.half_rate:.4g} rad/s")
        return omega

    @cached_property
    def poles(self) -> Complex:
        """Poles s = ln z/T of the closed loop, the slowest first; those of pure delays are left out [1/s]."""
        return self.poles_at(1.0)

    def poles_at(self, gain: float) -> Complex:
        """Return the poles of the closed loop with `gain` times its own gain: a place on its root locus [1/s]."""
        z = np.linalg.eigvals(self.law.monodromy(gain)).astype(np.complex128)
        found = np.asarray(np.log(z[np.abs(z) > _NOTHING]) / (self.law.ticks * self.period), np.complex128)
        return found[np.argsort(-found.real, kind="stable")]

    @property
    def stable(self) -> bool:
        """Whether all that the loop is disturbed by fades."""
        return bool(self.poles[0].real < 0.0)

    @property
    def damping(self) -> float:
        """ζ of the least damped pair of poles; 1 where none swings."""
        swinging = self.poles[self.poles.imag > 0.0]
        return float((-swinging.real / np.abs(swinging)).min()) if swinging.size else 1.0

    @cached_property
    def margins(self) -> Margins:
        """Gain, phase and delay margin of the loop."""
        import control

        omega = np.geomspace(_LOWEST * self.half_rate, self.half_rate * (1.0 - 1e-9), _FINEST)
        seen: Any = control.FrequencyResponseData(self.open_loop(omega), omega, smooth=True)
        _, phase, _, _, crossover, _ = control.stability_margins(seen)
        if math.isinf(phase):
            phase = crossover = math.nan
        phase = math.radians(phase)
        return Margins(self._gain_margin(), phase, float(crossover), float(phase / crossover))

    def _gain_margin(self) -> float:
        """Return by what the gain may grow until a disturbance no longer fades."""
        def fades(gain: float) -> bool:
            return bool(np.abs(np.linalg.eigvals(self.law.monodromy(gain))).max() < 1.0)

        gains = np.geomspace(1e-3, 1e4, 141).tolist()
        low = next((k for k, gain in enumerate(gains) if fades(gain)), None)
        if low is None:
            return math.nan
        high = next((k for k in range(low, len(gains)) if not fades(gains[k])), None)
        if high is None:
            return math.inf
        least, most = gains[high - 1], gains[high]
        while most / least - 1.0 > 1e-9:
            middle = math.sqrt(least * most)
            least, most = (middle, most) if fades(middle) else (least, middle)
        return float(least)

    def loop(self) -> control.StateSpace:
        """Return L*(z), from the error to the angle at the edges, as a python-control system of the frame period.

        Raises
        ------
        InputError
            If the servo is digital: with what it remembers its loop is not one of the angle alone; see `system`.

        Examples
        --------
        >>> import control
        >>> import servotwin as st
        >>> seen = st.linear.sampled(st.PulseServo(st.load_servo("hitec-hs-755hb")))
        >>> round(float(control.margin(seen.loop())[1]), 3)  # phase margin [deg]
        70.469
        """
        import control

        if not isinstance(self.law, Bursts):
            raise InputError("loop of a digital servo", got=self.model, allowed="system for the "
                             "closed loop; open_loop, poles_at and margins")
        plant = self.law.plant
        found: Any = control.StateSpace(
            self.law.transition, self.law.jump()[:, np.newaxis], plant.angle[np.newaxis, :], [[0.0]], self.period,
            states=list(plant.states), inputs=["error_angle"], outputs=["output_angle"], name="frames")
        return found

    def system(self) -> control.StateSpace:
        """Return the closed loop from a commanded angle to the output angle as a python-control system.

        A pulse servo's is that of its edges. A digital servo's derivative is renewed every so many ticks, and its loop
        is the same again after these: that is the system's period, and for so long a command is held.

        Examples
        --------
        >>> import servotwin as st
        >>> servo = st.DigitalServo(st.load_servo("dynamixel-xl430-w250"))
        >>> system = st.linear.sampled(servo).system()
        >>> system.dt, system.ninputs, round(float(system.dcgain()), 6)
        (0.001, 1, 1.0)
        """
        import control

        ends: dict[str, Any] = {"inputs": ["command_angle"], "outputs": ["output_angle"]}
        if not isinstance(self.law, Ticks):
            loop: Any = control.StateSpace(control.feedback(self.loop()), name="frames", **ends)
            return loop
        A, B = self.law.over_a_turn()
        q = np.append(self.law.plant.angle, np.zeros(len(B) - len(self.law.plant.angle)))
        found: Any = control.StateSpace(A, B[:, np.newaxis], q[np.newaxis, :], [[0.0]], self.law.ticks * self.period,
                                        name="ticks", **ends)
        return found


def sampled(model: Model, load: Load | Part | None = None, *, angle: float | None = None,
            frame_period: float | None = None) -> SampledServo:
    """Return the small-signal loop of a servo that decides now and then.

    A frame of a pulse servo is one burst of voltage, of area A k_s T_f v_e, at the decision d behind the edge. So the
    error at the edges is E = V_command/(1 + L*), with L* = A k_s T_f p times the plant, behind d, sampled at T_f, and
    the output A k_s P(jω) e^{−jωd} E. A digital servo holds each duty for a tick T_c, T_d later.

    Parameters
    ----------
    model : PulseServo, PulseServoInductive or DigitalServo
    load : Load, optional
        Inertia, viscous friction, springs and elastic arms count, and pendulums by their stiffness.
    angle : float, optional
        About which the servo moves: it sets the width of the pulses, and the stiffness of pendulums. Unless given the
        middle of the travel, and pendulums as they hang [rad].
    frame_period : float, optional
        T_f of a pulse servo [s]; the servo's own unless given.

    Returns
    -------
    SampledServo

    Raises
    ------
    InputError
        If the model has neither frames nor ticks, or a bridge that leaves the motor open between drives; if a number
        is not possible.

    Warns
    -----
    UserWarning
        Names what is left out although it changes small motions too.

    See Also
    --------
    transfer_function : the mean of the pulses, without frames.
    frequency_response : the response to sines of a finite size, simulated.
    """
    check_model(model, frame_period, linear=False)
    load = as_load(load)
    if model.endless:
        raise InputError(f"the sampled loop of {model.servo.name}", got="potentiometer.fixed_angle",
                         allowed="a servo whose feedback turns with its shaft: this one has no loop")
    if isinstance(model, DigitalServo):
        return SampledServo(model=model, law=_ticks(model, load, angle))
    if not isinstance(model, PulseServo | PulseServoInductive):
        raise InputError("model of a sampled loop", got=model, allowed="a pulse servo or a digital servo: the others "
                         "follow their command at all times")
    if frame_period is not None:
        model = type(model)(model.servo.replace({"electronics.frame_period": frame_period}))
    model.check_mean("the sampled loop", ("motor.brush_drop_voltage",))
    return SampledServo(model=model, law=_bursts(model, load, angle))


def _bursts(model: PulseServo | PulseServoInductive, load: Load, angle: float | None) -> Bursts:
    numbers, T_f = model.pack(load), model.frame_period
    p = numbers.sensor.p
    s_mu = model.value("electronics.one_shot_slope") * p
    stretch = model.value("electronics.stretcher_gain") * s_mu
    return Bursts(
        plant=plant_of(numbers, load, angle), period=T_f, delay=mid_pulse(model, angle),
        spread=0.5 * s_mu, stretch=stretch, voltage=model.mean_gain() * T_f * p / stretch)


def _ticks(model: DigitalServo, load: Load, angle: float | None) -> Ticks:
    state = model.servo.get("firmware.off_state")
    if state in _ONE_WAY:
        raise InputError(f"the sampled loop of {model.servo.name}", got=f"a bridge with firmware.off_state {state!r}",
                         allowed="one that brakes: without current the voltage is the motor's own")
    numbers, firmware = model.pack(load), model.firmware()
    left_out = [name for name in _LEFT_OUT if model.servo.get(name) is not None]
    if left_out:
        warnings.warn(f"{model.servo.name}: the sampled loop leaves out {', '.join(left_out)}: commands that change "
                      "faster come later than it says", stacklevel=3)
    drop = numbers.bridge.D_drive - numbers.bridge.V_br
    told = ((firmware.latency, 0.0) if model.takes_goals else
            (mid_pulse(model, angle) + 0.5 * firmware.T_c, firmware.T_f))
    return Ticks(plant=plant_of(numbers, load, angle), firmware=firmware, voltage=numbers.source.V - drop, command=told)


def mid_pulse(model: Model, angle: float | None) -> float:
    """Return the pulse width of an angle, or of the middle of the travel [s]."""
    centre = signals.constant(mid_travel(model) if angle is None else angle, unit="rad")
    return float(model.command(centre).table[0].value)
