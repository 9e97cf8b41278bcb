"""How kernels run: by the environment variable SERVOTWIN_BACKEND, read once."""

from __future__ import annotations

import os
from functools import cache

from servotwin.errors import InputError

_VARIABLE = "SERVOTWIN_BACKEND"
_COMPILED, _PLAIN = "numba", "plain"


@cache
def is_plain() -> bool:
    """Tell whether kernels run in plain Python.

    Raises
    ------
    InputError
        If the variable says anything else than that, or which compiler makes them.
    """
    asked = os.environ.get(_VARIABLE) or _COMPILED
    if asked not in (_COMPILED, _PLAIN):
        raise InputError(f"environment variable {_VARIABLE}", got=asked, allowed=f"{_COMPILED} or {_PLAIN}")
    return asked == _PLAIN
