"""Watches whether the shaft of a servo at the bench comes to rest once nothing is done to it any more."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from servotwin.simulation.remarks import NOT_AT_REST, Remark
from servotwin.simulation.rest import LEAST_REST, constant_since, look_period, looks_at, swing_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from servotwin.web.live.station import Row, Station

_MOST = 4000  # points: over ten seconds of them
_AGAIN = 0.5  # s between two looks


class RestWatch:
    """Watches one servo; says once that it does not come to rest, until something is done again.

    Parameters
    ----------
    station : Station
    """

    def __init__(self, station: Station) -> None:
        self._station = station
        self.begin(station.state.time)

    def begin(self, time: float) -> None:
        """Forget what was seen: something was done at this time [s]."""
        self._since, self._next, self._said = time, time + LEAST_REST, False
        self._seen: deque[tuple[float, float]] = deque(maxlen=_MOST)

    def see(self, rows: Sequence[Row]) -> list[str]:
        """Take what shows of the time that has passed; return what is to be said, as people read it."""
        station = self._station
        model, names = station.model, station.columns
        if self._said or model.endless or not rows or "command_angle" not in model.available:
            return []
        at = names.index("output_angle")
        self._seen.extend((row[0], row[at]) for row in rows)
        now = rows[-1][0]
        if now < self._next:
            return []
        self._next = now + _AGAIN
        still = max(self._since, constant_since(station.told.shape.pieces.table, now), self._seen[0][0])
        if not now - still >= LEAST_REST:
            return []
        time, angle = np.array(self._seen).T
        looks = looks_at(still, now, look_period(model))
        found = swing_of(looks, np.interp(looks, time, angle))
        self._said = found.swing > 0.0
        return [Remark(NOT_AT_REST, now, **found._asdict()).words] if self._said else []
