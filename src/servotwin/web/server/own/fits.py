"""Fits of one visitor: begun, told how far, ended, and taken over to the bench."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING, Any

from servotwin.errors import InputError, ServotwinError
from servotwin.models import BoundedServo, DigitalServo, PulseServo, PulseServoInductive, default_model
from servotwin.parameters.output_side import OUTPUT_SIDE, output_value
from servotwin.parameters.servo import unit_of
from servotwin.units import si_unit
from servotwin.web.lessons import mystery
from servotwin.web.live.facts import models_of
from servotwin.web.live.scene_servo import model_named
from servotwin.web.live.taken_over import HOW, taken_over
from servotwin.web.server.own.process import EndedError, Work
from servotwin.web.server.wire import line_of

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Servo
    from servotwin.web.server.own.brought import Brought

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
        What the visitor brought.
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
        """Begin a fit; the page is told how far it is and what comes of it.

        Raises
        ------
        InputError
            If another fit goes on, or this one is not possible.
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
        """End the fit that goes on, if it is of this visitor."""
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
