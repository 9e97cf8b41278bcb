"""A room: a bench that goes on in real time, and the browsers that look at it."""

from __future__ import annotations

import asyncio
import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, ServotwinError
from servotwin.web.lessons.mystery import is_hidden, unknowns
from servotwin.web.live import LiveBench, Push, Scene, ServoPush
from servotwin.web.live.facts import facts_of, load_facts
from servotwin.web.live.readings import reading_of
from servotwin.web.server.pace import UNPACED, Pace
from servotwin.web.server.wire import line_of, packed, text_of

if TYPE_CHECKING:
    from servotwin.web.server.outbox import Outbox

RATE = 60.0
"""Pushes a second."""
_POINTS = 4.0  # of a push
_COARSEST = 120.0  # Hz: of points, however fast time goes
_BUDGET = 0.010  # s of computing at a stretch: then others have their turn
_SLICE = 0.004  # s of bench time between two looks at the clock, at least
_TOLD_AGAIN = 0.2  # s between two messages of what has changed


class Room:
    """A bench that goes on in real time, and the browsers that look at it.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self.outboxes: list[Outbox] = []
        self.pace = Pace(_now())
        self._changed: set[int] = set()
        self._told = 0.0
        self._cost = _SLICE  # s of computing for a second of bench time, about
        self.put(scene)

    # --- what is done -------------------------------------------------------------------------------------------------

    def put(self, scene: Scene) -> None:
        """Begin with another bench; what was done at it is done again, as fast as it goes.

        Raises
        ------
        ServotwinError
            If it is not possible: the bench stays as it was.
        """
        bench = LiveBench(replace(scene, end=0.0))
        self.bench, self._end = bench, scene.end
        self._broken: str | None = None
        self.pace.run(scene.end == 0.0, now=_now(), bench=bench.time)
        self.say({"scene": self.state()})
        self.show()

    def show(self) -> None:
        """Push how all stands at this instant."""
        bench = self.bench
        self._push(Push(bench.time, tuple(ServoPush(columns, [row], []) for columns, row in zip(
            bench.columns, bench.rows, strict=True)), []))

    def reset(self) -> None:
        """Begin anew with the same servos: as they are, without what was done."""
        scene = self.bench.scene()
        first = tuple(action for action in scene.actions if action.time == 0.0)
        self.put(replace(scene, actions=first, end=0.0))

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
        return action.time

    def run(self, running: bool) -> None:
        """Let time go on, or stand still."""
        if running and self._broken is not None:
            raise InputError("bench", got=self._broken, allowed="a new beginning")
        self.pace.run(running, now=_now(), bench=self.bench.time)
        self.show()  # whole: it may take the place of a push that waits

    def ask(self, speed: object) -> None:
        """Let time go at another speed."""
        self.pace.ask(speed, now=_now(), bench=self.bench.time)

    def step(self) -> None:
        """Go on by one frame, or by a tick of a bus servo, and stand."""
        if self.replaying or self._broken is not None:
            raise InputError("single frame", got=self._broken or "a bench that is being repeated",
                             allowed="one that stands")
        self.pace.run(False, now=_now(), bench=self.bench.time)
        until = self._next_frame()
        self._push(self._advance(until, max(_COARSEST, 20.0 / (until - self.bench.time))))

    @property
    def replaying(self) -> bool:
        """Whether it is still doing what was done before."""
        return self.bench.time < self._end

    def _next_frame(self) -> float:
        bench = self.bench
        if not any("pulse_width" in columns for columns in bench.columns):
            return bench.time + 1e-3
        edge = bench.next_edge
        return edge if edge > bench.time * (1.0 + 1e-12) else edge + 1.0 / bench.frame_rate

    # --- time ---------------------------------------------------------------------------------------------------------

    async def live(self) -> None:
        """Go on for ever: push what shows, and let others have their turn."""
        while True:
            start = _now()
            self.turn()
            waits = not (self.replaying or (self.pace.running and math.isinf(self.pace.speed)))
            if self.replaying and not all(box.free for box in self.outboxes):
                waits = True  # what is repeated is shown as a whole
            await asyncio.sleep(max(1.0 / RATE - (_now() - start), 0.0) if waits else 0.0)

    def turn(self) -> None:
        """Go on as far as time on the wall, or the budget of a turn, allows; push what shows."""
        bench, pace = self.bench, self.pace
        if self.replaying:
            if all(box.free for box in self.outboxes):
                self._push(self._until(self._end, _COARSEST))
                pace.begin(now=_now(), bench=bench.time)
        elif pace.running:
            target = min(pace.target(now=_now(), bench=bench.time), bench.time + 1e3)
            speed = pace.speed if math.isfinite(pace.speed) else 1.0
            pushed = self._until(target, max(_COARSEST, _POINTS * RATE / speed))
            pace.went(now=_now(), bench=bench.time)
            self._push(pushed)
        if self._changed and _now() - self._told > _TOLD_AGAIN:
            self._told = _now()
            self.say({"changed": [self._facts(k) for k in sorted(self._changed)],
                      "loads": load_facts(self.bench.scene(), self.bench.load_numbers)})
            self._changed.clear()

    def _until(self, target: float, points: float) -> Push:
        """Go on to a time, but for no longer than a turn may take."""
        start, pushes = _now(), [self._nothing()]
        while self.bench.time < target and _now() - start < _BUDGET and self._broken is None:
            until = min(target, self.bench.time + max(_SLICE, 0.2 * _BUDGET / max(self._cost, 1e-6)))
            before, at = self.bench.time, _now()
            pushes.append(self._advance(until, points))
            if self.bench.time > before:
                self._cost = (_now() - at) / (self.bench.time - before)
        return joined(pushes)

    def _advance(self, until: float, points: float) -> Push:
        try:
            return self.bench.advance(until, points)
        except ServotwinError as error:
            self._broken, self._end = line_of(error), 0.0
            self.pace.run(False, now=_now(), bench=self.bench.time)
            self.say({"said": f"the bench stands: {self._broken}"})
            return self._nothing()

    def _nothing(self) -> Push:
        return Push(self.bench.time, tuple(ServoPush(columns, [], []) for columns in self.bench.columns), [])

    # --- what is told -------------------------------------------------------------------------------------------------

    def say(self, message: dict[str, Any]) -> None:
        """Tell all who look at it."""
        text = text_of(message)
        for box in self.outboxes:
            box.text(text)

    def state(self) -> dict[str, Any]:
        """Return what a page has to know of the bench as it is."""
        scene = self.bench.scene()
        mystery = unknowns() if scene.servos[0].mystery is not None else []
        return {"scene": scene.text(), "name": scene.name, "servos": [self._facts(k) for k in range(len(scene.servos))],
                "loads": load_facts(scene, self.bench.load_numbers), "view": dict(scene.view),
                "lesson": dict(scene.lesson), "supply": dict(scene.supply) or None, "control": dict(scene.control) or None,
                "of_catalog": [servo.id for servo in scene.servos],
                "frame_rate": self.bench.frame_rate, "running": self.pace.running, "speed": self._speed(),
                "unknowns": mystery, "end": self._end}

    def _facts(self, servo: int) -> dict[str, Any]:
        bench = self.bench
        facts = facts_of(bench.now_models[servo], bench.scene(), bench.register_servo(servo))
        if bench.scene().servos[servo].mystery is not None:
            facts["parameters"] = [one for one in facts["parameters"] if not is_hidden(one["name"])]
        return {**facts, "servo": servo, "columns": bench.columns[servo]}

    def _speed(self) -> float | str:
        return self.pace.speed if math.isfinite(self.pace.speed) else UNPACED

    def _push(self, push: Push) -> None:
        if not self.outboxes:
            return
        bench, pace = self.bench, self.pace
        data = packed({
            "pace": pace.measured, "speed": self._speed(), "running": pace.running, "behind": pace.behind,
            "replaying": bench.time / self._end if self.replaying else None,
            "lcd": [reading_of(columns, row, bench.frame_rate)
                    for columns, row in zip(bench.columns, bench.rows, strict=True)]}, push)
        for box in self.outboxes:
            box.push(data)


def joined(pushes: list[Push]) -> Push:
    """Return pushes that follow each other as one.

    Examples
    --------
    >>> one = Push(1.0, (ServoPush(("time",), [(1.0,)], []),), [])
    >>> joined([one, one._replace(time=2.0)]).time
    2.0
    """
    if len(pushes) == 1:
        return pushes[0]
    servos = tuple(ServoPush(parts[0].columns, [row for part in parts for row in part.points],
                             [pulse for part in parts for pulse in part.pulses])
                   for parts in zip(*(push.servos for push in pushes), strict=True))
    return Push(pushes[-1].time, servos, [event for push in pushes for event in push.events])


def _now() -> float:
    return time.monotonic()
