"""Free text on its way in and out: names of servos, joints, columns and scenes, and whatever a file says of itself.

Names given by people may hold anything that Unicode has. On its way in a name is refused where it holds what no reader
sees (`checked_name`); on its way out each kind of file gets it as letters that mean nothing there: a comment of C, XML,
HTML, a terminal, the name of a file or of a function.
"""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Iterable
from typing import Any

from servotwin.errors import HIDDEN, InputError, one_line

LONGEST_NAME = 200  # characters
LONGEST_FILE_NAME = 255  # bytes, which file systems allow
LONGEST_STEM = 80  # of the name of a file or a function that is made of a name
DEEPEST = 16  # tables in tables: what reads keys of TOML takes a time that grows with the square of their parts
_DEVICES = re.compile(r"(con|prn|aux|nul|(?:com|lpt)[\d¹²³])(?=\.|$)", re.IGNORECASE)  # which Windows keeps for itself
# Of headers that C, its libraries, FMI and an FMU's own sources include
_HEADERS = re.compile("alloca|assert|availability|complex|component|corecrt.*|crtdefs|ctype|endian|errno|features|fenv|"
                      "float|fmi.*|inttypes|iso646|limits|locale|malloc|math|model|sal|setjmp|signal|std.*|string|"
                      "tgmath|time|vadefs|vcruntime.*|wchar|wctype|xlocale")
_KEPT = "\n\t"
# Strings and comments of TOML; one that does not end goes to the end of its line, or of the text
_QUOTED = re.compile(r'''"""(?:\\.|[^\\])*?(?:"{3,5}|\Z)|"(?:\\.|[^"\\\n])*+"?|#[^\n]*+'''
                     r"""|'{3}.*?(?:'{3,5}|\Z)|'[^'\n]*+'?""", re.DOTALL)
_DEEP = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}")


def fault_of(name: str, longest: float = LONGEST_NAME) -> str:
    r"""Return what a name must be that this one is not; empty where nothing is wrong with it.

    Examples
    --------
    >>> fault_of("my servo ($5, 日本)"), fault_of("a\x1b[2J")
    ('', 'a name without control or bidirectional characters (U+001B at character 2)')
    """
    hidden = HIDDEN.search(name)
    if hidden:
        about = unicodedata.name(hidden[0], "").lower()
        return (f"a name without control or bidirectional characters (U+{ord(hidden[0]):04X}"
                f"{f', {about},' if about else ''} at character {hidden.start() + 1})")
    return "" if len(name) <= longest else f"at most {longest} characters"


def checked_name(what: str, name: str, longest: float = LONGEST_NAME) -> str:
    r"""Return a name that was read, unless it holds what no reader sees or is too long.

    Parameters
    ----------
    what : str
        File and place.
    name : str
    longest : float
        [characters]

    Raises
    ------
    InputError
        If it holds a control or bidirectional character, or is longer.

    Examples
    --------
    >>> checked_name("arm.xml: joint", "el\u202ebow")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    servotwin.errors.InputError: arm.xml: joint: got 'el\u202ebow', allowed: a name without control ...
    """
    fault = fault_of(name, longest)
    if fault:
        raise InputError(what, got=name, allowed=fault)
    return name


def load_toml(text: str) -> dict[str, Any]:
    """Return what a text in TOML holds.

    Raises
    ------
    ValueError
        If it is no TOML, or has more than 16 tables in each other.

    Examples
    --------
    >>> load_toml('a.b = "c.d.e"')
    {'a': {'b': 'c.d.e'}}
    """
    import tomllib

    deep = f"nested too deeply, in more than {DEEPEST} tables"
    if _DEEP.search(_QUOTED.sub("_", text)):
        raise ValueError(deep)
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise ValueError(deep) from None
    if _depth(found) > DEEPEST:  # what is written of it has keys that long
        raise ValueError(deep)
    return found


def _depth(value: Any) -> int:
    if isinstance(value, dict):
        return 1 + max(map(_depth, value.values()), default=0)
    return max(map(_depth, value), default=0) if isinstance(value, list) else 0


def shown(text: str) -> str:
    r"""Return a text for a terminal, a figure or XML: control and bidirectional characters as what Python writes.

    Line ends and tabs stay.

    Examples
    --------
    >>> shown("red: \x1b[31m\n")
    'red: \\x1b[31m\n'
    """
    return HIDDEN.sub(lambda found: found[0] if found[0] in _KEPT else one_line(found[0]), text)


def shortened(name: str, longest: int = 40) -> str:
    """Return a name for an axis: its beginning and its end, where it is longer.

    Examples
    --------
    >>> shortened("left_arm/shoulder_pan", 12)
    'left_…er_pan'
    """
    half = longest // 2
    return name if len(name) <= longest else f"{name[:half - 1]}…{name[-half:]}"


def escape(text: str) -> str:
    """Return words as HTML.

    Examples
    --------
    >>> escape("</script>")
    '&lt;/script&gt;'
    """
    return html.escape(shown(text))


def c_comment(text: str) -> str:
    r"""Return words as they may stand in a comment of C: one line that neither ends nor begins one.

    Examples
    --------
    >>> c_comment("*/ int x;\n??/ /* \\")
    '* / int x;\\n? ?/ / *'
    """
    line = re.sub(r"(?<=\*)(?=/)|(?<=/)(?=\*)|(?<=\?)(?=\?)", " ", one_line(text))
    return line.rstrip("\\ ")


def identifier(name: str) -> str:
    """Return a name for files and functions in C: small letters, digits and _, a letter first.

    Examples
    --------
    >>> identifier("Hitec HS-755HB"), identifier("../../x"), identifier("math"), identifier("21")
    ('hitec_hs_755hb', 'x', 'servo_math', 'servo_21')
    """
    made = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:LONGEST_STEM].rstrip("_")
    return made if made[:1].isalpha() and not is_taken(made) else f"servo_{made}".rstrip("_")


def is_taken(name: str) -> bool:
    """Return whether a header of C or FMI, or a device of Windows, has the name of a file in C already.

    Examples
    --------
    >>> is_taken("stdio"), is_taken("nul"), is_taken("hs_755hb")
    (True, True, False)
    """
    return (_HEADERS.fullmatch(name) or _DEVICES.fullmatch(name)) is not None


def file_stem(name: str) -> str:
    """Return what a file of this name is called, without its ending.

    Examples
    --------
    >>> file_stem("elbow"), file_stem("../../x"), file_stem("con")
    ('elbow', 'x', 'con_')
    """
    plain = unicodedata.normalize("NFC", name)
    stem = re.sub(r"[^\w.+-]+", "_", plain)[:LONGEST_STEM].strip("._") or "unnamed"
    return _DEVICES.sub(r"\1_", stem, count=1) if _DEVICES.match(stem) else stem


def file_stems(names: Iterable[str]) -> dict[str, str]:
    """Return what files of these names are called, without their ending: one for each, in one folder.

    Examples
    --------
    >>> file_stems(["elbow", "left/hip", "left hip"])
    {'elbow': 'elbow', 'left/hip': 'left_hip', 'left hip': 'left_hip_2'}
    """
    made: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        stem, again = file_stem(name), 1
        while (own := stem if again == 1 else f"{stem}_{again}").casefold() in taken:
            again += 1
        made[name] = own
        taken.add(own.casefold())
    return made
