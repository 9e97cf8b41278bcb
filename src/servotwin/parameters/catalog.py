"""The catalog: servo files that come with the package, and how a servo is found."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

from servotwin.errors import UnknownNameError
from servotwin.parameters.servo import Servo
from servotwin.parameters.servo_file import read_servo_file


def _folder() -> Path:
    return Path(str(resources.files("servotwin.parameters"))) / "catalog"


def catalog_names() -> tuple[str, ...]:
    """Return the ids of all servos in the catalog, sorted.

    Examples
    --------
    >>> "hitec-hs-755hb" in catalog_names()
    True
    """
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


def load_servo(name: str | Path) -> Servo:
    """Return a servo of the catalog by its id, or one from a file.

    Parameters
    ----------
    name : str or Path
        An id such as ``"hitec-hs-755hb"``, or the path of a servo file: what ends in ``.toml``, holds a path
        separator, or is no id but a file that exists.

    Raises
    ------
    UnknownNameError
        If it is no id of the catalog; the nearest five are suggested.
    ServoFileError
        If the file cannot be read or holds something wrong.

    Warns
    -----
    UserWarning
        Of each value of a file that is not plausible.

    Examples
    --------
    >>> load_servo("hitec-hs-755hb").title
    'Hitec HS-755HB'
    """
    text = os.fspath(name)
    if isinstance(name, Path) or text.endswith(".toml") or os.sep in text or "/" in text:
        return read_servo_file(Path(name))
    if text not in catalog_names():
        if os.path.isfile(text):
            return read_servo_file(Path(text))
        raise UnknownNameError("servo", text, catalog_names(),
                               allowed="an id that `servotwin catalog list` shows, or a servo file")
    return read_servo_file(_folder() / f"{text}.toml", name=f"catalog/{text}.toml")
