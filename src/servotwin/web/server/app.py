"""The server: the page, what it asks for once, and the way on which it lives."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import hmac
import math
import secrets
import time
import warnings
from collections.abc import AsyncIterator
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocketDisconnect

from servotwin.datasheet.full_drive import speed_curve
from servotwin.errors import InputError, ServotwinError, UnknownNameError
from servotwin.models import BoundedServo, Model, default_model
from servotwin.parameters import catalog_names, load_servo
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, Temperatures
from servotwin.web.live.facts import models_of, size_of
from servotwin.web.server.messages import LONGEST_UPLOAD, MOST_VISITORS, MOST_WATCHERS, Allowance, line_of, text_of
from servotwin.web.server.own.brought import Desk
from servotwin.web.server.session import Room, aside
from servotwin.web.server.visitor import Visitor

if TYPE_CHECKING:
    from collections.abc import Iterable

    from starlette.requests import Request
    from starlette.types import ASGIApp, Message, Receive, Scope, Send
    from starlette.websockets import WebSocket

    from servotwin.web.live import Scene


# --- The files of the page, read once: whatever is asked for, no path reaches the disk --------------------------------

PAGE = Path(__file__).parent.parent / "page"
_FIRST = "index.html"
_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml",
          ".png": "image/png", ".json": "application/json"}
_PLAIN = "text/plain"


class File(NamedTuple):
    """A file as it is sent: its bytes, what they are, and a mark that changes with them."""

    data: bytes
    kind: str
    mark: str


class Files:
    """All files of a folder.

    Parameters
    ----------
    folder : Path

    Examples
    --------
    >>> files = Files(PAGE)
    >>> files.files["js/main.js"].kind, "../server/files.py" in files.files
    ('text/javascript', False)
    """

    def __init__(self, folder: Path) -> None:
        found = (path for path in sorted(folder.rglob("*")) if path.is_file())
        self.files = {path.relative_to(folder).as_posix(): _read(path) for path in found}
        scripts = (name for name, file in self.files.items() if file.kind == _TYPES[".js"])
        self._links = ", ".join(f"</page/{name}>; rel=modulepreload" for name in scripts)

    async def first(self, request: Request) -> Response:
        """Answer with the page itself; a browser then asks for all its modules at once, not one after the other."""
        return self._sent(request, self.files[_FIRST], {"link": self._links})

    async def other(self, request: Request) -> Response:
        """Answer with a file of the page, if there is one of that name."""
        file = self.files.get(request.path_params["name"])
        return Response("no such file\n", 404, media_type=_PLAIN) if file is None else self._sent(request, file, {})

    def _sent(self, request: Request, file: File, more: dict[str, str]) -> Response:
        if request.headers.get("if-none-match") == file.mark:
            return Response(status_code=304, headers={"etag": file.mark})
        return Response(file.data, media_type=file.kind, headers={"etag": file.mark, **more})


def _read(path: Path) -> File:
    data = path.read_bytes()
    return File(data, _TYPES.get(path.suffix, _PLAIN), f'"{hashlib.sha256(data).hexdigest()[:20]}"')


# --- The catalog as the page lists it, and the curves of a servo ------------------------------------------------------

@cache
def catalog_list() -> list[dict[str, Any]]:
    """Return all servos of the catalog: id, title, kind, mass, models, and what their sheets print (SI).

    Examples
    --------
    >>> next(one for one in catalog_list() if one["id"] == "hitec-hs-755hb")["sheet"]["stall_torque"]
    1.2945
    """
    found = []
    for name in catalog_names():
        servo = load_servo(name)
        numbers = {key: one["value"] for key, one in servo.sheet.items()
                   if isinstance(one, dict) and isinstance(one.get("value"), int | float)}
        units = {key: str(servo.sheet[key].get("unit", "")) for key in numbers}
        found.append({"id": name, "title": servo.title or name, "kind": servo.kind, "models": models_of(servo),
                      "mass_kg": size_of(servo)["mass_kg"], "sheet": numbers, "units": units})
    return found


@lru_cache(maxsize=64)
def curves_data(name: str) -> dict[str, Any]:
    """Return torque, current and efficiency over speed at full drive, cold (SI).

    Raises
    ------
    UnknownNameError
        If the catalog has no such servo.
    ServotwinError
        If its file lacks what the curves need.

    Examples
    --------
    >>> sorted(curves_data("hitec-hs-755hb"))
    ['current', 'efficiency', 'id', 'power', 'speed', 'torque', 'voltage']
    """
    if name not in catalog_names():
        raise UnknownNameError("servo", name, catalog_names())
    servo = load_servo(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model: Model = default_model(servo) if servo.kind != "analog" else BoundedServo(servo)
        curve = speed_curve(model, Temperatures(REFERENCE_TEMPERATURE, REFERENCE_TEMPERATURE))
    step = 4
    shown = {key: [float(f"{value:.5g}") for value in getattr(curve, key)[::step].tolist()]
             for key in ("speed", "torque", "current", "power", "efficiency")}
    volts = servo.get("supply.open_circuit_voltage")
    return {"id": name, **shown, "voltage": volts if isinstance(volts, float) else math.nan}


# --- Admission to the server: by the name under which the server was asked, and by the page that asks -----------------

HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
                               "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff", "referrer-policy": "no-referrer", "cache-control": "no-cache",
    "cross-origin-opener-policy": "same-origin", "cross-origin-resource-policy": "same-origin",
}
"""Headers of every answer to a browser."""
_LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
_FOREIGN = 4403


def names_of(host: str, port: int) -> frozenset[str]:
    """Return the names under which a server may be asked, as a browser writes them.

    Examples
    --------
    >>> sorted(names_of("127.0.0.1", 8000))
    ['127.0.0.1:8000', '[::1]:8000', 'localhost:8000']
    """
    own = f"[{host}]" if ":" in host else host
    found = {*_LOOPBACK, *(_addresses() if host in ("0.0.0.0", "::") else (own,))}
    return frozenset(f"{name}:{port}".lower() for name in found) | (frozenset(found) if port == 80 else frozenset())


def _addresses() -> Iterable[str]:
    """Return the names and addresses of this computer."""
    import socket

    name = socket.gethostname()
    yield from (name, f"{name}.local")
    try:
        found = socket.getaddrinfo(name, None)
    except OSError:
        found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:  # nothing is sent: it tells the way out
        try:
            probe.connect(("192.0.2.1", 9))
            yield probe.getsockname()[0]
        except OSError:
            pass
    for *_, address in found:
        host = str(address[0]).partition("%")[0]
        yield f"[{host}]" if ":" in host else host


class Guard:
    """Refuses what was not asked under a name of the server, or comes from a page that is not its own.

    Parameters
    ----------
    app : ASGI application
    names : frozenset of str
        Host names with their port, as `names_of` returns them.
    """

    def __init__(self, app: ASGIApp, names: frozenset[str]) -> None:
        self._app, self._names = app, names

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request in, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        wrong = self._wrong(scope)
        if wrong is None:
            await self._app(scope, receive, _with_headers(send) if scope["type"] == "http" else send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": _FOREIGN, "reason": wrong})
        else:
            body = f"{wrong}\n".encode()
            await send({"type": "http.response.start", "status": 403, "headers": [
                (b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]})
            await send({"type": "http.response.body", "body": body})

    def _wrong(self, scope: Scope) -> str | None:
        headers = {key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]}
        if headers.get("host", "").lower() not in self._names:
            return "asked under a name that is not this server's"
        origin = headers.get("origin")
        if origin is None:  # a browser always tells, where it matters
            return None
        parts = urlsplit(origin)
        if parts.scheme not in ("http", "https") or parts.netloc.lower() != headers["host"].lower():
            return "asked by a page of another origin"
        return None


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = {key.lower() for key, _ in message["headers"]}
            message["headers"] = [*message["headers"], *(
                (key.encode(), value.encode()) for key, value in HEADERS.items() if key.encode() not in own)]
        await send(message)
    return sent


# --- A log that a page hands in: who may, how large it may be, and what is answered -----------------------------------

_SLOWEST = 120.0  # s for the whole of a log to arrive
_HEARD = 2 * LONGEST_UPLOAD  # bytes that are let pass unkept, so that a browser hears why its log was refused
_LONGEST_LABEL = 80
TOKEN = "x-visitor"
"""The header that says whose log it is."""


async def take_log(request: Request, desk: Desk) -> Response:
    """Take a log and read it; answer how it was read.

    A file that was taken but cannot be read is answered with a line, too: it can be read again with other words.

    Parameters
    ----------
    request : Request
        Its body is the file; its header `TOKEN` says whose it is, its query `name` what it is called.
    desk : Desk
    """
    visitor = desk.find(request.headers.get(TOKEN, ""))
    if visitor is None:
        return _refused(403, "log: got no token of a visitor who is here, allowed: a page of this bench")
    try:
        visitor.may_bring()
    except InputError as error:
        return _refused(403 if visitor.role == "watcher" else 429, line_of(error))
    visitor.uploading = True
    try:
        async with asyncio.timeout(_SLOWEST):
            raw = await _body(request)
    except _TooLargeError as error:
        return _refused(413, line_of(error))
    except TimeoutError:
        return _refused(408, f"log: got a file that took more than {_SLOWEST:.0f} s to arrive, allowed: a faster line")
    except ClientDisconnect:
        return _refused(400, "log: got half of it")
    finally:
        visitor.uploading = False
    try:
        return JSONResponse({"log": await visitor.take(raw, label_of(request.query_params.get("name", "")))})
    except ServotwinError as error:
        return JSONResponse({"wrong": line_of(error)})


def label_of(name: str) -> str:
    r"""Return what a file is called in messages: its last part, printable and short. It is never used as a path.

    Examples
    --------
    >>> label_of("../../etc/run\n1.csv"), label_of("C:\\logs\\a.csv"), label_of("")
    ('run1.csv', 'a.csv', 'log.csv')
    """
    last = name.replace("\\", "/").rpartition("/")[2]
    return "".join(c for c in last if c.isprintable()).strip()[-_LONGEST_LABEL:] or "log.csv"


class _TooLargeError(InputError):
    """A log that is larger than is allowed."""

    def __init__(self, size: float) -> None:
        super().__init__("log", got=f"{size / 1e6:.1f} MB", allowed=f"at most {LONGEST_UPLOAD / 1e6:.0f} MB")


async def _body(request: Request) -> bytes:
    """Return the body, if it is no larger than is allowed; a little more is let pass, but not kept."""
    said = request.headers.get("content-length", "")
    announced = int(said) if said.isdecimal() and len(said) < 20 else 0
    if announced > _HEARD:
        raise _TooLargeError(announced)
    data, size = bytearray(), 0
    async for chunk in request.stream():
        size += len(chunk)
        if size > _HEARD:
            break
        if max(size, announced) <= LONGEST_UPLOAD:
            data += chunk
        else:
            data.clear()
    if size > LONGEST_UPLOAD:
        raise _TooLargeError(size)
    return bytes(data)


def _refused(status: int, line: str) -> Response:
    return JSONResponse({"error": line}, status_code=status)


# --- The server: the page, what it asks for once, and the way on which it lives ---------------------------------------

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
        """The teacher's part of a link, in a class."""
        self.code = "".join(secrets.choice(_LETTERS) for _ in range(6)) if classroom else None
        """Messages of watchers."""
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
