"""The rows that a run of servos on a bus leaves behind, as motions and events of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin.models.engine.bus import event_log
from servotwin.models.engine.dynamics import guards
from servotwin.models.state.modes import Mode
from servotwin.simulation.engine import TRIPS, Event, Part, Plan, event_name
from servotwin.simulation.trajectory import Motions

if TYPE_CHECKING:
    from servotwin.simulation.bus_run import Rows

_WORDS = {event_log.DRIVES + 1: "drive forward", event_log.DRIVES - 1: "drive backward", event_log.DRIVES: "drive ends",
          event_log.SILENCE + 1: "silence begins", event_log.SILENCE: "silence ends",
          event_log.REFUSED: "pulse refused",
          **{event_log.TRIPS + k: word for k, word in enumerate(TRIPS)}}


def motions_of(plans: Sequence[Plan], rows: Rows) -> list[Motions]:
    """Return the motions of each servo."""
    units = rows.motions["unit"]
    return [Motions([Part(plan, rows.motions[units == j])], rows.numbers) for j, plan in enumerate(plans)]


def events_of(plans: Sequence[Plan], rows: Rows) -> list[tuple[Event, ...]]:
    """Return the events of each servo."""
    found: list[list[Event]] = [[] for _ in plans]
    for unit, time, kind, zone, contact, angle in rows.events.tolist():
        if kind in guards.KINKS:
            continue
        name = _WORDS.get(kind) or event_name(int(kind), Mode(int(zone), int(contact), 0, 0, 0))
        found[int(unit)].append(Event(time, name, angle))
    return [tuple(events) for events in found]
