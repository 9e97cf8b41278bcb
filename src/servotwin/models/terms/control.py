"""One tick of a digital servo: measure, follow the profile, compute the law, limit, protect.

The state of the program is changed in place, in a record of compiled code or in an object with the same names.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

from servotwin.models.terms.duty import BRAKED, OPEN
from servotwin.models.terms.firmware import FAILSAFE, LIMP, Firmware
from servotwin.physics.firmware import (
    NEARLY,
    braking_distance,
    counted,
    cut,
    duty_for_bus_current,
    duty_for_motor_current,
    duty_of,
    error_beyond_zone,
    filtered_angle,
    integrated_error,
    started_duty,
)

# --- The profile of a digital servo -----------------------------------------------------------------------------------

def present(firmware: Firmware) -> bool:
    """Tell whether the reference takes time to get to a goal."""
    return firmware.v < math.inf or firmware.a < math.inf


def follow(firmware: Firmware, firm: Any) -> None:
    """Advance the reference by a tick."""
    if not present(firmware):
        firm.r, firm.rate = firm.goal, 0.0
        return
    T_c, rest = firmware.T_c, firm.goal - firm.r
    way = math.copysign(1.0, rest)
    speed, change = abs(firm.rate), firmware.a * T_c
    S = braking_distance(speed, firmware.a, T_c)
    if firm.on_course == 0 and way * firm.rate >= 0.0 and S <= abs(rest) * (1.0 + NEARLY):
        firm.on_course = 1
    if firm.on_course == 0:  # it brakes, goes too far, and comes back
        speed = speed - change if speed - change > firmware.v_0 + NEARLY * change else 0.0
        firm.rate = math.copysign(speed, firm.rate)
        firm.r += firm.rate * T_c
        return
    speed = max(speed - change, 0.0) if S >= abs(rest) * (1.0 - NEARLY) else min(speed + change, firmware.v)
    speed = max(speed, firmware.v_0)
    if speed * T_c >= abs(rest) * (1.0 - NEARLY):
        firm.r, firm.rate = firm.goal, 0.0
    else:
        firm.rate = way * speed
        firm.r += firm.rate * T_c


# --- The protections of a digital servo: overload, current, heat, supply; what they leave of the duty -----------------

NONE, OVERLOAD, CURRENT, HEAT, UNDERVOLTAGE = range(5)  # as `trip` shows them
OFF = -1.0  # of a clock that does not run
COOLER = 5.0  # K below its trip it works again


def acting(firm: Any) -> int:
    """Return which protection acts; of several the one that comes last in the list."""
    if firm.starved != 0:
        return UNDERVOLTAGE
    if firm.hot != 0:
        return HEAT
    if firm.tripped != 0:
        return CURRENT
    return OVERLOAD if firm.overloaded != 0 else NONE


def stop(firm: Any) -> bool:
    """Tell whether heat or supply stop it: no duty, and the shaft is where it shall be."""
    return bool(firm.hot != 0 or firm.starved != 0)


def allowed(firmware: Firmware, firm: Any) -> float:
    """Return how much duty the protections leave."""
    if stop(firm):
        return 0.0
    return firmware.overload_output if firm.overloaded != 0 else math.inf


def judge(firmware: Firmware, firm: Any, w: float, limp: bool, i: float, V_bus: float, T_h: float) -> None:
    """Look, after the loop has asked for a duty w, at all that is protected: duty, current, voltage, temperature."""
    if firmware.overload_duty < math.inf:
        _judge_overload(firmware, firm, w, limp)
    _judge_current(firmware, firm, i)
    if T_h > firmware.trip_temperature:
        firm.hot = 1
    elif T_h <= firmware.trip_temperature - COOLER:
        firm.hot = 0
    firm.starved = 1 if V_bus < firmware.undervoltage else 0


def _judge_current(firmware: Firmware, firm: Any, i: float) -> None:
    """Too much current for too long makes it limp until the next goal."""
    if not abs(i) >= firmware.trip_current:
        firm.current_clock = OFF
        return
    firm.current_clock = 0.0 if firm.current_clock < 0.0 else firm.current_clock + firmware.T_c
    if firm.current_clock >= firmware.trip_time - NEARLY * firmware.T_c:
        firm.tripped, firm.current_clock = 1, OFF


def _judge_overload(firmware: Firmware, firm: Any, w: float, limp: bool) -> None:
    """Too much duty for too long, at a standstill, and there is less of it until less is asked for."""
    eased = w * firm.overload_sign < firmware.overload_output * (1.0 - NEARLY)
    if firm.overloaded != 0:
        if firmware.latches > 0.0 or not (eased or firm.torque == 0):
            return
        firm.overloaded = 0
    if firm.overload_clock >= 0.0:
        firm.overload_clock += firmware.T_c
        if eased or limp:
            firm.overload_clock = OFF
        elif abs(firm.y - firm.overload_y) > firmware.stall_travel * (1.0 + NEARLY):
            _start(firm, w)
    if firm.overload_clock < 0.0 and abs(w) > firmware.overload_duty * (1.0 + NEARLY):
        _start(firm, w)
    if firm.overload_clock >= firmware.overload_time - NEARLY * firmware.T_c:
        firm.overloaded, firm.overload_clock = 1, OFF


def _start(firm: Any, w: float) -> None:
    firm.overload_clock, firm.overload_y, firm.overload_sign = 0.0, firm.y, 1.0 if w > 0.0 else -1.0


# --- One tick of a digital servo: measure, follow the profile, compute the law, limit, protect ------------------------

WAITING = 16  # duties that may wait, see `parameters.groups.MOST_WAITING`
Duties = tuple[float, float, float, float, float, float, float, float, float, float, float, float, float, float, float,
               float]
NOWHERE = math.inf  # where no goal has been given


class Firm(NamedTuple):
    """Everything that a program remembers; angles [rad], times [s], duties [1]."""

    torque: int  # 1: torque is on
    tick: int  # number of the next tick
    draws: int  # of noise so far, one a tick
    waiting: int  # duties that are decided and not yet applied
    head: int  # where the next one is put
    duties: Duties
    duty: float  # of the bridge now, or `OPEN`, `BRAKED`
    decided: float  # of the latest tick
    frame: int  # number of the next pulse
    falls: float  # when the pulse that has risen falls; inf: none has
    width: float  # of that
    hears: float  # nothing new comes before this time
    heard: float  # when the latest command was taken; -inf: none yet
    given: float  # the goal that a table of commands begins with, or `NOWHERE`
    since: float  # from when on it does: one that is another one is written when a call begins
    coming: Duties  # goals of the next ticks that are written already
    known: int  # how many of them
    first: int  # where the next one is
    written: float  # the latest goal that was written, or `NOWHERE`
    goal: float  # g, or `NOWHERE`
    y: float
    age: int  # ticks since power-up
    x: float  # of which the derivative is, when it was renewed last
    y_then: float  # y then
    resting: int  # 1: y has hardly moved between the two latest times
    D: float
    J: float
    excess: float  # (u − w) + (J − I) of the latest tick
    r: float
    rate: float  # of it
    on_course: int
    overload_clock: float
    overload_y: float
    overload_sign: float
    overloaded: int
    current_clock: float
    lost: int  # 1: without a command for too long
    tripped: int  # 1: limp by a current, until the next goal
    hot: int
    starved: int
    restart: float  # time until it has started anew
    soft: float  # since the first goal; −1: none has come
    trip: int


_NONE = cast("Duties", (0.0,) * WAITING)
AT_START = Firm(
    torque=1, tick=0, draws=0, waiting=0, head=0, duties=_NONE, duty=0.0, decided=0.0, frame=0, falls=math.inf,
    width=0.0, hears=-math.inf, heard=-math.inf, given=NOWHERE, since=0.0, coming=_NONE, known=0, first=0,
    written=NOWHERE, goal=NOWHERE, y=0.0, age=0, x=0.0, y_then=0.0, resting=0, D=0.0, J=0.0, excess=0.0, r=0.0,
    rate=0.0, on_course=0, overload_clock=OFF, overload_y=0.0, overload_sign=0.0, overloaded=0, current_clock=OFF,
    lost=0, tripped=0, hot=0, starved=0, restart=0.0, soft=OFF, trip=NONE)
Programs = Sequence[Firm]
NOT_STARTED: Programs = (AT_START,)
ABSENT: Any = 0  # in its place where there is no program


def thawed(firm: Firm) -> Any:
    """Return an object with what a program remembers, to be changed in place."""
    return SimpleNamespace(**firm._asdict() | {"duties": list(firm.duties), "coming": list(firm.coming)})


def frozen(firm: Any) -> Firm:
    """Return what such an object holds."""
    return Firm(**vars(firm) | {"duties": tuple(firm.duties), "coming": tuple(firm.coming)})


def told_by(firm: Any) -> tuple[float, float, float, int]:
    """Return what shows of a program: its duty, or `OPEN`, `BRAKED`; goal and reference [rad]; its trip."""
    return firm.duty, firm.r if firm.goal == NOWHERE else firm.goal, firm.r, firm.trip


class Sensed(NamedTuple):
    """Measured values of the program at a tick, its own angle apart."""

    i: float  # of the motor [A]
    V_bus: float
    back_emf: float  # [V]
    R: float  # R_a + r_c [Ω]
    T_h: float  # of the housing [K]


NOTHING_SENSED = Sensed(0.0, math.inf, 0.0, 1.0, 0.0)


def senses(firmware: Firmware) -> bool:
    """Tell whether a tick needs more than the angle."""
    return (firmware.I_m < math.inf or firmware.trip_current < math.inf or firmware.trip_temperature < math.inf
            or firmware.undervoltage > 0.0)


def tick(firmware: Firmware, firm: Any, angle: float, sensed: Sensed, silence: float) -> float:
    """Return the duty on which a tick decides, or `OPEN`, `BRAKED`; `silence` is the time without a command [s]."""
    if firm.restart > 0.0 and not _has_started(firmware, firm, silence):
        return OPEN
    _measure(firmware, firm, angle)
    if firm.goal != NOWHERE:
        firm.soft = firm.soft + firmware.T_c if firm.soft >= 0.0 else 0.0
    limp = _loses(firmware, firm, silence) or firm.torque == 0 or firm.goal == NOWHERE or _is_limp(firmware, firm)
    if stop(firm):
        _stay(firm)
    w = 0.0 if limp else _asked_for(firmware, firm)
    judge(firmware, firm, w, limp, sensed.i, sensed.V_bus, sensed.T_h)
    firm.trip = acting(firm)
    if firm.starved != 0 and firmware.resets > 0.0:
        _lose_all(firmware, firm)
        return OPEN
    if stop(firm):
        _stay(firm)
    if limp or _is_limp(firmware, firm):
        _let_go(firmware, firm)
        return BRAKED if firm.torque == 0 and firmware.brakes > 0.0 else OPEN
    firm.decided = _given(firmware, firm, w, sensed)
    return float(firm.decided)


def _has_started(firmware: Firmware, firm: Any, silence: float) -> bool:
    """Tell whether a program that starts anew is ready by now; what it was sent before is lost."""
    slack = NEARLY * firmware.T_c
    if firm.restart > firmware.T_c + slack or silence > firmware.T_c - firm.restart + slack:
        firm.goal = NOWHERE
    firm.restart -= firmware.T_c
    if firm.restart > slack:
        return False
    firm.restart, firm.trip = 0.0, NONE
    return True


def _loses(firmware: Firmware, firm: Any, silence: float) -> bool:
    """Tell whether it is limp for want of a command; or go to the angle that it has for that case."""
    if firm.goal == NOWHERE or silence < firmware.timeout - NEARLY * firmware.T_c:
        firm.lost = 0
        return False
    if firmware.loss == FAILSAFE and firm.lost == 0:
        aim(firmware, firm, firmware.failsafe)
    firm.lost = 1
    return firmware.loss == LIMP


def _is_limp(firmware: Firmware, firm: Any) -> bool:
    """Tell whether a protection leaves no torque at all."""
    return bool(firm.tripped != 0 or (firm.overloaded != 0 and firmware.overload_output == 0.0))


def _stay(firm: Any) -> None:
    """Set the goal to where the shaft is."""
    firm.goal = firm.r = firm.y
    firm.rate, firm.on_course = 0.0, 0


def aim(firmware: Firmware, firm: Any, goal: float) -> None:
    """Take a goal [rad]; a new one is off course at first."""
    goal = min(max(goal, firmware.lower), firmware.upper)
    if not goal == firm.goal:
        firm.goal, firm.on_course = goal, 0


def _measure(firmware: Firmware, firm: Any, angle: float) -> None:
    now = counted(angle, firmware.quantum)
    if firm.age == 0:
        firm.y = firm.y_then = firm.r = now
        firm.x = -now if firmware.of_measurement > 0.0 else 0.0
    else:
        firm.y = filtered(firmware, firm.y, now)
    firm.age += 1
    if firm.age % int(firmware.m) == 0:
        firm.resting = 1 if rests(firmware, firm.y - firm.y_then) else 0
        firm.y_then = firm.y


def filtered(firmware: Firmware, before: float, now: float) -> float:
    """Return y of a tick that follows another, of an angle that has been counted."""
    if firmware.weight < 1.0:
        return cut(filtered_angle(before, now, firmware.weight), _whole(firmware))
    return now


def rests(firmware: Firmware, travel: float) -> bool:
    """Tell whether y has hardly moved."""
    return abs(travel) < firmware.rest_travel * (1.0 - NEARLY)


def _whole(firmware: Firmware) -> float:
    """Return what angles are cut to: a count, where the program has no fractions of one."""
    return firmware.quantum if firmware.whole > 0.0 else 0.0


def _asked_for(firmware: Firmware, firm: Any) -> float:
    """Return the duty w that the law asks for, within its own limit."""
    rate, delta = firm.rate, firmware.delta
    if not stop(firm):
        follow(firmware, firm)
    z = beyond_zone(firmware, firm.r, firm.y)
    _renew(firmware, firm, z)
    u = duty_of(firmware.k_p, z, delta)
    J = 0.0
    if firmware.k_i > 0.0:
        if firmware.at_rest == 0.0 or (firm.resting != 0 and acting(firm) == NONE):
            firm.J = integrated_error(firm.J, z, firm.excess, firmware.k_i, firmware.kappa, firmware.T_c)
        J = cut(firm.J, delta)
    integral = min(max(J, -firmware.I_limit), firmware.I_limit)
    u += integral + firm.D
    if firmware.k_v > 0.0:
        u += duty_of(firmware.k_v, firm.rate, delta)
    if firmware.k_a > 0.0:
        u += duty_of(firmware.k_a, (firm.rate - rate) / firmware.T_c, delta)
    u, w = limited(firmware, u)
    firm.excess = (u - w) + (J - integral)
    return w


def beyond_zone(firmware: Firmware, r: float, y: float) -> float:
    """Return the error z beyond the dead zone [rad]."""
    error = cut(r, _whole(firmware)) - y
    return error_beyond_zone(error, firmware.h, firmware.gate > 0.0)


def limited(firmware: Firmware, terms: float) -> tuple[float, float]:
    """Return u and w for the sum of all terms: with what it takes to start, and within the limit of the torque."""
    # a sum of whole steps is one, whatever floats make of it
    u = started_duty(cut(terms, firmware.delta), firmware.minimum)
    return u, min(max(u, -firmware.torque_limit), firmware.torque_limit)


def _renew(firmware: Firmware, firm: Any, z: float) -> None:
    """Renew the derivative, each so many ticks; between them it is held."""
    if firmware.k_d == 0.0 or firm.age % int(firmware.m) != 0:
        return
    x = -firm.y if firmware.of_measurement > 0.0 else z
    firm.D = derivative(firmware, x - firm.x)
    firm.x = x


def derivative(firmware: Firmware, change: float) -> float:
    """Return the derivative's term D after a change of x [rad]."""
    if abs(change) < firmware.threshold * (1.0 - NEARLY):
        return 0.0
    return duty_of(firmware.k_d / (firmware.m * firmware.T_c), change, firmware.delta)


def _given(firmware: Firmware, firm: Any, w: float, sensed: Sensed) -> float:
    """Return the duty that limits and trips leave of w."""
    most = min(firmware.duty_limit, allowed(firmware, firm))
    if firm.soft < firmware.soft_time - NEARLY * firmware.T_c:
        most = min(most, firmware.soft_duty)
    d = within(firmware, w, most, firm.decided)
    if firmware.I_m < math.inf and sensed.V_bus > 0.0:
        low, high = _within_current(firmware, sensed)
        d = min(max(d, low), high)
        d = min(max(d, -firmware.duty_limit), firmware.duty_limit)
    return d


def within(firmware: Firmware, w: float, most: float, before: float) -> float:
    """Return the duty that is left of w within a limit, and as near to the one before as it has to be."""
    d = min(max(w, -most), most)
    if firmware.slew < math.inf:
        change = firmware.slew * firmware.T_c
        d = min(max(d, before - change), before + change)
    return d


def _within_current(firmware: Firmware, sensed: Sensed) -> tuple[float, float]:
    """Return the duties between which the current stays within its limit."""
    v_b, R, V, I_m = sensed.back_emf, sensed.R, sensed.V_bus, firmware.I_m
    if firmware.senses_bus > 0.0:
        return duty_for_bus_current(I_m, v_b, R, V, -1.0), duty_for_bus_current(I_m, v_b, R, V, 1.0)
    return duty_for_motor_current(-I_m, v_b, R, V), duty_for_motor_current(I_m, v_b, R, V)


def _let_go(firmware: Firmware, firm: Any) -> None:
    """Follow the shaft, so that nothing jumps when torque comes back."""
    firm.r, firm.rate, firm.on_course = firm.y, 0.0, 0
    firm.J = firm.D = firm.excess = firm.decided = 0.0
    firm.x = -firm.y if firmware.of_measurement > 0.0 else 0.0


def _lose_all(firmware: Firmware, firm: Any) -> None:
    """Begin to start anew, as at power-up."""
    firm.goal = firm.written = NOWHERE
    firm.overloaded = firm.tripped = firm.hot = firm.starved = 0
    firm.overload_clock = firm.current_clock = firm.soft = OFF
    _let_go(firmware, firm)
    firm.age, firm.restart, firm.trip = 0, firmware.restart_time, UNDERVOLTAGE
