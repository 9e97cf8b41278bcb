"""The table of symptoms: how strong each is in a run or a log, and from where on it is one."""

from __future__ import annotations

import math
from itertools import pairwise
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.datasheet.warming import HOT_WINDING
from servotwin.logs.columns import step_of
from servotwin.physics import Temperatures
from servotwin.simulation.metrics import tolerance
from servotwin.simulation.rest import AT_REST, LEAST_REST, look_period, rest_of, swing_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.datasheet import Masses
    from servotwin.logs import Log
    from servotwin.models import Model
    from servotwin.simulation import Rest, Result


# --- Sources of symptoms: a run, or a log with its noise, where the target stands still -------------------------------

Array = NDArray[np.float64]

LOOK = 2e-3  # s between two looks at a run
_AVERAGED = 10e-3  # s over which samples of a log are averaged, at most: shafts do not swing faster than some 30 Hz
_CHANCE = 0.01  # assumed: of all logs of a shaft at rest, in which noise may once go beyond what is taken for noise
_LEAST_MEANS = 8  # that two periods and the way there take
_BENT = 3  # ordinates of a spectrum that a parabola and a taper change
_ARRIVES = 5.0  # s, assumed: what has not arrived by then stands off its target, however it creeps on
_TRIPS = "trips by "  # begins the events of a protection


class Noise(NamedTuple):
    """The noise that a recorder adds to an angle.

    Parameters
    ----------
    size : float
        Standard deviation; inf where the log does not tell [rad].
    step : float
        Of what is read; 0 where the recorder does not count [rad].
    reach : float
        How many standard deviations none of the log's samples, and of their means, goes beyond but in one of a hundred
        logs [1].
    """

    size: float
    step: float
    reach: float

    @property
    def swing(self) -> float:
        """From end to end, as far as noise goes: a smaller swing cannot be distinguished from rest [rad]."""
        return max(AT_REST, 2.0 * self.reach * self.size + self.step)

    def of_means(self, many: int) -> Noise:
        """Return that of means of so many samples each."""
        return self._replace(size=self.size / math.sqrt(many))

    def drift(self, n: int) -> float:
        """Return by how much a straight line through n samples of a shaft at rest rises or falls [rad].

        Its standard error is √(12/n) of the noise, by least squares; rounding makes 1.5 counts of it at most, where the
        reading changes by one in the middle.
        """
        return self.reach * self.size * math.sqrt(12.0 / n) + 1.5 * self.step

    def end(self, n: int) -> float:
        """Return how far off a straight line through n samples may end: by 2/√n of the noise and half a count [rad]."""
        return 2.0 * self.reach * self.size / math.sqrt(n) + 0.5 * self.step


NO_NOISE = Noise(0.0, 0.0, 0.0)


class End(NamedTuple):
    """Where a shaft stands at the end of a stretch.

    Parameters
    ----------
    angle : float
        [rad].
    doubt : float
        How far off that may be: by noise, and by what it would still go: in half a second as fast as its noise hides,
        or, if it is seen to move, as fast as it does for as long again as the stretch has lasted, up to 5 s [rad].
    rests : bool
        Whether its speed has sunk into its noise, or it swings and goes no further.
    """

    angle: float
    doubt: float
    rests: bool


class Hold(NamedTuple):
    """A stretch in which the target stands still for half a second or more.

    Parameters
    ----------
    way : float
        From the target before to this one; 0 where the target did not go there straight from a shaft at rest [rad].
    jumps : bool
        Whether it went there at once.
    farthest : float
        How far from its target the shaft was since the stretch before [rad].
    before, end : End
        Of what was before, and of itself.
    target : float
        [rad].
    highest : float
        How far beyond its end the shaft went, seen from where it was before, less its noise [rad].
    swing : float
        From end to end in its later half; 0 of a shaft that does not swing, or by no more than noise [rad].
    """

    way: float
    jumps: bool
    farthest: float
    before: End
    end: End
    target: float
    highest: float
    swing: float


class Record(NamedTuple):
    """A run or a log.

    Parameters
    ----------
    holds : tuple of Hold
    finest : float
        Angle that the servo is not asked to tell from another: its deadband of full width, but none wider than usual,
        or its count [rad].
    rest : Rest, optional
        Of a run, how the servo drives at its end; None where command or load move there.
    swing : float
        The widest of the stretches, but for the one of `rest`; nan where there is none [rad].
    heat : float
        Mean of i² R in the second half; nan where no current was measured [W].
    tripped : float
        Share of the time since a protection has acted first; 0 where none has; nan of a log [1].
    trip : str
        By what.
    noise : Noise
        Of a log.
    """

    holds: tuple[Hold, ...]
    finest: float
    rest: Rest | None
    swing: float
    heat: float
    tripped: float
    trip: str = ""
    noise: Noise = NO_NOISE


def of_run(run: Result, finest: float, *, from_rest: bool) -> Record:
    """Return what a run shows whose output times are those of `looked_at`, of a servo that tells so much apart [rad].

    One that begins where a log does, and not at rest, is judged as a log without noise.
    """
    end = run.ended
    time = looked_at(end)
    target, angle, current = run["command_angle"], run["output_angle"], run["armature_current"][time >= 0.5 * end]
    rest = rest_of(run, with_current=False)
    first = next((event for event in run.events if event.kind.startswith(_TRIPS)), None)
    every = max(1, round(look_period(run.model, framed=run.command.edges is None) / LOOK))
    holds = holds_of(time, target, angle, None if from_rest else NO_NOISE, every=every)
    return Record(
        holds=holds, finest=finest, rest=rest, swing=_widest(holds if rest is None else holds[:-1]),
        heat=float(np.mean(current**2)) * run.model.value("motor.armature_resistance"),
        tripped=0.0 if first is None else (end - first.time) / end,
        trip="" if first is None else first.kind.removeprefix(_TRIPS))


def _widest(holds: tuple[Hold, ...]) -> float:
    return max((hold.swing for hold in holds), default=math.nan)


def looked_at(duration: float) -> Array:
    """Return when a run is looked at [s]."""
    return np.arange(0.0, duration, LOOK)


def of_log(log: Log, model: Model, target: Array, finest: float) -> Record:
    """Return what a log shows; `target` is the angle that each of its commands asks `model` for [rad].

    As many samples as follow each other within 10 ms are one, their mean: that takes noise away, and no motion.
    """
    time, angle = log.time - log.start, angle_of(log, model)
    there = np.isfinite(angle)
    time, target, angle = time[there], target[there], angle[there]
    step, many = step_of(angle), max(1, int(_AVERAGED / float(np.median(np.diff(time))))) if len(time) > 1 else 1
    time, angle, target = _means(time, many), _means(angle, many), target[:len(time) // many * many:many]
    noise = noise_of(angle, stretches(time, target), step)
    holds = holds_of(time, target, angle, noise) if math.isfinite(noise.size) else ()
    heat = math.nan
    if "armature_current" in log.measured:
        current = log.measured["armature_current"][log.time >= log.start + 0.5 * log.duration]
        heat = float(np.nanmean(current**2)) * model.value("motor.armature_resistance")
    return Record(holds, finest, None, _widest(holds), heat, math.nan, noise=noise)


def noise_of(angle: Array, spans: list[tuple[int, int]], step: float) -> Noise:
    """Return the noise of an angle in the later halves of stretches in which its target stands still [rad].

    White noise has the same power at all frequencies, a swing at few: the ordinates of a periodogram are exponentially
    distributed, and their median is ln 2 of the mean power, whatever swings. Its standard error is 1/√n of the mean
    (David and Nagaraja, Order Statistics, section 10.2: 1/(2 f √n) of a density f); it is taken two of them higher.

    Examples
    --------
    >>> time, scatter = 0.01 * np.arange(800), np.random.default_rng(0).normal(0.0, 0.01, 800)
    >>> noise_of(np.sin(12.0 * time) + scatter, [(0, 800)], 0.0).size
    0.01
    """
    power: list[float] = []
    for a, b in spans:
        late = angle[(a + b) // 2:b]  # what comes before may still be on its way, and the rest creep
        place, taper = np.arange(len(late)), np.hanning(len(late) + 2)[1:-1]
        if len(late) > 2 * _BENT:
            off = late - np.polyval(np.polyfit(place, late, 2), place)
            power += (np.abs(np.fft.rfft(off * taper)[_BENT:])**2 / float(taper @ taper)).tolist()
    if not power:
        return Noise(math.inf, step, 1.0)
    mean = float(np.median(power)) / math.log(2.0) * (1.0 + 2.0 / math.log(2.0) / math.sqrt(len(power)))
    looks = 2 * len(angle)  # samples, and means of two, of four, ...
    return Noise(math.sqrt(mean), step, NormalDist().inv_cdf(1.0 - 0.5 * _CHANCE / looks))


def angle_of(log: Log, model: Model) -> Array:
    """Return the angle that a log measured, nan where it did not [rad]."""
    name = log.angle_name
    values = np.where(log.used(name), log.measured[name], np.nan)
    if name == "output_angle":
        return values
    return np.asarray((values - model.value("potentiometer.feedback_offset"))
                      / model.value("potentiometer.feedback_gain"))


def stretches(time: Array, target: Array) -> list[tuple[int, int]]:
    """Return first and one past the last sample of each stretch in which a target stands still for half a second.

    Examples
    --------
    >>> stretches(np.array([0.0, 0.2, 0.3, 0.6, 0.9]), np.array([0.0, 0.0, 1.0, 1.0, 1.0]))
    [(2, 5)]
    """
    bounds = [0, *(np.flatnonzero(np.diff(target) != 0.0) + 1).tolist(), len(time)]
    return [(a, b) for a, b in pairwise(bounds)
            if b - a >= 2 and time[b - 1] - time[a] >= LEAST_REST]


def holds_of(time: Array, target: Array, angle: Array, noise: Noise | None = None, *,
             every: int = 1) -> tuple[Hold, ...]:
    """Return the stretches in which a target [rad] stands still, and what the shaft did there.

    Without a noise it is a run that begins at rest. The motion of a log's shaft before is not known: it may have come
    as far as the targets lie apart.

    Parameters
    ----------
    time, target, angle : ndarray, shape (n,)
        [s], [rad].
    noise : Noise, optional
        Of a log, or of a run that begins as one.
    every : int
        Samples of which one is looked at for a swing.
    """
    found: list[Hold] = []
    known = noise is None
    noise = NO_NOISE if noise is None else noise
    first = int(np.argmax(target != target[0])) or len(target)
    last = first - 1  # sample at which what was before has ended
    before = End(float(angle[0]), 0.0, True) if known else end_of(time[:first], angle[:first], noise)
    for a, b in stretches(time, target):
        begins = a == 0 and not known
        way, gone = float(target[a] - target[last]), target[min(last, a):a + 1]
        straight = before.rests and not begins and np.ptp(gone) <= abs(way)
        late = slice((a + b) // 2, b, every)  # what comes before may still be on its way
        swing = _swing(time[late], angle[late], noise)
        end = end_of(time[a:b], angle[a:b], noise, swings=swing > 0.0)
        farthest = float(np.abs(angle[min(last, a):b] - target[a]).max())
        sense = math.copysign(1.0, target[a] - before.angle)
        found.append(Hold(
            way=way if straight else 0.0, jumps=a - last == 1 or bool(time[a] - time[last] <= _AVERAGED), before=before,
            end=end, target=float(target[a]), swing=swing,
            farthest=max(farthest, float(np.ptp(target))) if begins else farthest,
            highest=float((sense * (angle[a:b] - end.angle)).max()) - (0.0 if known else 0.5 * noise.swing)))
        before, last = end, b - 1
    return tuple(found)


def _swing(time: Array, angle: Array, noise: Noise) -> float:
    """Return a swing from end to end that stands out of noise, as slow ones do in means of many samples; 0 without."""
    swing, many = swing_of(time, angle, noise.swing).swing, 2
    while swing == 0.0 and noise.size > 0.0 and len(time) // many >= _LEAST_MEANS:
        swing = swing_of(_means(time, many), _means(angle, many), noise.of_means(many).swing).swing
        many *= 2
    return swing


def _means(values: Array, many: int) -> Array:
    """Return the means of so many values each; the last few that make no more one are left out."""
    return np.asarray(values[:len(values) // many * many].reshape(-1, many).mean(axis=1))


def end_of(time: Array, angle: Array, noise: Noise, *, swings: bool = False) -> End:
    """Return where a shaft [rad] stands at the end of a stretch: where the straight line through it ends.

    The line goes through the last half second, and twice as much again and again, as long as it neither rises nor falls
    by more than a shaft at rest does.

    Examples
    --------
    >>> time = np.linspace(0.0, 2.0, 201)
    >>> end_of(time, 1.0 - np.exp(-8.0 * time), NO_NOISE).rests, end_of(time, 0.1 * time, NO_NOISE)
    (True, End(angle=0.2, doubt=0.2, rests=False))
    """
    whole = float(time[-1] - time[0])
    if swings:
        half = len(time) // 2
        return End(float(angle[half:].mean()), noise.end(len(time) - half), True)
    span, found = min(LEAST_REST, whole), None
    while True:
        some = time >= time[-1] - span
        if (n := int(np.count_nonzero(some))) < 3:
            return found or End(float(angle[-1]), math.inf, False)
        slope, end = np.polyfit(time[some] - time[-1], angle[some], 1)
        if abs(slope) * span > max(AT_REST, noise.drift(n)):
            goes_on = max(0.0, min(whole, _ARRIVES - whole))
            return found or End(float(end), abs(float(slope)) * goes_on + noise.end(n), False)
        found = End(float(end), noise.end(n) + noise.drift(n) * min(1.0, LEAST_REST / span), True)
        if span >= whole:
            return found
        span = min(2.0 * span, whole)


# --- The table of symptoms: how strong each is in a run or a log, and from where on it is one -------------------------

HOT_HOUSING = 324.15  # K, 51 °C
_NEAR = math.radians(1.0)
_LEAST_WAY = math.radians(3.0)
_MOVED, _OVERSHOOT = 0.5, 0.1
_WARMS = 600.0  # s


class Judged(NamedTuple):
    """How strong a symptom is.

    Parameters
    ----------
    value, limit : float
        SI; the symptom is there where the value is above the limit; nan where it cannot be determined.
    """

    value: float
    limit: float

    @property
    def found(self) -> bool:
        """Whether the symptom is there."""
        return self.value > self.limit


class Symptom(NamedTuple):
    """One row of the table.

    Parameters
    ----------
    name : str
        Such as "overshoots".
    threshold : str
        From where on it is one, as people read it.
    source : str
        Where the threshold is from.
    judge : callable
        Returns from a record and the servo's thermal masses how strong it is.
    hides : tuple of str
        Symptoms that only follow from this one.
    unit : str
        Of value and limit as people read them; `factor` leads there from SI.
    factor : float
    """

    name: str
    threshold: str
    source: str
    judge: Callable[[Record, Masses | None], Judged]
    hides: tuple[str, ...] = ()
    unit: str = ""
    factor: float = 1.0


def _trips(record: Record, masses: Masses | None) -> Judged:
    return Judged(record.tripped, 0.0)


def _stuck(record: Record, masses: Masses | None) -> Judged:
    return max((Judged(max(0.0, 1.0 - (hold.end.angle - hold.before.angle) / hold.way
                           - (hold.end.doubt + hold.before.doubt) / abs(hold.way)), 1.0 - _MOVED)
                for hold in record.holds if abs(hold.way) >= _NEAR), default=Judged(math.nan, 1.0 - _MOVED))


def _buzzes(record: Record, masses: Masses | None) -> Judged:
    rest = record.rest
    if rest is None or record.swing > 0.0:
        return Judged(record.swing, 0.0)
    return Judged((max(rest.duty, rest.swing) if math.isfinite(rest.duty) else rest.swing) if rest.restless else 0.0,
                  0.0)


def _off(hold: Hold, record: Record) -> Judged:
    return Judged(max(0.0, abs(hold.target - hold.end.angle) - hold.end.doubt),
                  max(_NEAR, float(tolerance(hold.farthest, record.finest))))


def _sags(record: Record, masses: Masses | None) -> Judged:
    return max((_off(hold, record) for hold in record.holds), key=lambda one: one.value / one.limit,
               default=Judged(math.nan, _NEAR))


def _overshoots(record: Record, masses: Masses | None) -> Judged:
    wide = [hold for hold in record.holds if hold.jumps and min(
        abs(hold.way), abs(hold.target - hold.before.angle)) >= _LEAST_WAY]
    if not wide:
        return Judged(math.nan, _OVERSHOOT)
    return max(Judged(max(0.0, hold.highest - hold.end.doubt) / abs(hold.target - hold.before.angle)
                      if not (hold.swing > 0.0 or _off(hold, record).found) else 0.0, _OVERSHOOT) for hold in wide)


def _warms(record: Record, masses: Masses | None) -> Judged:
    if masses is None or math.isnan(record.heat):
        return Judged(math.nan, math.nan)
    after = masses.after(_WARMS, record.heat, Temperatures(masses.ambient, masses.ambient))
    return max((Judged(float(now) - masses.ambient, limit - masses.ambient) for now, limit in (
        (after.housing, HOT_HOUSING), (after.winding, HOT_WINDING))), key=lambda one: one.value / one.limit)


SYMPTOMS: tuple[Symptom, ...] = (
    Symptom("trips", "any protection acts", "the servo's own program", _trips,
            ("does not move", "sags", "overshoots"), "% of the time", 100.0),
    Symptom("does not move", "it goes less than half of the way that it is sent, of 1 deg or more",
            "as the smallest move of `curves`", _stuck, ("sags",), "% of the way missing", 100.0),
    Symptom("buzzes", "it swings by 0.1 deg or more where nothing changes, or its bridge switches on and on "
            "where friction holds it",
            "as the remarks of a run; 0.1 deg is about one count of an encoder of 12 bit", _buzzes, ("overshoots",),
            "% of duty or rad", 100.0),
    Symptom("overshoots", "by more than 10 % of a step of 3 deg or more", "assumed", _overshoots, (), "%", 100.0),
    Symptom("sags", "it stands off its command by more than 1 deg, 5 % of the way, and two deadbands no wider "
            "than usual",
            "as `curves` and `simulate` say that a servo has arrived", _sags, (), "deg", math.degrees(1.0)),
    Symptom("gets warm", "ten minutes of this bring its housing above 51 deg C, or its winding above 100 deg C",
            "ISO 13732-1: skin burns after a minute at 51 deg C; a hot winding as in `curves`", _warms, (), "K"),
)
"""In the order in which they are reported."""
