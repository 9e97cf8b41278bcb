"""A servo under constant conditions: whether its shaft comes to rest, and how its bridge drives there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models import DigitalServo, PulseServo, PulseServoInductive
from servotwin.models.engine.cosim import piece_before, starts
from servotwin.models.switched import SwitchedServo
from servotwin.physics.pieces import piece_value
from servotwin.simulation.metrics import mean_current

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.physics.pieces import Piece
    from servotwin.signals import Signal
    from servotwin.simulation.result import Result

Array = NDArray[np.float64]

AT_REST = math.radians(0.1)
"""The swing below which a shaft is at rest [rad]: about one count of an encoder of 12 bit (0.088 deg)."""

LEAST_REST = 0.5
"""For which command and load have stood still at the end [s]; in as much the bridge is looked at."""

_LEGS = 4  # ways between two reversals, which two periods have
_KEEPS = 0.75  # part of the swing before that one that does not decay still has
_LATE = 3.0  # times as long as such ways take: a shaft that has not turned back for longer stands
_LONGEST = 10.0  # s that are looked at
_ROUNDING = 1e-9  # s
_SAMPLE = 3e-3  # s: shafts do not swing faster than some 30 Hz
_STAYS = 0.9  # part of the duty before that one that does not fade still has


class Swing(NamedTuple):
    """A shaft that goes to and fro.

    Parameters
    ----------
    swing : float
        From end to end; 0 of a shaft that is at rest [rad].
    frequency : float
        Of a whole period; 0 of a shaft that is at rest [Hz].
    """

    swing: float
    frequency: float


NONE = Swing(0.0, 0.0)


class Driven(NamedTuple):
    """How a bridge is driven: from when to when [s], and by which duty; of pulses −1, 0 or +1."""

    start: Array
    end: Array
    duty: Array


class Rest(NamedTuple):
    """A servo at the end of a run, where command and load stand still.

    Parameters
    ----------
    since : float
        From when on neither command nor load change [s].
    swing : float
        Of a shaft that does not come to rest, from end to end; 0 where it does, or is still on its way [rad].
    frequency : float
        Of that swing; 0 without one [Hz].
    travel : float
        From the lowest to the highest angle in the last half second [rad].
    drive_rate : float
        How often the bridge begins to drive, or reverses, there; nan of a mean voltage [Hz].
    duty : float
        Mean magnitude of its duty there: of pulses their share of the time; nan of a mean voltage [1].
    current : float
        Mean of the supply there; of a model without one, that of the motor regardless of its sign [A].
    fades : bool
        Whether the duty is well below that of half of the time before: of a shaft that creeps to where it stands.
    held : bool
        Whether friction alone holds the shaft against its load where it is.
    """

    since: float
    swing: float
    frequency: float
    travel: float
    drive_rate: float
    duty: float
    current: float
    fades: bool
    held: bool

    @property
    def stands(self) -> bool:
        """Whether the shaft is at rest."""
        return self.swing == 0.0 and self.travel < AT_REST

    @property
    def buzzes(self) -> bool:
        """Whether the shaft is at rest where friction would hold it, and its bridge switches on and on."""
        return self.stands and self.held and self.drive_rate > 0.0 and not self.fades

    @property
    def restless(self) -> bool:
        """Whether the shaft does not come to rest, or buzzes there."""
        return self.swing > 0.0 or self.buzzes

    @property
    def moves_on(self) -> bool:
        """Whether the shaft is still on its way."""
        return self.swing == 0.0 and self.travel >= AT_REST


def swing_of(time: Array, angle: Array, least: float = AT_REST) -> Swing:
    """Return the swing of a shaft that goes to and fro until the end, at angles [rad] since nothing changes any more.

    It has to turn back several times by more than `least`, the last time not long ago, and its ways not to get
    smaller: a shaft that overshoots, or arrives at the very end, does not swing.

    Parameters
    ----------
    time, angle : ndarray, shape (n,)
        [s], [rad].
    least : float
        Limit below which a swing is rest; of measured angles no less than their noise reaches from end to end [rad].

    Examples
    --------
    >>> t = np.linspace(0.0, 3.0, 3001)
    >>> swing = swing_of(t, 0.01 * np.sin(4.0 * np.pi * t))
    >>> round(swing.swing, 4), round(swing.frequency, 2)
    (0.02, 2.0)
    >>> swing_of(t, np.exp(-2.0 * t) * np.sin(4.0 * np.pi * t))
    Swing(swing=0.0, frequency=0.0)
    """
    half = len(time) // 2  # what comes before may still be on its way
    if len(time) < 2 * _LEGS or not np.ptp(angle[half:]) > least:
        return NONE
    at = _turns(angle, least)
    ways, spans = np.abs(np.diff(angle[at])), np.diff(time[at])
    if len(ways) < _LEGS + 1:  # the first one leads there
        return NONE
    ways, spans = ways[-max(_LEGS, len(ways) // 2):], spans[-max(_LEGS, len(ways) // 2):]
    middle = len(ways) // 2
    if ways[-middle:].mean() < _KEEPS * ways[:middle].mean() or time[-1] - time[at[-1]] > _LATE * spans.max():
        return NONE
    return Swing(float(np.ptp(angle[at[-_LEGS - 1]:])), float(0.5 / spans.mean()))


def _turns(angle: Array, least: float) -> list[int]:
    """Return the places between which the angle goes one way, but for less than `least`, the first place included."""
    found, low, high, far, way = [0], 0, 0, 0, 0
    values = angle.tolist()
    for k, value in enumerate(values):
        if way == 0:
            low, high = (k if value < values[low] else low), (k if value > values[high] else high)
            way, far = (value - values[low] > least) - (values[high] - value > least), k
        elif way * (value - values[far]) >= 0.0:
            far = k
        elif way * (values[far] - value) > least:
            found.append(far)
            way, far = -way, k
    return found


def constant_since(pieces: Sequence[Piece], end: float) -> float:
    """Return from when on the pieces of a signal keep one value up to the end [s]; inf where they do not.

    Examples
    --------
    >>> from servotwin import signals
    >>> constant_since(signals.step(0.0, 1.0, at=0.2, unit="rad").pieces.table, 1.0)
    0.2
    """
    since = math.inf
    value = math.nan
    for piece in reversed([piece for piece in pieces if piece.start < end]):
        if piece.slope or piece.amplitude or (piece.value != value and since < math.inf):
            break
        since, value = piece.start, piece.value
    return since if since == math.inf else max(since, 0.0)


def still_since(command: Signal, load: Load, end: float) -> float:
    """Return from when on neither a command nor a load's torque changes by the end [s]; inf where one does."""
    return max(constant_since(command.pieces.table, end), constant_since(load.torque_pieces.table, end),
               *(last for _, last in command.silences if last < end), 0.0)


def rest_of(result: Result, *, with_current: bool = True) -> Rest | None:
    """Return what a servo does where command and load stand still at the end of a run; None where that is too short.

    A motor, a servo that turns without end, and a run that ended before its time have none. The current, which takes
    longer than all else, is nan where it is not asked for.
    """
    end, time = result.ended, _looks_of(result)
    if time is None:
        return None
    since, driven = still_since(result.command, result.load, end), _driven_of(result)
    angle = result.at("output_angle", time)
    swing, middle, begun = swing_of(time, angle), 0.5 * (since + end), end - LEAST_REST
    rate, duty = _drives(driven, begun, end)
    _, before = _drives(driven, max(middle - 0.5 * LEAST_REST, since), min(middle + 0.5 * LEAST_REST, end))
    current = mean_current(result, begun) if with_current else math.nan
    return Rest(since=since, swing=swing.swing, frequency=swing.frequency,
                travel=float(np.ptp(angle[time >= begun - _ROUNDING])), drive_rate=rate, duty=duty, current=current,
                fades=duty < _STAYS * before, held=_held(result))


def _looks_of(run: Result) -> Array | None:
    """Return when a shaft is looked at to see what it does at the end [s]; None where that cannot be determined."""
    model, end = run.model, run.ended
    if not run.status.ok or model.endless or "command_angle" not in model.available:
        return None
    since = still_since(run.command, run.load, end)
    if not since <= end - LEAST_REST:
        return None
    return looks_at(max(since, end - _LONGEST), end, look_period(model, framed=run.command.edges is None))


def look_period(model: Model, *, framed: bool = True) -> float:
    """Return how often a shaft is looked at to see whether it rests [s].

    Of a pulse servo once a frame: a load moves it to and fro within each, and it stands where it is after a whole one.
    """
    return model.frame_period if framed and isinstance(model, PulseServo | PulseServoInductive) else _SAMPLE


def _held(run: Result) -> bool:
    """Tell whether friction holds the shaft against its load where it is, without any torque of the motor."""
    end, load = run.ended, run.load
    numbers, tau = run.model.plant(load), piece_value(piece_before(load.torque_pieces.rows, end, False), end)
    angle = float(run.at("output_angle", np.array([end]))[0])
    return not any(starts(numbers, forward, 0.0, tau, angle) for forward in (True, False))


def looks_at(since: float, end: float, step: float) -> Array:
    """Return the times [s] up to an end, one step from the other, of which none is before `since`."""
    return np.maximum(end - step * np.arange(int((end - since) / step), -1.0, -1.0), since)


def _driven_of(result: Result) -> Driven | None:
    """Return how the bridge of a run was driven; None of a mean voltage."""
    if not isinstance(result.model, SwitchedServo):
        return None
    digital = isinstance(result.model, DigitalServo)
    own = result.trajectory.segments
    return Driven(own.starts, own.ends, own.rows["duty" if digital else "drive"])


def _drives(driven: Driven | None, start: float, end: float) -> tuple[float, float]:
    """Return how often a bridge begins to drive or reverses [Hz], and the mean magnitude of its duty."""
    if driven is None:
        return math.nan, math.nan
    some = (driven.end > start) & (driven.start < end)
    duty = driven.duty[some]
    now = np.where(np.abs(duty) <= 1.0, duty, 0.0)  # beyond, torque is off
    begins = (now[1:] != 0.0) & (now[1:] * now[:-1] <= 0.0)
    spans = np.minimum(driven.end[some], end) - np.maximum(driven.start[some], start)
    return np.count_nonzero(begins) / (end - start), float(np.abs(now) @ spans) / (end - start)
