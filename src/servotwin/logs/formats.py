"""The formats of logs: the table of which `read_logs`, the help of commands and the documentation are made."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import Literal, NamedTuple


class LogFormat(NamedTuple):
    """A format of logs.

    Parameters
    ----------
    what : str
        Its files, in words.
    holds : {"table", "json", "dataset"}
        What the functions of its module are given: the path of a table, path and content of a JSON file, or the path
        of a dataset of several files.
    module : str
        Of `servotwin.logs`. It has `logs_of`, which gives the logs, and unless it is for tables `recognises`, which
        says of a content, or of the path of a dataset, whether it is in this format.
    """

    what: str
    holds: Literal["table", "json", "dataset"]
    module: str

    @property
    def room(self) -> ModuleType:
        """The module, loaded when it is asked for."""
        return import_module(f"servotwin.logs.{self.module}")


# one line here makes a format known
LOG_FORMATS = {
    "csv": LogFormat("tables (CSV) with or without a sidecar", "table", "csv_logs"),
    "bam": LogFormat("raw logs of BAM (JSON)", "json", "bam_logs"),
    "miuzei": LogFormat("runs of the Miuzei data (JSON)", "json", "miuzei"),
    "lerobot": LogFormat("LeRobot datasets", "dataset", "lerobot"),
}
FORMATS = ("auto", *LOG_FORMATS)  # what may be asked for


def formats_that_hold(what: str) -> dict[str, LogFormat]:
    """Return the formats of one kind, by name.

    Examples
    --------
    >>> list(formats_that_hold("json"))
    ['bam', 'miuzei']
    """
    return {name: one for name, one in LOG_FORMATS.items() if one.holds == what}
