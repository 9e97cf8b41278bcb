"""The program of a digital servo under a standing error: stiffness, dead zone, cap and protections."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin.datasheet.holding import Span, spanned
from servotwin.errors import InputError
from servotwin.loads import as_load
from servotwin.models import DigitalServo
from servotwin.models.engine.dynamics import contacts
from servotwin.models.standing import standing_current
from servotwin.physics import motor
from servotwin.physics.firmware import NEARLY, cut, duty_of, error_beyond_zone, started_duty

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from servotwin.models import Model
    from servotwin.models.terms.firmware import Firmware
    from servotwin.models.terms.numbers import Numbers

_FINEST = 1e-12  # rad
_MOST_TORQUE = 1e3  # times the stalled motor's: where the search for what friction holds ends


_GUESSED = ("stiffness", "dead_zone", "minimum_duty", "friction_error", "start_error", "cap_error", "cap_torque",
            "cap_lifts")


class Standing(NamedTuple):
    """Torques at the shaft while an error stands.

    Parameters
    ----------
    motor : float
        Of the motor, before friction [N m].
    lifts : float
        Against less than this the shaft goes towards its goal [N m].
    holds : float
        Against more than this the load turns it back; inf where it cannot at all [N m].
    """

    motor: float
    lifts: float
    holds: float


class Protection(NamedTuple):
    """A protection: its threshold, and its effect.

    Parameters
    ----------
    kind : str
        "overload", "current", "heat" or "undervoltage".
    threshold : float
        Duty asked for [1], current [A], temperature [K] or voltage [V].
    time : float
        For which it has to last; 0: at once [s].
    left : float
        Most duty while it acts; 0: no torque at all [1].
    error : float
        At which a shaft that is held fast passes the threshold; nan where an error does not [rad].
    torque : float
        Of the motor at that error; nan where there is none [N m].
    left_torque : float
        Of the motor at the duty that is left [N m].
    release_error : float
        Below which it lets go of an overload; nan where something else ends it [rad].
    latches : bool
        Whether nothing but a power cycle ends it.
    """

    kind: str
    threshold: float
    time: float
    left: float
    error: float
    torque: float
    left_torque: float
    release_error: float
    latches: bool


@dataclass(frozen=True)
class Loop:
    """The loop of a digital servo at rest: torque over an error that stands, derivative and integral left out.

    Parameters
    ----------
    model : DigitalServo

    Raises
    ------
    InputError
        If the model is another.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.feetech_sts({"P_Coefficient": 16}, servo="feetech-sts3215-12v")
    >>> loop = Loop(st.DigitalServo(servo))
    >>> round(loop.stiffness, 1), round(loop.cap_error, 3), round(loop.cap_torque, 2)
    (16.2, 0.368, 6.01)
    """

    model: DigitalServo

    def __post_init__(self) -> None:
        _program(self.model)

    @cached_property
    def stiffness(self) -> float:
        """Torque of the motor per error, between dead zone and cap: k_p (V − V_ce0) K_out/R [N m/rad]."""
        return float(self.model.loop_stiffness())

    @cached_property
    def spans(self) -> dict[str, Span]:
        """Ranges of those of its numbers that rest on guesses, by name."""
        return spanned(self.model, lambda model: {name: getattr(Loop(_program(model)), name) for name in _GUESSED})

    def droop_spans(self, torque: float) -> dict[str, Span]:
        """Return the ranges of the droops for a torque [N m] that rest on guesses: "held" and "lifted"."""
        return spanned(self.model, lambda model: dict(zip(
            ("held", "lifted"), Loop(_program(model)).droop(torque), strict=True)))

    @cached_property
    def dead_zone(self) -> float:
        """Error within which the program does nothing, half of its width [rad]."""
        firmware = self._firmware
        return float(cut(firmware.h, self._count))

    @cached_property
    def count(self) -> float:
        """Step in which it sees its angle; 0: none [rad]."""
        return float(self._firmware.quantum)

    @cached_property
    def minimum_duty(self) -> float:
        """The duty added to any that is not 0 [1]."""
        return float(self._firmware.minimum)

    @cached_property
    def most_duty(self) -> float:
        """The most duty that the bridge gets [1]."""
        return float(self.model.most_duty)

    @cached_property
    def has_integral(self) -> bool:
        """Whether it integrates: the error that a load leaves goes away in time."""
        return bool(self._firmware.k_i > 0.0)

    @cached_property
    def friction_torque(self) -> float:
        """Static friction of the shaft without load or drive, forward [N m]."""
        return float(contacts.holding_bounds(self._plant, 0.0, 0.0)[1])

    @cached_property
    def friction_error(self) -> float:
        """That friction as an error, dead zone apart: half of the band in which it sticks [rad]."""
        return self.friction_torque / self.stiffness

    @cached_property
    def start_error(self) -> float:
        """The smallest error that moves the free shaft; nan where none does [rad]."""
        return self._first(lambda e: self.at(e).lifts > 0.0)

    @property
    def startup_moves(self) -> bool:
        """Whether the torque of the smallest duty exceeds friction: no error is small enough to be left alone."""
        return self.minimum_duty > 0.0 and self.motor_torque(self.minimum_duty) > self.friction_torque

    @cached_property
    def cap_error(self) -> float:
        """The smallest error at which the motor gives all that duty and current may be [rad]."""
        return self._first(lambda e: self.at(e).motor >= self.cap_torque * (1.0 - NEARLY))

    @cached_property
    def cap_torque(self) -> float:
        """Torque of the standing motor there [N m]."""
        return self.motor_torque(self.most_duty)

    @property
    def cap_lifts(self) -> float:
        """The torque that it lifts there, friction taken off [N m]."""
        return self._lifted(self.cap_torque)

    def asked(self, error: float) -> float:
        """Return the duty w that the program asks for while an error [rad] stands, of P and startup alone."""
        firmware = self._firmware
        h = cut(firmware.h, self._count)
        z = error_beyond_zone(cut(error, self._count), h, firmware.gate > 0.0)
        u = started_duty(duty_of(firmware.k_p, z, firmware.delta), firmware.minimum)
        return min(max(u, -firmware.torque_limit), firmware.torque_limit)

    def duty_of(self, error: float) -> float:
        """Return the duty that the bridge gets while an error [rad] stands, and nothing has tripped."""
        return min(max(self.asked(error), -self._firmware.duty_limit), self._firmware.duty_limit)

    def motor_torque(self, d: float) -> float:
        """Return the torque of the standing motor at a duty, at the shaft [N m]."""
        return motor.electromagnetic_torque(self._current(d), self._plant.motor.K)

    def at(self, error: float) -> Standing:
        """Return the torques while an error [rad] stands."""
        tau_m = self.motor_torque(self.duty_of(error))
        return Standing(tau_m, self._lifted(tau_m), self._held(tau_m))

    def droop(self, torque: float) -> tuple[float, float]:
        """Return between which errors [rad] a torque [N m] may stand: where it is just held, and just lifted.

        A shaft that the load pulls down stops at the first, one that comes up to its goal at the second; nan where the
        servo does not hold or lift so much. The error is that of the angle as the program sees it.

        Raises
        ------
        InputError
            If the torque is no finite number that is not negative.
        """
        if not 0.0 <= torque < math.inf:
            raise InputError("torque of a droop", got=torque, allowed="a number of at least 0 [N m]")
        return (self._first(lambda e: self.at(e).holds >= torque), self._first(lambda e: self.at(e).lifts >= torque))

    def over(self, errors: ArrayLike) -> NDArray[np.float64]:
        """Return torque of the motor, what it lifts and what it holds over errors [rad], shape (3, n) [N m]."""
        return np.array([self.at(error) for error in np.asarray(errors, dtype=np.float64).tolist()]).T

    @cached_property
    def protections(self) -> tuple[Protection, ...]:
        """Protections of the servo: those that its numbers give, in the order of the signal `trip`."""
        firmware, none = self._firmware, math.nan
        found = []
        if firmware.overload_duty < math.inf:
            error = self._first(lambda e: self.asked(e) > firmware.overload_duty * (1.0 + NEARLY))
            release = self._first(lambda e: self.asked(e) >= firmware.overload_output * (1.0 - NEARLY))
            reached = none if math.isnan(error) else self.at(error).motor
            found.append(Protection(
                "overload", firmware.overload_duty, firmware.overload_time, firmware.overload_output, error, reached,
                self.motor_torque(min(firmware.overload_output, self.most_duty)),
                none if firmware.latches > 0.0 else release, bool(firmware.latches > 0.0)))
        if firmware.trip_current < math.inf:
            error = self._first(lambda e: self._current(self.duty_of(e)) >= firmware.trip_current)
            reached = none if math.isnan(error) else self.at(error).motor
            found.append(Protection("current", firmware.trip_current, firmware.trip_time, 0.0, error, reached, 0.0,
                                    none, False))
        for kind, threshold, given in (("heat", firmware.trip_temperature, firmware.trip_temperature < math.inf),
                                       ("undervoltage", firmware.undervoltage, firmware.undervoltage > 0.0)):
            if given:
                found.append(Protection(kind, threshold, 0.0, 0.0, none, none, 0.0, none, False))
        return tuple(found)

    @cached_property
    def _firmware(self) -> Firmware:
        return self.model.firmware()

    @cached_property
    def _plant(self) -> Numbers:
        return self.model.pack(as_load(None))

    @property
    def _count(self) -> float:
        """The step to which the program cuts angles, where it has no fractions of a count."""
        return float(self._firmware.quantum if self._firmware.whole > 0.0 else 0.0)

    def _current(self, d: float) -> float:
        return standing_current(self._plant, self._firmware, d)

    def _lifted(self, tau_m: float) -> float:
        return self._where(lambda tau: tau_m - tau - contacts.holding_bounds(self._plant, tau_m, -tau)[1], tau_m)

    def _held(self, tau_m: float) -> float:
        return self._where(lambda tau: tau_m - tau + contacts.holding_bounds(self._plant, tau_m, -tau)[0], tau_m)

    def _where(self, balance: Callable[[float], float], tau_m: float) -> float:
        """Return the load [N m] at which a balance that falls with it is 0; inf where it never is."""
        from scipy.optimize import brentq

        span = abs(tau_m) + self.friction_torque
        low, high = tau_m - span, tau_m + span
        while balance(high) > 0.0:
            high += span
            if high > _MOST_TORQUE * (self.cap_torque + self.friction_torque):
                return math.inf
        while balance(low) < 0.0:
            low -= span
            if low < -_MOST_TORQUE * (self.cap_torque + self.friction_torque):
                return -math.inf
        return low if span == 0.0 else float(brentq(balance, low, high, xtol=1e-15, rtol=8.9e-16, maxiter=200))

    def _first(self, so: Callable[[float], bool]) -> float:
        """Return the smallest error [rad] for which something is so that stays so beyond it; nan where none is."""
        firmware, step = self._firmware, self._count
        far = firmware.h + (1.0 + firmware.delta) * (firmware.torque_limit + 1.0) / firmware.k_p + 4.0 * step
        if so(0.0):
            return 0.0
        if not so(far):
            return math.nan
        if step > 0.0:
            low, high = 0, math.ceil(far / step)
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (low, middle) if so(middle * step) else (middle, high)
            return high * step
        low_, high_ = 0.0, far
        while high_ - low_ > _FINEST:
            half = 0.5 * (low_ + high_)
            low_, high_ = (low_, half) if so(half) else (half, high_)
        return high_


def _program(model: Model) -> DigitalServo:
    """Return the same model: what guesses change of a digital servo is one."""
    if not isinstance(model, DigitalServo):
        raise InputError("model of a loop", got=type(model).__name__, allowed="DigitalServo")
    return model


def loop_of(model: Model) -> Loop | None:
    """Return the loop of a digital servo; None of other models.

    Examples
    --------
    >>> import servotwin as st
    >>> loop_of(st.PulseServo(st.load_servo("hitec-hs-755hb"))) is None
    True
    """
    return Loop(model) if isinstance(model, DigitalServo) else None
