"""Demands of a servo on the loop that steps it, by its terms: what can come up at all, and what does not matter."""

from __future__ import annotations

from collections.abc import Iterator

from servotwin.models.engine.motions.choice import may_depend
from servotwin.models.terms import bridge, elastic, firmware, frame, motor, play, sensor, source
from servotwin.models.terms.dependence import (
    CURVED_Q,
    CURVED_T,
    CURVED_W,
    FADING,
    FOLLOWS,
    ON_HEAT,
    ON_I,
    ON_Q,
    PLAY,
    RECORDED,
    REGULATED,
    SPRING,
    STEEP_W,
    TWO_BODIES,
)
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.numbers import ACTS, Numbers, moved
from servotwin.physics.pieces import Piece

_COMES_UP: dict[str, tuple[int, ...]] = {
    "CORE": (STEEP_W,), "INSIDE": (PLAY,), "ON_FORWARD": (PLAY,), "ON_BACKWARD": (PLAY,),
    "LINEAR": (FOLLOWS,), "LINEAR_BACKWARD": (FOLLOWS,),  # without the other zones clang makes slower bands
    "LIMITED_FORWARD": (REGULATED,), "LIMITED_BACKWARD": (REGULATED,), "SHORT_FORWARD": (REGULATED,),
    "SHORT_BACKWARD": (REGULATED,),
    "WITH_CURRENT": (ON_I,), "HELD": (ON_I,), "CREEP": (FADING,), "APART": (PLAY,), "PAIR": (SPRING,),
    "WARMING": (ON_HEAT | ON_I,),
    "SERIES": (),  # of servos on a bus, where they are looked at afterwards
    "STEP": (STEEP_W, CURVED_Q, CURVED_T, ON_I),
    "LONG_STEP": (ON_HEAT, CURVED_W, CURVED_Q, FADING, SPRING, ON_I | ON_Q, *(
        TWO_BODIES | other for other in (ON_Q, ON_I, STEEP_W, RECORDED, FOLLOWS))),
}
"""Modes and kinds of motion that not all servos have: each comes up where something of this has to be followed."""
_NOT_BESIDE = {"CREEP": SPRING}


def needed(numbers: Numbers, own_chip: Chip, program: Firmware) -> int:
    """Return what a servo asks of whoever follows it, beside what its acceleration may depend on."""
    return (motor.needs(numbers.motor) | bridge.needs(numbers.bridge, numbers.source) | source.needs(numbers.source)
            | play.needs(numbers.play) | sensor.needs(numbers.sensor) | elastic.needs(numbers.elastic)
            | frame.needs(own_chip) | firmware.needs(program))


def demanded(numbers: Numbers, own_chip: Chip, program: Firmware, u: Piece) -> int:
    """Return all that a servo asks of whoever follows it under a command: flags of `terms.dependence`."""
    return may_depend(numbers, u) | needed(numbers, own_chip, program)


def idle(followed: int) -> tuple[str, ...]:
    """Return the numbers of terms and commands that act nowhere, where nothing has to be followed but this."""
    return tuple(path for path, acts in ACTS.items() if not acts & followed)


def impossible(followed: int, always: int = 0) -> tuple[str, ...]:
    """Return modes and kinds of motion that do not come up, where nothing but this has to be followed, but `always`."""
    if followed == -1:
        return ()
    return tuple(word for word, by in _COMES_UP.items()
                 if not any(some & ~followed == 0 for some in by) or always & _NOT_BESIDE.get(word, 0))


def certain(always: int) -> Iterator[str]:
    """Return the numbers that are positive wherever this has to be followed: those that ask for it by themselves."""
    for path, acts in ACTS.items():
        if acts & always and needed(*moved(path, 1.0)) & acts & always:
            yield path
