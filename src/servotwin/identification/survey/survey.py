"""All that a log says by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.suspicions.look import beat_of, rough_noise
from servotwin.loads import Load
from servotwin.logs.columns import COMMANDS
from servotwin.logs.log import Log
from servotwin.logs.log_checks import is_defined
from servotwin.units.words import unit_shown

if TYPE_CHECKING:
    from servotwin.logs.log import Log


# --- The clock of a log: its beat, how far stamps lie off it, and where rows are missing ------------------------------

Array = NDArray[np.float64]
_GAP = 1.7  # usual steps: one row is missing, or more
_COARSE = 0.2  # of a step: what a clock counts in


class Gap(NamedTuple):
    """Rows that are missing.

    Parameters
    ----------
    at, length : float
        Of the last row before it, and to the next one [s].
    """

    at: float
    length: float


class Clock(NamedTuple):
    """Remarks on time stamps.

    Parameters
    ----------
    period : float
        The usual step [s].
    jitter : float
        Standard deviation of the steps that are none of a gap [s].
    unit : float
        Step that stamps are whole multiples of; 0 where that is small beside the period, or they are none [s].
    gaps : tuple of Gap
        The longest first.
    off_beat : int
        Stamps that lie off the beat of the others.
    """

    period: float
    jitter: float
    unit: float
    gaps: tuple[Gap, ...]
    off_beat: int


def clock_of(time: Array) -> Clock:
    """Return what is to be said of time stamps [s].

    Examples
    --------
    >>> found = clock_of(np.delete(0.02 * np.arange(100.0), [40, 41]))
    >>> round(found.period, 6), len(found.gaps), round(found.gaps[0].length, 6)
    (0.02, 1, 0.06)
    """
    steps = np.diff(time)
    period = float(np.median(steps))
    wide = np.flatnonzero(steps > _GAP * period)
    order = wide[np.argsort(-steps[wide], kind="stable")]
    beat = beat_of(time)
    return Clock(period, float(np.std(steps[steps <= _GAP * period])), _unit(steps, period),
                 tuple(Gap(float(time[k]), float(steps[k])) for k in order.tolist()),
                 0 if beat is None else int(beat.off.sum()))


def _unit(steps: Array, period: float) -> float:
    """Return the largest of 1 s, 0.1 s, ... of which all steps are whole multiples, if it is coarse."""
    for power in range(0, -7, -1):
        unit = 10.0**power
        if np.abs(steps / unit - np.round(steps / unit)).max() < 1e-4 * max(1.0, float(np.abs(steps / unit).max())):
            return unit if unit > _COARSE * period and np.ptp(steps) > 0.5 * unit else 0.0
    return 0.0


# --- Faults of a log, and experiments that it lacks: sentences, each with what to do ----------------------------------

_ARRIVED = 0.6  # s of one command, within which any servo gets there
_LATE = 0.2  # s: more than a servo's dead time
_CLEAR, _SURE = 0.6, 0.95  # correlation, that tells a sign, and a scale
_SCALES = {180.0 / math.pi: "degrees were taken for radians", math.pi / 180.0: "radians were taken for degrees",
           2.0: "a factor of two", 0.5: "a factor of two"}
_NEAR = 0.07
_USUAL = (0.7, 1.4)  # angle over commanded angle
_PULSE_GAINS = (math.radians(0.03) * 1e6, math.radians(0.4) * 1e6)  # rad/s of pulse
_FASTEST = math.radians(3000.0)  # rad/s
_ALONE = math.radians(5.0)  # more than noise
_SELDOM, _OFTEN = 0.1, 0.5  # of the rows
_STUCK, _MUCH_NOISE = 10, 2.0  # rows without noise, of a sensor that has so many steps of it elsewhere
_TURN = 2.0 * math.pi
_CENTRE = math.radians(90.0)
_OFF_ZERO = 10.0  # deg
_OFF_CENTRE = math.radians(10.0)
_SMALL = {"angle": math.radians(3.0), "pulse_width": 30e-6}
_LARGE = {"angle": math.radians(45.0), "pulse_width": 450e-6}


def wrong_of(log: Log, clock: Clock, values: Values, motion: Motion) -> Iterator[str]:
    """Give what cannot be right, each in one sentence."""
    angle = log.measured[log.angle_name]
    seen = angle[np.isfinite(angle)]
    failed = _failed(log, angle)
    count = int(failed.sum())
    if count:
        at, half = float(log.time[np.argmax(failed)]), 0.5 * clock.period
        yield (f"{count} {'reading' if count == 1 else 'readings'} of the angle, the first at {at:.4g} s, far from "
               "those before and after, as no servo moves: the sensor failed there; "
               f"--leave-out {max(at - half, 0.0):.4g}..{at + half:.4g} leaves one out")
        seen = angle[np.isfinite(angle) & ~failed]
    jumps = int((np.abs(np.abs(np.diff(seen)) - _TURN) < 0.25 * _TURN).sum()) if log.angle_name == "output_angle" else 0
    if jumps:
        yield (f"the angle jumps by a whole turn, {jumps} times: a sensor that begins again; servotwin fit ... --mend "
               "wrap joins the pieces")
    elif np.fmax(motion.speed, np.ptp(seen) / log.duration) > _FASTEST and log.angle_name == "output_angle":
        speed = float(np.fmax(motion.speed, np.ptp(seen) / log.duration))
        yield (f"the shaft turns at {math.degrees(speed):.0f} deg/s, faster than any servo: look at the "
               f"units of angle and time ({clock.period:.3g} s a row)")
    if not len(log.changes) and motion.onset > _LATE and not _defined(log):
        yield (f"the shaft begins to move {motion.onset:.2g} s after the first row, and the command never changes: "
               "look which column is the command")
    if log.angle_name == "output_angle":
        yield from _against(log, motion)
    if values.flat_low or values.flat_high:
        ends = [f"{count} rows stand at {'the lowest' if low else 'the highest'} value"
                for count, low in ((values.flat_low, True), (values.flat_high, False)) if count]
        yield f"{' and '.join(ends)} without noise: the sensor is at the end of its range, or the shaft on a stop"
    yield from _stands(log, angle, values)
    moves = [float(np.mean(np.diff(each) != 0.0)) for each in (angle, log.held)]
    if moves[0] < _SELDOM < _OFTEN < moves[1] and motion.lag < 0.5 * clock.period:
        yield ("the angle jumps and stands, the command moves in each row and comes no earlier: are they each other's "
               "columns?")
    if motion.lag < 0.0 and motion.steps == 0 and abs(motion.correlation) > _CLEAR:
        yield (f"the angle comes {-1e3 * motion.lag:.0f} ms before the command: the columns have two clocks, or the "
               "command was logged late")


def _stands(log: Log, angle: NDArray[np.float64], values: Values) -> Iterator[str]:
    """Give where a reading stays the same to the last digit, of a sensor with noise, long after the command moved."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.diff(angle) == 0.0, [False]]).astype(int)))
    runs = [(first, last) for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
            if last - first >= _STUCK]
    others = np.ones(len(angle), np.bool_)
    for first, last in runs:
        others[first:last + 1] = False
    if not rough_noise(angle[others & np.isfinite(angle)]) > _MUCH_NOISE * values.step > 0.0:
        return
    for first, last in runs:
        moved = np.abs(log.held[first:last + 1] - log.held[first]) > _LARGE.get(log.command_kind, math.inf) / 10.0
        if moved.any() and log.time[last] - log.time[first + np.argmax(moved)] > _ARRIVED:
            start, stop = float(log.time[first]), float(log.time[last])
            yield (f"the angle stays the same to the last digit from {start:.4g} to {stop:.4g} s, while the command "
                   f"moves on: the sensor stood still there; --leave-out {start:.4g}..{stop:.4g} leaves that out")


def _failed(log: Log, angle: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which samples of an angle lie alone: further from both neighbours, on one side, than any servo goes."""
    step, apart = np.diff(angle), np.diff(log.time)
    turns = np.abs(np.abs(step) - _TURN) < _OFF_CENTRE  # noise where a sensor begins again
    fast = (np.abs(step) > _FASTEST * apart + _ALONE) & ~turns
    found = np.zeros(len(angle), np.bool_)
    if log.angle_name == "output_angle":
        found[1:-1] = fast[:-1] & fast[1:] & (step[:-1] * step[1:] < 0.0)
    return found


def _slow(log: Log) -> bool:
    """Tell whether each command is held for so long that any servo would have followed it."""
    return bool(np.min(np.diff([log.start, *log.time[log.changes]]), initial=math.inf) > _ARRIVED)


def _defined(log: Log) -> bool:
    """Tell whether the command was said, and is none of the file."""
    return log.reading is not None and any(is_defined(one.column) for name, one in log.reading.layout.items()
                                           if name in COMMANDS)


def _against(log: Log, motion: Motion) -> Iterator[str]:
    """Give what is wrong between angle and command."""
    gain, kind = motion.gain, log.command_kind
    moves = np.ptp(log.held) > _LARGE.get(kind, math.inf) / 3.0
    if not math.isfinite(gain) or abs(motion.correlation) < _CLEAR:
        if moves and not motion.still and motion.steps and _slow(log):
            yield "the angle does not follow the command: look at wiring and supply, and which column is which"
        elif moves and motion.still:
            yield "the command moves and the shaft does not: look at wiring and supply"
        return
    if gain < 0.0:
        yield (f"the angle falls where the command grows; unless the servo is built in reverse, "
               f"{_say(log, -1.0, motion)} turns it")
    if abs(motion.correlation) < _SURE:
        return
    if kind == "angle":
        known = next((what for factor, what in _SCALES.items() if abs(math.log(abs(gain) / factor)) < _NEAR), "")
        soft = abs(gain) < 1.0 and bool(log.load.pendulums or log.load.springs or log.load.recorded)
        if not soft and (known or not _USUAL[0] < abs(gain) < _USUAL[1]):
            yield (f"the shaft moves {abs(gain):.3g} times as far as it is asked to{f': {known}' if known else ''}; "
                   f"{_say(log, 1.0 / gain)} puts that right if the command is right")
        elif abs(motion.zero - _CENTRE) < _OFF_CENTRE and log.held.min() >= 0.0:
            yield (f"the angle is 0 where the command is {math.degrees(motion.zero):.0f} deg: the command counts from "
                   f"an end, as servo.write does; {_say_command(log)} counts it from the centre")
    elif kind == "pulse_width" and not _PULSE_GAINS[0] < abs(gain) < _PULSE_GAINS[1]:
        yield (f"the shaft turns {math.degrees(gain) * 1e-6:.3g} deg per us of pulse, and servos 0.05 to 0.2: look at "
               "the unit of the angle")


def _say(log: Log, factor: float, motion: Motion | None = None) -> str:
    """Return the words of --columns that multiply the angle; one that is turned keeps the zero of its command."""
    column = None if log.reading is None else log.reading.layout.get(log.angle_name)
    if column is None:
        return "a scale of the angle"
    zero = 0.0 if motion is None or log.command_kind != "angle" or column.unit != "deg" else math.degrees(motion.zero)
    zero = 0.0 if abs(zero) < _OFF_ZERO else round(zero)
    scale, offset = (float(f"{value:.4g}") for value in (factor * column.scale, factor * column.offset + zero))
    shown = unit_shown(column.unit, scale, offset)
    return f'--columns "angle={column.column}:{shown}"'


def _say_command(log: Log) -> str:
    name = next(name for name, kind in COMMANDS.items() if kind == log.command_kind)
    column = None if log.reading is None else log.reading.layout.get(name)
    if column is None:
        return "a zero of the command"
    return f'--columns "command={column.column}:{unit_shown(column.unit, column.scale, column.offset - 90.0)}"'


def missing_of(log: Log, clock: Clock, motion: Motion) -> Iterator[str]:
    """Give the experiments that a log lacks, each with what it would tell."""
    held, changes = log.held, log.changes
    sizes = np.abs(np.diff(held))[np.diff(held) != 0.0]
    small, large = _SMALL.get(log.command_kind, math.nan), _LARGE.get(log.command_kind, math.nan)
    if motion.still or not len(changes):
        if motion.still:
            yield "a motion: steps of the command of 10 to 60 deg, there and back, each held for a second"
            return
        yield "a command that changes within the log, and a column that says when: the dead time hangs on it"
    elif log.time[changes[0]] - log.start < 0.2:
        yield "rest before the first command, 0.3 s or more: it tells noise and zero"
    if len(sizes) and math.isfinite(large):
        if np.ptp(held) < large:
            yield "a large step, 60 deg or more: it tells the speed"
        if motion.steps and not (sizes <= small).any():
            yield "small steps, 0.2 to 3 deg both ways, each held for a second: they tell deadband, play and friction"
        if not ((np.diff(held) > 0.0).any() and (np.diff(held) < 0.0).any()):
            yield "the way back: friction, play and droop differ by direction"
    if not any(name in log.measured for name in ("supply_current", "armature_current")):
        yield "a current (0.1 ohm in the supply line, or an INA219): it tells torque from speed"
    if log.load == Load():
        yield "the same motion with a known weight on an arm (a sidecar says which): it tells the torque"
    if clock.period > 0.021:
        yield f"more rows: one each {1e3 * clock.period:.0f} ms hides what happens within a frame; 5 to 20 ms tell it"


# --- How the motion of a log goes with its command: gain and zero, dead time, speed -----------------------------------

_HELD = 0.3  # s of one command, after which a shaft has arrived or is on its way for long
_AT_REST = 0.25  # of a stretch of one command: the end of it
_STEPS_ONLY = 0.2  # of the rows change the command at most: else it moves all the time
_LAGS = 61
_LONGEST_LAG = 0.6  # s
_CLEARLY = 0.2  # of what is left without a shift: an angle does not come first unless that is clear
_SEEN = 0.03  # of a travel, by which a motion has begun
_SIGMAS = 5.0
_FEWEST = 8  # rows
_SPEED_LASTS = 0.03  # s
_SPEED_OVER = 3  # rows to either side


class Motion(NamedTuple):
    """How a motion goes with its command.

    Parameters
    ----------
    gain : float
        Of the angle over the command [rad per SI unit of the command]; nan where the log does not tell.
    zero : float
        The command at which the angle is 0, in SI.
    correlation : float
        Of angle and command, the lag taken away.
    lag : float
        The dead time of steps in the median; where the command moves all the time, by how much the angle comes later
        [s].
    steps : int
        Of which the dead time was seen; 0 where the command moves all the time.
    speed : float
        The fastest that lasts [rad/s].
    onset : float
        When the shaft first leaves where it was, from the first row on; nan where it does not [s].
    still : bool
        Whether the shaft does not move.
    """

    gain: float
    zero: float
    correlation: float
    lag: float
    steps: int
    speed: float
    onset: float
    still: bool


def motion_of(log: Log) -> Motion:
    """Return how the angle of a log goes with its command.

    Examples
    --------
    >>> time = 0.01 * np.arange(400.0)
    >>> command = np.where(time % 2.0 < 1.0, 0.0, 1.0)
    >>> angle = np.interp(time, [1.05, 1.25, 2.05, 2.25, 3.05, 3.25], [0.0, 1.0, 1.0, 0.0, 0.0, 1.0])
    >>> found = motion_of(Log(name="a", time=time, command=command, command_kind="angle",
    ...                       measured={"output_angle": angle}))
    >>> round(found.gain, 3), found.steps, 0.04 < found.lag < 0.08, round(found.speed, 1)
    (1.0, 3, True, 5.0)
    """
    used = log.used(log.angle_name) & log.sent
    time, angle, command = log.time[used], log.measured[log.angle_name][used], log.held[used]
    if len(time) < _FEWEST:
        return Motion(math.nan, math.nan, math.nan, math.nan, 0, math.nan, math.nan, still=log.is_constant)
    changes = np.flatnonzero(np.diff(command) != 0.0) + 1
    noise = rough_noise(angle)
    speed = _speed(time, angle)
    if len(changes) > _STEPS_ONLY * len(time):
        lag, steps = _lag(time, angle, command), 0
    else:
        seen = _dead_times(time, angle, command, changes, noise)
        lag, steps = (float(np.median(seen)) if seen else math.nan), len(seen)
    x = command[np.maximum(np.searchsorted(time, time - (lag if math.isfinite(lag) else 0.0), side="right") - 1, 0)]
    at = _rests(time, changes) if steps else np.ones(len(time), np.bool_)
    gain, zero, correlation = _line(x[at], angle[at])
    way = np.abs(angle - np.median(angle[:3]))
    away = way > max(_SEEN * float(way.max()), _SIGMAS * noise)
    onset = float((time - log.start)[int(np.argmax(away))]) if away.any() else math.nan
    return Motion(gain, zero, correlation, lag, steps, speed, onset, still=log.is_constant)


def _rests(time: Array, changes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the rows at the end of each stretch of one command, all where these are few."""
    rest = np.zeros(len(time), np.bool_)
    for first, stop in pairwise([0, *changes.tolist(), len(time)]):
        span = time[stop - 1] - time[first]
        if span >= _HELD:
            rest[first:stop] = time[first:stop] >= time[stop - 1] - _AT_REST * span
    return rest if rest.sum() >= _FEWEST else np.ones(len(time), np.bool_)


def _dead_times(time: Array, angle: Array, command: Array, changes: NDArray[np.int64], noise: float) -> list[float]:
    """Return the time from each step to the first motion, of those before and after which the command is held."""
    found = []
    for k, nxt in pairwise([*changes.tolist(), len(time)]):
        before = changes[changes < k]
        since = time[before[-1]] if len(before) else time[0]
        if time[k] - since < _HELD or time[nxt - 1] - time[k] < _HELD:
            continue
        base = float(np.median(angle[max(0, k - 5):k]))
        way = float(angle[nxt - 1]) - base
        seen = max(_SEEN * abs(way), _SIGMAS * noise)
        away = np.flatnonzero((angle[k:nxt] - base) * np.sign(way) > seen)
        if abs(way) > 2.0 * seen and len(away):
            found.append(float(time[k + away[0]] - time[k]))
    return found


def _lag(time: Array, angle: Array, command: Array) -> float:
    """Return the shift at which angle and command go together best; below 0 the angle comes first."""
    if np.ptp(command) == 0.0 or np.ptp(angle) == 0.0:
        return math.nan
    lags = np.linspace(-0.25 * _LONGEST_LAG, _LONGEST_LAG, _LAGS)
    fits = [abs(np.corrcoef(np.interp(time - lag, time, command), angle)[0, 1]) for lag in lags.tolist()]
    best = int(np.nanargmax(fits))
    if lags[best] < 0.0 and 1.0 - fits[best] > _CLEARLY * (1.0 - max(fits[int(np.searchsorted(lags, 0.0)):])):
        best = int(np.searchsorted(lags, 0.0))
    return float(lags[best])


def _line(x: Array, y: Array) -> tuple[float, float, float]:  # gain, zero, correlation
    if len(x) < _FEWEST or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return math.nan, math.nan, math.nan
    gain, constant = np.polyfit(x - x.mean(), y, 1)
    zero = float(x.mean() - constant / gain) if gain else math.nan
    return float(gain), zero, float(np.corrcoef(x, y)[0, 1])


def _speed(time: Array, angle: Array) -> float:
    """Return the fastest speed over some rows: single outliers do not count."""
    apart = max(2 * _SPEED_OVER, math.ceil(_SPEED_LASTS / float(np.median(np.diff(time)))))
    if len(time) <= apart + 2:
        return math.nan
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(angle, 2, mode="edge"), 5), axis=1)
    return float(np.abs((smooth[apart:] - smooth[:-apart]) / (time[apart:] - time[:-apart])).max())


# --- A sensor by the values of its signal: noise, steps, ends of its range --------------------------------------------

_FEW = 8  # different values, at least, that show steps
_MANY = 20_000  # different values: steps finer than that do not matter
_WHOLE = 0.3  # of a step, off which values may lie that were rounded
_FLAT = 10  # rows of one value at an end of the range
_MOVES = 0.5  # of neighbouring rows differ where there is noise


class Values(NamedTuple):
    """Remarks on a measured signal, in SI.

    Parameters
    ----------
    low, high : float
    missing : int
        Rows without a value.
    noise : float
        Standard deviation, from second differences.
    step : float
        Step that values are whole multiples of; 0 where they are none.
    counts : int
        Steps of a whole turn, where it is an angle and their number a power of two; else 0.
    flat_low, flat_high : int
        Rows that stand at an end of the range without the noise that they have elsewhere.
    """

    low: float
    high: float
    missing: int
    noise: float
    step: float
    counts: int
    flat_low: int
    flat_high: int


def values_of(values: Array, *, angle: bool) -> Values:
    """Return what is to be said of a signal; nan where nothing was measured.

    Examples
    --------
    >>> turn = np.round(4096 * np.sin(np.arange(200.0)) / 12.0) * 2.0 * np.pi / 4096
    >>> found = values_of(turn, angle=True)
    >>> found.counts, round(math.degrees(found.step), 3)
    (4096, 0.088)
    """
    seen = values[np.isfinite(values)]
    if not len(seen):
        return Values(math.nan, math.nan, len(values), math.nan, 0.0, 0, 0, 0)
    step = _step(seen)
    turn = _TURN / step if angle and step > 0.0 else 0.0
    bits = round(math.log2(turn)) if turn > 1.0 else 0
    counts = 2**bits if bits >= 8 and abs(turn / 2**bits - 1.0) < 2e-3 else 0
    low, high = float(seen.min()), float(seen.max())
    return Values(low, high, len(values) - len(seen), rough_noise(seen), step, counts,
                  _flat(seen, low), _flat(seen, high))


def _step(seen: Array) -> float:
    different = np.unique(np.round(seen, 12))
    if not _FEW <= len(different) <= _MANY:
        return 0.0
    steps = np.diff(different)
    least = float(steps.min())
    step = float(np.median(steps[steps < 1.5 * least]))
    for _ in range(3):  # rounded values: ever more of them say how large it is
        number = np.round((different - different[0]) / step)
        step = float(np.dot(number, different - different[0]) / np.dot(number, number))
    off = np.abs((different - different[0]) / step - np.round((different - different[0]) / step))
    return step if off.max() < _WHOLE and len(different) > 2 else 0.0


def _flat(seen: Array, end: float) -> int:
    """Return how many rows stand at an end of the range, in runs without noise where others have some.

    At its first row a shaft may be at rest there.
    """
    if np.mean(np.diff(seen) != 0.0) < _MOVES:
        return 0
    at = np.concatenate([[0], (seen == end).astype(int), [0]])
    edges = np.flatnonzero(np.diff(at))
    runs = (edges[1::2] - edges[::2])[edges[::2] > 0]
    return int(runs[runs >= _FLAT].sum())


# --- All that a log says by itself ------------------------------------------------------------------------------------

FEWEST = 8  # rows that say anything
_MOST_GAPS = 20
_ANGLES = ("output_angle", "load_angle")


class Lowest(NamedTuple):
    """The least voltage of a supply [V], and when it came first [s]."""

    voltage: float
    time: float


@dataclass(frozen=True, kw_only=True)
class Survey:
    """The survey of a log, in SI.

    Parameters
    ----------
    log : Log
    clock : Clock
    values : mapping of str to Values
        By measured signal.
    motion : Motion
    wrong : tuple of str
        Errors of the log, each in one sentence that says what to do.
    missing : tuple of str
        Experiments that it lacks, and what they would tell.
    """

    log: Log
    clock: Clock
    values: Mapping[str, Values]
    motion: Motion
    wrong: tuple[str, ...]
    missing: tuple[str, ...]

    @property
    def supply(self) -> Lowest | None:
        """Least voltage of the supply and when it came first [s]; None where it was not logged."""
        volts = self.log.measured.get("bus_voltage")
        if volts is None or not np.isfinite(volts).any():
            return None
        k = int(np.nanargmin(volts))
        return Lowest(float(volts[k]), float(self.log.time[k]))

    @property
    def facts(self) -> dict[str, Any]:
        """All of it as plain data."""
        log, clock = self.log, self.clock
        reading = log.reading
        return {
            "name": log.name, "rows": len(log), "duration": log.duration,
            "columns": [] if reading is None else [vars(one) for one in reading.columns],
            "unread": [] if reading is None else list(reading.unread),
            "remarks": [] if reading is None else list(reading.remarks),
            "command": {"kind": log.command_kind, "low": float(log.held.min()), "high": float(log.held.max()),
                        "changes": len(log.changes)},
            "clock": {**clock._asdict(), "gaps": [gap._asdict() for gap in clock.gaps[:_MOST_GAPS]],
                      "gap_count": len(clock.gaps)},
            "supply": None if self.supply is None else self.supply._asdict(),
            "signals": {name: found._asdict() for name, found in self.values.items()},
            "motion": self.motion._asdict(), "wrong": list(self.wrong), "missing": list(self.missing)}


def survey_of(log: Log) -> Survey:
    """Return what a log says by itself: no servo, no fit.

    Raises
    ------
    InputError
        If it has next to no rows.

    Examples
    --------
    >>> import numpy as np
    >>> time = 0.01 * np.arange(300.0)
    >>> command = np.where(time < 1.0, 0.0, 1.0)
    >>> log = Log(name="a", time=time, command=command, command_kind="angle", measured={
    ...     "output_angle": -np.interp(time, [1.05, 1.25], [0.0, 1.0])})
    >>> survey_of(log).wrong[0]
    'the angle falls where the command grows; unless the servo is built in reverse, a scale of the angle turns it'
    """
    if len(log) < FEWEST:
        raise InputError(f"log {log.name!r}" if log.reading is None else log.reading.file, got=f"{len(log)} rows",
                         allowed=f"at least {FEWEST}")
    clock, motion = clock_of(log.time), motion_of(log)
    values = {name: values_of(found, angle=name in _ANGLES) for name, found in log.measured.items()}
    return Survey(log=log, clock=clock, values=values, motion=motion,
                  wrong=tuple(wrong_of(log, clock, values[log.angle_name], motion)),
                  missing=tuple(missing_of(log, clock, motion)))
