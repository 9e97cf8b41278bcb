"""From an exception to one line, an exit code and a JSON object."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any

from servotwin import errors
from servotwin.cli.interrupts import CODE
from servotwin.errors import ServotwinError

_LONGEST = 600  # characters; what is longer is cut in its middle


@dataclass(frozen=True, kw_only=True)
class Failure:
    """The message to the user.

    Parameters
    ----------
    message : str
        One line.
    code : int
        Exit code.
    kind : str
        Name of the error.
    data : dict
        Fields of the error: what, got, allowed.
    """

    message: str
    code: int
    kind: str
    data: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return one JSON object, on one line.

        Examples
        --------
        >>> Failure(message="no", code=2, kind="InputError").to_json()
        '{"error": {"type": "InputError", "message": "no"}}'
        """
        return json.dumps({"error": {"type": self.kind, "message": self.message, **self.data}})


def describe(error: BaseException) -> Failure:
    """Return what to say about an exception.

    Examples
    --------
    >>> from servotwin.errors import InputError
    >>> describe(InputError("duration", got=0.0, allowed="a positive number")).message
    'duration: got 0.0, allowed: a positive number'
    >>> describe(KeyboardInterrupt()).code
    130
    """
    kind = type(error).__name__
    if isinstance(error, KeyboardInterrupt) or kind == "Abort":
        return Failure(message="interrupted", code=CODE, kind="KeyboardInterrupt")
    if isinstance(error, ServotwinError):
        return Failure(message=one_line(str(error)), code=2, kind=kind, data=_data(error))
    if hasattr(error, "format_message"):  # of the command line's parser, whichever version of it
        return Failure(message=one_line(error.format_message()), code=2, kind="UsageError")
    if isinstance(error, BrokenPipeError):
        return Failure(message="the reader of the output went away before the end (broken pipe)", code=2, kind=kind)
    if isinstance(error, OSError):
        return Failure(message=one_line(_of_system(error)), code=2, kind=kind)
    if isinstance(error, MemoryError):
        return Failure(message="not enough memory for this; ask for fewer outputs (a shorter --duration or a larger "
                               "--output-step)", code=2, kind="MemoryError")
    return Failure(message=one_line(f"a mistake of servotwin itself ({kind}: {error}); please report it with the "
                                    "traceback, which SERVOTWIN_TRACEBACK=1 shows"), code=1, kind=kind)


def one_line(text: str) -> str:
    r"""Return a text as one printable line.

    Examples
    --------
    >>> one_line("two\nlines and a \x00")
    'two lines and a \\x00'
    """
    line = errors.one_line(" ".join(text.split()))
    half = _LONGEST // 2
    return line if len(line) <= _LONGEST else f"{line[:half]} ... {line[-half:]}"


def _of_system(error: OSError) -> str:
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {reason}" if error.filename is not None else reason


def _data(error: ServotwinError) -> dict[str, Any]:
    found = {name: getattr(error, name, None) for name in ("what", "got", "allowed", "suggestion", "status", "time")}
    return {name: _plain(value) for name, value in found.items() if value is not None}


def _plain(value: object) -> Any:
    if isinstance(value, bool | str) or (isinstance(value, int | float) and math.isfinite(value)):
        return value if not isinstance(value, str) else one_line(value)
    return one_line(repr(value))
