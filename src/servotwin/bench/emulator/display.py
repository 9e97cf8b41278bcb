"""The display of the board: what an HD44780 shows of what is written to it, half a byte at a time."""

from __future__ import annotations

COLUMNS = 16
LINES = 2
_SECOND = 0x40  # address of the second line
_ROW = 40  # characters of a line in its memory
_DATA = 0x10  # bit that stands for RS
_TABLE = {0xDF: "°", 0xE4: "µ", 0xF7: "π", 0xF4: "Ω", 0x7E: "→", 0x7F: "←", 0x5C: "¥"}  # of its ROM A00
_CLEAR, _HOME, _ENTRY, _SWITCH, _SHIFT, _FUNCTION, _GLYPHS, _ADDRESS = (1 << k for k in range(8))


class Display:
    """A 16 × 2 HD44780 on four data lines that is only written to.

    Examples
    --------
    >>> display = Display()
    >>> for order in (3, 3, 3, 2, 2, 8, 0, 12, 0, 6):
    ...     display.write(order)
    >>> for letter in b"90":
    ...     display.write(16 | letter >> 4)
    ...     display.write(16 | letter & 15)
    >>> display.lines
    ('90              ', '                ')
    """

    def __init__(self) -> None:
        self._memory = [" "] * (2 * _ROW)
        self._at = 0  # address counter
        self._step = 1
        self._four = False  # data lines; eight after power comes
        self._high: int | None = None  # first half of a byte
        self._on = False
        self._glyphs = False  # what is written goes to the generator of characters

    @property
    def lines(self) -> tuple[str, str]:
        """What is read on it; blanks where it is off."""
        if not self._on:
            return " " * COLUMNS, " " * COLUMNS
        return "".join(self._memory[:COLUMNS]), "".join(self._memory[_ROW:_ROW + COLUMNS])

    def write(self, half: int) -> None:
        """Take half a byte, as E falls; bit 4 is RS."""
        nibble = half & 15
        if not self._four:  # the lower four lines are not connected, and read as 0
            self._order(nibble << 4)
            return
        if self._high is None:
            self._high = nibble
            return
        byte, self._high = self._high << 4 | nibble, None
        if half & _DATA:
            self._put(byte)
        else:
            self._order(byte)

    def _put(self, byte: int) -> None:
        if self._glyphs:
            return
        place = self._at if self._at < _ROW else self._at - _SECOND + _ROW
        if 0 <= place < len(self._memory):
            letter = chr(byte) if 0x20 <= byte < 0x7E else "\N{REPLACEMENT CHARACTER}"
            self._memory[place] = _TABLE.get(byte, letter)
        self._move(self._step)

    def _move(self, by: int) -> None:
        """Go on in the order of its memory: the second line follows the first, and the first the second."""
        place = self._at if self._at < _ROW else self._at - _SECOND + _ROW
        place = (place + by) % (2 * _ROW)
        self._at = place if place < _ROW else place - _ROW + _SECOND

    def _order(self, byte: int) -> None:
        if byte & _ADDRESS:
            self._at, self._glyphs = byte & 0x7F, False
        elif byte & _GLYPHS:
            self._glyphs = True
        elif byte & _FUNCTION:
            self._four = not byte & 0x10
            self._high = None
        elif byte & _SHIFT:
            if not byte & 0x08:
                self._move(1 if byte & 0x04 else -1)
        elif byte & _SWITCH:
            self._on = bool(byte & 0x04)
        elif byte & _ENTRY:
            self._step = 1 if byte & 0x02 else -1
        elif byte & (_HOME | _CLEAR):
            self._at, self._glyphs = 0, False
            if byte & _CLEAR:
                self._memory[:] = " " * len(self._memory)
                self._step = 1
