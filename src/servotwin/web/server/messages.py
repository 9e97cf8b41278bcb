"""The wire of the page: messages in JSON, and pushes as a header with numbers behind it."""

from __future__ import annotations

import asyncio
import json
import math
from array import array
from collections import deque
from collections.abc import Callable
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from starlette.websockets import WebSocket

    from servotwin.web.live import Push


# --- How much one visitor may ask for ---------------------------------------------------------------------------------

MOST_VISITORS = 8
MOST_WATCHERS = 40
LONGEST_MESSAGE = 1_000_000  # bytes: the text of a scene
LONGEST_UPLOAD = 20_000_000  # bytes


class Allowance:
    """So many things a second, and so many at once.

    Parameters
    ----------
    rate : float
        [1/s]
    burst : float
        At once.

    Examples
    --------
    >>> allowance = Allowance(rate=10.0, burst=2.0)
    >>> [allowance.take(now) for now in (0.0, 0.0, 0.0, 0.1)]
    [True, True, False, True]
    """

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst = rate, burst
        self._left, self._at = burst, 0.0

    def take(self, now: float) -> bool:
        """Return whether one more is allowed at a time on the wall [s]."""
        self._left = min(self._burst, self._left + self._rate * max(now - self._at, 0.0))
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


# --- The wire of the page: messages in JSON, and pushes as a header with numbers behind it ----------------------------

VERSION = 1
_BYTES = 8  # of a number
_DEEPEST = 6  # tables in tables of a message
_LONGEST_LINE = 300  # characters of what is sent


def message_of(text: object) -> dict[str, Any]:
    """Return a message that a page sent.

    Raises
    ------
    InputError
        If it is none: no JSON object, or numbers that are not finite.

    Examples
    --------
    >>> message_of('{"run": true, "id": 3}')
    {'run': True, 'id': 3}
    """
    if not isinstance(text, str):
        raise InputError("message", got="bytes", allowed="text: one object in JSON")
    try:
        found = json.loads(text, parse_constant=_refused)
    except RecursionError:
        raise InputError("message", got="tables nested too deeply", allowed="one object in JSON") from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError("message", got=text[:60], allowed="one object in JSON") from None
    if not isinstance(found, dict):
        raise InputError("message", got=text[:60], allowed="one object in JSON")
    _check_depth(found, _DEEPEST)
    return found


def id_of(message: Mapping[str, Any]) -> int | None:
    """Return the number by which a page identifies its message; None without.

    Examples
    --------
    >>> id_of({"id": 7}), id_of({"id": "seven"})
    (7, None)
    """
    number = message.get("id")
    return number if isinstance(number, int) and not isinstance(number, bool) and abs(number) < 2**53 else None


def text_of(message: Mapping[str, Any]) -> str:
    """Return a message to a page; what is no finite number becomes null.

    Examples
    --------
    >>> text_of({"time": float("nan")})
    '{"time":null}'
    """
    try:
        return json.dumps(message, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(_finite(message), separators=(",", ":"))


def packed(header: Mapping[str, Any], push: Push) -> bytes:
    """Return a push as bytes: length of its header, header, zeros up to a multiple of 8, then numbers.

    Parameters
    ----------
    header : mapping
        Sent beside the numbers.
    push : Push

    Examples
    --------
    >>> from servotwin.web.live import Push, ServoPush
    >>> data = packed({}, Push(0.5, (ServoPush(("time", "output_angle"), [(0.5, 1.25)], [(0.0, 1.5e-3)]),), []))
    >>> len(data) % 8, data[-32:-24] == array("d", [0.5]).tobytes()
    (0, True)
    """
    servos = ",".join(f'{{"n":{len(one.points)},"m":{len(one.pulses)},"columns":{_listed(one.columns)}}}'
                      for one in push.servos)
    told = text_of({"t": push.time, **header, "events": push.events})
    text = f'{told[:-1]},"servos":[{servos}]}}'.encode()
    numbers = array("d")
    for one in push.servos:
        numbers.extend(chain.from_iterable(one.points))
        numbers.extend(chain.from_iterable(one.pulses))
    if array("H", [1]).tobytes()[0] == 0:  # a machine that keeps numbers the other way round
        numbers.byteswap()
    gap = -(4 + len(text)) % _BYTES
    return b"".join([len(text).to_bytes(4, "little"), text, bytes(gap), numbers.tobytes()])


def line_of(error: Exception) -> str:
    """Return what to tell of an error, in one line.

    Examples
    --------
    >>> line_of(InputError("speed", got=0, allowed="more"))
    'speed: got 0, allowed: more'
    """
    line = " ".join(str(error).split())
    return line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]} ..."


@lru_cache(maxsize=64)
def _listed(columns: tuple[str, ...]) -> str:
    """Return names in JSON: the same in push after push."""
    return json.dumps(columns, separators=(",", ":"))


def _refused(word: str) -> Any:
    raise InputError("message", got=word, allowed="finite numbers")


def _check_depth(value: Any, left: int) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError("message", got=value, allowed="finite numbers")
    if isinstance(value, dict | list):
        if left == 0:
            raise InputError("message", got="tables nested too deeply", allowed=f"at most {_DEEPEST} deep")
        for one in value.values() if isinstance(value, dict) else value:
            _check_depth(one, left - 1)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value



class Outbox:
    """The way to one browser.

    A push that comes while another is on its way replaces the one that waits; `missed` counts those.

    Parameters
    ----------
    socket : WebSocket
        That was accepted.
    """

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._texts: deque[str] = deque()
        self._letters = 0  # of all texts
        self._push: Callable[[], bytes] | None = None
        self._something, self._room = asyncio.Event(), asyncio.Event()
        self._room.set()
        self.missed = self._sent = self._taken = 0
        self.closed = False

    @property
    def free(self) -> bool:
        """Whether nothing waits."""
        return self._push is None and not self._texts

    def text(self, text: str) -> None:
        """Send a message; a browser that takes none of many is given up."""
        if len(self._texts) >= _MOST_TEXTS or self._letters > _MOST_LETTERS:
            self.closed = True
        else:
            self._texts.append(text)
            self._letters += len(text)
            if len(self._texts) >= _FEW:
                self._room.clear()
        self._something.set()

    def push(self, packed: Callable[[], bytes]) -> None:
        """Send a push, unless a later one comes before its turn: only then it is packed."""
        if self._push is not None:
            self.missed += 1
        self._push = packed
        self._something.set()

    async def room(self) -> None:
        """Wait until few messages wait: who does not listen is not listened to."""
        await self._room.wait()

    async def deliver(self) -> None:
        """Send what waits until the browser is gone, or does not take it."""
        sending, watching = asyncio.create_task(self._send()), asyncio.create_task(self._watch())
        try:
            await asyncio.wait([sending, watching], return_when=asyncio.FIRST_COMPLETED)
        finally:
            sending.cancel()
            watching.cancel()
            await asyncio.gather(sending, watching, return_exceptions=True)

    async def _send(self) -> None:
        while not self.closed:
            await self._something.wait()
            self._something.clear()
            while not (self.closed or self.free):
                self._sent += 1
                await self._send_next()
                self._taken = self._sent

    async def _watch(self) -> None:
        """Return when a message has been on its way for too long: one look for all is cheaper than a timer for each."""
        last = 0
        while self._taken == self._sent or self._sent != last:
            last = self._sent
            await asyncio.sleep(SLOWEST)

    async def _send_next(self) -> None:
        if self._texts:
            text = self._texts.popleft()
            self._letters -= len(text)
            if len(self._texts) < _FEW:
                self._room.set()
            await self._socket.send_text(text)
            return
        push, self._push = self._push, None
        if push is not None:
            await self._socket.send_bytes(push())

_MOST_TEXTS = 256  # that wait: who takes none of them is gone
_MOST_LETTERS = 20_000_000  # of them, beside the one that comes
_FEW = 4  # texts that wait, and the browser may say more
SLOWEST = 30.0
"""How long a browser may take over one message [s]."""
