"""The server: the page, what it asks for once, and the way on which it lives."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import secrets
import time
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

from starlette.applications import Starlette
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocketDisconnect

from servotwin.errors import ServotwinError
from servotwin.web.server.aside import aside
from servotwin.web.server.catalog import catalog_list, curves_data
from servotwin.web.server.files import PAGE, Files
from servotwin.web.server.guard import Guard
from servotwin.web.server.limits import MOST_VISITORS, MOST_WATCHERS, Allowance
from servotwin.web.server.own.desk import Desk
from servotwin.web.server.room import Room
from servotwin.web.server.uploads import take_log
from servotwin.web.server.visitor import Visitor
from servotwin.web.server.wire import line_of, text_of

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.types import ASGIApp
    from starlette.websockets import WebSocket

    from servotwin.web.live import Scene

FULL, NOT_IN = 4008, 4003
"""Codes with which a browser is sent away: no room is left, or it has not said the code."""
_SHEETS = asyncio.Lock()
_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # none that look alike


class House:
    """All rooms: one for each visitor, or one for a whole class.

    Parameters
    ----------
    scene : Scene
        With which rooms begin.
    classroom : bool
        Whether there is one bench, which the teacher steers and others watch.
    """

    def __init__(self, scene: Scene, *, classroom: bool) -> None:
        self._scene = scene
        self._visitors = 0
        self.teacher = secrets.token_urlsafe(18) if classroom else None
        """What the teacher's link says, in a class."""
        self.code = "".join(secrets.choice(_LETTERS) for _ in range(6)) if classroom else None
        """What watchers have to say."""
        self._tries = Allowance(rate=5.0, burst=60.0)
        self._shared: Room | None = None
        self._teachers = self._watchers = 0
        self._living: asyncio.Task[None] | None = None
        self.desk = Desk()

    async def upload(self, request: Request) -> Response:
        """Take a log that a visitor hands in."""
        return await take_log(request, self.desk)

    async def visit(self, socket: WebSocket) -> None:
        """Take a browser in, or tell it why not."""
        await socket.accept()
        if self.teacher is None:
            await self._own_room(socket)
        else:
            await self._class(socket)

    async def _own_room(self, socket: WebSocket) -> None:
        if self._visitors >= MOST_VISITORS:
            await _away(socket, FULL, f"all {MOST_VISITORS} places are taken: try again when someone has left")
            return
        self._visitors += 1
        living: asyncio.Task[None] | None = None
        try:
            room = await aside("bench", lambda: Room(self._scene))
            living = asyncio.create_task(room.live())
            await Visitor(socket, room, "own", self.desk).stay()
        finally:
            self._visitors -= 1
            if living is not None:
                living.cancel()

    async def _class(self, socket: WebSocket) -> None:
        asked = socket.query_params
        teaches = hmac.compare_digest(asked.get("teacher", "").encode(), (self.teacher or "").encode())
        if not teaches and not self._tries.take(time.monotonic()):  # a code is short; what teaches nobody guesses
            await _away(socket, NOT_IN, "too many at once: try again in a moment")
            return
        if not teaches and not hmac.compare_digest(asked.get("code", "").strip().lower().encode(),
                                                   (self.code or "").encode()):
            await _away(socket, NOT_IN, "that is not the code on the teacher's screen")
            return
        if self._teachers >= MOST_VISITORS if teaches else self._watchers >= MOST_WATCHERS:
            await _away(socket, FULL, f"all {MOST_VISITORS if teaches else MOST_WATCHERS} places are taken")
            return
        if self._shared is None:
            self._shared = Room(self._scene)
            self._living = asyncio.create_task(self._shared.live())
        self._watchers, self._teachers = self._watchers + (not teaches), self._teachers + teaches
        try:
            await Visitor(socket, self._shared, "teacher" if teaches else "watcher", self.desk,
                          self.code if teaches else None).stay()
        finally:
            self._watchers, self._teachers = self._watchers - (not teaches), self._teachers - teaches


async def _away(socket: WebSocket, code: int, line: str) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
        async with asyncio.timeout(5.0):
            await socket.send_text(text_of({"full": line}))
            await socket.close(code, line[:100])


def application(scene: Scene, names: frozenset[str], *, classroom: bool = False) -> tuple[ASGIApp, House]:
    """Return the server's application, and the house that it keeps.

    Parameters
    ----------
    scene : Scene
        With which benches begin.
    names : frozenset of str
        Under which it may be asked, as `guard.names_of` returns them.
    classroom : bool
        Whether there is one bench for a class.
    """
    house, files = House(scene, classroom=classroom), Files(PAGE)
    routes = [
        Route("/", files.first), Route("/page/{name:path}", files.other),
        Route("/api/catalog", _catalog), Route("/api/curves/{name}", _curves),
        Route("/api/log", house.upload, methods=["POST"]), WebSocketRoute("/live", house.visit)]

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        yield
        if house._living is not None:
            house._living.cancel()

    return Guard(Starlette(routes=routes, lifespan=lifespan), names), house


async def _catalog(request: Request) -> Response:
    async with _SHEETS:  # they are computed once: one waits for the other
        return JSONResponse(await aside("catalog", catalog_list))


async def _curves(request: Request) -> Response:
    try:
        async with _SHEETS:
            return JSONResponse(await aside("curves", lambda: curves_data(request.path_params["name"])))
    except ServotwinError as error:
        return JSONResponse({"error": line_of(error)}, status_code=404)
