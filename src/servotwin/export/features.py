"""What the code of a servo has to follow, and which kernels therefore are in it."""

from __future__ import annotations

from functools import reduce

from servotwin.models.engine.demands import demanded
from servotwin.models.terms.dependence import (
    AT_COMMANDS,
    AT_STOPS,
    BEYOND,
    BY_SHARE,
    CURVED_Q,
    DROPS,
    DRY,
    FADING,
    ON_HEAT,
    ON_I,
    ONE_WAY,
    PLAY,
    PROGRAM,
    PULSES,
    PWM,
    REGULATED,
    SHOWN,
    SLACK,
    SPRING,
    STEEP_W,
    STEPS,
    STRAIGHT,
    TABLE,
)
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.firmware import present as programmed
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.numbers import ACTS, NOTHING, Numbers
from servotwin.physics.pieces import Piece
from servotwin.simulation.compile import Recipe

ENTRIES = ("start", "advance", "answer", "observe")
APART = ("heat.T_amb",)  # stands apart too, for where nothing gets warm
_ALWAYS = STRAIGHT | DRY | AT_STOPS | SHOWN


def features_of(numbers: Numbers, chip: Chip, program: Firmware, table: bool) -> int:
    """Return all that a servo asks of the code that follows it: flags of `terms.dependence`."""
    flags = _ALWAYS | demanded(numbers, chip, program, Piece()) | (TABLE if table else 0)
    if programmed(program):
        flags |= BEYOND | AT_COMMANDS | ONE_WAY
    rooms = numbers._asdict() | {"chip": chip, "firmware": program}
    for path, acts in ACTS.items():
        room, *fields = path.split(".")
        if path not in APART and room in rooms and not acts & flags and reduce(getattr, fields, rooms[room]) != reduce(
                getattr, fields, NOTHING[room]):
            flags |= acts
    return flags


def recipe_of(flags: int) -> Recipe:
    """Return the recipe of a servo that asks for this; what else there is is left out."""
    always = PROGRAM | PWM if flags & PROGRAM else 0
    return Recipe("alone", tuple(f"servotwin.models.engine.run.alone:{entry}" for entry in ENTRIES), knows=flags,
                  always=always, never=("ALL", "READINGS"))


_WORDS = {
    ON_I: "inductance", CURVED_Q: "a pendulum", ON_HEAT: "heat", PLAY: "play of the gear",
    SPRING: "a spring between two bodies",
    FADING: "friction that fades", BY_SHARE: "friction by torque", REGULATED: "a limit of current",
    SLACK: "play of the potentiometer", STEPS: "its steps", TABLE: "its table", DROPS: "drops and open bridges",
    PULSES: "pulses", PROGRAM: "a program", STEEP_W: "smoothed friction"}


def left_out(flags: int) -> str:
    """Return in words what the code of a servo that asks for this does not follow."""
    return ", ".join(word for flag, word in _WORDS.items() if not flags & flag) or "nothing"
