"""Which gain gives a wanted margin or overshoot under a load, and what stiffness that buys."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import physics, signals
from servotwin.errors import InputError
from servotwin.linear.sampled import Bursts, Margins, SampledServo, sampled
from servotwin.linear.transfer_function import check_model
from servotwin.loads import Load, as_load
from servotwin.models import DigitalServo, PulseServo, PulseServoInductive, mid_travel
from servotwin.parameters import REGISTER_FAMILIES
from servotwin.simulation import Simulator, simulate_many
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.loads import Part
    from servotwin.models import Model
    _Tuned = DigitalServo | PulseServo | PulseServoInductive


# --- The gains that a servo can be given ------------------------------------------------------------------------------

_TRIED = 60  # P gains for each D, evenly by their logarithm
_RANGE = (0.02, 50.0)  # of P without a register, over what the servo has
_NEXT = 1e-4  # of a gain: nothing is between two that are nearer
_LEADS = (0.0, 0.005, 0.01, 0.02, 0.04)  # s, D over P without a register; as long as ticks and motors take


class _Names(NamedTuple):
    P: str
    D: str
    most: int
    tried: tuple[int, ...]  # of D


_REGISTERS = {
    "feetech-sts": _Names("P_Coefficient", "D_Coefficient", 254, (0, 8, 16, 32, 64, 128, 254)),
    "dynamixel-x": _Names("Position_P_Gain", "Position_D_Gain", 16383, (0, 250, 500, 1000, 2000, 4000, 8000, 16000)),
    **dict.fromkeys(("dynamixel-mx", "dynamixel-xl320"), _Names("P_Gain", "D_Gain", 254, (0, 8, 16, 32, 64, 128, 254))),
}


class Gain(NamedTuple):
    """A servo with other gains, or with a loop around it: what was set, and to what."""

    settings: dict[str, float]
    model: DigitalServo | PulseServo | PulseServoInductive


def gains_of(model: DigitalServo, *, derivative: bool) -> list[list[Gain]]:
    """Return servos with other gains P, growing, in a list for every D; that of the servo alone unless asked."""
    names = _REGISTERS.get(str(model.servo.sheet.get("registers")))
    if names is None:
        return _by_number(model, derivative=derivative)
    values = np.unique(np.round(np.geomspace(1.0, names.most, 2 * _TRIED)).astype(int)).tolist()
    own: tuple[int | None, ...] = names.tried if derivative else (None,)
    return [[_set(model, names, P, D) for P in values] for D in own]


def _set(model: DigitalServo, names: _Names, P: int, D: int | None) -> Gain:
    settings = {names.P: P} | ({} if D is None else {names.D: D})
    with warnings.catch_warnings():  # of registers that were not asked for
        warnings.simplefilter("ignore")
        servo = REGISTER_FAMILIES[str(model.servo.sheet["registers"])](settings, servo=model.servo)
    return Gain(dict(settings), DigitalServo(servo))


def _by_number(model: DigitalServo, *, derivative: bool) -> list[list[Gain]]:
    P_own = model.value("firmware.proportional_gain")
    found = []
    for lead in _LEADS if derivative else (None,):
        row = []
        for P in (P_own * np.geomspace(*_RANGE, _TRIED)).tolist():
            settings = {"firmware.proportional_gain": P}
            if lead is not None:
                settings["firmware.derivative_gain"] = lead * P
            row.append(Gain(settings, DigitalServo(model.servo.replace(settings))))
        found.append(row)
    return found


def between(low: Gain, high: Gain) -> Gain | None:
    """Return a gain between two of one row, or around one servo; None where nothing is between them.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> between(Gain({"outer_gain": 0.1}, model), Gain({"outer_gain": 0.4}, model)).settings
    {'outer_gain': 0.2}
    """
    model = low.model
    names = _REGISTERS.get(str(model.servo.sheet.get("registers")))
    if names is not None and names.P in low.settings and isinstance(model, DigitalServo):
        P = int(low.settings[names.P] + high.settings[names.P]) // 2
        D = low.settings.get(names.D)
        return None if P == low.settings[names.P] else _set(model, names, P, None if D is None else int(D))
    if all(high.settings[name] <= value * (1.0 + _NEXT) for name, value in low.settings.items()):
        return None
    settings = {name: math.sqrt(value * high.settings[name]) for name, value in low.settings.items()}
    return Gain(settings, DigitalServo(model.servo.replace(settings)) if isinstance(model, DigitalServo) else model)


# --- A loop around a pulse servo --------------------------------------------------------------------------------------

# c[n+1] = c[n] + g (r − q[n]): what a microcontroller can do about droop, dead zone and friction. The servo itself gets
# the angle c as a pulse; g is the part of the error that is made good in a frame.

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class OuterLoop:
    """The loop of a servo at its frames, and an integrator around it.

    Parameters
    ----------
    inner : Bursts
    gain : float
        g, of the error that the command makes good in a frame [1].
    """

    inner: Bursts
    gain: float

    @property
    def ticks(self) -> int:
        """Every frame is the same."""
        return 1

    @property
    def period(self) -> float:
        """T_f [s]."""
        return self.inner.period

    @cached_property
    def _steps(self) -> tuple[Array, Array]:
        """Return transition and input of plant and command, for what is added to the command at an edge."""
        n, jump = len(self.inner.plant.B), self.inner.jump()
        transition = np.zeros((n + 1, n + 1))
        transition[:n, :n], transition[:n, n], transition[n, n] = self.inner.monodromy(), jump, 1.0
        return transition, np.append(jump, 1.0)  # what is added counts in this very frame

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return the loop, angle at the edges over the error that is integrated, shape of `omega`."""
        transition, told = self._steps
        z = np.exp(1j * np.asarray(omega) * self.period)[..., np.newaxis, np.newaxis] * np.eye(len(told))
        moved = np.linalg.solve(z - transition, self.gain * told[:, np.newaxis])[..., 0]
        return np.asarray(moved @ np.append(self.inner.plant.angle, 0.0), np.complex128)

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output angle over a wanted angle's, shape of `omega`."""
        omega = np.asarray(omega, dtype=np.float64)
        z = np.exp(1j * omega * self.period)
        added = self.gain * z / (z - 1.0) / (1.0 + self.open_loop(omega))  # command over wanted angle
        return np.asarray(added * self.inner.closed_loop(omega), np.complex128)

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop over a frame, its gain `gain` times its own."""
        transition, told = self._steps
        return transition - gain * self.gain * np.outer(told, np.append(self.inner.plant.angle, 0.0))


def stepped(model: PulseServo | PulseServoInductive, load: Load, gain: float, *, start: float, step: float,
            frames: int) -> Array:
    """Return the output angle at the edges of a simulated step of the wanted angle, all terms counted.

    Parameters
    ----------
    model : PulseServo or PulseServoInductive
    load : Load
    gain : float
        g [1]
    start, step : float
        Where the servo rests, and by how much the wanted angle steps [rad].
    frames : int
    """
    simulator, T_f = Simulator(model, load=load), model.frame_period
    asked, wanted = start, start + step
    state = simulator.initial(signals.constant(asked, unit="rad"))
    angles = [state["output_angle"]]
    low, high = (model.value_or(f"stops.{side}_angle", side_at) for side, side_at in (
        ("lower", -np.inf), ("upper", np.inf)))
    for k in range(frames):
        asked = min(max(asked + gain * (wanted - state["output_angle"]), low), high)
        state = simulator.advance(state, (k + 1) * T_f, signals.constant(asked, unit="rad"))
        angles.append(state["output_angle"])
    return np.array(angles)


# --- Which gain gives a wanted margin or overshoot under a load, and what stiffness that buys -------------------------


_STEP = math.radians(10.0)
_DURATION = 2.0  # s, in which a step comes to rest
_SAMPLE = 1e-3  # s
_OUTER = np.geomspace(0.005, 1.9, 40)  # gains that are tried of an outer loop
_NEAR = 0.05  # an overshoot that is so near is the wanted one
_EVEN = 0.01  # overshoots that differ by less are the same: the larger gain wins


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """A gain that gives what was wanted.

    Parameters
    ----------
    model : Model
        The servo with that gain; as it is where the gain is that of a loop around it.
    settings : mapping of str to float
        Registers by name and value; `firmware` parameters where the servo has no register for P, an AX-12A too, whose
        P follows from compliance slopes in seven steps; "outer_gain", the part of the error that a loop around a pulse
        servo makes good in a frame.
    margins : Margins
        Of the loop with that gain, friction and deadband apart.
    overshoot : float
        Of a simulated step, all terms counted, beyond where it ends, over its way [1].
    step : float
        The size of that step [rad].
    stiffness : float
        Torque per error of the servo itself, K k_p V/R or K A k_s p/R [N m/rad].
    """

    model: Model
    settings: dict[str, float]
    margins: Margins
    overshoot: float
    step: float
    stiffness: float


class _Task(NamedTuple):
    """The tuned number."""

    model: _Tuned
    load: Load
    step: float

    @property
    def start(self) -> float:
        """Where the simulated step begins [rad]."""
        return mid_travel(self.model) - 0.5 * self.step


def tune(model: Model, load: Load | Part | None = None, *, overshoot: float | None = None,
         phase_margin: float | None = None, derivative: bool = False, step: float = _STEP,
         frame_period: float | None = None) -> Tuning:
    """Find the largest gain that gives a wanted overshoot, or leaves a wanted phase margin.

    Of a digital servo that is P of its program; of a pulse servo, whose own gain is soldered, that of an integrator
    around it, which a microcontroller with a tap of the potentiometer can be.

    Parameters
    ----------
    model : DigitalServo, PulseServo or PulseServoInductive
    load : Load, optional
        Nothing unless given.
    overshoot : float, optional
        Of a simulated step, over its way; within 0.05 of it [1].
    phase_margin : float, optional
        At least that, of the sampled loop without friction, by the largest gain: bisected, or the largest number that
        a register takes [rad].
    derivative : bool
        Whether D of a digital servo is looked for too.
    step : float
        Size of the simulated step, about the middle of the travel [rad].
    frame_period : float, optional
        T_f of a pulse servo [s]; the servo's own unless given.

    Raises
    ------
    InputError
        If not exactly one of both is wanted, a number is not possible, or no gain gives it: what there is is said.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    >>> found = tune(model, st.loads.Inertia(5e-3), phase_margin=np.radians(60.0))
    >>> sorted(found.settings), bool(np.degrees(found.margins.phase) > 60.0)
    (['P_Coefficient'], True)
    """
    if not isinstance(model, DigitalServo | PulseServo | PulseServoInductive):
        raise InputError("model to tune", got=model, allowed="a digital servo, for its P, or a pulse servo, for a loop "
                         "around it")
    check_model(model, frame_period, linear=False)
    if derivative and not isinstance(model, DigitalServo):
        raise InputError("derivative", got=model, allowed="a digital servo: the loop around a pulse servo has no D")
    if frame_period is not None:
        model = type(model)(model.servo.replace({"electronics.frame_period": frame_period}))
    _check(overshoot, phase_margin, step)
    task = _Task(model, as_load(load), step)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what the loop leaves out, once for each gain; simulation has it
        rows = (gains_of(model, derivative=derivative) if isinstance(model, DigitalServo)
                else [[Gain({"outer_gain": g}, model) for g in _OUTER.tolist()]])
        if phase_margin is not None:
            return _by_margin(task, rows, phase_margin)
        return _by_overshoot(task, rows, overshoot or 0.0)


def _check(overshoot: float | None, phase_margin: float | None, step: float) -> None:
    if (overshoot is None) == (phase_margin is None):
        raise InputError("what to tune for", got="both" if overshoot is not None else "nothing",
                         allowed="an overshoot or a phase margin")
    if overshoot is not None and not (is_finite(overshoot) and 0.0 <= overshoot < 1.0):
        raise InputError("overshoot", got=overshoot, allowed="from 0 to less than 1, a part of the way")
    if phase_margin is not None and not (is_finite(phase_margin) and 0.0 < phase_margin < math.pi):
        raise InputError("phase margin", got=phase_margin, allowed="between 0 and pi rad (180 deg)")
    if not (is_finite(step) and step > 0.0):
        raise InputError("step", got=step, allowed="a finite positive number [rad]")


def _by_margin(task: _Task, rows: list[list[Gain]], wanted: float) -> Tuning:
    """Return the stiffest of the largest gains that leave a margin."""
    def margin(gain: Gain) -> float:
        return _loop(task, gain).margins.phase

    best: Gain | None = None
    for row in rows:
        low, high = 0, len(row)  # the margin falls as the gain grows
        while low < high:
            middle = (low + high) // 2
            enough = margin(row[middle]) >= wanted
            low, high = (middle + 1, high) if enough else (low, middle)
        if low == 0:
            continue
        found = row[low - 1] if low == len(row) else _largest(row[low - 1], row[low], lambda g: margin(g) >= wanted)
        if best is None or _stiffness(found) > _stiffness(best):
            best = found
    if best is None:
        most = max(margin(row[0]) for row in rows)
        raise InputError("phase margin", got=f"{math.degrees(wanted):.4g} deg",
                         allowed=f"at most {math.degrees(most):.4g} deg, that of the smallest gain")
    return _tuning(task, best, float(_overshoots(task, [best])[0]))


def _largest(low: Gain, high: Gain, enough: Callable[[Gain], bool]) -> Gain:
    """Return the largest gain from one that leaves enough up to one that does not."""
    while (middle := between(low, high)) is not None:
        low, high = (middle, high) if enough(middle) else (low, middle)
    return low


def _by_overshoot(task: _Task, rows: list[list[Gain]], wanted: float) -> Tuning:
    """Return the stiffest of the gains whose overshoot is the wanted one, as nearly as there are gains."""
    gains = [gain for row in rows for gain in row if _loop(task, gain).stable]
    seen = _overshoots(task, gains)
    away = np.abs(seen - wanted)
    if not np.nanmin(away) <= _NEAR:
        raise InputError("overshoot", got=f"{100.0 * wanted:.4g} %",
                         allowed=f"what there is: {100.0 * np.nanmin(seen):.3g} to {100.0 * np.nanmax(seen):.3g} % of "
                         f"a step of {math.degrees(task.step):.4g} deg with this load")
    even = np.flatnonzero(away <= np.nanmin(away) + _EVEN).tolist()
    best = max(even, key=lambda k: (_stiffness(gains[k]), gains[k].settings.get("outer_gain", 0.0)))
    return _tuning(task, gains[best], float(seen[best]))


def _tuning(task: _Task, gain: Gain, overshoot: float) -> Tuning:
    return Tuning(model=gain.model, settings=gain.settings, margins=_loop(task, gain).margins, overshoot=overshoot,
                  step=task.step, stiffness=_stiffness(gain))


def _loop(task: _Task, gain: Gain) -> SampledServo:
    seen = sampled(gain.model, task.load)
    if isinstance(seen.law, Bursts):
        return SampledServo(model=seen.model, law=OuterLoop(inner=seen.law, gain=gain.settings["outer_gain"]))
    return seen


def _stiffness(gain: Gain) -> float:
    """Return the torque per error of the servo itself [N m/rad]."""
    model = gain.model
    if isinstance(model, DigitalServo):
        return float(model.loop_stiffness())
    K = physics.output_torque(model.value("motor.torque_constant"), model.value("gear.gear_reduction"))
    return float(K / model.value("motor.armature_resistance") * model.mean_gain()
                 * model.value("potentiometer.feedback_gain"))


def _overshoots(task: _Task, gains: list[Gain]) -> Array:
    """Return the overshoot of simulated steps over their way; nan where a run fails."""
    model = task.model
    if not isinstance(model, DigitalServo):
        frames = math.ceil(_DURATION * 3.0 / model.frame_period)  # an integrator takes its time
        return np.array([_overshoot(stepped(model, task.load, gain.settings["outer_gain"], start=task.start,
                                            step=task.step, frames=frames)) for gain in gains])
    command = signals.step(task.start, task.start + task.step, at=0.0, unit="rad")
    names = ("firmware.proportional_gain", "firmware.derivative_gain")
    batch = simulate_many(
        model, command, duration=_DURATION, load=task.load, outputs=("output_angle",),
        parameters={name: np.array([gain.model.value_or(name, 0.0) for gain in gains]) for name in names},
        output_times=_SAMPLE * np.arange(round(_DURATION / _SAMPLE) + 1))
    return np.array([_overshoot(angles) for angles in batch["output_angle"]])


def _overshoot(angles: Array) -> float:
    way = angles[-1] - angles[0]
    return math.nan if not way > 0.0 else max(0.0, float(np.max(angles) - angles[-1]) / way)
