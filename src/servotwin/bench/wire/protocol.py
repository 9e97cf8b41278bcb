"""The text of the protocol, read once: numbers, names, and the messages with their fields."""

from __future__ import annotations

import struct
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from servotwin.errors import InputError

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
        What it is for.
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
    """What the text says.

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
