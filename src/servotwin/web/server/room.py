"""A room: a bench that goes on in real time, and the browsers that look at it."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, ServotwinError
from servotwin.simulation.remarks import NOT_AT_REST
from servotwin.web.live import LiveBench, Push, Scene, ServoPush
from servotwin.web.live.readings import reading_of
from servotwin.web.server.aside import aside
from servotwin.web.server.pace import UNPACED, Pace
from servotwin.web.server.state import Snapshot, changes_of, snapshot_of, state_of
from servotwin.web.server.stint import Stint
from servotwin.web.server.wire import line_of, packed, text_of

if TYPE_CHECKING:
    from servotwin.web.server.outbox import Outbox

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
    """A bench that goes on in real time, and the browsers that look at it.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self.outboxes: list[Outbox] = []
        self.pace = Pace(_now())
        self._version = 0  # of all that a page is told but once
        self._told: tuple[int, str] = (-1, "")  # of which version a page is told what
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
        """Begin with the bench of a scene that is made, read and built while the present one goes on.

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
        """Let time go on, or stand still."""
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
        """Go on by one frame, or by a tick of a bus servo, and stand."""
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
        """Go on for ever: push what shows, and let others have their turn."""
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
        """Go on as far as time on the wall, or the budget of a turn, allows; push what shows."""
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

    # --- what is told -------------------------------------------------------------------------------------------------

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
    """Return a bench at its beginning, when what was done at it ends [s], and what a page is told of it."""
    bench = LiveBench(replace(scene, end=0.0))
    return bench, scene.end, _message(snapshot_of(bench), scene.end == 0.0, speed, scene.end)


def _message(seen: Snapshot, running: bool, speed: float | str, end: float) -> str:
    return text_of({"scene": {**state_of(seen), "running": running, "speed": speed, "end": end}})


def _now() -> float:
    return time.monotonic()
