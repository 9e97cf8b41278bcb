"""Frames on the wire: length, version, sequence, kind, time, payload, CRC-16; stuffed, so that 0 begins anew."""

from __future__ import annotations

import binascii
import struct
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any, NamedTuple

from servotwin.errors import InputError

# --- The text of the protocol, read once: numbers, names, and the messages with their fields --------------------------

_PLAIN = {"u8": "B", "u16": "H", "u32": "I", "text8": "8s"}
_REPEATED = {"points": "HHH", "counts": "H"}  # what fills the rest of a payload


@dataclass(frozen=True)
class Field:
    """A field of a message.

    Parameters
    ----------
    name, type, unit, text : str
        As the text of the protocol has them.
    """

    name: str
    type: str
    unit: str
    text: str


@dataclass(frozen=True)
class Kind:
    """A kind of message.

    Parameters
    ----------
    name : str
    number : int
        On the wire.
    sender : {"computer", "board"}
    text : str
        Purpose of the message.
    fields : tuple of Field
    answer : str
        Name of the message that answers it; empty where none does.
    """

    name: str
    number: int
    sender: str
    text: str
    fields: tuple[Field, ...]
    answer: str = ""

    def pack(self, values: Mapping[str, Any]) -> bytes:
        """Return the payload.

        Raises
        ------
        InputError
            If a field is missing, unknown, or does not fit into its type.

        Examples
        --------
        >>> protocol().kinds["pulse"].pack({"width": 3000, "period": 40000}).hex()
        'b80b409c'
        """
        if set(values) != {one.name for one in self.fields}:
            raise InputError(f"message {self.name!r}", got=", ".join(values) or "nothing",
                             allowed=", ".join(one.name for one in self.fields) or "no fields")
        parts = []
        for one in self.fields:
            value = values[one.name]
            try:
                if one.type in _REPEATED:
                    form = struct.Struct("<" + _REPEATED[one.type])
                    parts += [form.pack(*(item if isinstance(item, tuple | list) else (item,))) for item in value]
                else:
                    text = one.type.startswith("text")
                    parts.append(struct.pack("<" + _PLAIN[one.type], value.encode() if text else value))
            except (struct.error, TypeError) as error:
                raise InputError(f"message {self.name!r}: {one.name}", got=value, allowed=f"{one.type} ({error})"
                                 ) from None
        return b"".join(parts)

    def unpack(self, payload: bytes) -> dict[str, Any]:
        """Return the fields of a payload.

        Raises
        ------
        InputError
            If it has another length.

        Examples
        --------
        >>> protocol().kinds["pulse"].unpack(bytes.fromhex("b80b409c"))
        {'width': 3000, 'period': 40000}
        """
        values: dict[str, Any] = {}
        at = 0
        for one in self.fields:
            rest = len(payload) - at
            form = struct.Struct("<" + (_REPEATED.get(one.type) or _PLAIN[one.type]))
            if one.type in _REPEATED:
                if rest % form.size:
                    raise self._wrong_length(payload)
                items = [item if len(item) > 1 else item[0] for item in form.iter_unpack(payload[at:])]
                values[one.name], at = items, len(payload)
            elif rest < form.size:
                raise self._wrong_length(payload)
            else:
                (value,) = form.unpack_from(payload, at)
                values[one.name] = value.rstrip(b"\0 ").decode("ascii", "replace") if one.type == "text8" else value
                at += form.size
        if at != len(payload):
            raise self._wrong_length(payload)
        return values

    def _wrong_length(self, payload: bytes) -> InputError:
        return InputError(f"message {self.name!r}", got=f"{len(payload)} bytes", allowed="what its fields take")


@dataclass(frozen=True)
class Protocol:
    """The protocol of the text.

    Parameters
    ----------
    numbers : mapping of str to number
        `version`, `baud`, `silence`, …
    words : mapping of str to mapping of str to int
        Tables of names: `channels`, `reference`, `rate`, `mode`, `result`, `event`.
    kinds : mapping of str to Kind
        Messages by name.
    """

    numbers: Mapping[str, float]
    words: Mapping[str, Mapping[str, int]]
    kinds: Mapping[str, Kind]

    def kind(self, number: int) -> Kind | None:
        """Return the message with this number, None if there is none."""
        return next((kind for kind in self.kinds.values() if kind.number == number), None)

    def word(self, table: str, number: int) -> str:
        """Return the name of a number in a table, or the number itself as text.

        Examples
        --------
        >>> protocol().word("event", 4), protocol().word("event", 99)
        ('silent', '99')
        """
        return next((name for name, value in self.words[table].items() if value == number), str(number))

    @property
    def tick(self) -> float:
        """Of the board's clock [s]."""
        return 1.0 / self.numbers["ticks_per_second"]

    def ticks(self, seconds: float) -> int:
        """Return a time in whole ticks of the board's clock, the nearest.

        Examples
        --------
        >>> protocol().ticks(1.5e-3)
        3000
        """
        return round(seconds * self.numbers["ticks_per_second"])


@lru_cache(maxsize=1)
def protocol() -> Protocol:
    """Return the protocol of the bench.

    Examples
    --------
    >>> protocol().numbers["baud"], protocol().kinds["hello"].answer
    (500000, 'identity')
    """
    text = tomllib.loads(files("servotwin.bench.wire").joinpath("protocol.toml").read_text(encoding="utf-8"))
    kinds = {}
    for one in text.pop("message"):
        fields = tuple(Field(**field) for field in one["fields"])
        kinds[one["name"]] = Kind(one["name"], one["kind"], one["from"], one["text"], fields, one.get("answer", ""))
    words = {name: MappingProxyType(table) for name, table in text.items() if isinstance(table, dict)}
    numbers = {name: value for name, value in text.items() if name not in words}
    return Protocol(MappingProxyType(numbers), MappingProxyType(words), MappingProxyType(kinds))

# --- Frames on the wire -----------------------------------------------------------------------------------------------

_HEAD = struct.Struct("<BBBBI")
_CRC = struct.Struct("<H")
_FIRST = 0xFFFF  # what the CRC starts with
_BLOCK = 254  # bytes that one length byte of the stuffing can speak for


class Frame(NamedTuple):
    """A frame that arrived whole.

    Parameters
    ----------
    kind : int
    sequence : int
        Of the sender's frames, modulo 256.
    time : int
        Of the sender [ticks], modulo 2³².
    payload : bytes
    """

    kind: int
    sequence: int
    time: int
    payload: bytes


def to_wire(frame: Frame) -> bytes:
    """Return the bytes of a frame, with a 0 before and after.

    Examples
    --------
    >>> to_wire(Frame(1, 7, 0, b"")).hex()
    '000104010701010101034feb00'
    """
    head = _HEAD.pack(len(frame.payload), int(protocol().numbers["version"]), frame.sequence, frame.kind, frame.time)
    body = head + frame.payload
    return b"\0" + stuffed(body + _CRC.pack(binascii.crc_hqx(body, _FIRST))) + b"\0"


def from_wire(block: bytes) -> Frame | None:
    """Return the frame between two zeros, None if it is not whole.

    Examples
    --------
    >>> from_wire(to_wire(Frame(1, 7, 0, b"")).strip(bytes(1)))
    Frame(kind=1, sequence=7, time=0, payload=b'')
    """
    body = unstuffed(block)
    if body is None or len(body) < _HEAD.size + _CRC.size:
        return None
    length, version, sequence, kind, time = _HEAD.unpack_from(body)
    if length != len(body) - _HEAD.size - _CRC.size or version != protocol().numbers["version"]:
        return None
    if binascii.crc_hqx(body[:-_CRC.size], _FIRST) != _CRC.unpack_from(body, len(body) - _CRC.size)[0]:
        return None
    return Frame(kind, sequence, time, body[_HEAD.size:-_CRC.size])


def stuffed(data: bytes) -> bytes:
    """Return data without zeros by consistent overhead byte stuffing (Cheshire & Baker 1999).

    Examples
    --------
    >>> stuffed(bytes([1, 0, 0, 2])).hex()
    '0201010202'
    """
    out = bytearray()
    parts = data.split(b"\0")
    for k, part in enumerate(parts):
        while len(part) >= _BLOCK:
            out += b"\xff" + part[:_BLOCK]
            part = part[_BLOCK:]
            if not part and k == len(parts) - 1:
                return bytes(out)
        out.append(len(part) + 1)
        out += part
    return bytes(out)


def unstuffed(data: bytes) -> bytes | None:
    """Return what was stuffed, None if nothing can have been.

    Examples
    --------
    >>> unstuffed(stuffed(bytes(300))) == bytes(300), unstuffed(bytes([9, 1]))
    (True, None)
    """
    out = bytearray()
    at = 0
    while at < len(data):
        code = data[at]
        part = data[at + 1:at + code]
        if code == 0 or len(part) != code - 1 or 0 in part:
            return None
        out += part
        at += code
        if code <= _BLOCK and at < len(data):
            out.append(0)
    return bytes(out)


class Splitter:
    """Takes bytes as they come and gives the frames in them; counts what was no frame, and what never came.

    Parameters
    ----------
    bad : int
        Pieces between zeros that were no whole frame, so far.
    lost : int
        Frames that the sender's numbers say are missing, so far: 255 at most between two that came.

    Examples
    --------
    >>> splitter = Splitter()
    >>> wire = to_wire(Frame(1, 7, 0, b"")) + bytes([3, 3]) + to_wire(Frame(1, 9, 0, b""))
    >>> [frame.sequence for frame in splitter.feed(wire)], splitter.bad, splitter.lost
    ([7, 9], 1, 1)
    """

    def __init__(self) -> None:
        self.bad = 0
        self.lost = 0
        self._rest = b""
        self._last: int | None = None
        self._overlong = False

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that these bytes complete."""
        found = []
        *blocks, self._rest = (self._rest + data).split(b"\0")
        for block in blocks:
            if self._overlong:  # counted when it became too long
                self._overlong = False
            elif block:
                frame = from_wire(block)
                if frame is None:
                    self.bad += 1
                else:
                    if self._last is not None:
                        self.lost += (frame.sequence - self._last - 1) % 256
                    self._last = frame.sequence
                    found.append(frame)
        whole = _HEAD.size + int(protocol().numbers["longest_payload"]) + _CRC.size
        if len(self._rest) > whole + whole // _BLOCK + 1:  # the most bytes of a stuffed frame
            self.bad += not self._overlong
            self._rest, self._overlong = b"", True
        return found

    def again(self) -> None:
        """Forget the sender's last number: it begins anew, after a reset say."""
        self._last = None


class Clock:
    """Time of the board since the first look [s], from its ticks, which wrap every 36 minutes.

    Looks may be out of order by less than a quarter of that.

    Examples
    --------
    >>> clock = Clock()
    >>> clock.seconds(2**32 - 2), clock.seconds(2**32 - 1), clock.seconds(4)
    (0.0, 5e-07, 3e-06)
    """

    def __init__(self) -> None:
        self._first: int | None = None
        self._ticks = 0

    def seconds(self, ticks: int) -> float:
        """Return the time of a look, which may be a little before the last one."""
        if self._first is None:
            self._first = self._ticks = ticks
        ahead = (ticks - self._ticks) % 2**32
        if ahead >= 2**31:
            ahead -= 2**32
        now = self._ticks + ahead
        self._ticks = max(self._ticks, now)
        return (now - self._first) * protocol().tick
