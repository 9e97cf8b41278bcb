"""The loop of a servo that decides now and then: a pulse servo every frame, a digital one every tick."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import signals
from servotwin.errors import InputError
from servotwin.linear.bursts import Bursts
from servotwin.linear.law import Law
from servotwin.linear.plant import plant_of
from servotwin.linear.ticks import Ticks
from servotwin.linear.transfer_function import check_model
from servotwin.loads import as_load
from servotwin.models import DigitalServo, PulseServo, PulseServoInductive, mid_travel
from servotwin.units import is_finite

if TYPE_CHECKING:
    import control
    from numpy.typing import ArrayLike

    from servotwin.loads import Load, Part
    from servotwin.models import Model

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

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
        What it may lose at its crossover; nan where there is none [rad].
    crossover : float
        Frequency at which its gain is 1 [rad/s].
    delay : float
        What may come later: phase over crossover [s].
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
        What decides, and what that does to the plant.

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
