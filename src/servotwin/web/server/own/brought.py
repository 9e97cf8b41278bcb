"""Uploads of one visitor: a log, its twin beside it, and the fit that was begun with it."""

from __future__ import annotations

import asyncio
import hmac
import json
import tempfile
import time
import zlib
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.errors import InputError, ServotwinError
from servotwin.models import BoundedServo, DigitalServo, PulseServo, PulseServoInductive, default_model
from servotwin.parameters.servo import OUTPUT_SIDE, output_value, unit_of
from servotwin.simulation.lanes.inputs import with_numbers
from servotwin.units import si_unit
from servotwin.web.lessons import mystery
from servotwin.web.live.facts import models_of
from servotwin.web.live.live_bench import load_of
from servotwin.web.live.scene import HOW, model_named, taken_over
from servotwin.web.server.messages import Allowance, line_of
from servotwin.web.server.own.worker import Done, EndedError, Work, WorkError

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.web.server.session import Room


# --- Fits of one visitor: begun, reported on, ended, and taken over to the bench --------------------------------------

LONGEST = 600.0
"""How long a fit may take [s]."""
_NICE = 15
FITTED = tuple(kind.__name__ for kind in (PulseServo, PulseServoInductive, BoundedServo, DigitalServo))
"""Fidelities that can be fitted."""
_MOST_FREE = 30
_AT_OUTPUT = {
    "output_torque_constant": "torque per current at the output", "output_inertia": "inertia of motor and gear at the "
    "output", "output_coulomb_torque": "dry friction at the output, both ways alike"}


class Fits:
    """Fits of one visitor.

    Parameters
    ----------
    brought : Brought
        Uploads of the visitor.
    """

    def __init__(self, brought: Brought) -> None:
        self._of = brought
        self._work: Work | None = None
        self._found: dict[str, Any] | None = None
        self._far = (0.0, time.monotonic())
        self.tasks: set[asyncio.Task[None]] = set()

    async def plan(self, servo: object, model: object) -> dict[str, Any]:
        """Return what a fit of a servo would search, for the page to choose from.

        Raises
        ------
        InputError
            If there is no such servo, or it cannot be fitted.
        """
        kind, start, _ = self._start(servo, model)
        names = tuple(mystery.sought()) if self._is_mystery(servo) else await asyncio.to_thread(_usual, kind, start)
        able = [name for name in models_of(start) if name in FITTED]
        return {"servo": servo, "model": kind.__name__, "models": able,
                "free": [_free_facts(start, name) for name in names]}

    def begin(self, asked: dict[str, Any]) -> None:
        """Begin a fit; the page gets how far it is and what comes of it.

        Raises
        ------
        InputError
            If another fit runs, or this one is not possible.
        """
        desk = self._of.desk
        if desk.fitting is not None:
            share, began = desk.fitting._far
            raise InputError("fit", got=f"another fit is running ({100.0 * share:.0f} % after "
                             f"{time.monotonic() - began:.0f} s)", allowed="one at a time: wait for its end")
        log, (kind, start, bounds) = self._of.log, self._start(asked.get("servo", 0), asked.get("model"))
        run = None if asked.get("all") is True else self._of.run_of(asked.get("run", 0))
        free = _free(asked.get("free"), bounds)
        sought = {name: ends for name, ends in (bounds or {}).items() if name in (free or ())}
        given = {"logs": log.logs, "run": run, "servo": start, "model": kind.__name__, "load": self._of.load(),
                 "frame_rate": self._of.room.bench.frame_rate, "free": free,
                 "bounds": sought or None, "priors": None if bounds else "servo",
                 "diagnose": asked.get("diagnose") is not False}
        self._far, self._found = (0.0, time.monotonic()), None
        work = self._work = Work("fit", given, limit=LONGEST, nice=_NICE, told=self._told)
        desk.fitting = self
        task = asyncio.create_task(self._fit(work, asked.get("servo", 0)))
        self.tasks.add(task)
        task.add_done_callback(self.tasks.discard)

    def cancel(self) -> None:
        """End the fit that runs, if it is of this visitor."""
        if self._work is not None:
            self._work.end()

    async def take_over(self, how: object) -> None:
        """Put the fitted servo on the bench.

        Raises
        ------
        InputError
            If there is none, or no room for it.
        """
        if self._found is None:
            raise InputError("fit", got="none that has ended", allowed="a fit first")
        if not isinstance(how, str) or how not in HOW:
            raise InputError("take", got=how, allowed=", ".join(HOW))
        bench, found = self._of.room.bench, self._found
        scene, models, load, rate = bench.scene(), bench.now_models, dict(bench.load_numbers), bench.frame_rate
        await self._of.room.begin("servos", lambda: taken_over(
            scene, models, load, rate, found["file"], found["model"], found["servo"], how))

    async def _fit(self, work: Work, servo: int) -> None:
        tell = self._of.tell
        try:
            done = await work.done()
            self._found = {"file": done.facts["file"], "model": done.facts["model"], "servo": servo}
            tell({"fit": {"state": "done", **done.facts}})
        except EndedError:
            tell({"fit": {"state": "cancelled"}})
        except ServotwinError as error:
            tell({"fit": {"state": "failed", "message": line_of(error)}})
        finally:
            self._work = None
            if self._of.desk.fitting is self:
                self._of.desk.fitting = None

    def _told(self, share: float, text: str) -> None:
        self._far = (share, self._far[1])
        self._of.tell({"fit": {"state": "running", "share": share, "text": text,
                               "seconds": time.monotonic() - self._far[1]}})

    def _is_mystery(self, servo: object) -> bool:
        self._of.model_of(servo)
        return isinstance(servo, int) and self._of.room.bench.scene().servos[servo].mystery is not None

    def _start(self, servo: object, model: object) -> tuple[type[Model], Servo, dict[str, tuple[float, float]] | None]:
        """Return the fidelity, where a fit begins, and its bounds: of a mystery, what the page tells and no more."""
        now = self._of.model_of(servo)
        hidden = self._is_mystery(servo)
        start = mystery.known_of(now.servo) if hidden else now.servo
        if model is None:
            kind = type(now) if type(now).__name__ in FITTED else type(default_model(start))
        elif isinstance(model, str) and model in FITTED:
            kind = model_named(model)
        else:
            raise InputError("model of a fit", got=model, allowed=", ".join(FITTED))
        kind(start)
        pulses = kind is not BoundedServo  # which has another chip: none of what is hidden but the motor's
        bounds = mystery.sought() if hidden else None
        if bounds is not None and not pulses:
            bounds = {name: ends for name, ends in bounds.items() if not name.startswith("electronics.")}
        return kind, start, bounds


def _usual(kind: type[Model], servo: Servo) -> tuple[str, ...]:
    from servotwin.identification.fitting.checks import usual_free

    return usual_free(kind(servo))


def _free(asked: object, bounds: dict[str, Any] | None) -> list[str] | None:
    """Return what is searched; None: what is usual."""
    if asked is None:
        return None if bounds is None else list(bounds)
    if not isinstance(asked, list) or not 1 <= len(asked) <= _MOST_FREE or not all(isinstance(x, str) for x in asked):
        raise InputError("free", got=asked if isinstance(asked, str) else type(asked).__name__,
                         allowed=f"a list of 1 to {_MOST_FREE} names")
    return list(asked)


def _free_facts(servo: Servo, name: str) -> dict[str, Any]:
    if name in OUTPUT_SIDE:
        one = OUTPUT_SIDE[name]
        return {"name": name, "meaning": _AT_OUTPUT.get(name, one.meaning), "unit": si_unit(one.dimension),
                "value": output_value(servo, name)}
    from servotwin.parameters import GROUPS

    group, _, key = name.partition(".")
    meaning = GROUPS[group].__dataclass_fields__[key].metadata["meaning"].partition(" (")[0]  # without equations
    return {"name": name, "meaning": meaning,
            "unit": unit_of(name), "value": servo.get(name)}


# --- The desk at which visitors hand in what they bring: who they are, and whose fit is being computed ----------------

_AT_ONCE = 2  # logs that are read or compared: others wait


class Desk:
    """The desk of a house.

    Examples
    --------
    >>> Desk().find("nobody") is None
    True
    """

    def __init__(self) -> None:
        self._visitors: list[Brought] = []
        self.light = asyncio.Semaphore(_AT_ONCE)
        """For work that takes seconds."""
        self.fitting: Fits | None = None
        """The fits of the visitor that has one running."""

    def enter(self, visitor: Brought) -> None:
        """Take a visitor in."""
        self._visitors.append(visitor)

    async def leave(self, visitor: Brought) -> None:
        """Let a visitor go, and all that was brought."""
        self._visitors.remove(visitor)
        await visitor.free()

    def find(self, token: str) -> Brought | None:
        """Return the visitor whose token it is, in a time that does not tell how much of it is right; None without."""
        found = None
        for one in self._visitors:
            if hmac.compare_digest(one.token.encode(), token.encode()):
                found = one
        return found


# --- Uploads of one visitor: a log, its twin beside it, and the fit that was begun with it ----------------------------

READING, COMPARING = 60.0, 300.0  # s that it may take; the first comparison of its kind ever compiles
_WORK_NICE = 10
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
    """Uploads of one visitor.

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
        """Read a log that was brought, in place of the one before; return what is reported of it.

        Raises
        ------
        InputError
            If it cannot be read; what columns mean can then be said with `read_again`.
        """
        self._log = None
        return await self._read({"raw": raw, "packed": False, "label": label, "columns": "", "mend": ""})

    def read_again(self, columns: object, mend: object) -> None:
        """Begin to read the log once more with words for its columns; the page gets what comes of it.

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
        """Begin to lay the log over a servo of the bench; the page gets what comes of it.

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
        work = self._work = Work(kind, given, limit=limit, nice=_WORK_NICE)
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
