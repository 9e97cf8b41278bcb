"""The search for what jumps: which command each pulse of a log carries, and with which period pulses come.

The cost is smooth in everything else, so it is scanned here and fitted there. A trial is one simulation of a log; when
its pulses come is corrected to first order, by what a delay would change.

A command acts from the first tick on that follows its pulse. Where ticks and pulses lie to each other is no more than
that to a log: between two ends of pulses, later ticks cannot be distinguished from earlier pulses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.search.case import (
    DELAY_SCALE,
    Frames,
    Gap,
    LogPart,
    Point,
    between,
    changes,
    gap_of,
    gaps,
    latency,
)
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.least_squares import Loss

if TYPE_CHECKING:
    from servotwin.identification.fitting.search.forecast import Forecast


# --- The ticks of a program that pulses command: which command each of them takes -------------------------------------

_TICK, _PHASE = "firmware.control_period", "firmware.control_phase"


class Ticks(NamedTuple):
    """When pulses end that bring another command, after the tick that the servo's own phase says.

    Parameters
    ----------
    period : float
        T_c [s].
    ends : ndarray
        Of pulses, within a tick [s].
    gaps : tuple of Gap
        Later ticks, by up to T_c [s], between which one of them takes another command.
    """

    period: float
    ends: Array
    gaps: tuple[Gap, ...]

    def wait(self, later: float) -> float:
        """Return how long a command waits in the mean for its tick [s], if ticks come so much later."""
        return float(np.mean(np.mod(later - self.ends, self.period))) if len(self.ends) else 0.0

    def gap_of(self, later: float) -> Gap:
        """Return how far ticks that come so much later could go with the same commands [s]."""
        if not len(self.ends):
            return Gap(later - 0.5 * self.period, later + 0.5 * self.period)
        back = float(np.mod(later - self.ends, self.period).min())
        ahead = float(np.mod(self.ends - later, self.period).min())
        return Gap(later - back, later + ahead)


def ticks_of(forecast: Forecast, point: Point, k: int) -> Ticks:
    """Return which ticks take which commands of a log, as its pulses come at a point."""
    case, model = forecast.cases[k], forecast.model
    values: dict[str, Any] = {**forecast.space.columns(point.shared[None, :len(forecast.space)]),
                              **case.log.parameters}
    period, phase = (float(np.ravel(values.get(name, model.value_or(name, 0.0)))[0]) for name in (_TICK, _PHASE))
    first = forecast.first_pulse(point, k)
    command = forecast.command_at(point, k)
    edges = np.array(command.edges)
    widths = np.asarray(model.command(command)(edges))
    brings = np.append(True, np.diff(widths) != 0.0) & (edges > 0.0)  # the first of all may be cut off
    ends = np.mod((edges + widths)[brings] - first - forecast.lead_at(point, k) - phase, period)
    return Ticks(period, ends, between(ends, period))


# --- The search for what jumps ----------------------------------------------------------------------------------------

Array = NDArray[np.float64]
Mask = Callable[[int], NDArray[np.bool_]]
_MOST_GAPS = 24  # of a log, that are tried at first
_TIMES, _FINE_TIMES = 4, 16  # steps of a frame, either way
_BEST = 3  # that are tried again where they then are best
_FIRST_LOGS = 3  # of a scan of periods
_FIRST_PULSES = 600  # after which no further log is taken
_LIKELY = 5  # periods, that are searched from
_MOST_PERIODS = 160
_MOST_PHASES = 8  # for each period
_ASKED = 0.25  # of the periods: those that are simulated
_REACH = 0.06  # of a period, either way: more than a PCA9685's clock is off by its data sheet
_FINE = (1e-5, 3e-5, 1e-4, 2e-4, 4e-4, 8e-4)  # of a period: quartz clocks
_WINDOWS = 6  # of a log, that are compared
_NARROWEST = 1e-10  # share of a beat
_UNLIKELY = 100.0  # times the weight of the best: pulses that count no more
_DRIFTS = 1e-2  # how often pulses that do not drift would look as if


class PulseChoice(NamedTuple):
    """A trial of one log: the assignment, and when its first pulse comes (scaled, as its own number)."""

    frames: Frames
    first: float


class PulseTrial(NamedTuple):
    """The result of a trial: its cost, and the time of the first pulse at which that was.

    The cost counts how narrow the gaps are in which phases have to lie: less the logarithm of their share of a frame,
    and of a tick.
    """

    cost: float
    choice: PulseChoice


class Scan:
    """Trials at a point of the search.

    Parameters
    ----------
    forecast : Forecast
    loss : Loss
    point : Point
    widening : float
        How many residuals stand for one that is independent.
    mask : callable, optional
        Returns which residuals of a log count; all unless given.
    """

    def __init__(self, forecast: Forecast, loss: Loss, point: Point, widening: float = 1.0,
                 mask: Mask | None = None) -> None:
        self.forecast, self.loss, self.point = forecast, loss, point
        self.widening, self.mask = widening, mask
        self.ticks = {k: ticks_of(forecast, point, k) for k in range(len(point.own))} if forecast.ticked else {}

    def place(self, k: int) -> int:
        """Return where a log's own numbers hold the time of its first pulse."""
        return self.forecast.names_of_own(self.forecast.cases[k]).index("frame_phase")

    def now(self, k: int) -> PulseChoice:
        """Return what the point has for a log."""
        return PulseChoice(self.forecast.frames_of(self.point, k), float(self.point.own[k][self.place(k)]))

    def like(self, k: int, gap: Gap, period: float | None = None) -> PulseChoice:
        """Return a trial of other phases whose commands wait as long in the mean as they do now."""
        now, log = self.now(k), self.forecast.cases[k].log
        frames = now.frames._replace(phase=gap.middle, period=now.frames.period if period is None else period)
        waits = now.first * DELAY_SCALE - now.frames.phase + latency(log, now.frames)
        return PulseChoice(frames, (frames.phase + waits - latency(log, frames)) / DELAY_SCALE)

    def later(self, k: int, steps: int) -> list[PulseChoice]:
        """Return trials of the present assignment whose pulses come earlier and later, up to a frame."""
        now = self.now(k)
        step = now.frames.period / steps / DELAY_SCALE
        return [now, *(PulseChoice(now.frames, now.first + i * step) for i in range(-steps, steps + 1) if i)]

    def ticking(self, k: int) -> list[PulseChoice]:
        """Return trials of other ticks, which take their commands as long after the pulses in the mean as they do now.

        There are none unless ticks are sought.
        """
        now, ticks = self.now(k), self.ticks.get(k)
        if ticks is None:
            return []
        waits = ticks.wait(now.frames.tick)
        return [PulseChoice(now.frames._replace(tick=gap.middle),
                            now.first + (waits - ticks.wait(gap.middle)) / DELAY_SCALE)
                for gap in _spread(ticks.gaps)
                if abs(_wrapped(now.frames.tick - gap.middle, ticks.period)) >= 0.5 * gap.width]

    def moved(self, choices: Mapping[int, PulseChoice]) -> Point:
        """Return the point with other pulses of some logs."""
        own = list(self.point.own)
        frames = [self.forecast.frames_of(self.point, k) for k in range(len(own))]
        for k, choice in choices.items():
            own[k] = own[k].copy()
            own[k][self.place(k)] = choice.first
            frames[k] = choice.frames
        return self.point._replace(own=tuple(own), frames=tuple(frames))

    def tried(self, choices: Mapping[int, Sequence[PulseChoice]], *, moves: bool = True) -> dict[int, list[PulseTrial]]:
        """Run all trials of some logs in one batch; each comes back with its pulses moved to where they fit best.

        `moves=False` leaves them where they are.
        """
        return {k: [self._corrected(k, choice, part, 6 * moves) for choice, part in zip(some, parts, strict=True)]
                for (k, some), parts in zip(choices.items(), self.parts(choices, rates=True).values(), strict=True)}

    def parts(self, choices: Mapping[int, Sequence[PulseChoice]], *, rates: bool = False) -> dict[int, list[LogPart]]:
        """Run all trials of some logs in one batch; return what each says."""
        which = [[k for k, some in choices.items() if i < len(some)] for i in range(max(map(len, choices.values())))]
        points = [self.moved({k: choices[k][i] for k in some}) for i, some in enumerate(which)]
        found: dict[int, list[LogPart]] = {k: [] for k in choices}
        told = self.forecast.at_all(points, cases=list(choices), each=which, rates=rates)
        for some, parts in zip(which, told, strict=True):
            for k, part in zip(some, parts, strict=True):
                found[k].append(part)
        return found

    def best(self, choices: Mapping[int, Sequence[PulseChoice]], rounds: int = 2) -> dict[int, list[PulseTrial]]:
        """Run all trials, and the best of them again where they then fit best; return the latter, the best first."""
        found = {k: sorted(some, key=lambda trial: trial.cost)[:_BEST] for k, some in self.tried(choices).items()}
        for _ in range(rounds):
            again = self.tried({k: [trial.choice for trial in some] for k, some in found.items()})
            found = {k: sorted(some, key=lambda trial: trial.cost) for k, some in again.items()}
        return found

    def _corrected(self, k: int, choice: PulseChoice, part: LogPart, rounds: int) -> PulseTrial:
        """Return the cost that a trial would have with its pulses moved, to first order, at most half a frame."""
        r, g = part.residual, part.later
        if self.mask is not None:
            r, g = r[self.mask(k)], g[self.mask(k)]
        if not np.isfinite(r).all():
            return PulseTrial(math.inf, choice)
        step, most = 0.0, 0.5 * choice.frames.period / DELAY_SCALE
        for _ in range(rounds):
            w = self.loss.weight(r + g * step)
            power = float(w @ g**2)
            if power <= 0.0:
                break
            step = min(max(-float(w @ (g * r)) / power, -most), most)
        cost, moved = min((self.loss.cost(r + g * s), s) for s in (0.0, step))
        shares = [gap_of(self.forecast.cases[k].log, choice.frames).width / choice.frames.period]
        if ticks := self.ticks.get(k):
            shares.append(ticks.gap_of(choice.frames.tick).width / ticks.period)
        cost -= self.widening * sum(math.log(max(share, _NARROWEST)) for share in shares)
        return PulseTrial(cost, PulseChoice(choice.frames, choice.first + moved))


def settled(scan: Scan, cases: Sequence[int]) -> Point:
    """Return the point with the best pulses for every log: when they come, and which command each of them carries."""
    several = {k: gaps(scan.forecast.cases[k].log, scan.now(k).frames.period) for k in cases}
    first = scan.best({k: [*scan.later(k, _TIMES), *(scan.like(k, gap) for gap in _spread(some) if len(some) > 1)]
                       for k, some in several.items()})
    found = {k: trials[0].choice for k, trials in first.items()}
    many = [k for k, some in several.items() if len(some) > _MOST_GAPS]
    if many:
        there = Scan(scan.forecast, scan.loss, scan.moved(found), scan.widening, scan.mask)
        near = there.best({k: [found[k], *(there.like(k, gap) for gap in _near(there, k, several[k]))] for k in many})
        found |= {k: trials[0].choice for k, trials in near.items()}
    there = Scan(scan.forecast, scan.loss, scan.moved(found), scan.widening, scan.mask)
    others = {k: [found[k], *more] for k in cases if (more := there.ticking(k))}
    if others:
        found |= {k: trials[0].choice for k, trials in there.best(others).items()}
    return scan.moved(found)


def credible(scan: Scan, cases: Sequence[int]) -> dict[int, list[PulseChoice]]:
    """Return the pulses that each log allows: of at least a hundredth of the weight of the best.

    Where the shaft rests at all samples about which pulses come earlier or later, the cost has a plateau; so they are
    tried as they are.
    """
    logs = [scan.forecast.cases[k].log for k in cases]
    several = {k: gaps(log, scan.now(k).frames.period) for k, log in zip(cases, logs, strict=True)}
    fixed = scan.tried({k: scan.later(k, _FINE_TIMES) for k in cases}, moves=False)
    others = {k: [scan.like(k, gap) for gap in _near(scan, k, some)] for k, some in several.items() if len(some) > 1}
    for k in cases:
        if more := scan.ticking(k):
            others.setdefault(k, []).extend(more)
    moved = scan.tried(others) if others else {}
    found = {}
    for k in cases:
        trials = [*fixed[k], *moved.get(k, [])]
        reach = min(trial.cost for trial in trials) + scan.widening * math.log(_UNLIKELY)
        found[k] = [trial.choice for trial in trials if trial.cost <= reach]
    return found


def drifts(forecast: Forecast, loss: Loss, point: Point, cases: Sequence[int], *, remember: bool = True) -> bool:
    """Tell whether the pulses of some logs come later or earlier and earlier in the course of a log.

    Delays of the windows of a log scatter as residuals make it, or more (chi squared). A wrong model makes them scatter
    too, so that this says only whether it is worth to look. `remember=False` takes residuals as independent: pulses
    that are far off leave residuals which follow each other.
    """
    from scipy.special import chdtrc

    total, freedom = 0.0, 0
    parts = forecast.at_all([point], cases=cases, rates=True)[0]
    if not all(np.isfinite(part.residual).all() for part in parts):
        return False
    r = [np.clip(part.residual, -loss.limit, loss.limit) for part in parts]
    power = (widening(parts, loss) if remember else 1.0) * sum(float(x @ x) for x in r) / max(sum(map(len, r)), 1)
    for x, part in zip(r, parts, strict=True):
        g = part.later
        share = np.cumsum(g**2)
        if not share[-1] > 0.0:
            continue
        window = np.minimum((_WINDOWS * share / share[-1] * (1.0 - 1e-12)).astype(int), _WINDOWS - 1)
        weight = np.bincount(window, g**2, _WINDOWS)
        with np.errstate(invalid="ignore", divide="ignore"):
            late = -np.bincount(window, g * x, _WINDOWS) / weight
        known = weight > 0.0
        middle = float(np.average(late[known], weights=weight[known]))
        total += float((weight[known] * (late[known] - middle) ** 2).sum()) / max(power, 1e-300)
        freedom += int(known.sum()) - 1
    return freedom > 0 and float(chdtrc(freedom, total)) < _DRIFTS


def likely_periods(scan: Scan, cases: Sequence[int]) -> list[float]:
    """Return the frame periods that some logs fit best, the best first [s].

    Simulated are those that promise most to first order.
    """
    forecast = scan.forecast
    nominal = scan.now(cases[0]).frames.period
    order = sorted(cases, key=lambda k: -len(gaps(forecast.cases[k].log, nominal)))
    pulses = np.cumsum([forecast.cases[k].log.duration / nominal for k in order])
    rich = [k for k, before in zip(order, [0.0, *pulses], strict=False) if before < _FIRST_PULSES][:_FIRST_LOGS]
    longest = max(forecast.cases[k].log.duration for k in rich)
    left = _foretold(scan, rich, _periods(nominal, longest))
    costs = _costs(scan, rich, sorted(left, key=lambda period: left[period])[:math.ceil(_ASKED * len(left))])
    found: list[float] = []
    for period in sorted(costs, key=lambda period: costs[period]):
        if all(abs(period - other) > 2.0 * _step(nominal, longest) for other in found):
            found.append(period)
    return found[:_LIKELY]


def _foretold(scan: Scan, cases: Sequence[int], periods: Sequence[float]) -> dict[float, float]:
    """Return the share of the cost that pulses of each period leave to first order, at the best phase of each log.

    A command waits for its pulse; where that wait is another one than now, the motion after it is as much later. All
    numbers may follow, in each log for itself.
    """
    forecast, before = scan.forecast, 0.0
    left = np.zeros(len(periods))
    for k, part in zip(cases, forecast.at_all([scan.point], derivatives=True, rates=True, cases=cases)[0], strict=True):
        now, log, case = scan.now(k), forecast.cases[k].log, forecast.cases[k]
        at = np.searchsorted(t := changes(log), case.times - now.first * DELAY_SCALE, side="right") - 1
        weight = np.sqrt(scan.loss.weight(part.residual))
        basis = np.linalg.qr(np.column_stack([part.shared, part.own]) * weight[:, None])[0]
        if not len(t) or not np.isfinite(basis).all():
            continue
        places = np.concatenate(list(case.places.values()))
        shifted = np.where(at[places] >= 0, part.later * weight, 0.0)[:, None] / DELAY_SCALE
        r = part.residual * weight
        r = r - basis @ (basis.T @ r)
        before += float(r @ r)
        here = t[np.maximum(at[places], 0)]
        for i, period in enumerate(periods):
            phases = period * np.arange(_MOST_PHASES) / _MOST_PHASES
            d = shifted * (np.mod(phases - here[:, None], period)
                           - np.mod(now.frames.phase - here, now.frames.period)[:, None])
            left[i] += float(((r[:, None] + d - basis @ (basis.T @ d)) ** 2).sum(axis=0).min())
    return dict(zip(periods, (left / max(before, 1e-300)).tolist(), strict=True))


def _costs(scan: Scan, cases: Sequence[int], periods: Sequence[float]) -> dict[float, float]:
    """Return what each period costs in some logs, at the best of its phases."""
    choices: dict[int, list[PulseChoice]] = {k: [] for k in cases}
    of_period: dict[int, list[float]] = {k: [] for k in cases}
    for period in periods:
        for k in cases:
            there = _spread(gaps(scan.forecast.cases[k].log, period), _MOST_PHASES)
            choices[k] += [scan.like(k, gap, period) for gap in there]
            of_period[k] += [period] * len(there)
    costs = dict.fromkeys(periods, 0.0)
    for k, trials in scan.tried(choices).items():
        least = dict.fromkeys(periods, math.inf)
        for period, trial in zip(of_period[k], trials, strict=True):
            least[period] = min(trial.cost, least[period])
        for period, cost in least.items():
            costs[period] += cost
    return costs


def with_period(scan: Scan, cases: Sequence[int], period: float) -> Point:
    """Return the point with pulses of another period."""
    choices = {k: [scan.like(k, gap, period) for gap in _spread(gaps(scan.forecast.cases[k].log, period))]
               for k in cases}
    return scan.moved({k: trials[0].choice for k, trials in scan.best(choices).items()})


def _periods(nominal: float, duration: float) -> list[float]:
    """Return periods that put pulses off by an eighth of a frame at most, and finer about the middle."""
    step = _step(nominal, duration)
    count = math.floor(_REACH * nominal / step)
    coarse = [nominal + k * step for k in range(-count, count + 1)]
    return [*coarse, *(nominal * (1.0 + side * share) for share in _FINE for side in (-1.0, 1.0))]


def _step(nominal: float, duration: float) -> float:
    return max(0.25 * nominal / max(duration / nominal, 1.0), 2.0 * _REACH * nominal / _MOST_PERIODS)


def _spread(some: Sequence[Gap], most: int = _MOST_GAPS) -> list[Gap]:
    """Return some gaps that cover the frame: the widest of each part of it."""
    if len(some) <= most:
        return list(some)
    length = some[-1].low - some[0].low
    parts: dict[int, Gap] = {}
    for gap in some:
        part = int((gap.low - some[0].low) / length * most * (1.0 - 1e-12))
        if part not in parts or gap.width > parts[part].width:
            parts[part] = gap
    return list(parts.values())


def _near(scan: Scan, k: int, some: Sequence[Gap]) -> list[Gap]:
    """Return the gaps next to the present phase, and the widest of all."""
    frames = scan.now(k).frames
    order = sorted(some, key=lambda gap: abs(_wrapped(gap.middle - frames.phase, frames.period)))
    return list(dict.fromkeys([*order[:_MOST_GAPS // 2], max(some, key=lambda gap: gap.width)]))


def widening(parts: Sequence[LogPart], loss: Loss) -> float:
    """Return how many residuals stand for one that is independent, if each follows the one before it."""
    r = [np.clip(part.residual, -loss.limit, loss.limit) for part in parts]
    rho = sum(float(x[1:] @ x[:-1]) for x in r) / max(sum(float(x @ x) for x in r), 1e-300)
    return (1.0 + max(rho, 0.0)) / max(1.0 - max(rho, 0.0), 0.02)


def _wrapped(time: float, period: float) -> float:
    """Return a time moved by whole periods to within half of one about 0 [s]."""
    return (time + 0.5 * period) % period - 0.5 * period
