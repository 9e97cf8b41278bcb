"""Commands that the shaft did not follow: stretches in which it did as if it were not driven."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import HUBER, robust_deviation
from servotwin.identification.fitting.suspicions.look import Array, Finding, Look, Mask, aligned, said_times
from servotwin.identification.survey.survey import motion_of
from servotwin.logs.column_words import SAID
from servotwin.models.standing import mid_travel
from servotwin.models.terms.wiring import TRAVEL_SLACK
from servotwin.units.words import unit_shown

if TYPE_CHECKING:
    from servotwin.logs.columns import Column
    from servotwin.logs.formats import Reading
    from servotwin.logs.log import Log
    from servotwin.models import Model


# --- Commands that the shaft did not follow: stretches in which it did as if it were not driven -----------------------

_BIN = 0.02  # s: a frame, and the bins that commands and speeds are averaged over
_AHEAD = 3  # bins, by which a speed is foretold
_PAST = 8  # bins before, whose commands may still act: delays up to 0.16 s
_FEWEST = 60  # bins
_SATURATES = (0.05, 0.1, 0.2, 0.5, 1.0)  # rad, errors at which the drive may be full; the best is taken
_ROUNDS = 10
_SETTLED = 0.01  # of the scale
_SIGMAS = 8.0
_FARTHER = 5.0  # times: of 624 healthy logs of the bench no habit was off by more than 4 times as much one way
_STRONG = 0.1  # of the speed without load: less drive says nothing
_HALF = 0.5
_SMALL = 0.1  # rad, a way on which friction and deadband may hold the shaft
_MOST = 0.6  # of a window's commands
_TOO_FAST = 2.0  # times the speed without load
_AROUND = 6  # bins
_LONG = 3  # bins in a row: an outlier gives one to either side
_STILL = 0.3  # s without motion, after a command that was to move
_DELAY = 0.1  # s, more than the delay of a servo and its bus
_LEAST = 0.2  # rad, a command that moves any servo
_SHARE = 0.3  # of the commanded span
_FOLLOWS = 0.5  # of the commanded span the shaft went through: else it is a soft servo that may stand still
_FORGOTTEN = 3.0  # times e: a twentieth is left of how far off it was
_MORE = 0.1  # s after an event, until the motion is as commanded


def not_followed(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs with stretches in which the shaft did not follow its command, which are left out."""
    return [finding for one in looks for finding in _not_followed(one)]


def _not_followed(one: Look) -> list[Finding]:
    habit = _usual(one)
    windows = _joined([*(_against(one, habit) if habit else ()), *_standing(one)])
    if not windows:
        return []
    far = _joined([(start, _back(one, habit, stop)) for start, stop in windows]) if habit else windows
    # where nothing were left to fit, what follows stays; and all of it, if that is not enough
    mended = next((some for some in (far, windows) if _is_enough(one, some)), None)
    stays = None if mended is None else replace(one.log, left_out=(*one.log.left_out, *mended))
    said = ", ".join(f"{start:.4g} to {stop:.4g}" for start, stop in windows[:3])
    said += ", ..." if len(windows) > 3 else ""
    return [Finding("not followed", one.log.name, (
        f"log {one.log.name!r}: from {said} s the shaft does not follow its command, as if it got no pulses; look at "
        "wiring and supply; mending \"not followed\" leaves this out"), stays)]


def _is_enough(one: Look, windows: Sequence[tuple[float, float]]) -> bool:
    """Tell whether most of what counts lies outside some windows."""
    out = np.zeros(len(one.time), np.bool_)
    for start, stop in windows:
        out |= (one.log.time >= start) & (one.log.time < stop)
    return bool((one.counts & ~out).sum() > _HALF * one.counts.sum())


def _back(one: Look, habit: _Habit, stop: float) -> float:
    """Return when a shaft that was not driven until some time is where it would be if it had been [s].

    As long as the drive is full it goes as it would from anywhere, and stays as far off as it was. Once its commands
    are so near that the drive depends on where it is, that shrinks with the time that it takes to go so far at full
    speed.
    """
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    shrunk = 0.0
    for k in np.flatnonzero(time >= stop - one.log.start)[1:]:
        before = asked[(time > time[k] - _DELAY) & (time <= time[k])]
        if (np.abs(before - angle[k]) < habit.full_at).all():
            shrunk += (time[k] - time[k - 1]) * one.top_speed / habit.full_at
        if shrunk > _FORGOTTEN:
            return float(time[k] + one.log.start)
    return float(one.log.time[-1] + _BIN)


def _joined(windows: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    for start, stop in sorted(windows):
        if found and start <= found[-1][1]:
            found[-1] = found[-1][0], max(stop, found[-1][1])
        else:
            found.append((start, stop))
    return found


# ---------------------------------------------------------------- against the drive, judged by the log's own habits
@dataclass(frozen=True)
class _Habit:
    """How the speed of a log follows from speed, angle and commands before: residuals of a robust line."""

    time: Array
    residual: Array
    drive: Array  # what the commands give to the speed
    arrived: Array  # what they would give to a shaft that is where it is afterwards: little, if it has arrived
    possible: Mask  # no speed around that only an outlier has
    scale: float
    full_at: float  # of an error, from which on the drive is full [rad]


def _usual(one: Look) -> _Habit | None:
    """Return the habit that explains most of a log's speeds; None of a log that is too short for one."""
    habits = [habit for error in _SATURATES if (habit := _habit(one, error)) is not None]
    return min(habits, key=lambda habit: habit.scale, default=None)


def _against(one: Look, best: _Habit) -> Iterator[tuple[float, float]]:
    """Give the windows in which the speed lacks more than all that the commands give to it.

    A shaft that gets no drive lacks just that, one on which an earlier command still acts twice as much. And it lacks
    far more, at once and in all, than the habit ever says too little: no missing pulse makes a shaft faster, so that is
    how far off a habit is.
    """
    full = float(np.quantile(np.abs(best.drive), 0.9))
    if full < _STRONG * one.top_speed or not best.scale > 0.0:
        return
    strong = np.minimum(np.abs(best.drive), np.sign(best.drive) * best.arrived) > _HALF * full
    lack = -best.residual * np.sign(best.drive)
    found = strong & best.possible & (lack > np.maximum(np.abs(best.drive), _SIGMAS * best.scale))
    unsure = max((_size(-lack[first:last + 1]) for first, last in _runs((lack < 0.0) & best.possible)), default=0.0)
    for first, last in _runs(lack > _HALF * np.abs(best.drive)):
        here = slice(first, last + 1)
        if last - first + 1 >= _LONG and found[here].any() and _size(lack[here]) > _FARTHER * unsure:
            begin = best.time[first] - _AHEAD * _BIN
            if _arrives(one, float(begin), float(best.time[last])):
                continue
            yield float(begin + one.log.start), float(best.time[last] + _MORE + one.log.start)


def _size(off: Array) -> float:
    """Return the largest of some speeds times their sum: how far off they are, at once and in all."""
    return float(off.max() * off.sum())


def _arrives(one: Look, begin: float, end: float) -> bool:
    """Tell whether the shaft goes to its command in a window, or has no way to go: a habit of few motions is unsure."""
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    start, stop = np.interp((begin, end), time, angle)
    goals = asked[(time >= begin - _DELAY) & (time <= end)]
    nearer = np.abs(goals - stop) < _HALF * np.abs(goals - start)
    small = np.abs(goals - start) < _SMALL
    return bool(len(goals) and (small | nearer).mean() > _MOST)


def _habit(one: Look, error: float) -> _Habit | None:
    time, angle = one.time[one.smooth], one.angle[one.smooth]
    if len(time) < _FEWEST or time[-1] - time[0] < _FEWEST * _BIN:
        return None
    grid = np.arange(time[0], time[-1] + 1e-9, _BIN)
    q = np.interp(grid, time, angle)
    speed = np.gradient(q, _BIN)
    asked = _binned(one, grid)
    k = np.arange(_PAST, len(grid) - _AHEAD - 1)
    past = k[:, None] + _AHEAD - np.arange(_AHEAD + _PAST)
    drives, arrived = (np.clip((asked[past] - q[at]) / error, -1.0, 1.0)
                       for at in (np.minimum(past, k[:, None]), k[:, None] + _AHEAD))
    known = np.column_stack([np.ones(len(k)), speed[k], speed[k - 1], np.sin(q[k]), np.cos(q[k]), drives])
    y = speed[k + _AHEAD]
    weight, residual, scale = np.ones(len(k)), y, math.inf
    little = 1e-6 * len(k) * np.eye(known.shape[1])  # commands of neighbouring bins may be the same
    for _ in range(_ROUNDS):
        counted = known * (weight**2)[:, None]
        line = np.linalg.solve(counted.T @ known + little, counted.T @ y)  # a decomposition of so many rows is slow
        residual, before = y - known @ line, scale
        scale = robust_deviation(residual)
        if abs(scale - before) < _SETTLED * scale:
            break
        weight = np.sqrt(np.minimum(1.0, HUBER * scale / np.maximum(np.abs(residual), 1e-12)))
    gains = line[-drives.shape[1]:]
    around = np.pad(np.abs(speed), _AROUND, mode="edge")[k[:, None] + _AHEAD + np.arange(2 * _AROUND + 1)]
    possible = (around < _TOO_FAST * one.top_speed).all(axis=1)
    return _Habit(grid[k + _AHEAD], residual, drives @ gains, arrived @ gains, possible, scale, error)


def _binned(one: Look, grid: Array) -> Array:
    """Return the commanded angle in the mean of each bin before a time [rad]."""
    fine = grid[:, None] - _BIN * (np.arange(4) + 0.5) / 4.0
    at = np.searchsorted(one.time, fine, side="right") - 1
    return np.asarray(one.asked[np.maximum(at, 0)].mean(axis=1))


def _runs(mask: Mask) -> Iterator[tuple[int, int]]:
    """Give first and last place of each stretch that is true."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    yield from zip(np.flatnonzero(edges > 0).tolist(), (np.flatnonzero(edges < 0) - 1).tolist(), strict=True)


# -------------------------------------------------------------------------- standing still under large commands
def _standing(one: Look) -> Iterator[tuple[float, float]]:
    """Give the windows in which the shaft stands while commands change by what moves it at other times."""
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    if len(time) < 4:
        return
    large = max(_LEAST, _SHARE * float(np.ptp(asked)))
    if np.ptp(angle) < _FOLLOWS * np.ptp(asked):
        return
    rest = max(6.0 * one.noise, 0.01)
    first = 0
    while first < len(time) - 1:
        away = np.flatnonzero(np.abs(angle[first:] - angle[first]) > rest)
        last = first + int(away[0]) - 1 if len(away) else len(angle) - 1
        if time[last] - time[first] > _STILL + _DELAY:
            here = np.flatnonzero((time >= time[first]) & (time <= time[last] - _DELAY))
            off = np.abs(asked[here] - asked[first]) > large
            if off.any() and _lasting(time[here], off):
                yield (float(time[here][np.argmax(off)] + one.log.start),
                       float(time[last] + _MORE + one.log.start))
        first = max(last, first + 1)


def _lasting(time: Array, off: Mask) -> bool:
    """Tell whether a command stayed away for so long that a servo would have moved."""
    return any(time[last] - time[first] >= _STILL - _DELAY for first, last in _runs(off))


# --- Commands that count from an end of the travel, as `servo.write(90)` does -----------------------------------------

_CENTRES = (90.0, 135.0)  # deg: of servo.write, and of servos of 270 degrees
_CLEAR = 0.6  # correlation
_NEAR = 10.0  # deg: further from it no sketch counts


class Centred(NamedTuple):
    """Logs whose commands count from the middle of the travel, and what was found of those that did not."""

    logs: tuple[Log, ...]
    sentences: tuple[str, ...]
    turned: tuple[Log, ...]


def centred(logs: Sequence[Log], model: Model) -> Centred:
    """Return logs with zero and sign of servo.write put right.

    Only commands that the servo could not follow as they are, and can about its middle, are taken for such.

    Raises
    ------
    InputError
        If the servo cannot follow a command, whatever its zero: names file, row and degrees.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.logs import Log
    >>> time = 0.02 * np.arange(200.0)
    >>> command = np.radians(np.where(time % 2.0 < 1.0, 90.0, 150.0))
    >>> log = Log(name="a", time=time, command=command, command_kind="angle", measured={"output_angle": command})
    >>> centred([log], st.BoundedServo(st.load_servo("towerpro-mg996r"))).sentences[0].split(":")[1]
    ' commands of 90 to 150 deg count from an end of the travel, as servo.write does'
    """
    low, high = model.value_or("stops.lower_angle", -math.inf), model.value_or("stops.upper_angle", math.inf)
    made, turned, said = [], [], dict[str, list[str]]()
    for log in logs:
        if log.command_kind != "angle" or _inside(log.held, low, high):
            made.append(log)
            continue
        found = _about_the_middle(log, model, low, high)
        made.append(found.log)
        said.setdefault(found.sentence, []).append(repr(log.name))
        turned.append(found.log)
    sentences = tuple(f"log {names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {sentence}"
                      for sentence, names in said.items())
    return Centred(tuple(made), sentences, tuple(turned))


class _Found(NamedTuple):
    log: Log
    sentence: str


def _inside(angle: Array, low: float, high: float) -> bool:
    return bool(angle.min() >= low - TRAVEL_SLACK and angle.max() <= high + TRAVEL_SLACK)


def _about_the_middle(log: Log, model: Model, low: float, high: float) -> _Found:
    middle = mid_travel(model)
    own = float(np.degrees(log.held.min())), float(np.degrees(log.held.max()))
    for centre in _CENTRES:
        shift = middle - math.radians(centre)
        if own[0] >= -1e-6 and own[1] <= 2.0 * centre + 1e-6 and _inside(log.held + shift, low, high):
            break
    else:
        raise _refused(log, model, low, high)
    sign, offset, words = _angle(log, math.radians(centre), middle)
    measured = dict(log.measured)
    if log.angle_name == "output_angle":
        measured["output_angle"] = sign * measured["output_angle"] + offset
    at = "" if middle == 0.0 else f" ({math.degrees(middle):.4g} deg of the servo)"
    what = f"commands of {own[0]:.4g} to {own[1]:.4g} deg count" if own[1] > own[0] else (
        f"a command of {own[0]:.4g} deg counts")
    sentence = (f"{what} from an end of the travel, as servo.write does: {centre:g} deg is taken for its "
                f"middle{at}{words}")
    moved = replace(log, command=log.command + shift, measured=measured, reading=_reading(log, shift, sign, offset))
    return _Found(moved, sentence)


def _angle(log: Log, centre: float, middle: float) -> tuple[float, float, str]:  # sign, offset [rad], words
    """Return how the measured angle becomes one about the middle: its sign, and where it stands at the centre."""
    motion = motion_of(log)
    if log.angle_name != "output_angle" or not abs(motion.correlation) > _CLEAR:
        return 1.0, 0.0, "; the angle stays as it is: it does not tell its zero"
    sign = math.copysign(1.0, motion.gain)
    there = math.degrees(motion.gain * (centre - motion.zero))  # what it measures at the centre
    known = (0.0, math.degrees(centre), math.degrees(middle))
    near = min(known, key=lambda one: abs(one - there))
    there = near if abs(near - there) < _NEAR else round(there, 1)
    turned = ", and counts against the command" if sign < 0.0 else ""
    return sign, middle - sign * math.radians(there), f"; the angle is {there:g} deg there{turned}"


def _reading(log: Log, shift: float, sign: float, offset: float) -> Reading | None:
    """Return how the log was read, with what a sidecar has to say of zero and sign."""
    if log.reading is None:
        return None
    layout = dict(log.reading.layout)
    for name, change in (("command_angle", (1.0, shift)), ("output_angle", (sign, offset))):
        if name in layout:
            layout[name] = _moved(layout[name], *change)
    columns = tuple(replace(one, unit=unit_shown(here.unit, here.scale, here.offset), known=SAID) if (
        here := layout.get(one.signal)) is not None and here != log.reading.layout[one.signal] else one
        for one in log.reading.columns)
    return replace(log.reading, layout=layout, columns=columns)


def _moved(column: Column, sign: float, offset: float) -> Column:
    more = math.degrees(offset) if column.unit == "deg" else offset
    return replace(column, scale=sign * column.scale, offset=round(sign * column.offset + more, 9) + 0.0)


def _refused(log: Log, model: Model, low: float, high: float) -> InputError:
    """Return the error of a log whose commands the servo cannot follow: where they leave the travel by most."""
    middle = mid_travel(model)
    own = np.degrees(log.held)
    centre = next((one for one in _CENTRES if own.min() >= -1e-6 and own.max() <= 2.0 * one + 1e-6
                   and own.max() > math.degrees(high)), None)
    shift = 0.0 if centre is None else middle - math.radians(centre)
    k = int(np.argmax(np.maximum(low - log.held - shift, log.held + shift - high)))
    counted = "" if centre is None else f", which is {math.degrees(log.held[k] + shift):.4g} deg about its middle"
    file = f"log {log.name!r}" if log.reading is None else log.reading.file
    return InputError(f"{file}: row {k + 1} ({log.time[k]:.4g} s), command", got=f"{own[k]:.4g} deg{counted}",
                      allowed=f"{math.degrees(low):.4g} to {math.degrees(high):.4g} deg, the travel of "
                      f'{model.servo.name}; --columns "command=COLUMN:deg-90" moves the zero of a command')


# --- Angles that turn against the command -----------------------------------------------------------------------------

_LAGS = np.arange(0.0, 0.301, 0.02)  # s: delay and slew of a servo that follows at all
_SHORT_LAGS = np.arange(0.0, 0.161, 0.02)
_RESPONSE = 0.06  # s, over which an angle begins to change
_APART = 0.2  # by which the correlation against the command has to be larger than that with it
_SIGN_FEWEST = 8  # samples
_SIGN_LEAST = 5e-3  # rad, standard deviation of commands that say something


def turned(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs whose angle turns against the command."""
    found = [one for one in looks if _is_turned(one)]
    good = [one for one in looks if one not in found and _SIGN_LEAST < float(np.std(one.asked[one.counts]))]
    return [Finding("sign", one.log.name, (
        f"log {one.log.name!r}: the angle turns against the command throughout" + (", unlike that of other logs"
        if good else "") + "; turn its sign where it is recorded, or the servo's command; mending \"sign\" turns it"),
        one.with_angle(aligned(one, -one.angle, good))) for one in found]


def _is_turned(one: Look) -> bool:
    time, angle = one.time[one.counts], one.angle[one.counts]
    if len(time) < _SIGN_FEWEST or float(np.std(one.asked[one.counts])) < _SIGN_LEAST:
        return False
    followed = [_correlation(_asked(one, time[time >= lag] - lag), angle[time >= lag]) for lag in _LAGS]
    if max(np.max(followed), -np.min(followed)) < _CLEAR:  # commands so fast that the shaft only feels them
        followed = _responses(one, time, angle)
    return bool(-np.min(followed) > max(_CLEAR, np.max(followed) + _APART))


def _responses(one: Look, time: Array, angle: Array) -> list[float]:
    """Return the correlations of commands and the changes of angle after them, where the angle stood being known."""
    apart = float(np.median(np.diff(time)))
    later = max(_RESPONSE, 3.0 * apart)
    at = np.arange(time[0], time[-1] - later, apart)
    if len(at) < _SIGN_FEWEST:
        return [0.0]
    here = np.interp(at, time, angle)
    change = np.interp(at + later, time, angle) - here
    return [_correlation(*(_without(here, y) for y in (_asked(one, at + 0.5 * later - lag), change)))
            for lag in _SHORT_LAGS]


def _asked(one: Look, time: Array) -> Array:
    """Return the commanded angle that held at some times [rad]."""
    at = np.searchsorted(one.time, time + 1e-9, side="right") - 1
    return one.asked[np.maximum(at, 0)]


def _without(known: Array, y: Array) -> Array:
    """Return what a straight line over `known` does not explain."""
    if float(np.ptp(known)) == 0.0:
        return y
    slope, constant = np.polyfit(known, y, 1)
    return np.asarray(y - slope * known - constant)


def _correlation(x: Array, y: Array) -> float:
    if len(x) < _SIGN_FEWEST or min(float(np.std(x)), float(np.std(y))) < 1e-9:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


# --- Angles whose span does not fit the commanded one: another unit, scale or travel ----------------------------------

_FACTOR = math.sqrt(2.0)  # half way to 2 on a scale of ratios; pulse gains of makers differ by 12 %
_REST = 0.3  # s, in which the command hardly changes
_SLOW = 0.1  # of the speed without load: what counts as hardly
_SPAN_LEAST = math.radians(20.0)  # of commands, so that friction and deadband count for little
_SPAN_FEWEST = 10  # samples at rest
_SPAN_MOST = 200  # of them in pairs
_ARRIVED = 0.5  # s, after which a shaft is where commands send it, wherever it began
_EDGE = 0.01  # of the samples: what is left of outliers
_BEYOND = 1.1  # of the travel from stop to stop
_KNOWN = (2.0, 3.0, 4.0, 1.5, 4.0 / 3.0, 180.0 / math.pi, 2.0 * math.pi)  # and their inverses
_SPAN_NEAR = 0.07


def spans(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs whose angle moves much more or less than the command asks."""
    ratios = [ratio if not math.isnan(ratio := _ratio(one)) else _too_far(one) for one in looks]
    good = [one for one, ratio in zip(looks, ratios, strict=True)
            if not math.isnan(ratio) and 1.0 / _FACTOR < ratio < _FACTOR]
    found = [_scaled(one, ratio, good) for one, ratio in zip(looks, ratios, strict=True)
             if ratio > _FACTOR or (0.0 < ratio < 1.0 / _FACTOR and _free(one))]
    named = {finding.log for finding in found}
    return [*found, *(finding for one in looks if one.log.name not in named for finding in _beyond(one))]


def _ratio(one: Look) -> float:
    """Return how far the shaft goes where the command asks for one radian; nan where the log does not say."""
    time, angle, asked = one.time[one.smooth], one.angle[one.smooth], one.asked[one.smooth]
    if len(time) < _SPAN_FEWEST:
        return math.nan
    first = np.searchsorted(time, time - _REST)
    least = _SLOW * one.top_speed * _REST
    still = np.array([k > 0 and np.ptp(asked[a:k + 1]) < least and abs(angle[k] - angle[a]) < least + 6.0 * one.noise
                      and time[k] - time[0] >= _REST for k, a in enumerate(first)])
    x, y = asked[still], angle[still]
    if len(x) < _SPAN_FEWEST:
        return math.nan
    some = np.linspace(0, len(x) - 1, min(len(x), _SPAN_MOST)).astype(int)
    dx, dy = (np.subtract.outer(v[some], v[some]) for v in (x, y))
    far = dx > _SPAN_LEAST
    return float(np.median(dy[far] / dx[far])) if far.sum() >= _SPAN_FEWEST else math.nan


def _too_far(one: Look) -> float:
    """Return how much wider the measured span is than the commanded one; nan where it is not clearly wider."""
    later = one.smooth & (one.time >= _ARRIVED)
    if later.sum() < _SPAN_FEWEST or np.ptp(one.asked) < _SPAN_LEAST:
        return math.nan
    low, high = np.quantile(one.angle[later], (_EDGE, 1.0 - _EDGE))
    ratio = float((high - low) / np.ptp(one.asked))
    return ratio if ratio > _FACTOR else math.nan


def _free(one: Look) -> bool:
    """Tell whether no load pushes more on one side than on the other, so that a soft servo moves less."""
    return not (one.log.load.pendulums or one.log.load.springs or one.log.load.recorded)


def _scaled(one: Look, ratio: float, good: Sequence[Look]) -> Finding:
    known = min((*_KNOWN, *(1.0 / k for k in _KNOWN)), key=lambda k: abs(math.log(abs(ratio) / k)))
    factor = known if abs(math.log(abs(ratio) / known)) < _SPAN_NEAR else ratio
    try:
        mended = one.with_angle(aligned(one, one.angle / factor, good))
    except InputError:  # an angle that hardly moves would be of any size
        mended = None
    return Finding("span", one.log.name, (
        f"log {one.log.name!r}: the shaft moves {ratio:.3g} times as far as it is asked to; check unit and scale of "
        "the angle, and travel and pulse range in the servo file (potentiometer.feedback_gain); mending \"span\" "
        f"divides the angle by {factor:.4g}"), mended)


def _beyond(one: Look) -> list[Finding]:
    """Return a finding where the angle goes through more than lies between the stops."""
    travel = one.model.value_or("stops.upper_angle", math.inf) - one.model.value_or("stops.lower_angle", -math.inf)
    angle: Array = one.angle[one.smooth]
    if len(angle) < _SPAN_FEWEST or not math.isfinite(travel):
        return []
    span = float(np.quantile(angle, 1.0 - _EDGE) - np.quantile(angle, _EDGE))
    if span < _BEYOND * travel:
        return []
    return [Finding("span", one.log.name, (
        f"log {one.log.name!r}: the shaft goes through {span:.3g} rad, and the servo file's stops are {travel:.3g} rad "
        "apart; check the unit of the angle, and stops.lower_angle and stops.upper_angle"), None)]


# --- Angles that jump by a constant that no servo could turn so fast --------------------------------------------------

TURN = 2.0 * math.pi
_WRAP_TOO_FAST = 4.0  # times the speed without load: what no motion explains, whatever the sheet is worth
_NOISE = 6.0  # standard errors
_WRAP_FEWEST = 3  # jumps, which distinguish a modulus that is not known beforehand from outliers
_STAYS = 3  # samples on either side of a jump: an outlier comes back at once
_NEAR_TURN = 0.5  # rad, how far offsets of two logs of one rig may differ


def wraps(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs whose angle wraps, or lies a whole turn beside the others."""
    jumps = [_jumps(one) for one in looks]
    good = [one for one, found in zip(looks, jumps, strict=True) if found is None]
    found = [_unwrapped(one, good, *jump) for one, jump in zip(looks, jumps, strict=True) if jump is not None]
    return [*found, *_turned_logs(good)]


def _jumps(one: Look) -> tuple[float, NDArray[np.int64]] | None:
    """Return the modulus, and the samples at which the angle jumps; None where it does not."""
    seen = np.flatnonzero(np.isfinite(one.angle))
    time, angle = one.time[seen], one.angle[seen]
    steps = np.diff(angle)
    moves = one.top_speed * np.diff(time) + _NOISE * one.noise
    sizes = np.abs(steps)
    at = np.flatnonzero(sizes > _WRAP_TOO_FAST * moves)
    if not len(at):
        return None
    turns = at[np.abs(sizes[at] - TURN) < np.minimum(_WRAP_TOO_FAST * moves[at], 0.25 * TURN)]
    if len(turns) and np.subtract(*np.quantile(angle, (0.99, 0.01))) < TURN + _WRAP_TOO_FAST * moves[turns].max():
        return TURN, seen[turns + 1]
    carried = 0.5 * (np.pad(steps, 1)[:-2] + np.pad(steps, 1)[2:])  # by the motion, meanwhile
    modulus = float(np.median(np.abs((steps - carried)[at])))
    alike = at[np.abs(sizes[at] - modulus) < np.minimum(_WRAP_TOO_FAST * moves[at], 0.25 * modulus)]
    apart = np.diff(np.concatenate([[-_STAYS], at, [len(steps) + _STAYS]])) >= _STAYS
    stays = (apart[1:] & apart[:-1])[np.isin(at, alike)]
    one_range = np.ptp(angle) < modulus + float(_WRAP_TOO_FAST * moves[alike].max(initial=0.0))
    if len(alike) < max(_WRAP_FEWEST, math.ceil(0.8 * len(at))) or stays.sum() < max(_WRAP_FEWEST, 0.5 * len(alike)) \
            or not one_range:
        return None
    return modulus, seen[alike + 1]


def _unwrapped(one: Look, good: Sequence[Look], modulus: float, at: NDArray[np.int64]) -> Finding:
    seen = np.isfinite(one.angle)
    before = np.maximum.accumulate(np.where(seen, np.arange(len(seen)), 0))
    turns = np.zeros(len(seen))
    turns[at] = -np.sign(one.angle[at] - one.angle[before[at - 1]])
    angle = aligned(one, one.angle + modulus * np.cumsum(turns), good, steps_of=modulus)
    size = "2π, a whole turn" if modulus == TURN else f"{modulus:.4g}, always the same"
    return Finding("wrap", one.log.name, (
        f"log {one.log.name!r}: the angle jumps by {size} (rad) {said_times(one.log.time[at])}, faster than "
        "any servo: a sensor that begins again there; mending \"wrap\" joins the pieces"), one.with_angle(angle))


def _turned_logs(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs that lie a whole turn or several beside the others."""
    gaps = [(one, one.gap()) for one in looks if one.counts.any()]
    if len(gaps) < 2:
        return []
    values = np.array([gap for _, gap in gaps])
    usual = float(np.median(values)) if len(values) > 2 else float(values[np.argmin(np.abs(values))])
    found = []
    for one, gap in gaps:
        turns = round((gap - usual) / TURN)
        if turns and abs(gap - usual - turns * TURN) < _NEAR_TURN:
            found.append(Finding("wrap", one.log.name, (
                f"log {one.log.name!r}: its angles lie {_turns(turns)} beside those of the other logs; mending "
                "\"wrap\" puts them there"), one.with_angle(one.angle - turns * TURN)))
    return found


def _turns(number: int) -> str:
    return "a whole turn" if abs(number) == 1 else f"{abs(number)} whole turns"
