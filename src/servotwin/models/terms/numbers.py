"""All that a servo and its load are, as plain numbers: a record for each term, and all terms by their names."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

from servotwin.models.state.modes import Vector
from servotwin.models.state.records import fields_of
from servotwin.models.terms import follower
from servotwin.models.terms.bridge import NO_BRIDGE, Bridge, Off
from servotwin.models.terms.elastic import NO_ELASTIC, Elastic
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.follower import NO_FOLLOWER, Follower
from servotwin.models.terms.frame import NO_CHIP, Chip
from servotwin.models.terms.friction import NO_FRICTION, Friction
from servotwin.models.terms.heat import NO_HEAT, Heat
from servotwin.models.terms.load import NO_LOAD, Load
from servotwin.models.terms.motor import NO_MOTOR, Motor
from servotwin.models.terms.play import NO_PLAY, Play
from servotwin.models.terms.sensor import NO_SENSOR, Sensor
from servotwin.models.terms.shaft import NO_SHAFT, Shaft
from servotwin.models.terms.source import NO_SOURCE, Source
from servotwin.models.terms.stops import NO_STOPS, Stops
from servotwin.physics.thermal import magnet_factor, winding_resistance

# --- All that a servo and its load are, as plain numbers: a record for each term --------------------------------------

class Numbers(NamedTuple):
    """Everything that the automaton reads, the chip apart; plain floats in SI, at the output shaft."""

    motor: Motor = NO_MOTOR
    bridge: Bridge = NO_BRIDGE
    source: Source = NO_SOURCE
    follower: Follower = NO_FOLLOWER
    shaft: Shaft = NO_SHAFT
    friction: Friction = NO_FRICTION
    load: Load = NO_LOAD
    stops: Stops = NO_STOPS
    play: Play = NO_PLAY
    sensor: Sensor = NO_SENSOR
    heat: Heat = NO_HEAT
    elastic: Elastic = NO_ELASTIC


NEUTRAL = Numbers()


def at_temperature(numbers: Numbers, T_w: float, T_h: float) -> Numbers:
    """Return the numbers with a winding and a housing of these temperatures [K]: copper and magnets follow them."""
    cold, bridge = numbers.motor, numbers.bridge
    off, silence = bridge.off, bridge.silence
    R = winding_resistance(T_w, cold.R)
    more = R - cold.R
    field = magnet_factor(T_h, numbers.heat.magnet)
    between = Off(off.D, off.R + more, off.coast)
    same = silence.R == off.R and silence.D == off.D and silence.coast == off.coast
    silent = between if same else Off(silence.D, silence.R + more, silence.coast)
    return Numbers(
        Motor(cold.K * field, cold.K_b * field, R, cold.L),
        Bridge(bridge.D_drive, bridge.R_drive + more, between, silent, bridge.V_br, bridge.pwm, bridge.one_way),
        numbers.source, numbers.follower, numbers.shaft, numbers.friction, numbers.load, numbers.stops, numbers.play,
        numbers.sensor, numbers.heat, numbers.elastic)


def warm(numbers: Numbers, y: Vector) -> Numbers:
    """Return the numbers at the temperatures of a state; the numbers themselves where they stay."""
    return at_temperature(numbers, y.T_w, y.T_h) if numbers.heat.C_w > 0.0 else numbers


# --- All terms --------------------------------------------------------------------------------------------------------

ROOMS: dict[str, Any] = {**dict(fields_of(Numbers)), "chip": Chip, "firmware": Firmware}
"""The records of all terms, by name."""
NOTHING: dict[str, Any] = {**NEUTRAL._asdict(), "chip": NO_CHIP, "firmware": NO_FIRMWARE}
"""Their values where they are absent."""
APART = ("heat.T_amb",)
"""Numbers that a servo without the term has too: its temperature, for where nothing gets warm."""


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
