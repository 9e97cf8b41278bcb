"""Every exception that servotwin raises: one tree, and each carries what was wrong as data.

A message is one line made of three parts: what was looked at, what was got, and what is allowed.
"""

from __future__ import annotations

import difflib
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


SUGGESTIONS = 5
NEAR = 0.4  # share of letters that two names have in common, in their order
LONGEST_NAME = 200
LONGEST_SHOWN = 120  # letters of a value in a message
FEWEST_LETTERS = 3  # that say something where another name holds them
BEGINS, HOLDS = 3.0, 2.0  # how near such a name is at least
HIDDEN = re.compile(r"[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u206f\ud800-\udfff\ufff9-\ufffb"
                    r"\ufffe\uffff]")
"""Invisible parts of a text: control and bidirectional characters, line ends, halves of characters, none."""


def one_line(text: str) -> str:
    r"""Return a text as one line that shows all of it: what is not printable as Python writes it.

    Examples
    --------
    >>> one_line("two\nlines")
    'two\\nlines'
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class ServotwinError(Exception):
    """Root of all exceptions of this package."""


class InputError(ServotwinError, ValueError):
    """Something that the caller gave is not usable.

    Parameters
    ----------
    what : str
        The thing looked at, for example ``"motor.armature_resistance"``.
    got : object, optional
        The value that was given.
    allowed : str, optional
        Values that would have been accepted.

    Examples
    --------
    >>> str(InputError("duration", got=0.0, allowed="a positive number of seconds"))
    'duration: got 0.0, allowed: a positive number of seconds'
    """

    def __init__(self, what: str, got: object = None, allowed: str | None = None) -> None:
        self.what = what
        self.got = got
        self.allowed = allowed
        super().__init__(self._message())

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by state: subclasses have other constructors."""
        return (_rebuild, (type(self), self.args, self.__dict__))

    def _message(self) -> str:
        text = self.what
        if self.got is not None:
            text += f": got {_shown(self.got)}"
        if self.allowed is not None:
            text += f"{',' if self.got is not None else ':'} allowed: {self.allowed}"
        return one_line(text)  # what a person named may hold a line end or an escape sequence


class UnitError(InputError):
    """A unit that does not exist or does not fit the quantity."""


class ParameterError(InputError):
    """A servo parameter is unknown, out of its physical range, or not finite."""


class MissingParameterError(ParameterError):
    """A model requires a parameter that the servo does not have."""

    def __init__(self, model: str, servo: str, names: Iterable[str]) -> None:
        self.model = model
        self.servo = servo
        self.names = tuple(names)
        super().__init__(f"{model} needs {', '.join(self.names)}, which servo {servo!r} does not give")


class ServoFileError(InputError):
    """A servo file cannot be read or holds something wrong; names the file, the table and the key."""

    def __init__(self, file: str, problem: str, table: str | None = None, key: str | None = None,
                 got: object = None, allowed: str | None = None) -> None:
        self.file = file
        self.table = table
        self.key = key
        where = file + (f" [{table}]" if table else "") + (f" {key}" if key else "")
        super().__init__(f"{where}: {problem}", got=got, allowed=allowed)


class UnknownNameError(InputError, KeyError):
    """A name that is not in a known set; suggests the nearest one, or of a set too large to be listed the nearest five.

    Parameters
    ----------
    kind, name : str
        Kind of name that it should be, and the name that it is.
    known : iterable of str
        All that it may be.
    allowed : str, optional
        Text in place of a list of them all.
    meant : str, optional
        The one of them that people call so.

    Examples
    --------
    >>> str(UnknownNameError("servo", "sg90", ["towerpro-sg90", "towerpro-sg92r"], allowed="an id"))
    "unknown servo 'sg90'; did you mean 'towerpro-sg90' or 'towerpro-sg92r'?: allowed: an id"
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], *, allowed: str | None = None,
                 meant: str | None = None) -> None:
        self.name = name
        self.known = tuple(known)
        near = [] if meant is None else [meant]
        near += [one for one in _nearest(str(name), self.known) if one != meant]
        self.suggestions = tuple(near[:1 if allowed is None else SUGGESTIONS])
        self.suggestion = self.suggestions[0] if near else None
        hint = f"; did you mean {_either(self.suggestions)}?" if near else ""
        super().__init__(f"unknown {kind} {_shown(name)}{hint}", allowed=allowed or ", ".join(self.known) or "none")

    def __str__(self) -> str:
        return InputError._message(self)  # KeyError would print the repr


class CommandError(InputError):
    """A command signal that is malformed, or that the model cannot take."""


class LoadError(InputError):
    """A load that is malformed, or that the model cannot carry."""


class OutputExistsError(InputError):
    """An output file is there already and overwriting was not asked for."""

    def __init__(self, path: object) -> None:
        self.path = path
        super().__init__(f"{path} exists already; use --force (overwrite=True) to replace it")


class OutputError(InputError):
    """An output cannot be written."""


class MissingExtraError(ServotwinError, ImportError):
    """An optional package is needed and not installed."""

    def __init__(self, package: str, extra: str) -> None:
        self.package = package
        self.extra = extra
        super().__init__(f"{package} is needed for this: pip install 'servotwin[{extra}]'")

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the constructor's own arguments."""
        return (type(self), (self.package, self.extra))


class SimulationError(ServotwinError, RuntimeError):
    """A simulation ended before its time; raised only on request (``raise_if_failed``)."""

    def __init__(self, status: str, time: float, cause: str) -> None:
        self.status = status
        self.time = time
        self.cause = cause
        super().__init__(f"simulation ended at t = {time:.6g} s: {cause}")

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the constructor's own arguments."""
        return (type(self), (self.status, self.time, self.cause))


class BenchError(ServotwinError, OSError):
    """A bench of real or emulated hardware does not do what it should: no port, no answer, a cut wire, no tool.

    Examples
    --------
    >>> str(BenchError("port /dev/ttyUSB0", "there is no such port"))
    'port /dev/ttyUSB0: there is no such port'
    """

    def __init__(self, what: str, problem: str) -> None:
        self.what = what
        self.problem = problem
        super().__init__(f"{what}: {problem}")

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the constructor's own arguments."""
        return (type(self), (self.what, self.problem))

    def __str__(self) -> str:
        """Return one line."""
        return one_line(f"{self.what}: {self.problem}")


class PlausibilityWarning(UserWarning):
    """A number of a servo is possible, but far from those of servos: its unit is probably another."""


def _rebuild(kind: type[InputError], args: tuple[object, ...], state: dict[str, object]) -> InputError:
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(state)
    return error


def _nearest(name: str, known: tuple[str, ...]) -> list[str]:
    """Return what is near a name, the nearest first: what begins so, what holds it, what is spelled alike."""
    asked = _letters(name)
    if not 0 < len(asked) < LONGEST_NAME:
        return []
    scores: dict[str, float] = {}
    for one in known:
        letters = _letters(str(one))
        parts = (letters, *map(_letters, str(one).replace("-", ".").split(".")))
        if len(asked) >= FEWEST_LETTERS and asked in letters:
            scores[one] = (BEGINS if letters.startswith(asked) else HOLDS) + len(asked) / len(letters)
        else:
            scores[one] = max(difflib.SequenceMatcher(None, part, asked).ratio() for part in parts)
    return sorted((one for one in scores if scores[one] >= NEAR), key=lambda one: -scores[one])


def _letters(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _either(names: tuple[str, ...]) -> str:
    *most, last = map(repr, names)
    return f"{', '.join(most)} or {last}" if most else last


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN - 3] + "..."
