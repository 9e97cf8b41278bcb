"""What a reader mends in a file when it is asked to, by name."""

from __future__ import annotations

from collections.abc import Mapping

TORN, RESET, DROP, SPREAD, CLOCK16, THOUSANDS = (
    "torn", "reset", "drop-repeated", "spread-repeated", "clock16", "thousands")
MENDS: Mapping[str, str] = {
    TORN: "leaves out rows that are cut, joined or hold no number",
    RESET: "makes a log of its own of what comes after the time began again",
    DROP: "leaves out rows with the stamp of the row before",
    SPREAD: "spreads rows with one stamp between their neighbours",
    CLOCK16: "joins times of a counter of 16 bits",
    THOUSANDS: "takes marks within whole numbers for thousands separators",
}
"""What a reader mends when it is asked to; the certain faults are mended unasked."""
