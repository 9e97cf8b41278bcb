"""The voltage of a bus at an instant, from where its servos stand there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from servotwin.models.engine.bus import shared_source
from servotwin.models.engine.bus.bus_records import Mate
from servotwin.models.engine.step import at_pulses
from servotwin.models.state.records import object_of
from servotwin.models.terms import duty
from servotwin.models.terms.bridge import coasts
from servotwin.models.terms.source import Source

if TYPE_CHECKING:
    from servotwin.models.state.modes import Vector
    from servotwin.simulation.engine import Plan, Segment


class BusVoltage:
    """The voltage of a bus, instant by instant.

    Parameters
    ----------
    source : Source
    servos : int
        How many there are.
    """

    def __init__(self, source: Source, servos: int) -> None:
        self._source = source
        self._mates: list[Any] = [object_of(Mate) for _ in range(servos)]
        self._connected = 0

    def begin(self) -> None:
        """Begin another instant, at which nobody is connected yet."""
        self._connected = 0

    def connect(self, plan: Plan, y: Vector, drive: float, now: float, silent: int) -> None:
        """Let a servo that stands at y take its place, if its motor is connected to the bus.

        Parameters
        ----------
        plan : Plan
        y : Vector
        drive : float
            How its bridge drives: −1, 0 or +1.
        now : float
            Duty of a digital servo.
        silent : int
            1 while pulses stay away from it.
        """
        numbers = duty.at_duty(plan.numbers, now) if plan.digital else at_pulses(plan.numbers, silent)
        if drive == 0.0 and not (coasts(numbers.bridge) and (y.i != 0.0 or y.w_m != 0.0)):
            return
        mate = self._mates[self._connected]
        mate.numbers = shared_source.on_stiff_source(numbers, drive == 0.0)
        mate.sign = shared_source.part_on_bus(drive, numbers.bridge, now, y)
        mate.returns, mate.y = int(drive == 0.0), y
        self._connected += 1

    def volts(self) -> float:
        """Return the voltage under the currents of all that are connected [V]."""
        return shared_source.put_in_zones(self._source, self._mates, self._connected, self._source.V)[1]

    def under(self, plans: Sequence[Plan], places: Sequence[tuple[Segment, Vector]]) -> float:
        """Return the voltage where each servo is in a segment and stands at a state [V]."""
        self.begin()
        for plan, (segment, y) in zip(plans, places, strict=True):
            self.connect(plan, y, segment.drive, segment.duty, segment.silent)
        return self.volts()
