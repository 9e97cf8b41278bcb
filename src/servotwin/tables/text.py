"""The text of a file, whichever of the usual encodings it is in."""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import NamedTuple

from servotwin.errors import InputError

_HEAD = 4096  # bytes that tell what a file is
_MOST_CONTROL = 0.1  # share of control characters in a text
_ZEROS = re.compile("\0{3,}")
_NOT_TEXT = {b"PK\x03\x04": "a zip archive or an Excel workbook", b"PAR1": "a Parquet file", b"\x1f\x8b": "a gzip file",
             b"\x89PNG": "a picture", b"\xd0\xcf\x11\xe0": "an Excel workbook", b"\x89HDF": "an HDF5 file",
             b"MATLAB": "a MATLAB file", b"%PDF": "a PDF"}
NUL = "a NUL"
_UTF16 = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


class Text(NamedTuple):
    """The lines of a file.

    Parameters
    ----------
    lines : list of str
        Those that end in a line end.
    rest : str
        What stands behind the last line end.
    encoding : str
    unwritten : int
        Zeros behind the text, which a card holds where its last block was not written.
    """

    lines: list[str]
    rest: str
    encoding: str
    unwritten: int = 0


def read_bytes(path: str | Path) -> bytes:
    """Return the contents of a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # a NUL in the path
        raise InputError(f"{path}: cannot be read ({error})") from None


def read_text(path: Path, *, damaged: bool = False) -> Text:
    r"""Return the lines of a text file: UTF-8 with or without a mark, UTF-16, else Windows-1252 or Latin-1.

    Parameters
    ----------
    path : Path
    damaged : bool
        Whether there may be zeros within the text too.

    Raises
    ------
    InputError
        If it cannot be read, or is no text.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_bytes("t;Winkel (\xb0)\r\n0;9\r\n0.02;1".encode("latin-1"))
    >>> read_text(file)
    Text(lines=['t;Winkel (°)', '0;9'], rest='0.02;1', encoding='cp1252', unwritten=0)
    """
    data = read_bytes(path)
    for start, what in _NOT_TEXT.items():
        if data.startswith(start):
            raise InputError(str(path), got=what, allowed="a text, such as CSV")
    whole, encoding = _decoded(data)
    text = whole.rstrip("\0")
    unwritten = len(whole) - len(text)
    _check(path, text, whole, damaged=damaged)
    # "−" is the minus sign of typesetters; \x1a ended files of old
    text = text.rstrip("\x1a").replace("\u2212", "-").replace("\r\n", "\n").replace("\r", "\n")
    *lines, rest = text.split("\n")
    return Text(lines, rest, encoding, unwritten)


def _decoded(data: bytes) -> tuple[str, str]:
    encoding = next((name for mark, name in _UTF16.items() if data.startswith(mark)), "")
    if encoding:
        data = data[2:]
    elif b"\0" in data[:_HEAD]:
        head = data[:_HEAD]
        # letters and digits of UTF-16 without a mark have a NUL in every second place
        places = head[1::2].count(0), head[::2].count(0)
        if max(places) > 0.7 * (len(head) // 2) and min(places) < 0.1 * len(head):
            encoding = "utf-16-le" if places[0] > places[1] else "utf-16-be"
    if encoding:
        return data[:len(data) // 2 * 2].decode(encoding, errors="replace"), encoding
    whole = max(data.rfind(b"\n"), data.rfind(b"\r")) + 1  # a line that was torn may end within a character
    for name in ("utf-8-sig", "cp1252"):
        try:
            return data[:whole].decode(name) + data[whole:].decode(name, errors="replace"), name
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1"), "latin-1"


def _check(path: Path, text: str, whole: str, *, damaged: bool) -> None:
    head = text[:_HEAD] if text.strip() else whole[:_HEAD]
    once = _ZEROS.sub("\0", head)  # a block that was never written counts as one
    control = sum(c < " " and c not in "\t\r\n\f\x1a" for c in once)
    if control > _MOST_CONTROL * len(once):
        raise InputError(str(path), got="binary data", allowed="a text, such as CSV")
    if "\0" in text and not damaged:
        before = text[:text.index("\0")]
        line = 1 + before.replace("\r\n", "\n").replace("\r", "\n").count("\n")
        raise InputError(f"{path}: line {line}", got=NUL, allowed="a text; the file was damaged")
