"""The other side of `process.Work`: does one piece of work that is given on stdin, and says what came of it."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any, BinaryIO

from servotwin.errors import ServotwinError
from servotwin.web.server.messages import line_of, text_of
from servotwin.web.server.own.frames import RefusedError, framed, taken

KINDS = {"reading": "reading", "comparison": "comparing", "fit": "fitting"}
"""Kinds of work, and the modules whose `work` does them."""
_BETWEEN = 0.2  # s between two words of how far it is
Tell = Callable[[float, str], None]


def main() -> None:
    """Take a piece of work, do it, and end."""
    given: dict[str, Any] = pickle.loads(taken(sys.stdin.buffer))  # by our own server
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(given["nice"])
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what prints shall not be taken for an answer
    threading.Thread(target=_end_with_the_server, daemon=True).start()
    _answer(pipe, *_worked(given, _teller(pipe)))
    pipe.flush()
    os._exit(0)  # at once: nothing is left to be done


def _worked(given: dict[str, Any], tell: Tell) -> tuple[dict[str, Any], list[bytes]]:
    try:
        facts, blobs = import_module(f"servotwin.web.server.own.{KINDS[given['work']]}").work(given, tell)
        return {"done": facts, "blobs": len(blobs)}, blobs
    except RefusedError as error:
        return {"wrong": line_of(error), "blobs": len(error.blobs)}, error.blobs
    except ServotwinError as error:
        return {"wrong": line_of(error), "blobs": 0}, []
    except MemoryError:
        return {"wrong": f"{given['work']}: got more than the memory holds, allowed: something smaller", "blobs": 0}, []
    except Exception as error:  # one visitor's log shall not end in silence
        line = f"{given['work']}: a mistake of servotwin itself ({type(error).__name__}); please report what was done"
        return {"wrong": line, "blobs": 0}, []


def _answer(pipe: BinaryIO, facts: dict[str, Any], blobs: list[bytes]) -> None:
    for piece in (text_of(facts).encode(), *blobs):
        pipe.writelines(framed(piece))


def _teller(pipe: BinaryIO) -> Tell:
    last = [-_BETWEEN]

    def tell(share: float, text: str) -> None:
        now = time.monotonic()
        if now - last[0] >= _BETWEEN:
            last[0] = now
            pipe.writelines(framed(json.dumps({"share": round(share, 4), "text": text}).encode()))
            pipe.flush()
    return tell


def _end_with_the_server() -> None:
    """End when the pipe ends: whoever wants the work is gone."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdin.buffer.read(1)
    os._exit(1)


if __name__ == "__main__":
    main()
