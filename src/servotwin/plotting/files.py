"""From figures to files: PNG, SVG or PDF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.errors import OutputError
from servotwin.look import FORMATS, to_bytes
from servotwin.parameters import write_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save(figure: Figure, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a figure to a file whose ending says the format: .png, .svg or .pdf.

    A failure leaves what was there untouched.

    Parameters
    ----------
    figure : Figure
    path : str or Path
    overwrite : bool
        Whether a file that is there already may be replaced.

    Raises
    ------
    OutputExistsError
        If the file exists and `overwrite` is false.
    OutputError
        If the ending is another, or the file cannot be written.
    """
    target = Path(path)
    file_format = target.suffix.lower().removeprefix(".")
    if file_format not in FORMATS:
        raise OutputError("ending of a picture's name", got=target.name,
                          allowed=", ".join(f".{name}" for name in FORMATS))
    write_file(target, to_bytes(figure, file_format), overwrite=overwrite)
