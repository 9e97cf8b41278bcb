"""The desk at which visitors hand in what they bring: who they are, and whose fit is being computed."""

from __future__ import annotations

import asyncio
import hmac
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from servotwin.web.server.own.brought import Brought
    from servotwin.web.server.own.fits import Fits

_AT_ONCE = 2  # logs that are read or compared: others wait


class Desk:
    """The desk of a house.

    Examples
    --------
    >>> Desk().find("nobody") is None
    True
    """

    def __init__(self) -> None:
        self._visitors: list[Brought] = []
        self.light = asyncio.Semaphore(_AT_ONCE)
        """For work that takes seconds."""
        self.fitting: Fits | None = None
        """Whose fit goes on."""

    def enter(self, visitor: Brought) -> None:
        """Take a visitor in."""
        self._visitors.append(visitor)

    async def leave(self, visitor: Brought) -> None:
        """Let a visitor go, and all that was brought."""
        self._visitors.remove(visitor)
        await visitor.free()

    def find(self, token: str) -> Brought | None:
        """Return the visitor whose token it is, in a time that does not tell how much of it is right; None without."""
        found = None
        for one in self._visitors:
            if hmac.compare_digest(one.token.encode(), token.encode()):
                found = one
        return found
