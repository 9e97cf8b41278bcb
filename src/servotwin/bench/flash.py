"""Putting the firmware onto a board, by avrdude."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from servotwin.errors import BenchError, UnknownNameError

BOARDS: Mapping[str, int] = {"uno": 115200, "nano": 115200, "nano-old": 57600}
"""Baud rates of the boot loaders: Optiboot's, and that of Nanos before 2018 and most of their copies [bit/s]."""
_PATIENCE = 120.0  # s


def firmware_file() -> Path:
    """Return the firmware that comes with the package, an Intel HEX file.

    Examples
    --------
    >>> firmware_file().name
    'servotwin-bench.hex'
    """
    return Path(str(files("servotwin.bench.firmware").joinpath("servotwin-bench.hex")))


def flash_command(port: str, board: str = "nano") -> Sequence[str]:
    """Return the words of the call.

    Raises
    ------
    UnknownNameError
        If there is no such board.

    Examples
    --------
    >>> flash_command("/dev/ttyUSB0", "nano-old")[1:7]
    ('-p', 'atmega328p', '-c', 'arduino', '-P', '/dev/ttyUSB0')
    """
    if board not in BOARDS:
        raise UnknownNameError("board", board, BOARDS)
    return ("avrdude", "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(BOARDS[board]), "-D",
            "-U", f"flash:w:{firmware_file()}:i")


def flash(port: str, board: str = "nano") -> str:
    """Write the firmware onto a board and return what avrdude said.

    Raises
    ------
    BenchError
        If avrdude is not installed, or fails: with its own last words.
    UnknownNameError
        If there is no such board.
    """
    command = flash_command(port, board)
    if shutil.which(command[0]) is None:
        raise BenchError("avrdude", "it is not installed (on Debian: apt install avrdude; macOS: brew install avrdude; "
                                    "Windows: it comes with the Arduino IDE)")
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=_PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        raise BenchError("avrdude", f"it has not ended after {_PATIENCE:.0f} s; is {port} the board's port?") from None
    said = [line.strip() for line in (done.stderr + done.stdout).splitlines() if line.strip()]
    if done.returncode != 0:
        cause = next((line for line in said if "error" in line.lower() or "can't" in line.lower()
                      or "not in sync" in line.lower()), said[-1] if said else "no word")
        hint = "; --board nano-old is the other boot loader" if "sync" in cause else ""
        raise BenchError("avrdude", f"{cause.removeprefix('avrdude').strip(': ')}{hint}")
    return "\n".join(said)
