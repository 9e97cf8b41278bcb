"""The board as the computer sees it: orders that are answered, and what it tells by itself."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from servotwin.bench.backends.board_backend import Backend
from servotwin.bench.wire.frames import Clock, Frame, Splitter, protocol, to_wire
from servotwin.errors import BenchError, InputError

NAME = "servotwn"  # of the firmware, as it says it
_ANSWER = 0.25  # s until an order is given once more
_SHORTEST = 1e-3  # s of a wait
_TRIES = 4
_START = 3.0  # s that a board needs at most after its port was opened: an Uno resets then
_FIRMWARE = "servotwin bench flash puts the firmware onto it"


class Message(NamedTuple):
    """Frames that came over the wire.

    Parameters
    ----------
    name : str
    time : float
        Of the board [s], from its first message on.
    values : mapping
        Its fields.
    """

    name: str
    time: float
    values: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Identity:
    """The identity of a board.

    Parameters
    ----------
    firmware : str
        Version.
    protocol : int
        Version.
    mode : str
    cause : int
        Of its last reset, the chip's own bits.
    """

    firmware: str
    protocol: int
    mode: str
    cause: int


class Board:
    """A board behind a backend.

    Parameters
    ----------
    backend : Backend
    listen : callable, optional
        Called with each message that answers nothing: samples, edges, events.

    Examples
    --------
    >>> from servotwin.bench.backends.emulated import MockBackend
    >>> board = Board(MockBackend())
    >>> board.open().mode
    'computer'
    >>> board.order("pulse", width=3000, period=40000)["room"]
    96
    >>> board.close()
    """

    def __init__(self, backend: Backend, listen: Callable[[Message], None] | None = None) -> None:
        self.backend = backend
        self.listen: Callable[[Message], None] = listen or (lambda message: None)
        self.splitter = Splitter()
        self.strange = 0  # frames that were whole but no message
        self._clock = Clock()
        self._sequence = 0
        self.time = 0.0  # of the board's last message [s]

    def open(self) -> Identity:
        """Take the wire and ask the board who it is.

        Raises
        ------
        BenchError
            If nobody answers, or not this firmware.
        """
        self.backend.open()
        try:
            return self._greeted()
        except BaseException:
            self.backend.close()
            raise

    def _greeted(self) -> Identity:
        for _ in range(round(_START / _ANSWER)):
            answer = self._asked("hello", {})
            if answer is not None:
                break
        else:
            heard = self.splitter.bad + self.strange
            problem = (f"answers, but not as the firmware of the bench does ({_FIRMWARE})" if heard
                       else f"no answer from a board ({_FIRMWARE}; is it the right port?)")
            raise BenchError(self.backend.name, problem)
        values = answer.values
        if values["name"] != NAME:
            raise BenchError(self.backend.name, f"another firmware answers, {values['name']!r} ({_FIRMWARE})")
        return Identity(firmware=f"{values['major']}.{values['minor']}", protocol=int(protocol().numbers["version"]),
                        mode=protocol().word("mode", values["mode"]), cause=values["cause"])

    def order(self, name: str, **values: Any) -> Mapping[str, Any]:
        """Give an order, until it is answered, and return the answer's fields.

        Raises
        ------
        BenchError
            If there is no answer, or the board refuses.
        """
        for _ in range(_TRIES):
            answer = self._asked(name, values)
            if answer is not None:
                result = answer.values.get("result", 0)
                if result != protocol().words["result"]["ok"] and not self._there_already(name, values, answer):
                    raise BenchError(self.backend.name, f"the board refuses {name!r}: "
                                                        f"{protocol().word('result', result)}")
                return answer.values
        raise BenchError(self.backend.name, f"the board does not answer {name!r} any more")

    def _there_already(self, name: str, values: Mapping[str, Any], answer: Message) -> bool:
        """Say whether points were taken when they came first, and only the answer was lost."""
        if name != "points" or protocol().word("result", answer.values["result"]) != "order":
            return False
        return bool(answer.values["value"] == (values["first"] + len(values["points"])) % 2**16)

    def wait(self, seconds: float) -> None:
        """Let a time of the board pass; what it tells meanwhile is listened to, and it hears that we are there."""
        self.order("ask")
        until = self.time + seconds
        while self.time < until:
            self.take(min(_ANSWER, max(until - self.time, _SHORTEST)))
            self.order("ask")

    def take(self, timeout: float) -> None:
        """Listen to what has come; wait for at most `timeout` [s] where nothing has."""
        for message in self._read(timeout):
            self.listen(message)

    def limp(self) -> None:
        """Torque off; never raises. Where nobody hears, the board stops by itself after a second of silence."""
        for _ in range(_TRIES):
            try:
                if self._asked("limp", {}) is not None:
                    return
            except Exception:  # a cut wire: silence does it
                return

    def close(self) -> None:
        """Give the wire back."""
        with contextlib.suppress(BenchError):
            self.backend.close()

    def _asked(self, name: str, values: Mapping[str, Any]) -> Message | None:
        """Send a message and return the answer to it, None where there is none in time."""
        kind = protocol().kinds[name]
        self._sequence = (self._sequence + 1) % 256
        self.backend.send(to_wire(Frame(kind.number, self._sequence, 0, kind.pack(values))))
        sequence = self._sequence
        waited = 0.0
        while waited < _ANSWER:
            found = None
            for message in self._read(_ANSWER / 5):
                if message.name == kind.answer and message.values["answers"] == sequence:
                    found = message
                else:
                    self.listen(message)
            if found is not None:
                return found
            waited += _ANSWER / 5
        return None

    def _read(self, timeout: float) -> list[Message]:
        found = []
        for frame in self.splitter.feed(self.backend.read(timeout)):
            kind = protocol().kind(frame.kind)
            try:
                if kind is None or kind.sender != "board":
                    raise InputError("kind of message", got=frame.kind)
                values = kind.unpack(frame.payload)
            except InputError:  # whole, but of another version of the firmware
                self.strange += 1
                continue
            self.time = self._clock.seconds(frame.time)
            found.append(Message(kind.name, self.time, values))
        return found
