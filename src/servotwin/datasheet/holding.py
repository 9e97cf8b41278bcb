"""A servo that stands: how far a load pulls it off, what it draws, and the smallest command that moves it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin import loads, physics, signals
from servotwin.datasheet.conditions import changed
from servotwin.datasheet.guesses import Span, spans
from servotwin.models import DigitalServo, mid_travel
from servotwin.models.outputs import warm_plant
from servotwin.simulation.simulator import simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from servotwin.models import Model
    from servotwin.models.columns import Samples
    from servotwin.simulation import Result

SETTLE, LOOK = 1.5, 0.5  # s: what is told of standing holds for the mean of the last half second of two, or more
_STANDS = math.radians(2.0)  # rad/s: what goes faster at the end does not stand
_FURTHEST_STEP = math.radians(20.0)
_WAIT, _MEAN = 1.0, 0.1  # s, after which a command has been followed or not, and over which the angle is averaged
_FOLLOWED = 0.5  # of the command
_HALVINGS = 18
_SOON = 0.2  # s, in which a command either moves the shaft or does not
_STIRRED = 1e-9  # rad
_TRIPS = "trips by "  # begins the events of a protection


class Held(NamedTuple):
    """A servo under a constant torque, 1.5 to 2 s after that was put on, or longer by what a protection waits.

    Parameters
    ----------
    torque : float
        Towards −q [N m].
    error : float
        Commanded less mean angle; nan where the shaft does not stand [rad].
    current : float
        Mean of the supply [A].
    heat : float
        Mean of i² R in the winding [W].
    trip : str
        What a digital servo trips by under it, "overload" or "current"; empty where it does not.
    span : Span, optional
        Range of `error`, where it rests on guesses; computed by `with_spans`.
    """

    torque: float
    error: float
    current: float
    heat: float
    trip: str = ""
    span: Span | None = None

    @property
    def stands(self) -> bool:
        """Whether the shaft stands at the end, or all but stands."""
        return not math.isnan(self.error)


def hold(model: Model, torque: float, *, inertia: float = 0.0) -> Held:
    """Return how a servo holds a constant torque [N m] in mid-travel; `inertia` is the load's [kg m²]."""
    asked, settle = mid_travel(model), SETTLE + _patience(model)
    end = settle + LOOK
    result = simulate(_without_stops(model), signals.constant(asked, unit="rad"), duration=end,
                      load=loads.Constant(torque) + loads.Inertia(inertia), output_times=[settle, end])
    trip = next((event.kind.removeprefix(_TRIPS) for event in result.events if event.kind.startswith(_TRIPS)), "")
    before, after = result["output_angle"].tolist()
    if trip or not (result.status.ok and abs(after - before) <= _STANDS * LOOK):
        return Held(torque, math.nan, math.nan, math.nan, trip)
    angle, current, heat = _means(result, settle)
    return Held(torque, asked - angle, current, heat)


def _patience(model: Model) -> float:
    """Return for how long [s] a protection of a digital servo waits before it acts."""
    if not isinstance(model, DigitalServo):
        return 0.0
    of = model.servo.firmware
    waits = [time for threshold, time in ((of.overload_duty, of.overload_time), (of.trip_current, of.trip_time))
             if threshold is not None and time is not None]
    return max(waits, default=0.0)


def holding_errors(model: Model, stall_torque: float, shares: tuple[float, ...] = (0.1, 0.25, 0.5, 0.75, 0.9)
                   ) -> tuple[Held, ...]:
    """Return how a servo holds shares of its stall torque [N m]."""
    return tuple(hold(model, share * stall_torque) for share in shares)


def with_spans(held: Sequence[Held], others: Sequence[Model], *, inertia: float = 0.0) -> tuple[Held, ...]:
    """Return how a servo holds some torques with the ranges of its errors.

    Parameters
    ----------
    held : sequence of Held
    others : sequence of Model
        The servo with its guesses at the ends of their ranges.
    inertia : float
        Of the load [kg m²].
    """
    found = spans({str(k): each.error for k, each in enumerate(held)}, (
        {str(k): hold(other, each.torque, inertia=inertia).error for k, each in enumerate(held)} for other in others))
    return tuple(each._replace(span=found.get(str(k))) for k, each in enumerate(held))


def smallest_move(model: Model) -> float:
    """Return the smallest step that the free shaft follows to half, from where there is no error [rad].

    It has a second for that. The potentiometer's noise is left out: with it every command moves a little now and then.
    """
    return _least_step(model, _follows)


def smallest_stir(model: Model) -> float:
    """Return the smallest step that moves the free shaft at all: half of the deadband, and what friction adds [rad]."""
    return _least_step(model, _stirs)


def _least_step(model: Model, does: Callable[[Model, float, float], bool]) -> float:
    free, start = _without_stops(model), mid_travel(model)
    low, high = 0.0, _FURTHEST_STEP
    if not does(free, start, high):
        return math.nan
    for _ in range(_HALVINGS):
        half = 0.5 * (low + high)
        low, high = (low, half) if does(free, start, half) else (half, high)
    return high


def _stirs(model: Model, start: float, step: float) -> bool:
    result = simulate(model, signals.step(start, start + step, at=0.0, unit="rad"), duration=_SOON,
                      output_times=[0.0, _SOON])
    before, after = result["output_angle"].tolist()
    return bool(abs(after - before) > _STIRRED)


def _follows(model: Model, start: float, step: float) -> bool:
    result = simulate(model, signals.step(start, start + step, at=0.0, unit="rad"), duration=_WAIT,
                      output_times=np.append(0.0, np.linspace(_WAIT - _MEAN, _WAIT, 11)))
    before, *after = result["output_angle"].tolist()
    return bool(float(np.mean(after)) - before >= _FOLLOWED * step)


def _without_stops(model: Model) -> Model:
    """Return the model without stops, which would hold what the servo does not, and without noise."""
    gone = ("stops.lower_angle", "stops.upper_angle", "potentiometer.noise")
    return changed(model, {name: None for name in gone if model.servo.get(name) is not None})


def _means(result: Result, start: float) -> tuple[float, float, float]:
    """Return the means of angle [rad], supply current [A] and heat of the winding [W] from `start` [s] on."""
    model, drive, load = result.model, result.drive, result.load
    drawn = "supply_current" if "supply_current" in model.available else "armature_current"

    def looked_at(samples: Samples) -> NDArray[np.float64]:
        i = model.output("armature_current", samples, drive, load)
        return np.array([samples.angle, model.output(drawn, samples, drive, load),
                         physics.copper_loss(i, warm_plant(model, samples, load).motor.R)])

    angle, current, heat = (result.trajectory.since(start).integral(looked_at) / (result.ended - start)).tolist()
    return angle, current, heat
