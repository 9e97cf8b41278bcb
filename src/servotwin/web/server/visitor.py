"""One browser: what it says is done in its room, and what it may not do is answered in a line."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from starlette.websockets import WebSocketDisconnect

from servotwin.errors import InputError, ServotwinError
from servotwin.web.lessons import lessons as taught
from servotwin.web.lessons import mystery
from servotwin.web.lessons.lessons import lessons, mystery_scene
from servotwin.web.live import read_fragment, read_scene
from servotwin.web.live.replay import exported
from servotwin.web.live.scene import checked_view, with_servos
from servotwin.web.server.messages import VERSION, Allowance, Outbox, id_of, line_of, message_of, text_of
from servotwin.web.server.own.brought import Brought
from servotwin.web.server.session import EXPORTS, aside

if TYPE_CHECKING:
    from collections.abc import Awaitable

    from starlette.websockets import WebSocket

    from servotwin.web.server.own.brought import Desk
    from servotwin.web.server.session import Room


# --- Pushes and messages to one browser: the latest push, and short messages in order; a slow one misses pushes -------



# --- Messages of a page, and what is done then: one function a word ---------------------------------------------------

Answer = dict[str, Any]
_LONGEST_EXPORT = 600.0  # s


async def answer_to(visitor: Visitor, message: dict[str, Any]) -> Answer:
    """Do what a message says; return what is answered.

    Raises
    ------
    ServotwinError
        If it says nothing that can be done.
    """
    words = [word for word in message if word in WORDS]
    if len(words) != 1:
        raise InputError("message", got=", ".join(map(str, message))[:100] or "nothing",
                         allowed=f"one of {', '.join(WORDS)}")
    if visitor.role == "watcher":
        raise InputError("message of a watcher", got=words[0], allowed="watching: the teacher steers")
    return await WORDS[words[0]](visitor, message)


async def _do(visitor: Visitor, message: dict[str, Any]) -> Answer:
    return {"time": visitor.room.do(message["do"], message.get("value"), message.get("servo"))}


async def _run(visitor: Visitor, message: dict[str, Any]) -> Answer:
    value = message["run"]
    if not isinstance(value, bool):
        raise InputError("run", got=value, allowed="true or false")
    visitor.room.run(value)
    return {"time": visitor.room.bench.time}


async def _speed(visitor: Visitor, message: dict[str, Any]) -> Answer:
    visitor.room.ask(message["speed"])
    return {"time": visitor.room.bench.time}


async def _step(visitor: Visitor, message: dict[str, Any]) -> Answer:
    visitor.room.step()
    return {"time": visitor.room.bench.time}


async def _reset(visitor: Visitor, message: dict[str, Any]) -> Answer:
    await visitor.room.reset()
    return {"time": 0.0}


async def _scene(visitor: Visitor, message: dict[str, Any]) -> Answer:
    await visitor.room.begin("scene", partial(read_scene, _text(message, "scene")))
    return {"time": 0.0}


async def _servos(visitor: Visitor, message: dict[str, Any]) -> Answer:
    scene = visitor.room.bench.scene()
    await visitor.room.begin("servos", partial(with_servos, scene, message["servos"], message.get("supply")))
    return {"time": 0.0}


async def _fragment(visitor: Visitor, message: dict[str, Any]) -> Answer:
    await visitor.room.begin("link", partial(read_fragment, _text(message, "fragment")))
    return {"time": 0.0}


async def _view(visitor: Visitor, message: dict[str, Any]) -> Answer:
    visitor.room.bench.show(checked_view(message["view"]))
    return {"time": visitor.room.bench.time}


async def _said(visitor: Visitor, message: dict[str, Any]) -> Answer:
    scene = visitor.room.bench.scene()
    return await aside("text of the bench", lambda: {"text": scene.text(), "fragment": scene.fragment()})


async def _export(visitor: Visitor, message: dict[str, Any]) -> Answer:
    bench = visitor.room.bench
    made = partial(exported, message["export"], bench.scene(), bench.now_models, message.get("servo") or 0)
    async with EXPORTS:
        return {"file": (await aside("export", made, _LONGEST_EXPORT))._asdict()}


async def _lesson(visitor: Visitor, message: dict[str, Any]) -> Answer:
    lesson = taught.lesson(_text(message, "lesson"))
    await visitor.room.begin("lesson", lambda: lesson.scene)
    return {"time": 0.0}


async def _mystery(visitor: Visitor, message: dict[str, Any]) -> Answer:
    await visitor.room.begin("mystery", partial(mystery_scene, message["mystery"]))
    return {"time": 0.0}


async def _guess(visitor: Visitor, message: dict[str, Any]) -> Answer:
    servo = visitor.room.bench.scene().servos[0]
    if servo.mystery is None:
        raise InputError("guess", got="a bench without a mystery", allowed="a mystery servo")
    return {"compared": mystery.compare(servo.mystery, message["guess"])}


async def _log(visitor: Visitor, message: dict[str, Any]) -> Answer:
    asked = _table(message, "log")
    if "columns" in asked:
        visitor.brought.read_again(asked["columns"], asked.get("mend", ""))
    elif "show" in asked:
        visitor.brought.compare(asked)
    elif "play" in asked:
        return {"time": visitor.brought.play(asked.get("run", 0))}
    elif "forget" in asked:
        visitor.brought.forget()
    else:
        raise InputError("log", got=", ".join(map(str, asked))[:100], allowed="one of columns, show, play, forget")
    return {}


async def _fit(visitor: Visitor, message: dict[str, Any]) -> Answer:
    asked, fits = _table(message, "fit"), visitor.brought.fits
    if "plan" in asked:
        return {"plan": await fits.plan(asked.get("servo", 0), asked.get("model"))}
    if "cancel" in asked:
        fits.cancel()
    elif "take" in asked:
        await fits.take_over(asked["take"])
    else:
        fits.begin(asked)
    return {}


def _table(message: dict[str, Any], key: str) -> dict[str, Any]:
    value = message[key]
    if not isinstance(value, dict) or not value:
        raise InputError(key, got=type(value).__name__, allowed="a table of what is asked")
    return value


def _text(message: dict[str, Any], key: str) -> str:
    value = message[key]
    if not isinstance(value, str):
        raise InputError(key, got=type(value).__name__, allowed="a text")
    return value


WORDS: dict[str, Callable[[Visitor, dict[str, Any]], Awaitable[Answer]]] = {
    "do": _do, "run": _run, "speed": _speed, "step": _step, "reset": _reset, "scene": _scene, "servos": _servos,
    "fragment": _fragment,
    "view": _view, "text": _said, "export": _export, "lesson": _lesson, "mystery": _mystery, "guess": _guess,
    "log": _log, "fit": _fit}
"""Messages of a page."""


# --- One browser: what it says is done in its room, and what it may not do is answered in a line ----------------------

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
