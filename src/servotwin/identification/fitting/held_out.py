"""Logs that are judged and not fitted: their first half tells when their pulses come, the second judges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Loss
from servotwin.identification.fitting.case import DELAY_SCALE, STEP, LogPart, Point, latency, widest
from servotwin.identification.fitting.fit import Trace
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.lanes import LogLanes
from servotwin.identification.fitting.phases import PulseChoice, Scan, settled
from servotwin.identification.fitting.scatter import by_sensor
from servotwin.logs.log import ANGLES
from servotwin.simulation.lanes.inputs import LOAD_NAMES

Array = NDArray[np.float64]


def trace_of(forecast: Forecast, point: Point, k: int, part: LogPart, *, held_out: bool, whole: bool = False) -> Trace:
    """Return a log beside its simulation; where pulses have a phase, the second half of one that was not fitted judges.

    Parameters
    ----------
    forecast, point
    k : int
        Which log.
    part : LogPart
        What it says at that point.
    held_out : bool
        Whether it was not fitted.
    whole : bool
        Whether all samples judge nevertheless.
    """
    case = forecast.cases[k]
    name = next(name for name in ANGLES if name in case.places)
    times, measured = case.times[case.places[name]], case.values[name]
    lanes = LogLanes(forecast, k, 0, point, sides=0, step=STEP, rates=False, noise=forecast.noise)
    sent = lanes.bundle()
    searched = forecast.space.columns(lanes.x)
    late = held_out and forecast.phased and not whole
    own = dict(zip(forecast.names_of_own(case), point.own[k], strict=True))
    return Trace(
        log=case.log, held_out=held_out, signal=name, time=case.log.time[0] + times, measured=measured,
        simulated=measured + by_sensor(forecast, k, part)[name],
        judged=np.asarray(times >= 0.5 * case.log.duration) if late else np.ones(len(times), np.bool_),
        command=forecast.command_at(point, k),
        delay=forecast.nuisance_of(point.shared, "delay") + float(own.get("log_delay", 0.0)) * DELAY_SCALE
        - forecast.lead_at(point, k),
        parameters={key: float(values[0]) for key, values in sent.columns.items()
                    if key not in searched and key not in LOAD_NAMES},
        initial={key: float(values[0]) for key, values in sent.initial.items()}, offset=lanes.offset)


def with_pulses_of(forecast: Forecast, loss: Loss, point: Point, held_out: Sequence[int],
                   fitted: Sequence[int] = ()) -> Point:
    """Return the point with the pulses that the first halves of some logs tell.

    Parameters
    ----------
    forecast, loss
    point : Point
        Where a search of other logs ended.
    held_out : sequence of int
        Logs that are judged.
    fitted : sequence of int
        Logs whose pulses were found: how long commands wait for these is where the search begins.
    """
    if not forecast.phased or not held_out:
        return point
    there = Scan(forecast, loss, point)
    waits = [now.first * DELAY_SCALE - now.frames.phase + latency(forecast.cases[k].log, now.frames)
             for k in fitted for now in (there.now(k),)]
    period = forecast.nuisance_of(point.shared, "frame_period")
    choices = {}
    for k in held_out:
        case = forecast.cases[k]
        frames = widest(case.log, period or case.period)
        usual = float(np.median(waits)) if waits else latency(case.log, frames)
        choices[k] = PulseChoice(frames, (frames.phase + usual - latency(case.log, frames)) / DELAY_SCALE)

    def first_half(k: int) -> NDArray[np.bool_]:
        case = forecast.cases[k]
        return np.concatenate([case.times[place] < 0.5 * case.log.duration for place in case.places.values()])

    begun = Scan(forecast, loss, there.moved(choices), mask=first_half)
    told = [k for k in held_out if first_half(k).any()]
    if not told:
        return begun.point
    there = Scan(forecast, loss, settled(begun, told), mask=first_half)  # to first order so far
    return there.moved({k: trials[0].choice for k, trials in there.best({k: [there.now(k)] for k in told}).items()})
