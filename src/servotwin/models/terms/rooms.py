"""All terms: of the plant, and of what decides on its drive; what they are where they are absent; where numbers act."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

from servotwin.models.state.records import fields_of
from servotwin.models.terms import follower
from servotwin.models.terms.chip import NO_CHIP, Chip
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.numbers import NEUTRAL, Numbers

ROOMS: dict[str, Any] = {**dict(fields_of(Numbers)), "chip": Chip, "firmware": Firmware}
"""The records of all terms, by name."""
NOTHING: dict[str, Any] = {**NEUTRAL._asdict(), "chip": NO_CHIP, "firmware": NO_FIRMWARE}
"""What they are where they are absent."""


def paths(prefix: str = "", rooms: Any = None) -> Iterator[tuple[str, Any, str]]:
    """Return all numbers as "friction.K_m", each with the record that it is in and its name there."""
    for name, kind in (ROOMS if rooms is None else dict(fields_of(rooms))).items():
        if hasattr(kind, "_fields"):
            yield from paths(f"{prefix}{name}.", kind)
        else:
            yield f"{prefix}{name}", rooms, name


ACTS: dict[str, int] = {
    **{f"{room}.{number}": flags for room, kind in ROOMS.items()
       for number, flags in sys.modules[kind.__module__].ACTS.items()},
    **follower.INPUTS}
"""Where numbers act, as their terms say it, and those of a command."""


def moved(path: str, by: float) -> tuple[Numbers, Chip, Firmware]:
    """Return all terms absent but for one number, which is so much away from what it is then, or has this value."""
    room, *fields = path.split(".")
    found = NOTHING | {room: _moved(NOTHING[room], fields, by)}
    own_chip, program = (found.pop(name) for name in ROOMS if name not in Numbers._fields)
    return Numbers(**found), own_chip, program


def _moved(record: Any, fields: list[str], by: float) -> Any:
    first, *rest = fields
    own = getattr(record, first)
    return record._replace(**{first: _moved(own, rest, by) if rest else own + by if abs(own) < 1e300 else by})
