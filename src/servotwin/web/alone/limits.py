"""Every number that the page as one file goes by, of the modules that have it."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.live.posts import NEVER
from servotwin.models.engine.live.screen import LEFT, PERIODS, TOO_LONG, USED
from servotwin.models.engine.memory import ACCURACY
from servotwin.physics.pieces import Piece
from servotwin.web.live.said import FRAME_RATE, RATES
from servotwin.web.live.scene import FORMAT, LONGEST_TEXT, MOST_ACTIONS, MOST_SERVOS, MOST_VIEW
from servotwin.web.server import pace, room, stint

_AT_ONCE = 64  # rows of what each servo on a shared supply does at once
_STEPS = 150_000  # of a servo in a call, half a second of computing: a motion that takes more stands
_ROWS, _EVENTS, _PULSES, _TRAIN, _GIVEN = 4096, 512, 1024, 64, 8  # room for what shows, and what is told


def limits() -> dict[str, Any]:
    """Return these numbers by the names that the page has for them; times are in seconds, but for `pause` [ms].

    Examples
    --------
    >>> limits()["speeds"]
    (1e-06, 10.0)
    """
    return {
        "rows": _ROWS, "events": _EVENTS, "pulses": _PULSES, "train": _TRAIN, "used": USED, "left": LEFT,
        "given": _GIVEN, "ends": 4, "at_once": _AT_ONCE,
        "piece": len(Piece._fields), "most_pieces": 2 * PERIODS + 1, "never": NEVER,
        "frame_rate": FRAME_RATE, "accuracy": ACCURACY, "rates": RATES,
        "format": FORMAT, "actions": MOST_ACTIONS, "servos": MOST_SERVOS,
        "text": LONGEST_TEXT, "view": MOST_VIEW,
        "speeds": pace.SPEEDS, "unpaced": pace.UNPACED, "over": pace.OVER, "late": pace.LATE,
        "steps": _STEPS, "too_long": TOO_LONG,
        "rate": room.RATE, "points": room.POINTS, "coarsest": room.COARSEST, "frame_points": room.FRAME_POINTS,
        "tick": room.TICK, "rounding": room.ROUNDING, "far": room.FAR, "pause": 1e3 / room.RATE,
        "budget": stint.BUDGET, "short": stint.SHORT / stint.BUDGET, "first_stretch": stint.FIRST,
        "longest": stint.LONGEST}
