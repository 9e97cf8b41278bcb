"""A log that a page hands in: who may, how large it may be, and what is answered."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response

from servotwin.errors import InputError, ServotwinError
from servotwin.web.server.limits import LONGEST_UPLOAD
from servotwin.web.server.wire import line_of

if TYPE_CHECKING:
    from starlette.requests import Request

    from servotwin.web.server.own.desk import Desk

_SLOWEST = 120.0  # s for the whole of a log to arrive
_HEARD = 2 * LONGEST_UPLOAD  # bytes that are let pass unkept, so that a browser hears why its log was refused
_LONGEST_LABEL = 80
TOKEN = "x-visitor"
"""The header that says whose log it is."""


async def take_log(request: Request, desk: Desk) -> Response:
    """Take a log and read it; answer how it was read.

    What was taken but cannot be read is answered with a line, too: it can be read again with other words.

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
