"""What boards print when they start, in the middle of a log: why they were reset, and the supply just before."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from servotwin.tables.reading import TextTable

_ESP32 = re.compile(r"rst:0x[0-9a-f]+ \((\w+)\)", re.IGNORECASE)  # of the ROM's boot loader: RESET_REASON in rom/rtc.h
_BROWNOUT = "Brownout detector was triggered"  # of ESP-IDF and the Arduino core
_AVR = re.compile(r"\bMCUSR\s*[=:]?\s*(0x[0-9a-f]+|0b[01]+|\d+)", re.IGNORECASE)
_CAUSES = {"BROWN": "by its brown-out detector: its supply was too low", "POWERON": "by power that came on",
           "WDT": "by its watchdog", "SW": "by its program", "DEEPSLEEP": "after deep sleep", "EXT": "from outside"}
_MCUSR = (("power that came on", 1), ("its reset pin", 2), ("its brown-out detector: its supply was too low", 4),
          ("its watchdog", 8))
"""Bits PORF, EXTRF, BORF, WDRF of an ATmega328P's MCUSR (its sheet, MCU status register)."""


class BootText(NamedTuple):
    """A line that a board printed when it started: which, what board, and why it was reset."""

    line: int
    board: str
    why: str


def boot_text(line: int, text: str) -> BootText | None:
    """Return what a line of text says of a reset; None where it says nothing.

    Examples
    --------
    >>> boot_text(7, "rst:0xf (RTCWDT_BROWN_OUT_RESET),boot:0x13").why
    'by its brown-out detector: its supply was too low'
    >>> boot_text(9, "MCUSR=0x04"), boot_text(1, "entry 0x400805f0")
    (BootText(line=9, board='AVR', why='by its brown-out detector: its supply was too low'), None)
    """
    if _BROWNOUT in text:
        return BootText(line, "ESP32", _CAUSES["BROWN"])
    if found := _ESP32.search(text):
        name = found[1].upper()
        why = next((words for part, words in _CAUSES.items() if part in name), f"({name})")
        return BootText(line, "ESP32", why)
    if found := _AVR.search(text):
        bits = int(found[1], 0) if found[1][:2].lower() in ("0x", "0b") else int(found[1])
        causes = [words for words, bit in _MCUSR if bits & bit]
        return BootText(line, "AVR", f"by {' and '.join(causes)}") if causes else None
    return None


def boot_remarks(table: TextTable, measured: Mapping[str, NDArray[np.float64]]) -> tuple[str, ...]:
    """Return a sentence on each reset that a board tells of behind a row of a table, with the supply just before.

    Parameters
    ----------
    table : TextTable
    measured : mapping of str to ndarray, shape (n,)
        Of its rows.
    """
    if not table.breaks:
        return ()
    lines = table.path.read_text(encoding=table.encoding, errors="replace").splitlines()
    places = np.array([row.line for row in table.rows])
    found: dict[int, BootText] = {}
    for at in table.breaks:
        text = boot_text(at, lines[at - 1]) if 0 < at <= len(lines) else None
        k = int(np.searchsorted(places, at)) - 1
        if text is None or k < 0 or not all(
                n in table.breaks or not lines[n - 1].strip() for n in range(int(places[k]) + 1, at)):
            continue  # behind a row of another log in this file
        if k not in found or text.why == _CAUSES["BROWN"]:
            found[k] = text
    return tuple(_words(text, {name: float(values[k]) for name, values in measured.items()})
                 for k, text in found.items())


def _words(text: BootText, last: Mapping[str, float]) -> str:
    seen = [f"{last[name]:.3g} {unit}" for name, unit in (("bus_voltage", "V"), ("supply_current", "A"))
            if math.isfinite(last.get(name, math.nan))]
    before = f"; just before: {', '.join(seen)}" if seen else ""
    return f"line {text.line}: the board ({text.board}) was reset {text.why}{before}"
