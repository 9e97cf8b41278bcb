"""One browser: what it says is done in its room, and what it may not do is told in a line."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
from typing import TYPE_CHECKING, Any

from starlette.websockets import WebSocketDisconnect

from servotwin.errors import InputError, ServotwinError
from servotwin.web.lessons.lessons import lessons
from servotwin.web.server.limits import Allowance
from servotwin.web.server.outbox import Outbox
from servotwin.web.server.own.brought import Brought
from servotwin.web.server.wire import VERSION, id_of, line_of, message_of, text_of
from servotwin.web.server.words import answer_to

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

    from servotwin.web.server.own.desk import Desk
    from servotwin.web.server.room import Room

_RATE, _BURST = 240.0, 480.0  # messages
_TOO_MANY = 4008


class Visitor:
    """One browser.

    Parameters
    ----------
    socket : WebSocket
        That was accepted.
    room : Room
    role : {"own", "teacher", "watcher"}
    desk : Desk
        That takes logs.
    code : str, optional
        That watchers need, for the teacher's page.
    """

    def __init__(self, socket: WebSocket, room: Room, role: str, desk: Desk, code: str | None = None) -> None:
        self.room, self.role, self.token = room, role, secrets.token_urlsafe(18)
        self._socket, self._code, self._desk = socket, code, desk
        self._box = Outbox(socket)
        self.brought = Brought(desk, room, self.token, role, lambda message: self._box.text(text_of(message)))
        self._allowance = Allowance(_RATE, _BURST)
        self._export: asyncio.Task[None] | None = None

    async def stay(self) -> None:
        """Listen and tell until the browser is gone."""
        self._box.text(text_of({"hello": {
            "visitor": self.token, "version": VERSION, "role": self.role, "code": self._code,
            "lessons": [lesson.listed() for lesson in lessons()]}}))
        self._box.text(await self.room.state_text())
        self.room.outboxes.append(self._box)
        self._desk.enter(self.brought)
        self.room.show()
        tasks = [asyncio.create_task(self._listen()), asyncio.create_task(self._box.deliver())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._box.closed = True
            self.room.outboxes.remove(self._box)
            tasks += [self._export] if self._export is not None else []
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self._desk.leave(self.brought)
            with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):  # it may be gone already
                await asyncio.wait_for(self._socket.close(), 1.0)

    async def _listen(self) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await self._box.room()
                text = (await self._socket.receive()).get("text", b"")
                if self._socket.client_state.name != "CONNECTED":
                    return
                if not self._allowance.take(time.monotonic()):
                    self._box.text(text_of({"refused": None, "message": "too many messages in a second"}))
                    await asyncio.sleep(0.05)
                    await self._socket.close(_TOO_MANY, "too many messages in a second")
                    return
                await self._hear(text)

    async def _hear(self, text: object) -> None:
        """Do what a message says, and answer; files are made beside, one at a time."""
        try:
            message = message_of(text)
        except ServotwinError as error:
            self._box.text(text_of({"refused": None, "message": line_of(error)}))
            return
        if "export" not in message:
            await self._answer(message)
        elif self._export is None or self._export.done():
            self._export = asyncio.create_task(self._answer(message))
        else:
            self._box.text(text_of({"refused": id_of(message), "message": line_of(
                InputError("export", got="another one at once", allowed="one after the other"))}))

    async def _answer(self, message: dict[str, Any]) -> None:
        number = id_of(message)
        try:
            answer = {"done": number, **await answer_to(self, message)}
        except ServotwinError as error:
            answer = {"refused": number, "message": line_of(error)}
        except Exception as error:  # one visitor's message shall not end the visits of others
            answer = {"refused": number, "message": "a mistake of servotwin itself "
                      f"({type(error).__name__}); please report what was done"}
        self._box.text(text_of(answer))
