"""The ticks of a program that pulses command: which command each of them takes.

A command acts from the first tick on that follows its pulse. Where ticks and pulses lie to each other is no more than
that to a log: between two ends of pulses, later ticks cannot be told from earlier pulses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.frames import Gap, between
from servotwin.identification.fitting.point import Point

if TYPE_CHECKING:
    from servotwin.identification.fitting.forecast import Forecast

Array = NDArray[np.float64]

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
