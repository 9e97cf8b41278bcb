"""How a simulation ended."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """How a simulation ended; each member carries its message.

    Examples
    --------
    >>> Status.COMPLETED.ok, Status.DIVERGED.message
    (True, 'the state is no longer finite')
    """

    COMPLETED = 0, "reached the end"
    DIVERGED = 1, "the state is no longer finite"
    STEP_TOO_SMALL = 2, "no step is short enough for the tolerance"
    CHATTER = 3, "events follow each other without time going on"
    TOO_FAST = 4, "it oscillates too fast to be followed"
    CROWDED = 5, "frames follow each other faster than the chip decides: a third decision would have to wait"

    def __init__(self, code: int, message: str) -> None:
        self.code = code
        self.message = message

    @classmethod
    def of_code(cls, code: int) -> Status:
        """Return the member with this code."""
        return next(status for status in cls if status.code == code)

    @property
    def ok(self) -> bool:
        """Whether the whole time was simulated."""
        return self is Status.COMPLETED
