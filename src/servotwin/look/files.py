"""From figures to bytes: PNG, SVG or PDF; the same figure gives the same bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from servotwin.errors import HIDDEN, OutputError
from servotwin.look.style import context
from servotwin.text import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
# No date and no program version in a file: two runs are comparable byte by byte.
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None}, "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
_DPI = 160


def to_bytes(figure: Figure, file_format: str, dpi: float = _DPI) -> bytes:
    """Return a figure as the contents of a file.

    Parameters
    ----------
    figure : Figure
    file_format : {"png", "svg", "pdf"}
    dpi : float
        Pixels an inch of a PNG.

    Raises
    ------
    OutputError
        If the format is none of these.

    Examples
    --------
    >>> from servotwin.look import axes_grid
    >>> to_bytes(axes_grid()[0], "png")[1:4]
    b'PNG'
    """
    if file_format not in FORMATS:
        raise OutputError("format of a picture", got=file_format, allowed=", ".join(FORMATS))
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        if HIDDEN.search(text.get_text()):
            text.set_text(shown(text.get_text()))
    with context(), io.BytesIO() as stream:
        figure.savefig(stream, format=file_format, dpi=dpi, metadata=_METADATA[file_format])
        return stream.getvalue()
