"""A log without a fit: where the servo was asked to be, where its shaft was, and how fast it may be."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.search.case import NORMAL, has_pulses, robust_deviation
from servotwin.logs.log import Log
from servotwin.models import Model

# --- A log without a fit ----------------------------------------------------------------------------------------------

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_AROUND = 5  # samples
_SIGMAS = 6.0
_NORMAL_D2 = NORMAL / math.sqrt(6.0)  # of the median magnitude of second differences of white noise


@dataclass(frozen=True)
class Finding:
    """Something in a log that is probably not what the servo did.

    Parameters
    ----------
    kind : str
        "wrap", "stamps", "rows", "sign", "span", "not followed" or "pulses".
    log : str
        Name of the log.
    sentence : str
        Observation, its time, and the remedy.
    mended : Log, optional
        The log with this, and the kinds before it in the list, put right; None where nobody can say how.

    Examples
    --------
    >>> Finding("sign", "run 1", "the angle turns against the command", None).kind
    'sign'
    """

    kind: str
    log: str
    sentence: str
    mended: Log | None


@dataclass(frozen=True)
class Look:
    """One log in angles.

    Parameters
    ----------
    log : Log
    model : Model
        With what the log says of its servo.
    time : ndarray, shape (n,)
        From the first sample on [s].
    asked : ndarray, shape (n,)
        Where an unloaded servo would stand under each command, within its stops [rad].
    drive : ndarray, shape (n,)
        The command as the model takes it: pulse width [s] or control voltage [V].
    angle : ndarray, shape (n,)
        Measured; nan where nothing was [rad].
    counts : ndarray of bool, shape (n,)
        Where the angle counts, and pulses come.
    smooth : ndarray of bool, shape (n,)
        Those of them that are no further from the ones around than a shaft goes meanwhile: no outliers.
    noise : float
        Of the angle, from second differences [rad].
    top_speed : float
        Without load, by the servo file [rad/s].
    """

    log: Log
    model: Model
    time: Array
    asked: Array
    drive: Array
    angle: Array
    counts: Mask
    smooth: Mask
    noise: float
    top_speed: float

    def with_angle(self, angle: Array) -> Log:
        """Return the log with another angle in place of its own [rad]."""
        name = self.log.angle_name
        values = angle * _gain(self.model) + _offset(self.model) if name == "feedback_voltage" else angle
        return replace(self.log, measured={**self.log.measured, name: values})

    def gap(self) -> float:
        """Return how far the measured angles lie from the commanded ones in the middle [rad]."""
        return float(np.median((self.angle - self.asked)[self.counts]))


def look(log: Log, model: Model) -> Look | None:
    """Return a log in angles; None where the model cannot follow its command, which is reported elsewhere."""
    own = {name: value for name, value in log.parameters.items() if name in (*model.requires, *model.optional)}
    try:
        with warnings.catch_warnings():  # of two calibrations that differ: it was said of the servo itself
            warnings.simplefilter("ignore")
            here = type(model)(model.servo.replace(own)) if own else model
            made = log.signal(own.get("electronics.frame_period", getattr(here, "frame_period", None)))
            drives = here.command(replace(made, edges=None) if not has_pulses(here) else made)
            gain: float = here.value("gear.gear_reduction") * here.value("motor.back_emf_constant")
            speed = float(here.value("supply.open_circuit_voltage") / gain)
    except ServotwinError:
        return None
    time = log.time - log.time[0]
    _, first, where = np.unique(log.held, return_index=True, return_inverse=True)
    levels = drives(time[first])
    drive, asked = levels[where], np.asarray(here.start_angle(cast("Any", levels)))[where]
    name = log.angle_name
    values = log.measured[name]
    angle = (values - _offset(here)) / _gain(here) if name == "feedback_voltage" else values
    counts = log.used(name) & log.sent
    noise = rough_noise(angle[counts])
    smooth = counts.copy()
    smooth[counts] = _near_others(time[counts], angle[counts], speed, noise)
    return Look(log, here, time, asked, drive, np.asarray(angle), counts, smooth, noise, speed)


def _near_others(time: Array, angle: Array, speed: float, noise: float) -> Mask:
    """Tell which angles are no further from the median around them than a shaft goes between two samples."""
    if len(time) < _AROUND:
        return np.ones(len(time), np.bool_)
    around = np.median(sliding_window_view(np.pad(angle, _AROUND // 2, mode="edge"), _AROUND), axis=1)
    return np.asarray(np.abs(angle - around) <= speed * float(np.median(np.diff(time))) + _SIGMAS * noise)


def aligned(one: Look, angle: Array, others: Sequence[Look], *, steps_of: float = 0.0) -> Array:
    """Return a corrected angle, shifted so that it lies beside its commands as those of other logs do [rad].

    Parameters
    ----------
    one : Look
    angle : ndarray, shape (n,)
        Corrected, but for a constant [rad].
    others : sequence of Look
        Logs of the same rig that need no correction; without any, and no `steps_of`, nothing is shifted.
    steps_of : float
        Shift by multiples of this only [rad].
    """
    if not others and not steps_of:
        return angle
    usual = float(np.median([other.gap() for other in others])) if others else 0.0
    shift = usual - float(np.median((angle - one.asked)[one.counts]))
    return angle + (steps_of * round(shift / steps_of) if steps_of else shift)


def said_times(time: Array, most: int = 3) -> str:
    """Return how often something happens, and the first times.

    Examples
    --------
    >>> said_times(np.array([0.5, 1.25, 2.0, 7.0]))
    '4 times, at 0.5, 1.25, 2 s, ...'
    """
    first = ", ".join(f"{t:.4g}" for t in time[:most])
    count = "once" if len(time) == 1 else f"{len(time)} times"
    return f"{count}, at {first} s" + (", ..." if len(time) > most else "")


def rough_noise(values: Array) -> float:
    """Return the noise of an otherwise smooth signal, from the median of its second differences; at least its steps'.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> 0.009 < rough_noise(np.sin(np.linspace(0.0, 6.0, 500)) + 0.01 * rng.standard_normal(500)) < 0.011
    True
    """
    if len(values) < 4:
        return 0.0
    steps = np.abs(np.diff(values))
    step = float(steps[steps > 0.0].min(initial=math.inf))
    seen = _NORMAL_D2 * float(np.median(np.abs(np.diff(values, n=2))))
    return max(seen, step / math.sqrt(12.0) if math.isfinite(step) else 0.0)


def _gain(model: Model) -> float:
    return model.value_or("potentiometer.feedback_gain", 1.0)


def _offset(model: Model) -> float:
    return model.value_or("potentiometer.feedback_offset", 0.0)


# --- The beat of a log's time stamps ----------------------------------------------------------------------------------

_BEAT_FEWEST = 20  # stamps
_ROUND = 15  # stamps to either side, over which the beat is the mean: clocks drift
_STEADY = 0.05  # of a period: most stamps have to be that near
_PAUSE = 5.5  # periods: the beat may begin anew
_OFF = 0.1  # of a period
_MOST_OFF = 0.2  # of all stamps: with more there is no beat to be off


@dataclass(frozen=True)
class Beat:
    """The beat of time stamps.

    Parameters
    ----------
    period : float
        [s].
    place : ndarray, shape (n,)
        Where each row lies on the beat [s].
    number : ndarray of int, shape (n,)
        Of the beats, rising by one where no row is missing.
    off : ndarray of bool, shape (n,)
        Whether a stamp lies beside its place by far more than most.
    """

    period: float
    place: Array
    number: NDArray[np.int64]
    off: Mask


def beat_of(time: Array) -> Beat | None:
    """Return the beat of rising time stamps; None where they have none.

    Examples
    --------
    >>> stamps = 0.02 * np.arange(60.0)
    >>> stamps[[20, 40]] += 0.008
    >>> found = beat_of(np.delete(stamps, 30))
    >>> round(found.period, 6), np.flatnonzero(found.off).tolist(), found.number[-1].item()
    (0.02, [20, 39], 59)
    """
    if len(time) < _BEAT_FEWEST:
        return None
    period = _period(time)
    turn = 2.0 * np.pi * time / period
    hand = np.exp(1j * turn)
    parts = np.concatenate([[0], np.cumsum(np.diff(time) > _PAUSE * period)])
    on = np.ones(len(time), np.bool_)
    for _ in range(3):
        slip = np.angle(hand * np.conj(_local(hand * on, parts))) / (2.0 * np.pi)  # of a period, -0.5 to 0.5
        scale = robust_deviation(slip)
        off = np.abs(slip) > max(_SIGMAS * scale, _OFF)
        on = ~off
    if scale > _STEADY or off.mean() > _MOST_OFF or not on[[0, -1]].any():
        return None
    # The local beat drifts, so whole numbers of beats come from step to step
    rough = np.concatenate([[0], np.cumsum(np.round(np.diff(time / period - slip)))]).astype(np.int64)
    off[[k + int(abs(slip[k + 1]) > abs(slip[k])) for k in np.flatnonzero(np.diff(rough) < 1)]] = True
    number = _numbered(rough, off)
    place = _places(time, number, ~off, period)
    return None if place is None else Beat(period, place, number, off)


def _period(time: Array) -> float:
    """Return the median time of a beat, from ever more rows apart, each counted with what was known before."""
    steps = np.diff(time)
    period = float(np.median(steps))
    apart = 2
    while apart <= min(64, len(time) // 4):
        spans = time[apart:] - time[:-apart]
        period = float(np.median(spans / np.maximum(np.round(spans / period), 1.0)))
        apart *= 2
    return period


def _local(hand: NDArray[np.complex128], parts: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Return the mean direction around each row, within its part of the log."""
    sums = np.zeros(len(hand), np.complex128)
    for part in np.unique(parts):
        here = np.flatnonzero(parts == part)
        total = np.concatenate([[0.0], np.cumsum(hand[here])])
        k = np.arange(len(here))
        sums[here] = total[np.minimum(k + _ROUND + 1, len(here))] - total[np.maximum(k - _ROUND, 0)]
    return sums


def _numbered(rough: NDArray[np.int64], off: Mask) -> NDArray[np.int64]:
    """Return numbers that rise from row to row: a row that is off goes where there is room between others."""
    number = rough.copy()
    for k in range(1, len(number)):
        if off[k]:
            number[k] = max(number[k], number[k - 1] + 1)
    for k in range(len(number) - 2, -1, -1):
        if off[k]:
            number[k] = min(number[k], number[k + 1] - 1)
    return number


def _places(time: Array, number: NDArray[np.int64], on: Mask, period: float) -> Array | None:
    """Return where each row lies on the beat: its stamp, or between its neighbours that are on."""
    if (np.diff(number) < 1).any():
        return None
    drift = time - number * period
    place = np.where(on, time, number * period + np.interp(number, number[on], drift[on]))
    return place if (np.diff(place) > 0.0).all() else None


# --- Time stamps that lie off the beat of the others, and rows that are missing ---------------------------------------

_TELLS = 4.0  # times the noise, by which stamp and beat have to differ in angle
_WRONG_VOTES = 0.25  # of angles that differ so far, fit the beat better by chance at most, if the stamps are right
_CHANCE = 0.02  # of so many by chance: three of three are enough
_RUN = 2  # rows off in a row, in the mean
_FEWEST = 4  # rows on the beat
_SEEN = 6.0  # times the noise, that an unknown instant of a command has to matter
_NEAR = 10  # rows to either side
_USUAL = 0.8  # of their changes are at most usual
_SETTLED = 0.1  # s after a motion


def wrong_stamps(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs some of whose stamps lie off the beat, where the angles of all logs say that it is the stamps."""
    beats = [(one, beat) for one in looks if (beat := beat_of(one.log.time)) is not None and _single(beat.off)]
    votes = [_votes(one, beat) for one, beat in beats]
    tell = sum(vote.tell for vote in votes)
    if not tell:
        return []
    from scipy.special import bdtrc

    if bdtrc(sum(vote.beat for vote in votes) - 1, tell, _WRONG_VOTES) > _CHANCE:
        return []
    return [_restamped(one, beat) for (one, beat), vote in zip(beats, votes, strict=True) if 2 * vote.beat >= vote.tell]


def _single(off: Mask) -> bool:
    """Tell whether some rows are off, one or two at a time: longer runs are a clock whose beat changes."""
    begins = int(np.count_nonzero(np.diff(np.concatenate([[0], off.astype(int)])) > 0))
    return 0 < int(off.sum()) <= _RUN * begins


def _restamped(one: Look, beat: Beat) -> Finding:
    return Finding("stamps", one.log.name, (
        f"log {one.log.name!r}: {beat.off.sum()} of {len(one.time)} time stamps lie off the beat of the others, "
        f"{beat.period:.4g} s, by up to {np.abs(beat.place - one.log.time).max():.2g} s: "
        f"{said_times(one.log.time[beat.off])}; the angles fit the beat; mending \"stamps\" puts them on it"),
        replace(one.log, time=beat.place))


class _Votes(NamedTuple):
    """Rows whose angle tells stamp from beat, and those of them that fit the beat better."""

    tell: int
    beat: int


def _votes(one: Look, beat: Beat) -> _Votes:
    on = one.counts & ~beat.off
    rows = np.flatnonzero(one.counts & beat.off)
    if on.sum() < _FEWEST:
        return _Votes(0, 0)
    from scipy.interpolate import PchipInterpolator  # slow to load

    curve = PchipInterpolator(one.log.time[on], one.angle[on], extrapolate=False)
    by_stamp, by_beat = (np.abs(one.angle[rows] - curve(at[rows])) for at in (one.log.time, beat.place))
    tell = np.abs(by_stamp - by_beat) > _TELLS * one.noise  # nan, outside, is no
    return _Votes(int(tell.sum()), int((by_beat < by_stamp)[tell].sum()))


def missing_rows(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs in which a command changed while rows are missing: it is unknown when."""
    return [finding for one in looks for finding in _missing(one)]


def _missing(one: Look) -> list[Finding]:
    beat = beat_of(one.log.time)
    if beat is None or one.log.command_hold == "linear":
        return []
    steps = np.diff(beat.number)
    lost = int((steps - 1).sum())
    at = np.flatnonzero((steps > 1) & _matters(one, beat))
    if not len(at):
        return []
    windows = _left(one, at)
    stays = replace(one.log, left_out=(*one.log.left_out, *windows)) if _some_left(one, windows) else None
    return [Finding("rows", one.log.name, (
        f"log {one.log.name!r}: {lost} rows are missing, and the command changed meanwhile "
        f"{said_times(one.log.time[at])}: nobody knows when; mending \"rows\" leaves out the motions after"), stays)]


def _matters(one: Look, beat: Beat) -> Mask:
    """Tell for each step between rows whether the command's change in it, more than usual, would be seen if late."""
    change = np.abs(np.diff(one.asked))
    steps = np.diff(beat.number)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(np.where(steps == 1, change, 0.0), _NEAR), 2 * _NEAR + 1)
    usual = np.quantile(near, _USUAL, axis=1)  # of commands that change all the time, such as a sine
    late = (steps - 1) * beat.period
    return np.asarray(np.minimum(change - usual * steps, one.top_speed * late) > max(_SEEN * one.noise, 1e-9))


def _left(one: Look, at: NDArray[np.int64]) -> list[tuple[float, float]]:
    """Return the windows in which the motions after some rows take place [s]."""
    found: list[tuple[float, float]] = []
    for k in at.tolist():
        begin = float(one.log.time[k]) + 1e-9
        travel = abs(float(one.asked[k + 1] - one.angle[k])) if math.isfinite(one.angle[k]) else 0.0
        end = float(one.log.time[k + 1]) + travel / one.top_speed + _SETTLED
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found


def _some_left(one: Look, windows: Sequence[tuple[float, float]]) -> bool:
    """Tell whether half of what counts stays: else nothing is left to fit."""
    out = np.zeros(len(one.time), np.bool_)
    for start, stop in windows:
        out |= (one.log.time >= start) & (one.log.time < stop)
    return bool((one.counts & ~out).sum() > 0.5 * one.counts.sum())


# --- Commands that the servo's chip would refuse ----------------------------------------------------------------------

def refused(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs with pulses outside the limits that the chip takes."""
    return [finding for one in looks if has_pulses(one.model) for finding in _refused(one)]


def _refused(one: Look) -> list[Finding]:
    low = one.model.value_or("electronics.pulse_width_min", 0.0)
    high = one.model.value_or("electronics.pulse_width_max", math.inf)
    outside = ((one.drive < low) | (one.drive > high)) & one.log.sent
    if not outside.any():
        return []
    worst = one.drive[outside][np.argmax(np.maximum(low - one.drive[outside], one.drive[outside] - high))]
    return [Finding("pulses", one.log.name, (
        f"log {one.log.name!r}: {outside.sum()} of {len(outside)} commands, the first at "
        f"{one.log.time[np.argmax(outside)]:.4g} s, lie outside the {low:.4g} to {high:.4g} s that the servo's chip "
        f"takes (such as {worst:.4g} s) and would not be followed; check the unit of the command, and "
        "electronics.pulse_width_min and pulse_width_max"), None)]
