"""The formats of logs: the table of which `read_logs`, the help of commands and the documentation are made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from servotwin import plugins

if TYPE_CHECKING:
    from servotwin.logs.columns import Column


# --- Mends of a reader, by name ---------------------------------------------------------------------------------------

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
"""Mends of a reader when it is asked to; the certain faults are mended unasked."""


# --- How a file was read: which of its columns is what, and what was passed over --------------------------------------

@dataclass(frozen=True)
class ReadColumn:
    """How one column of a file was read.

    Parameters
    ----------
    column : str
        As the header has it.
    signal : str
    unit : str
        Of its numbers, with scale and offset.
    known : str
        How this was known: "named" by a name of `servotwin`, "--columns", "sidecar", or "guessed" and from what.
    """

    column: str
    signal: str
    unit: str
    known: str

    @property
    def guessed(self) -> bool:
        """Whether it was guessed."""
        return self.known.startswith("guessed")


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How a log was read from its file.

    Parameters
    ----------
    file : str
    columns : tuple of ReadColumn
    remarks : tuple of str
        Parts that were passed over, each in one line.
    unread : tuple of str
        Columns that are none of these.
    layout : mapping of str to Column
        Of a CSV file: what its sidecar would say.

    Examples
    --------
    >>> print(Reading(columns=(ReadColumn("ms", "time", "ms", "guessed from its name"),), unread=("note",)))
    column  signal  unit  known
    ms      time    ms    guessed from its name
    not read: note
    """

    file: str = ""
    columns: tuple[ReadColumn, ...] = ()
    remarks: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    layout: Mapping[str, Column] = field(default_factory=dict, repr=False)

    def __str__(self) -> str:
        rows = [("column", "signal", "unit", "known"),
                *((one.column, one.signal, one.unit, one.known) for one in self.columns)]
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
        return "\n".join([*lines, *self.notes()])

    def notes(self) -> tuple[str, ...]:
        """Return what is said below the table: remarks, and what was not read."""
        unread = (f"not read: {', '.join(self.unread)}",) if self.unread else ()
        return (*self.remarks, *unread)



# --- The formats of logs ----------------------------------------------------------------------------------------------

class LogFormat(NamedTuple):
    """A format of logs.

    Parameters
    ----------
    what : str
        Its files, in words.
    holds : {"table", "json", "dataset"}
        Arguments of the functions of its module: the path of a table, path and content of a JSON file, or the path
        of a dataset of several files.
    module : str
        Of `servotwin.logs`, or with dots of any package. It has `logs_of`, which gives the logs, and unless it is for
        tables `recognises`, which says of a content, or of the path of a dataset, whether it is in this format.
    """

    what: str
    holds: Literal["table", "json", "dataset"]
    module: str

    @property
    def room(self) -> ModuleType:
        """The module, loaded when it is asked for."""
        return import_module(self.module if "." in self.module else f"servotwin.logs.{self.module}")


# one line here makes a format known
LOG_FORMATS = {
    "csv": LogFormat("tables (CSV) with or without a sidecar", "table", "csv_logs"),
    "bam": LogFormat("raw logs of BAM (JSON)", "json", "bam_logs"),
    "miuzei": LogFormat("runs of the Miuzei data (JSON)", "json", "miuzei"),
    "lerobot": LogFormat("LeRobot datasets", "dataset", "lerobot"),
}
FORMATS = ("auto", *LOG_FORMATS)  # what may be asked for without a plug-in


def log_formats() -> dict[str, LogFormat]:
    """Return all formats by name: those of `LOG_FORMATS`, and of plug-ins."""
    return LOG_FORMATS | _added()


@cache
def _added() -> dict[str, LogFormat]:
    return plugins.loaded("log_formats", LOG_FORMATS, use=_format)


def _format(found: Any) -> LogFormat:
    """Return a format of a plug-in whose module can be loaded."""
    if not isinstance(found, LogFormat):
        raise TypeError(f"{found!r} is no LogFormat")
    _ = found.room
    return found


def formats_that_hold(what: str) -> dict[str, LogFormat]:
    """Return the formats of one kind, by name.

    Examples
    --------
    >>> list(formats_that_hold("json"))
    ['bam', 'miuzei']
    """
    return {name: one for name, one in log_formats().items() if one.holds == what}



class Layout(NamedTuple):
    """The columns of a table: by signal, and as they are shown."""

    columns: dict[str, Column]
    shown: tuple[ReadColumn, ...]
