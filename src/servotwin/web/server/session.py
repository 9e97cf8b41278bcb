"""A room: a bench that runs in real time, and the browsers that look at it."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from servotwin.errors import InputError, ServotwinError
from servotwin.simulation.remarks import NOT_AT_REST
from servotwin.units import is_finite
from servotwin.web.lessons.mystery import is_hidden, unknowns
from servotwin.web.live import LiveBench, Push, Scene, ServoPush
from servotwin.web.live.facts import facts_of, load_facts, reading_of
from servotwin.web.server.messages import line_of, packed, text_of

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.web.server.messages import Outbox


# --- How a bench is advanced: in stretches that are short enough that others have their turn --------------------------

BUDGET = 0.010  # s of computing in a turn
SHORT, LONG = 0.2 * BUDGET, 0.5 * BUDGET  # s of computing: a stretch of less, and of more, is given another length
FIRST = 5e-4  # s of bench time: the first stretch, of which nothing is known yet
LONGEST = 0.1  # s: one that begins at rest may continue in motion, which costs a thousand times as much
PATIENCE = 1.0
"""How long a stretch may take [s]: then the bench stands."""


class Stint:
    """A bench that is advanced.

    Parameters
    ----------
    bench : LiveBench

    Examples
    --------
    >>> from servotwin.web.live import LiveBench
    >>> from servotwin.web.server.serve import first_scene
    >>> stint = Stint(LiveBench(first_scene()))
    >>> stint.until(1e-3, 1e3).time, stint.broken
    (0.001, None)
    """

    def __init__(self, bench: LiveBench) -> None:
        self._bench = bench
        self._stretch = FIRST
        self._ends = self._stands = 0.0
        self.broken: str | None = None
        """Why it cannot continue, in a line."""
        bench.hurried(lambda: _now() > self._ends, self._within)

    def begin(self) -> None:
        """Forget how fast it was: its numbers are others."""
        self._stretch = FIRST

    def until(self, target: float, points: float) -> Push:
        """Advance it to a time [s], but for no longer than a turn may take; return what shows, at a rate [Hz]."""
        self._ends, pushes = _now() + BUDGET, [self._nothing()]
        while (self._bench.due or not self._bench.reached(target)) and self.broken is None and _now() < self._ends:
            before, at = self._bench.time, _now()
            pushes.append(self.to(max(min(target, before + self._stretch), before), points))
            spent = _now() - at
            if spent < SHORT:
                self._stretch = min(4.0 * self._stretch, LONGEST)
            elif spent > LONG:
                self._stretch = max(0.5 * self._stretch, FIRST)
        return joined(pushes)

    def to(self, until: float, points: float) -> Push:
        """Advance it to a time [s] at a stretch; what it cannot is noted in `broken`."""
        self._stands = _now() + PATIENCE
        try:
            return self._bench.advance(until, points)
        except ServotwinError as error:
            self.broken = line_of(error)
        except Exception as error:  # one bench shall not end the others
            self.broken = f"a mistake of servotwin itself ({type(error).__name__}); please report what was done"
        return self._nothing()

    def _within(self, time: float) -> None:
        if _now() > self._stands:
            raise InputError("motion", got=f"one that takes more than {PATIENCE:g} s to compute at t = {time:.6g} s",
                             allowed="numbers of a servo that is not so fast, and a new beginning")

    def _nothing(self) -> Push:
        bench = self._bench
        return Push(bench.time, tuple(ServoPush(columns, [], []) for columns in bench.columns), [])


def joined(pushes: list[Push]) -> Push:
    """Return pushes that follow each other as one.

    Examples
    --------
    >>> one = Push(1.0, (ServoPush(("time",), [(1.0,)], []),), [])
    >>> joined([one, one._replace(time=2.0)]).time
    2.0
    """
    servos = tuple(ServoPush(parts[-1].columns, [row for part in parts for row in part.points],
                             [pulse for part in parts for pulse in part.pulses])
                   for parts in zip(*(push.servos for push in pushes), strict=True))
    return Push(pushes[-1].time, servos, [event for push in pushes for event in push.events])


def _now() -> float:
    return time.monotonic()


# --- A clock that never lies: bench time by the time on the wall, and how slow it really runs -------------------------

SPEEDS = (1e-6, 10.0)
"""Slowest and fastest speed that may be asked for [s of the bench per s]."""
UNPACED = "unpaced"
OVER = 1.0  # s on the wall over which the pace is measured
LATE = 0.1  # s on the wall: a debt of more is dropped


class Pace:
    """How far bench time should be, and how fast it has really gone.

    Parameters
    ----------
    now : float
        Time on the wall [s].

    Examples
    --------
    >>> pace = Pace(0.0)
    >>> pace.ask(0.5, now=0.0, bench=0.0)
    >>> pace.target(now=0.04, bench=0.0)
    0.02
    >>> pace.went(now=1.0, bench=0.1), round(pace.measured, 3), pace.behind
    (None, 0.1, True)
    """

    def __init__(self, now: float) -> None:
        self.speed = 1.0
        self.running = True
        self._from = (now, 0.0)
        self._went: deque[tuple[float, float]] = deque([(now, 0.0)])
        self._late_until = -math.inf

    def ask(self, speed: object, *, now: float, bench: float) -> None:
        """Take another speed, of `SPEEDS` or `UNPACED`.

        Raises
        ------
        InputError
            If it is none.
        """
        if speed == UNPACED:
            speed = math.inf
        elif not (is_finite(speed) and SPEEDS[0] <= speed <= SPEEDS[1]):
            raise InputError("speed", got=speed, allowed=f"a number from {SPEEDS[0]:g} to {SPEEDS[1]:g}, or {UNPACED}")
        self.speed = float(speed)
        self.begin(now=now, bench=bench)

    def run(self, running: bool, *, now: float, bench: float) -> None:
        """Run, or stand still."""
        self.running = running
        self.begin(now=now, bench=bench)

    def begin(self, *, now: float, bench: float) -> None:
        """Count from here on, without debt."""
        self._from, self._late_until = (now, bench), -math.inf
        self._went = deque([(now, bench)])

    def target(self, *, now: float, bench: float) -> float:
        """Return how far bench time should be [s]; inf if it goes as fast as it can."""
        if not self.running:
            return bench
        return self._from[1] + self.speed * (now - self._from[0]) if math.isfinite(self.speed) else math.inf

    def went(self, *, now: float, bench: float) -> None:
        """Take note of how far bench time has come; a debt that is too large is dropped, and reported."""
        if math.isfinite(self.speed) and self.target(now=now, bench=bench) - bench > LATE * self.speed:
            self._from, self._late_until = (now, bench), now + OVER
        self._went.append((now, bench))
        while len(self._went) > 2 and self._went[1][0] <= now - OVER:
            self._went.popleft()

    @property
    def behind(self) -> bool:
        """Whether it could not keep up within the last second."""
        return self._went[-1][0] < self._late_until

    @property
    def measured(self) -> float:
        """Bench seconds per second on the wall over the last second; 0 while it stands."""
        (first, start), (last, end) = self._went[0], self._went[-1]
        return (end - start) / (last - first) if self.running and last > first else 0.0


# --- The state of a bench for a page ----------------------------------------------------------------------------------

class Snapshot(NamedTuple):
    """A bench at an instant; nothing of it changes any more."""

    scene: Scene
    models: tuple[Model, ...]
    registers: tuple[Servo, ...]
    load_numbers: dict[str, float]
    columns: tuple[tuple[str, ...], ...]
    frame_rate: float


def snapshot_of(bench: LiveBench) -> Snapshot:
    """Return a bench as it is now."""
    return Snapshot(bench.scene(), bench.now_models, tuple(map(bench.register_servo, range(len(bench.models)))),
                    dict(bench.load_numbers), bench.columns, bench.frame_rate)


def state_of(seen: Snapshot) -> dict[str, Any]:
    """Return what a page needs of a bench.

    Examples
    --------
    >>> from servotwin.web.live import LiveBench
    >>> from servotwin.web.server.serve import first_scene
    >>> state = state_of(snapshot_of(LiveBench(first_scene())))
    >>> [servo["model"] for servo in state["servos"]], state["frame_rate"]
    (['PulseServo'], 50.0)
    """
    scene = seen.scene
    return {"scene": scene.text(), "name": scene.name,
            "servos": [servo_facts(seen, k) for k in range(len(scene.servos))],
            "loads": load_facts(scene, seen.load_numbers), "view": dict(scene.view), "lesson": dict(scene.lesson),
            "supply": dict(scene.supply) or None, "control": dict(scene.control) or None,
            "of_catalog": [servo.id for servo in scene.servos], "frame_rate": seen.frame_rate,
            "unknowns": unknowns() if scene.servos[0].mystery is not None else []}


def servo_facts(seen: Snapshot, servo: int) -> dict[str, Any]:
    """Return what a page gets of a servo; of a mystery not what is hidden."""
    facts = facts_of(seen.models[servo], seen.scene, seen.registers[servo])
    if seen.scene.servos[servo].mystery is not None:
        facts["parameters"] = [one for one in facts["parameters"] if not is_hidden(one["name"])]
    return {**facts, "servo": servo, "columns": seen.columns[servo]}


def changes_of(seen: Snapshot, servos: list[int]) -> dict[str, Any]:
    """Return what a page needs of servos whose numbers were changed."""
    return {"changed": [servo_facts(seen, k) for k in servos], "loads": load_facts(seen.scene, seen.load_numbers)}


# --- Work beside the benches that takes longer than a turn: in a thread of its own, for so long and no longer ---------

Found = TypeVar("Found")
LONGEST_ASIDE = 30.0
"""How long something may take, unless it is given more time [s]."""
EXPORTS = asyncio.Semaphore(2)
"""So many long ones at once, of all visitors."""


class _StoppedError(BaseException):
    """The end of a computation whose result no request waits for."""


async def aside(what: str, work: Callable[[], Found], seconds: float | None = None) -> Found:
    """Return what a function returns, while the benches continue; it ends when nobody waits for it any more.

    The interpreter proceeds within a function of Python at any time, so it can be stopped at any time: what it does is
    to have no effect but what it returns.

    Parameters
    ----------
    what : str
        For messages.
    work : callable
    seconds : float
        How long it may take [s]; `LONGEST` unless given.

    Raises
    ------
    InputError
        If it takes longer.

    Examples
    --------
    >>> asyncio.run(aside("sum", lambda: sum([1, 2])))
    3
    """
    loop, most = asyncio.get_running_loop(), LONGEST_ASIDE if seconds is None else seconds
    found: asyncio.Future[Found] = loop.create_future()
    thread = threading.Thread(target=_compute, args=(work, loop, found), name=what, daemon=True)
    thread.start()
    try:
        async with asyncio.timeout(most):
            return await asyncio.shield(found)
    except TimeoutError:
        raise InputError(what, got=f"more than {most:g} s of work", allowed="something shorter") from None
    finally:
        if not found.done() and thread.ident is not None:
            found.cancel()
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident), ctypes.py_object(_StoppedError))


def _compute(work: Callable[[], Found], loop: asyncio.AbstractEventLoop, found: asyncio.Future[Found]) -> None:
    with contextlib.suppress(_StoppedError, RuntimeError):  # stopped; or the loop is gone
        try:
            value = work()
        except Exception as error:
            loop.call_soon_threadsafe(_tell, found, partial(found.set_exception, error))
        else:
            loop.call_soon_threadsafe(_tell, found, partial(found.set_result, value))


def _tell(found: asyncio.Future[Found], tell: Callable[[], object]) -> None:
    if not found.done():
        tell()


# --- A room: a bench that runs in real time, and the browsers that look at it -----------------------------------------

RATE = 60.0
"""Pushes a second."""
POINTS = 3.0  # of a push: 180 a second are more than a screen has columns
COARSEST = 120.0  # Hz: of points, however fast time goes
FRAME_POINTS = 20.0  # of a single frame
TICK = 1e-3  # s, of a bus servo
ROUNDING = 1e-12  # of an instant: the share that does not count
FAR = 1e3  # s, at most at once
_TOLD_AGAIN = 0.2  # s between two messages of what has changed, at least
_ASIDE = 5.0  # times as long as it takes to put such a message together
_MOST_LOOKS = 3  # at a bench that changes while its state is put together


class Room:
    """A bench that runs in real time, and the browsers that look at it.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self.outboxes: list[Outbox] = []
        self.pace = Pace(_now())
        self._version = 0  # of all that a page is sent but once
        self._told: tuple[int, str] = (-1, "")  # of which version a page is sent what
        self._telling = asyncio.Lock()
        self._tasks: set[asyncio.Task[None]] = set()
        self._install(LiveBench(replace(scene, end=0.0)), scene.end)

    # --- what is done -------------------------------------------------------------------------------------------------

    def put(self, scene: Scene) -> None:
        """Begin with another bench; what was done at it is done again, as fast as it goes.

        Raises
        ------
        ServotwinError
            If it is not possible: the bench stays as it was.
        """
        self._begin(*_built(scene, self._speed()))

    async def begin(self, what: str, make: Callable[[], Scene]) -> None:
        """Begin with the bench of a scene that is made, read and built while the present one runs.

        Raises
        ------
        ServotwinError
            If it is not possible, or takes too long: the bench stays as it was.
        """
        speed = self._speed()
        self._begin(*await aside(what, lambda: _built(make(), speed)))

    def _begin(self, bench: LiveBench, end: float, told: str) -> None:
        self._install(bench, end)
        self._told = self._version, told
        for box in self.outboxes:
            box.text(told)
        self.show()

    def _install(self, bench: LiveBench, end: float) -> None:
        self.bench, self._end, self._stint = bench, end, Stint(bench)
        self._changed: set[int] = set()
        self._told_at, self._told_for = 0.0, 0.0
        self._version += 1
        self.pace.run(end == 0.0, now=_now(), bench=bench.time)

    def show(self) -> None:
        """Push how all stands at this instant."""
        bench = self.bench
        self._push(Push(bench.time, tuple(ServoPush(columns, [row], []) for columns, row in zip(
            bench.columns, bench.rows, strict=True)), []))

    async def reset(self) -> None:
        """Begin anew with the same servos: as they are, without what was done."""
        scene = self.bench.scene()
        first = tuple(action for action in scene.actions if action.time == 0.0)
        await self.begin("new beginning", lambda: replace(scene, actions=first, end=0.0))

    def do(self, kind: str, value: Any, servo: int | None) -> float:
        """Do something now; return when [s].

        Raises
        ------
        ServotwinError
            If it is not possible; nothing has changed then.
        """
        if self.replaying:
            raise InputError("action", got="while the bench is being repeated", allowed="a moment later")
        action = self.bench.do(kind, value, servo)
        if kind in ("set", "register"):
            self._changed |= set(range(len(self.bench.models))) if servo is None else {servo}
            self._stint.begin()
        if kind not in ("command", "push"):
            self._version += 1
        return action.time

    def run(self, running: bool) -> None:
        """Let time advance, or stand still."""
        if running and self._stint.broken is not None:
            raise InputError("bench", got=self._stint.broken, allowed="a new beginning")
        self.pace.run(running, now=_now(), bench=self.bench.time)
        self._version += 1
        self.show()  # whole: it may take the place of a push that waits

    def ask(self, speed: object) -> None:
        """Let time go at another speed."""
        self.pace.ask(speed, now=_now(), bench=self.bench.time)
        self._version += 1

    def step(self) -> None:
        """Advance by one frame, or by a tick of a bus servo, and stand."""
        if self.replaying or self._stint.broken is not None:
            raise InputError("single frame", got=self._stint.broken or "a bench that is being repeated",
                             allowed="one that stands")
        self.pace.run(False, now=_now(), bench=self.bench.time)
        until = self._next_frame()
        push = self._stint.to(until, max(COARSEST, FRAME_POINTS / (until - self.bench.time)))
        self._stand_if_broken()
        self._push(push)

    @property
    def replaying(self) -> bool:
        """Whether it is still doing what was done before."""
        return self._stint.broken is None and (self.bench.due or not self.bench.reached(self._end))

    def _next_frame(self) -> float:
        bench = self.bench
        if not any("pulse_width" in columns for columns in bench.columns):
            return bench.time + TICK
        edge = bench.next_edge
        return edge if edge > bench.time * (1.0 + ROUNDING) else edge + 1.0 / bench.frame_rate

    # --- time ---------------------------------------------------------------------------------------------------------

    async def live(self) -> None:
        """Run for ever: push what shows, and let others have their turn."""
        due = _now()
        while True:
            self.turn()
            if self._changed and _now() - self._told_at > max(_TOLD_AGAIN, _ASIDE * self._told_for):
                self._tell_changes()
            waits = not (self.replaying or (self.pace.running and math.isinf(self.pace.speed)))
            if self.replaying and not all(box.free for box in self.outboxes):
                waits = True  # what is repeated is shown as a whole
            due = max(due + 1.0 / RATE, _now()) if waits else _now()
            await asyncio.sleep(max(due - _now(), 0.0))

    def turn(self) -> None:
        """Advance as far as time on the wall, or the budget of a turn, allows; push what shows."""
        bench, pace = self.bench, self.pace
        if self.replaying:
            if all(box.free for box in self.outboxes):
                self._push(self._stint.until(self._end, COARSEST))
                pace.begin(now=_now(), bench=bench.time)
        elif pace.running:
            target = min(pace.target(now=_now(), bench=bench.time), bench.time + FAR)
            speed = pace.speed if math.isfinite(pace.speed) else 1.0
            pushed = self._stint.until(target, max(COARSEST, POINTS * RATE / speed))
            pace.went(now=_now(), bench=bench.time)
            self._push(pushed)
        self._stand_if_broken()

    def _stand_if_broken(self) -> None:
        if self._stint.broken is not None and (self.pace.running or self._end):
            self._end = 0.0
            self.pace.run(False, now=_now(), bench=self.bench.time)
            self.say({"said": f"the bench stands: {self._stint.broken}"})
            self.show()

    # --- what is sent -------------------------------------------------------------------------------------------------

    def say(self, message: dict[str, Any]) -> None:
        """Tell all who look at it."""
        text = text_of(message)
        for box in self.outboxes:
            box.text(text)

    async def state_text(self) -> str:
        """Return the message that tells a page all of the bench; one who comes later gets the same, if it still holds.

        Raises
        ------
        ServotwinError
            If that takes too long.
        """
        async with self._telling:
            for _ in range(_MOST_LOOKS):
                if self._told[0] == self._version:
                    break
                version, more = self._version, (self.pace.running, self._speed(), self._end)
                put_together = partial(_message, snapshot_of(self.bench), *more)
                self._told = version, await aside("state of the bench", put_together)
            return self._told[1]

    def _tell_changes(self) -> None:
        """Put together, beside the bench, what has changed, and tell it."""
        bench, seen, those, self._told_at = self.bench, snapshot_of(self.bench), sorted(self._changed), _now()
        self._changed.clear()

        async def told() -> None:
            try:
                changes = await aside("changes", lambda: changes_of(seen, those))
            except ServotwinError as error:
                self.say({"said": line_of(error)})
            else:
                if bench is self.bench:
                    self.say(changes)
            self._told_for = _now() - self._told_at
            self._told_at = _now()

        task = asyncio.ensure_future(told())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _speed(self) -> float | str:
        return self.pace.speed if math.isfinite(self.pace.speed) else UNPACED

    def _push(self, push: Push) -> None:
        """Have what shows pushed; it is packed when a browser takes it, and once for all of them."""
        bench, pace = self.bench, self.pace
        header = {"pace": pace.measured, "speed": self._speed(), "running": pace.running, "behind": pace.behind,
                  "replaying": bench.time / self._end if self.replaying and self._end else None}
        columns, rows, rate = bench.columns, tuple(bench.rows), bench.frame_rate

        @cache
        def data() -> bytes:
            lcd = [reading_of(names, row, rate) for names, row in zip(columns, rows, strict=True)]
            return packed({**header, "lcd": lcd}, push)

        for box in self.outboxes:
            box.push(data)
        for _, kind, servo in push.events:
            if kind.startswith(NOT_AT_REST):
                self.say({"said": f"servo {servo + 1} {kind}"})


def _built(scene: Scene, speed: float | str) -> tuple[LiveBench, float, str]:
    """Return a bench at its beginning, when what was done at it ends [s], and what a page is sent of it."""
    bench = LiveBench(replace(scene, end=0.0))
    return bench, scene.end, _message(snapshot_of(bench), scene.end == 0.0, speed, scene.end)


def _message(seen: Snapshot, running: bool, speed: float | str, end: float) -> str:
    return text_of({"scene": {**state_of(seen), "running": running, "speed": speed, "end": end}})
