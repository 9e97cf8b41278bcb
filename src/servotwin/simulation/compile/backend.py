"""How kernels run: by the environment variable SERVOTWIN_BACKEND, read once, or plain where nothing compiles them."""

from __future__ import annotations

import os
from functools import cache

from servotwin.errors import InputError

_VARIABLE = "SERVOTWIN_BACKEND"
_COMPILED, _PLAIN = "c", "plain"
_without_compiler: list[bool] = []


def is_plain() -> bool:
    """Tell whether kernels run in plain Python.

    Raises
    ------
    InputError
        If the variable says anything else than "plain" or "c".
    """
    return bool(_without_compiler) or _asked() == _PLAIN


def use_plain() -> None:
    """Let kernels run in plain Python from now on."""
    _without_compiler.append(True)


@cache
def _asked() -> str:
    asked = os.environ.get(_VARIABLE) or _COMPILED
    if asked not in (_COMPILED, _PLAIN):
        raise InputError(f"environment variable {_VARIABLE}", got=asked, allowed=f"{_COMPILED} or {_PLAIN}")
    return asked
