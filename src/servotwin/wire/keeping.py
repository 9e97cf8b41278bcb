"""A file in which the stored registers of a bus outlive the process."""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError

if TYPE_CHECKING:
    from servotwin.wire.bus import Bus

_PAUSE = 0.1  # s between two writings
_AGAIN = 1.0  # s after one that failed
_FORM = "what servotwin wire --keep has written"


class Keep:
    """The file of a bus; read at once where there is one.

    Parameters
    ----------
    path : path
    bus : Bus
    say : callable
        Told when it cannot be written, and when it can again; the bus goes on meanwhile.
    """

    def __init__(self, path: str | Path, bus: Bus, say: Callable[[str], None]) -> None:
        self.path, self._bus, self._say = Path(path), bus, say
        self._due, self._fault = -1e9, ""
        if self.path.exists():
            bus.take_kept(read_kept(self.path, bus))
        elif not self.path.parent.is_dir():
            raise InputError("--keep", got=str(path), allowed="a file in a folder that there is")

    def save(self, *, always: bool = False) -> None:
        """Write the file where something has changed, not too often unless `always`; if that fails, later again."""
        now = time.monotonic()
        if not self._bus.to_keep or (not always and now < self._due):
            return
        try:
            self._write()
        except OSError as error:
            self._due, fault = now + _AGAIN, error.strerror or str(error)
            if fault != self._fault or always:
                end = "what is stored is lost" if always else "tried again every second"
                self._say(f"registers cannot be kept in {self.path} ({fault}): {end}")
            self._fault = fault
            return
        if self._fault:
            self._say(f"registers are kept in {self.path} again")
        self._due, self._fault = now + _PAUSE, ""
        self._bus.to_keep = False  # not before: an interrupt may come at any time, and saves what is left

    def _write(self) -> None:
        text = json.dumps({"servotwin": "wire", "protocol": self._bus.protocol, "servos": self._bus.kept()}, indent=1)
        beside = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        try:
            beside.write_text(text + "\n", "utf-8")
            beside.replace(self.path)
        except OSError:
            with contextlib.suppress(OSError):
                beside.unlink()
            raise


def read_kept(path: Path, bus: Bus) -> dict[str, dict[str, int]]:
    """Return the registers by servo of a file.

    Raises
    ------
    InputError
        If it is none, or of other servos.
    """
    try:
        found: Any = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError):
        raise InputError(f"{path}", got="no JSON", allowed=_FORM) from None
    servos = found.get("servos") if isinstance(found, dict) and found.get("servotwin") == "wire" else None
    if not isinstance(servos, dict) or not all(
            isinstance(one, dict) and all(type(value) is int for value in one.values()) for one in servos.values()):
        raise InputError(f"{path}", got="something else", allowed=_FORM)
    if found.get("protocol") != bus.protocol or not set(servos) <= {str(id) for id in bus.ids}:
        raise InputError(f"{path}", got=f"{found.get('protocol')}, IDs {', '.join(servos)}",
                         allowed=f"{bus.protocol}, IDs {', '.join(str(id) for id in bus.ids)}")
    for id, one in servos.items():
        registers = bus.device(int(id)).table.registers
        unknown = next((name for name in one if name not in registers), None)
        if unknown is not None:
            raise InputError(f"{path}: servo {id}", got=unknown, allowed="names of its registers")
    return servos
