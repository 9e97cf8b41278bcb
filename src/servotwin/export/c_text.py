"""The two texts of a servo as C."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from servotwin.errors import OutputError, OutputExistsError


@dataclass(frozen=True)
class CCode:
    """A servo as C99.

    Attributes
    ----------
    name : str
        Begins the names of the files, types and functions.
    header, source : str
        The two texts.
    left_out : str
        What the numbers of the servo have no use for, and the code does not follow.
    table : tuple of float
        All numbers of the servo in the order in which the struct of its table has them, the table of a potentiometer
        apart: what another servo with the same things left out may have in its place.
    """

    name: str
    header: str
    source: str
    left_out: str
    table: tuple[float, ...]

    def write(self, folder: str | Path, *, overwrite: bool = False) -> tuple[Path, Path]:
        """Write `name.h` and `name.c` into a folder, which is made where there is none; return their paths.

        Raises
        ------
        OutputExistsError
            If a file is there and `overwrite` is not given; then nothing has changed.
        OutputError
            If they cannot be written.
        """
        paths = Path(folder) / f"{self.name}.h", Path(folder) / f"{self.name}.c"
        for path in paths:
            if path.exists() and not overwrite:
                raise OutputExistsError(path)
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix=".servotwin-", dir=folder) as aside:
                for path, text in zip(paths, (self.header, self.source), strict=True):
                    (Path(aside) / path.name).write_text(text, encoding="utf-8")
                for path in paths:
                    os.replace(Path(aside) / path.name, path)
        except OSError as error:
            raise OutputError(f"{folder} cannot be written ({error.strerror or error})") from None
        return paths
