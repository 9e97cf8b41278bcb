"""Logs as they are kept: packed, and only ever unpacked in a process of their own."""

from __future__ import annotations

import pickle
import zlib

from servotwin.errors import InputError
from servotwin.logs import Log


def logs_of(packed: bytes) -> list[Log]:
    """Return all logs that were kept.

    Examples
    --------
    >>> log = Log(name="a", time=[0.0, 1.0, 2.0], command=[0.0, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.5, 1.0]})
    >>> logs_of(zlib.compress(pickle.dumps([log])))[0].name
    'a'
    """
    found: list[Log] = pickle.loads(zlib.decompress(packed))  # by our own process
    return found


def run_of(packed: bytes, run: int) -> Log:
    """Return one of the logs.

    Raises
    ------
    InputError
        If there is none of this number.
    """
    logs = logs_of(packed)
    if not 0 <= run < len(logs):
        raise InputError("run of the log", got=run, allowed=f"a whole number from 0 to {len(logs) - 1}")
    return logs[run]
