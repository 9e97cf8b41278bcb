"""What a page may say, and what is done then: one function a word."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError
from servotwin.web.lessons import lessons as taught
from servotwin.web.lessons import mystery
from servotwin.web.live import read_fragment, read_scene
from servotwin.web.live.chosen import with_servos
from servotwin.web.live.export import exported
from servotwin.web.live.scene import checked_view
from servotwin.web.server.aside import EXPORTS, aside

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from servotwin.web.server.visitor import Visitor

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
    visitor.room.run(_truth(message, "run"))
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
    await visitor.room.begin("mystery", partial(mystery.mystery_scene, message["mystery"]))
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


def _truth(message: dict[str, Any], key: str) -> bool:
    value = message[key]
    if not isinstance(value, bool):
        raise InputError(key, got=value, allowed="true or false")
    return value


WORDS: dict[str, Callable[[Visitor, dict[str, Any]], Awaitable[Answer]]] = {
    "do": _do, "run": _run, "speed": _speed, "step": _step, "reset": _reset, "scene": _scene, "servos": _servos,
    "fragment": _fragment,
    "view": _view, "text": _said, "export": _export, "lesson": _lesson, "mystery": _mystery, "guess": _guess,
    "log": _log, "fit": _fit}
"""What a page may say."""

