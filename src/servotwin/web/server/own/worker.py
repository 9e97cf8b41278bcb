"""A piece of work in a process of its own: it may take long or fail, and the benches continue meanwhile."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import servotwin
from servotwin.errors import InputError
from servotwin.web.server.own.frames import HEAD, MOST, framed

Told = Callable[[float, str], object]
_ONE = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_PATIENCE = 5.0  # s that a process has to go after it was ended


class Done(NamedTuple):
    """The result of a piece of work: plain facts, and bytes beside."""

    facts: dict[str, Any]
    blobs: list[bytes]


class Work:
    """A piece of work.

    The process ends with its work, with `end`, after its time, or with this process: it listens to it.

    Parameters
    ----------
    kind : str
        One of `servotwin.web.server.own.work.KINDS`.
    given : mapping
        Picklable.
    limit : float
        How long it may take [s].
    nice : int
        How far it stands behind the benches.
    told : callable, optional
        Called with the share that is done, and the work in progress.
    """

    def __init__(self, kind: str, given: dict[str, Any], *, limit: float, nice: int, told: Told | None = None) -> None:
        self._given = pickle.dumps({**given, "work": kind, "nice": nice, "limit": limit})
        self._kind, self._limit, self._told = kind, limit, told
        self._process: asyncio.subprocess.Process | None = None
        self.ended = False

    async def done(self) -> Done:
        """Do it, and return what came of it.

        Raises
        ------
        InputError
            If the work says that something is wrong, or took too long.
        EndedError
            If it was ended.
        """
        try:
            async with asyncio.timeout(self._limit):
                return await self._run()
        except TimeoutError:
            raise InputError(self._kind, got=f"more than {self._limit:.0f} s of work",
                             allowed="something shorter") from None
        finally:
            self.end()
            if self._process is not None:
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._process.wait(), _PATIENCE)

    def end(self) -> None:
        """End it now."""
        self.ended = True
        if self._process is not None and self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()

    async def _run(self) -> Done:
        process = self._process = await _started()
        if process.stdin is None or process.stdout is None:  # never: both are pipes
            raise InputError("work", got="a process without pipes")
        if self.ended:
            raise EndedError(self._kind)
        try:
            for part in framed(self._given):
                process.stdin.write(part)
            self._given = b""
            await process.stdin.drain()
            while True:
                said = json.loads(await _frame(process.stdout))
                if "share" in said:
                    if self._told is not None:
                        self._told(said["share"], said["text"])
                elif "wrong" in said:
                    raise WorkError(said["wrong"], [await _frame(process.stdout) for _ in range(said["blobs"])])
                else:
                    return Done(said["done"], [await _frame(process.stdout) for _ in range(said["blobs"])])
        except (asyncio.IncompleteReadError, ConnectionError):
            if self.ended:
                raise EndedError(self._kind) from None
            raise InputError(self._kind, got="a process that ended before its work",
                             allowed="something smaller: memory may not have sufficed") from None


class EndedError(InputError):
    """A piece of work was ended before it was done."""

    def __init__(self, kind: str) -> None:
        super().__init__(kind, got="an end before its time")


class WorkError(InputError):
    """An error of a piece of work, with the bytes that it gives back nevertheless."""

    def __init__(self, line: str, blobs: list[bytes]) -> None:
        super().__init__(line)
        self.blobs = blobs


async def _frame(stream: asyncio.StreamReader) -> bytes:
    size = int.from_bytes(await stream.readexactly(HEAD), "little")
    if size > MOST:
        raise InputError("work", got=f"{size} bytes", allowed=f"at most {MOST}")
    return await stream.readexactly(size)


async def _started() -> asyncio.subprocess.Process:
    """Start a process that waits for work; it hears no Ctrl-C, but shares the cores of this one by its niceness."""
    root = str(Path(servotwin.__file__).resolve().parents[1])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    own: dict[str, Any] = {"process_group": 0}
    if sys.platform == "win32":
        own = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.BELOW_NORMAL_PRIORITY_CLASS}
    return await asyncio.create_subprocess_exec(
        sys.executable, "-P", "-m", "servotwin.web.server.own.work", stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, env={**os.environ, **dict.fromkeys(_ONE, "1"), "PYTHONPATH": os.pathsep.join(paths)},
        **own)
