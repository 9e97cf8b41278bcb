"""What one visitor brought: a log, its twin beside it, and the fit that was begun with it."""

from __future__ import annotations

import asyncio
import json
import tempfile
import time
import zlib
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.errors import InputError, ServotwinError
from servotwin.simulation.lanes.inputs import with_numbers
from servotwin.web.live.beginning import load_of
from servotwin.web.server.limits import Allowance
from servotwin.web.server.own.fits import Fits
from servotwin.web.server.own.process import Done, EndedError, Work, WorkError
from servotwin.web.server.wire import line_of

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.web.server.own.desk import Desk
    from servotwin.web.server.room import Room

READING, COMPARING = 60.0, 300.0  # s that it may take; the first comparison of its kind ever compiles
_NICE = 10
_RATE, _BURST = 0.5, 6.0  # logs
_LONGEST_WORDS = 2000  # characters of what columns mean


class KeptLog(NamedTuple):
    """A log as it is kept, packed: its file, its runs once they are read, and their commands for a bench."""

    label: str
    raw: bytes
    logs: bytes = b""
    played: bytes = b""
    facts: dict[str, Any] | None = None


class Brought:
    """What one visitor brought.

    Parameters
    ----------
    desk : Desk
    room : Room
    token : str
        By which the visitor is known.
    role : str
        "own", "teacher" or "watcher".
    tell : callable
        Tells the visitor's page something.
    """

    def __init__(self, desk: Desk, room: Room, token: str, role: str, tell: Callable[[dict[str, Any]], object]) -> None:
        self.desk, self.room, self.token, self.role, self.tell = desk, room, token, role, tell
        self.allowance = Allowance(_RATE, _BURST)
        self.uploading = False
        self.fits = Fits(self)
        self._log: KeptLog | None = None
        self._work: Work | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._gone = False

    @property
    def log(self) -> KeptLog:
        """The log that was brought and read.

        Raises
        ------
        InputError
            If there is none.
        """
        if self._log is None or self._log.facts is None:
            raise InputError("log", got="none that was read", allowed="a log that is dropped on the page first")
        return self._log

    def may_bring(self) -> None:
        """Raise unless the visitor may bring a log now.

        Raises
        ------
        InputError
            If it is a watcher, or another log is on its way, or there were too many.
        """
        if self.role == "watcher":
            raise InputError("log of a watcher", got="one that was dropped", allowed="none: the teacher brings logs")
        if self.uploading or not self.allowance.take(time.monotonic()):
            raise InputError("log", got="one after another, faster than they are read", allowed="a moment later")

    async def take(self, raw: bytes, label: str) -> dict[str, Any]:
        """Read a log that was brought, in place of the one before; return what is told of it.

        Raises
        ------
        InputError
            If it cannot be read; what columns mean can then be said with `read_again`.
        """
        self._log = None
        return await self._read({"raw": raw, "packed": False, "label": label, "columns": "", "mend": ""})

    def read_again(self, columns: object, mend: object) -> None:
        """Begin to read the log once more with words for its columns; the page is told what comes of it.

        Raises
        ------
        InputError
            If there is none, or these are no words.
        """
        if self._log is None:
            raise InputError("log", got="none", allowed="a log that is dropped on the page first")
        if not isinstance(columns, str) or len(columns) > _LONGEST_WORDS:
            raise InputError("columns", got=type(columns).__name__,
                             allowed='words such as "time=t:ms angle=pos:deg-90"')
        if not isinstance(mend, str) or len(mend) > _LONGEST_WORDS:
            raise InputError("mend", got=type(mend).__name__, allowed='words such as "torn,reset"')
        given = {"raw": self._log.raw, "packed": True, "label": self._log.label, "columns": columns.strip(),
                 "mend": mend.strip()}

        async def reading() -> None:
            self.tell({"own": {"reading": await self._read(given)}})
        self._begin(reading())

    def compare(self, asked: dict[str, Any]) -> None:
        """Begin to lay the log over a servo of the bench; the page is told what comes of it.

        Raises
        ------
        InputError
            If there is no log, or no such servo.
        """
        log, model, run = self.log, self.model_of(asked.get("servo", 0)), self.run_of(asked.get("run", 0))
        given = {"logs": log.logs, "run": run, "servo": model.servo, "model": type(model).__name__,
                 "load": self.load(), "frame_rate": self.room.bench.frame_rate, "rig": asked.get("rig") is not False}

        async def comparing() -> None:
            done = await self._worked("comparison", given, COMPARING)
            self.tell({"own": {"overlay": done.facts}})
        self._begin(comparing())

    def play(self, run: object) -> float:
        """Give the log's command to the bench; return when [s].

        Raises
        ------
        InputError
            If there is none that it can play.
        """
        played = json.loads(zlib.decompress(self.log.played))[self.run_of(run)]
        if played is None:
            raise InputError("command of the log", got="too many changes", allowed="a shorter log")
        return self.room.do("command", played, None)

    def model_of(self, servo: object) -> Model:
        """Return a servo of the bench with its numbers of now.

        Raises
        ------
        InputError
            If there is none of this number.
        """
        models = self.room.bench.now_models
        if isinstance(servo, bool) or not isinstance(servo, int) or not 0 <= servo < len(models):
            raise InputError("servo", got=servo, allowed=f"a whole number from 0 to {len(models) - 1}")
        return models[servo]

    def run_of(self, run: object) -> int:
        """Return the number of a run of the log.

        Raises
        ------
        InputError
            If it has none of this number.
        """
        count = len((self.log.facts or {})["runs"])
        if isinstance(run, bool) or not isinstance(run, int) or not 0 <= run < count:
            raise InputError("run of the log", got=run, allowed=f"a whole number from 0 to {count - 1}")
        return run

    def load(self) -> Load:
        """Return what hangs on the shafts of the bench now."""
        bench = self.room.bench
        return with_numbers(load_of(bench.scene()), bench.load_numbers)

    def forget(self) -> None:
        """Let the log go."""
        self._log = None
        if self._work is not None:
            self._work.end()

    async def free(self) -> None:
        """Let all go: the visitor is gone."""
        self._gone = True
        self.forget()
        self.fits.cancel()
        tasks = [*self._tasks, *self.fits.tasks]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _read(self, given: dict[str, Any]) -> dict[str, Any]:
        with tempfile.TemporaryDirectory(prefix="servotwin-", ignore_cleanup_errors=True) as folder:
            try:
                done = await self._worked("reading", {**given, "folder": folder}, READING)
            except WorkError as error:
                if error.blobs and not self._gone:
                    self._log = KeptLog(given["label"], error.blobs[0])
                raise
        packed, logs, played = done.blobs
        if not self._gone:
            self._log = KeptLog(given["label"], packed, logs, played, done.facts)
        return done.facts

    async def _worked(self, kind: str, given: dict[str, Any], limit: float) -> Done:
        """Do some work in place of what is being done for this visitor."""
        if self._work is not None:
            self._work.end()
        work = self._work = Work(kind, given, limit=limit, nice=_NICE)
        async with self.desk.light:
            return await work.done()

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        async def told() -> None:
            try:
                await work
            except EndedError:  # another took its place, or the log was let go
                self.tell({"own": {"ended": True}})
            except ServotwinError as error:
                self.tell({"own": {"wrong": line_of(error)}})
        task = asyncio.create_task(told())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
