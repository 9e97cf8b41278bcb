"""What the servo at a joint is told: an angle of the joint, or, where it turns endlessly, a pulse width or a goal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from servotwin.datasheet.turning import is_pulsed
from servotwin.errors import InputError
from servotwin.models.switched import SwitchedServo

if TYPE_CHECKING:
    from servotwin.robots.mount import Mount


class Told(NamedTuple):
    """How a command of a joint becomes that of its servo: (command − zero)/gain.

    Parameters
    ----------
    kind : str
        Of the servo's command, "command_angle" or "pulse_width".
    gain, zero : float
        1 and 0 where the servo turns endlessly: it is told a pulse width or a goal, whatever its mount.
    rest : float
        What it is told before anybody has told it anything; nan: to hold where it begins.
    unit : str
        Of a command of the joint; empty where that is the joint's own, rad of a hinge and m of a slide.
    """

    kind: str
    gain: float
    zero: float
    rest: float
    unit: str

    def check(self, joint: str, goal: float, frame: float) -> None:
        """Raise InputError unless a command of a joint is finite, and a pulse shorter than a frame [s]."""
        if self.kind == "pulse_width" and not 0.0 < goal < frame:
            raise InputError(f"pulse of joint {joint}", got=goal,
                             allowed=f"a width of more than 0 and less than a frame of {frame:g} s: its servo turns "
                             "endlessly, and no angle is asked of it")
        if not math.isfinite(goal):
            raise InputError(f"goal of joint {joint}", got=goal,
                             allowed=f"a finite number of {self.unit or 'rad, or m of a slide'}")


def told(mount: Mount) -> Told:
    """Return how the servo of a mount is told where to go, or how fast to turn."""
    model = mount.model
    if not model.endless or not isinstance(model, SwitchedServo):
        return Told("command_angle", mount.gain, mount.zero, math.nan, "")
    if is_pulsed(model):
        return Told("pulse_width", 1.0, 0.0, model.neutral_pulse, "s")
    return Told("command_angle", 1.0, 0.0, model.value("potentiometer.fixed_angle"), "1")
