"""Who is let in: by the name under which the server was asked, and by the page that asks."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from collections.abc import Iterable

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
                               "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff", "referrer-policy": "no-referrer", "cache-control": "no-cache",
    "cross-origin-opener-policy": "same-origin", "cross-origin-resource-policy": "same-origin",
}
"""What every answer says to a browser."""
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
