"""The trials: which logs, in which order, how much of the fit's own effort, and what is said in the end."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.diagnosis.bench import DEAR, Purse, Setting, Spent, TrialBench
from servotwin.identification.fitting.diagnosis.candidates import TABLE, Candidate, mended_logs, possible
from servotwin.identification.fitting.diagnosis.drifts import changing_supply, warming
from servotwin.identification.fitting.diagnosis.events import MOST_LEFT, dropped_samples, lost_pulses
from servotwin.identification.fitting.diagnosis.gain import Told, gain
from servotwin.identification.fitting.diagnosis.holds import moved
from servotwin.identification.fitting.diagnosis.servos import mixed_gains, two_servos
from servotwin.identification.fitting.findings import findings
from servotwin.identification.fitting.fit import Trace
from servotwin.identification.fitting.point import Point
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.verdict import Cause, Verdict, shown

Try = Callable[[TrialBench], Told | None]

_LOGS = 4  # that are tried
_EXPLAINED = 1.2  # times the sensor's noise: then nothing else is tried
_ALIKE = 1.05  # times the least error: then the simpler is named first
_MOST = 5  # causes that are told
_SHARES = 2.0  # of what is left for a group: what one trial may take
_KINDS = {"stamps": ("stamps", "stamps that run at another rate than the servo", 'mend=("stamps",)'),
          "rows": ("dropped samples", "rows that are missing", 'mend=("rows",)'),
          "not followed": ("not followed", "commands that the servo did not follow", 'mend=("not followed",)')}


_SPECIAL: dict[str, Try] = {
    "mixed P register": mixed_gains, "supply that changes": changing_supply, "warming": warming,
    "two servos": two_servos}
"""Candidates that are tried in ways of their own."""
_EVENTS: dict[str, Try] = {"dropped samples": dropped_samples, "lost pulses": lost_pulses}
"""Those that explain a part of whatever is missing: tried where nothing else explains what they would have to."""


class Diagnosis(NamedTuple):
    """Causes, the best first; by how many half widths what may be missing would move each number, and what that is."""

    causes: tuple[Cause, ...]
    moved: Mapping[str, tuple[float, str]]


def diagnose(task: Task, point: Point, traces: Sequence[Trace], verdict: Verdict, sensor: str, budget: float,
             half: Mapping[str, float], tell: Callable[[float, str], None]) -> Diagnosis:
    """Return what explains the residuals of a fit, the best first; nothing that gains no more than chance.

    Beside it, what may be missing would do to the intervals.

    Parameters
    ----------
    task : Task
    point : Point
        Where the fit ended.
    traces : sequence of Trace
        Of all logs.
    verdict : Verdict
    sensor : str
        The angle's name.
    budget : float
        What may be simulated, in seconds of one lane of closed form.
    half : mapping of str to float
        Half widths of the intervals, on the scale of the search.
    tell : callable
        Told the share done, and what is tried.
    """
    noise = verdict.noise[sensor]
    purse = Purse(budget)
    try:
        bench = TrialBench(task, point, _chosen(task, traces), purse, noise)
    except (Spent, ServotwinError):
        return Diagnosis((), {})
    found: list[tuple[Cause, int]] = []
    groups = _ordered(bench, traces)
    count, k, left = sum(map(len, groups)), 0, purse.left
    for group in groups:
        if group is groups[-1] and any(cause.after < MOST_LEFT * cause.before for cause, _ in found):
            break
        # No group can use up what the next one needs, and no trial what those after it need
        allowed = left if group is groups[-1] else 0.5 * left
        for waiting, (name, try_it) in zip(range(len(group), 0, -1), group, strict=True):
            purse.left = given = min(_SHARES / waiting, 1.0) * allowed
            tell(max(k / count, min(1.0 - left / budget, 1.0)), f"trying: {name}")
            told = _told(bench, try_it)
            k += 1
            if told is not None and told.gain.counts:
                found.append((_cause(told, sensor), k))
                if told.gain.after < _EXPLAINED * noise:
                    return _diagnosis(bench, found, half)
            left, allowed = left - given + purse.left, allowed - given + purse.left
    return _diagnosis(bench, found, half)


def _diagnosis(bench: TrialBench, found: Sequence[tuple[Cause, int]], half: Mapping[str, float]) -> Diagnosis:
    causes = _ranked(found)
    try:
        return Diagnosis(causes, moved(bench, half, causes[0].name if causes else ""))
    except (ServotwinError, np.linalg.LinAlgError):
        return Diagnosis(causes, {})


def _told(bench: TrialBench, try_it: Try) -> Told | None:
    """Return what a candidate gains; None of one that cannot be tried, or not to its end."""
    try:
        return try_it(bench)
    except (Spent, ServotwinError, np.linalg.LinAlgError):
        return None


def _ordered(bench: TrialBench, traces: Sequence[Trace]) -> list[list[tuple[str, Try]]]:
    """Return all candidates with what tries them: what checks suggest and is cheap, what is dear, changes, events."""
    cheap: list[tuple[str, Try]] = []
    dear: list[tuple[str, Try]] = []
    for candidate in (*_of_findings(bench, traces), *TABLE):
        settings = possible(candidate, bench)
        if settings:
            (dear if settings[0].price > DEAR else cheap).append(
                (candidate.name, partial(_tried, candidate=candidate, settings=settings)))
    return [cheap, dear, list(_SPECIAL.items()), list(_EVENTS.items())]


def _chosen(task: Task, traces: Sequence[Trace]) -> list[int]:
    """Return the logs that are tried: of every kind of motion the one that is furthest off, then others."""
    fitted = sorted(task.fitted, key=lambda k: -float(np.mean(traces[k].residual**2)))
    first: dict[str, int] = {}
    for k in fitted:
        first.setdefault(traces[k].log.motion, k)
    chosen = list(first.values())[:_LOGS]
    return sorted([*chosen, *(k for k in fitted if k not in chosen)][:_LOGS])


def _of_findings(bench: TrialBench, traces: Sequence[Trace]) -> list[Candidate]:
    """Return the candidates that the checks of the logs suggest."""
    seen = findings([trace.log for trace in traces], bench.setting.model)
    made = []
    for kind, (name, words, remedy) in _KINDS.items():
        mended = {one.log: one.mended for one in seen if one.kind == kind and one.mended is not None}
        if mended:
            made.append(Candidate(name, words, remedy, partial(mended_logs, mended=mended)))
    return made


def _tried(bench: TrialBench, candidate: Candidate, settings: Sequence[Setting]) -> Told | None:
    """Return what a candidate gains, searched from the most promising of its settings; None if none promises enough."""
    promising = _promising(bench, settings)
    if not any(map(bench.may_gain, settings)) and not any(map(bench.gains_soon, promising)):
        return None
    trials = [bench.searched(setting, bench.base.point) for setting in promising]
    try:
        trials += [bench.afresh(setting) for setting in promising if setting.afresh]
    except Spent:
        pass  # what was searched from the fit counts
    good = [trial for trial in trials if all(np.isfinite(r).all() for r in trial.residuals)]
    if not good:
        return None
    gained = gain(bench.base.residuals, min(good, key=bench.left).residuals, bench.noise)
    return Told(candidate.name, candidate.words, candidate.remedy, gained)


def _promising(bench: TrialBench, settings: Sequence[Setting]) -> Sequence[Setting]:
    if len(settings) < 2:
        return settings
    costs = [bench.promise(setting) for setting in settings]
    return [settings[int(np.argmin(costs))]] if np.isfinite(costs).any() else []


def _cause(told: Told, sensor: str) -> Cause:
    sentence = (f"{told.words}: on parts of the logs that the trial did not see the error falls from "
                f"{shown(told.gain.before, sensor)} to {shown(told.gain.after, sensor)} ({told.remedy})")
    return Cause(told.name, sentence, told.gain.before, told.gain.after, told.remedy)


def _ranked(found: Sequence[tuple[Cause, int]]) -> tuple[Cause, ...]:
    """Return causes by the share of the error that they leave; of those alike the earlier of the table first."""
    left = sorted(found, key=lambda one: -one[0].gain)
    ranked: list[Cause] = []
    while left:
        least = 1.0 - left[0][0].gain
        alike = [one for one in left if 1.0 - one[0].gain <= _ALIKE * least]
        ranked += [cause for cause, _ in sorted(alike, key=lambda one: one[1])]
        left = [one for one in left if one not in alike]
    return tuple(ranked[:_MOST])
