"""A bench that runs in time: servos under one transmitter, what was done to them, and what shows of them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin import loads
from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.models import mid_travel
from servotwin.models.engine.live import posts
from servotwin.models.engine.live.posts import Sender
from servotwin.models.engine.live.screen import Looks, first_look
from servotwin.models.switched import SwitchedServo
from servotwin.parameters.groups import Supply
from servotwin.simulation.bus import MODEL_NAMES, MODELS, OF_BUS, check_rigid, check_supply, on_supply, source_of
from servotwin.simulation.bus_run import BusSteps
from servotwin.simulation.lanes.inputs import LOAD_NAMES
from servotwin.simulation.remarks import NOT_AT_REST, Remark
from servotwin.simulation.rest import LEAST_REST, constant_since, look_period, looks_at, swing_of
from servotwin.units import is_finite
from servotwin.web.live.actions import Action, checked
from servotwin.web.live.rules import LONGEST
from servotwin.web.live.scene import MOST_ACTIONS, Scene, family_of, with_registers
from servotwin.web.live.station import FrameEdge, Row, Seen, Station

if TYPE_CHECKING:
    from collections.abc import Mapping

    from servotwin.models import Model
    from servotwin.parameters import Servo


# --- Servos of a bench that hang on one supply: its voltage joins them ------------------------------------------------

class SharedSupply:
    """The supply that all stations of a bench hang on; what it is, the servo of each of them says alike.

    Parameters
    ----------
    stations : sequence of Station
        Of models that `hung` has returned.
    """

    def __init__(self, stations: Sequence[Station]) -> None:
        self._stations, self._steps = stations, BusSteps()

    def advance(self, until: float, rate: float, *, switches: bool = True) -> list[Seen]:
        """Advance all to a time [s]; return what shows of each, as `Station.advance` does.

        Raises
        ------
        SimulationError
            If they cannot continue.
        """
        those = self._stations
        looks = Looks(first_look(those[0].state.time, rate), rate, until, 1, int(switches))
        states, shown = self._steps.go_on(
            source_of(those[0].model.servo.supply), [one.plan for one in those], [one.state for one in those],
            [one.lines for one in those], looks, those[0].tell)
        for one, state in zip(those, states, strict=True):
            one.state = state
        return [one.seen(own) for one, own in zip(those, shown, strict=True)]


def hung(models: Sequence[Model], load: Load, supply: Mapping[str, float]) -> tuple[Model, ...]:
    """Return models as they are on a supply that they share.

    Parameters
    ----------
    models : sequence of Model
    load : Load
        Of each of them.
    supply : mapping
        Numbers of the group `supply` (SI).

    Raises
    ------
    InputError
        If one of them cannot be, or the supply is none.
    """
    shared = Supply(**supply)
    check_supply("supply of a scene", shared)
    found = []
    for k, model in enumerate(models):
        if not isinstance(model, MODELS):
            raise InputError(f"model of servo {k + 1} on a shared supply", got=type(model).__name__,
                             allowed=MODEL_NAMES)
        found.append(on_supply(model, shared))
        check_rigid(f"servo {k + 1} on a shared supply", found[-1].plant(load).elastic)
    return tuple(found)


# --- The transmitter of pulses: a frame clock whose rate may change, and frames that get lost -------------------------


class Transmitter:
    """A frame clock; a new rate takes effect after the frame that has begun.

    Parameters
    ----------
    rate : float
        Frames per second [Hz].
    seed : int
        Of which frames are lost.

    Examples
    --------
    >>> sender = Transmitter(50.0, seed=0)
    >>> [round(edge.time, 6) for edge in sender.until(0.05)], sender.until(0.05)
    ([0.0, 0.02, 0.04], [])
    """

    def __init__(self, rate: float, seed: int) -> None:
        self._clock: Any = SimpleNamespace(**Sender(rate, 0.0, seed, 0.0, 0, 0, 0.0)._asdict())

    @property
    def rate(self) -> float:
        """Frames per second [Hz]."""
        return float(self._clock.rate)

    @property
    def next_edge(self) -> float:
        """When the next frame begins [s]."""
        return posts.next_edge(self._clock)

    def snapped(self, time: float) -> float:
        """Return a time, or that of the edge right next to it: what is a billionth of a frame away is the edge [s]."""
        return posts.snapped(self._clock, time)

    def tune(self, rate: float) -> None:
        """Take another rate [Hz] from the next edge on."""
        posts.tune(self._clock, rate)

    def lose(self, share: float) -> None:
        """Let a share of the frames get lost from now on."""
        self._clock.lost = share

    def until(self, time: float) -> list[FrameEdge]:
        """Return the frames that begin before a time [s] and were not returned yet."""
        edges = []
        while (edge := self.next_edge) < time:
            edges.append(FrameEdge(edge, not posts.is_lost(self._clock)))
            posts.pass_edge(self._clock)
        return edges


# --- Watches whether the shaft of a servo at the bench comes to rest once nothing is done to it any more --------------

_MOST = 4000  # points: over ten seconds of them
_AGAIN = 0.5  # s between two looks


class RestWatch:
    """Watches one servo; says once that it does not come to rest, until something is done again.

    Parameters
    ----------
    station : Station
    """

    def __init__(self, station: Station) -> None:
        self._station = station
        self.begin(station.state.time)

    def begin(self, time: float) -> None:
        """Forget what was seen: something was done at this time [s]."""
        self._since, self._next, self._said = time, time + LEAST_REST, False
        self._seen: deque[tuple[float, float]] = deque(maxlen=_MOST)

    def see(self, rows: Sequence[Row]) -> list[str]:
        """Take what shows of the time that has passed; return what is to be said, as people read it."""
        station = self._station
        model, names = station.model, station.columns
        if self._said or model.endless or not rows or "command_angle" not in model.available:
            return []
        at = names.index("output_angle")
        self._seen.extend((row[0], row[at]) for row in rows)
        now = rows[-1][0]
        if now < self._next:
            return []
        self._next = now + _AGAIN
        still = max(self._since, constant_since(station.told.shape.pieces.table, now), self._seen[0][0])
        if not now - still >= LEAST_REST:
            return []
        time, angle = np.array(self._seen).T
        looks = looks_at(still, now, look_period(model))
        found = swing_of(looks, np.interp(looks, time, angle))
        self._said = found.swing > 0.0
        return [Remark(NOT_AT_REST, now, **found._asdict()).words] if self._said else []


# --- The start of a bench: its models, what hangs on their shafts, and the first command of each ----------------------

_ARM = 0.1  # m, of a scene that gives none
_PLAY = "gear.backlash"
NO_PLAY = "none, unless it is changed at the bench"
"""Source of the play of a servo of which none is known."""


def models_of(scene: Scene) -> tuple[Model, ...]:
    """Return the models of a scene's servos, on the supply that they share, if there is one.

    Raises
    ------
    InputError
        Or one of its kinds, if one of them is not possible.

    Examples
    --------
    >>> from servotwin.web.live import Scene, SceneServo
    >>> models_of(Scene(servos=(SceneServo(id="hitec-hs-755hb"),)))
    (PulseServo('hitec-hs-755hb'),)
    """
    models = [_with_play(servo.built()) for servo in scene.servos]
    return hung(models, load_of(scene), scene.supply) if scene.supply else tuple(models)


def _with_play(model: Model) -> Model:
    """Return a model whose play is given, 0 if it is not known, so that there can be some while time advances."""
    if not isinstance(model, SwitchedServo) or model.servo.get(_PLAY) is not None:
        return model
    return type(model)(model.servo.replace({_PLAY: 0.0}, source=NO_PLAY))


def load_of(scene: Scene) -> Load:
    """Return what hangs on each shaft: always all of it, so that each number can change while time advances.

    Raises
    ------
    LoadError
        If a number is out of its range.

    Examples
    --------
    >>> from servotwin.web.live import Scene, SceneServo
    >>> load_of(Scene(servos=(SceneServo(id="hitec-hs-755hb"),), load={"mass": 0.2})).pendulum.mass
    0.2
    """
    own: dict[str, Any] = dict(scene.load)
    arm = loads.Pendulum(mass=own.pop("mass", 0.0), length=own.pop("arm", _ARM),
                         hanging_angle=own.pop("hanging_angle", 0.0))
    return loads.Load(**own) + arm


def first_commands(scene: Scene, models: Sequence[Model]) -> list[Action]:
    """Return the commands at t = 0 that a scene says, and for servos without one the middle of their travel.

    They begin with one for each servo, or with one for all.

    Examples
    --------
    >>> from servotwin.web.live import Scene, SceneServo
    >>> scene = Scene(servos=(SceneServo(id="hitec-hs-755hb"), SceneServo(id="towerpro-mg996r")))
    >>> [(action.value["value"], action.servo) for action in first_commands(scene, models_of(scene))]
    [(90.0, 0), (0.0, 1)]
    """
    said = [action for action in scene.actions if action.kind == "command" and action.time == 0.0]
    if any(action.servo is None for action in said):
        return []
    told = {action.servo for action in said}
    found = [(k, middle_of(model)) for k, model in enumerate(models) if k not in told]
    if not told and len({value for _, value in found}) == 1:
        return [Action(0.0, "command", _hold(found[0][1]))]
    return [Action(0.0, "command", _hold(value), k) for k, value in found]


def first_of(actions: Sequence[Action], servo: int) -> dict[str, Any]:
    """Return the first command of a servo, which is there."""
    return next(dict(action.value) for action in actions
                if action.kind == "command" and action.servo in (None, servo))


def middle_of(model: Model) -> float:
    """Return the middle of a model's travel, as a first command has it [deg]."""
    return round(math.degrees(mid_travel(model)), 3)


def _hold(value: float) -> dict[str, Any]:
    return {"shape": "hold", "unit": "deg", "value": value}


# --- A bench that runs in time: servos under one transmitter, what was done to them, and what shows of ----------------

_AT_FIRST = 200  # actions at t = 0 that are done at once: what scenes have
WHOLE = ("command", "push", "torque")  # of these the last at an instant is all that counts


class ServoPush(NamedTuple):
    """Signals of a servo: rows by `columns`, and edges and widths [s] of its pulses, width 0 of a lost one."""

    columns: tuple[str, ...]
    points: list[Row]
    pulses: list[tuple[float, float]]


class Push(NamedTuple):
    """Signals of a stretch of time up to `time` [s]; events are (time, kind, servo)."""

    time: float
    servos: tuple[ServoPush, ...]
    events: list[tuple[float, str, int]]


class LiveBench:
    """Servos that advance side by side under the same commands.

    Actions of a scene are done at their times; those of `do` meanwhile come beside.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    InputError
        Or one of its kinds, if a servo, a load or the first command is not possible.

    Examples
    --------
    >>> from servotwin.web.live import SceneServo
    >>> bench = LiveBench(Scene(servos=(SceneServo(id="hitec-hs-755hb"),)))
    >>> _ = bench.do("command", {"shape": "hold", "unit": "us", "value": 1800.0})
    >>> push = bench.advance(0.5, 100.0)
    >>> push.time, len(push.servos[0].pulses), [action.kind for action in bench.scene().actions]
    (0.5, 25, ['command', 'command'])
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.models, load = models_of(scene), load_of(scene)
        self._todo = deque([*first_commands(scene, self.models), *scene.actions])
        self._stations = [Station(model, load, first_of(self._todo, k), scene.seed + k, scene.control)
                          for k, model in enumerate(self.models)]
        self._watches = [RestWatch(station) for station in self._stations]
        self._begun = self._first_ones()
        self._hurry: Callable[[], bool] | None = None
        self._supply = SharedSupply(self._stations) if scene.supply else None
        self._sender = Transmitter(scene.frame_rate, scene.seed)
        self._check_rate(scene.frame_rate)
        self._written: list[dict[str, int]] = [{} for _ in self.models]  # into registers
        self._done: list[Action] = []
        self.time = 0.0
        """[s]"""
        self.load_numbers: dict[str, float] = {}
        """Changes of loads since the start, by dotted name (SI)."""
        self._catch_up(_AT_FIRST)
        self.rows: list[Row] = [station.now() for station in self._stations]
        """The latest row of each servo."""

    @property
    def columns(self) -> tuple[tuple[str, ...], ...]:
        """Names of what rows have, of each servo."""
        return tuple(station.columns for station in self._stations)

    @property
    def frame_rate(self) -> float:
        """Of the transmitter [Hz]."""
        return self._sender.rate

    @property
    def now_models(self) -> tuple[Model, ...]:
        """The models with their numbers of now."""
        return tuple(station.model for station in self._stations)

    @property
    def next_edge(self) -> float:
        """When the next frame begins [s]."""
        return self._sender.next_edge

    @property
    def due(self) -> bool:
        """Whether something is still to be done before time advances."""
        return bool(self._todo) and self.reached(self._todo[0].time)

    def reached(self, time: float) -> bool:
        """Tell whether the bench has come to a time [s]; one that is a rounding behind its edge is the edge."""
        return self._sender.snapped(time) <= self.time

    def hurried(self, hurry: Callable[[], bool], tell: Callable[[float], object]) -> None:
        """Let somebody else decide how long it may take.

        Parameters
        ----------
        hurry : callable
            Says whether `advance` is to return early, between two things that were done at one instant.
        tell : callable
            Called with the time [s] now and then within a motion; the bench cannot continue after it has raised.
        """
        self._hurry = hurry
        for station in self._stations:
            station.tell = tell

    def register_servo(self, servo: int) -> Servo:
        """Return a servo as it was at the start, with all registers that were written since."""
        base = self.models[servo].servo
        return with_registers(base, self._written[servo]) if self._written[servo] else base

    def scene(self) -> Scene:
        """Return the scene as it is now: what was done so far, and what was still to be done."""
        return replace(self._scene, end=self.time, actions=(*self._done, *self._todo))

    def show(self, view: dict[str, Any]) -> None:
        """Keep what a page wants to be remembered of itself, as `checked_view` returns it."""
        self._scene = replace(self._scene, view=view)

    def do(self, kind: str, value: Any, servo: int | None = None) -> Action:
        """Do something now; it is kept with its time.

        Parameters
        ----------
        kind : str
            One of `servotwin.web.live.actions.KINDS`.
        value : object
            Value of the kind.
        servo : int, optional
            To which servo; to all that it fits unless given.

        Raises
        ------
        InputError
            Or one of its kinds; nothing has changed then.
        """
        action = checked(self.time, kind, value, servo, len(self._stations))
        if len(self._done) + len(self._todo) >= MOST_ACTIONS:
            raise InputError("record of the bench", got=f"{MOST_ACTIONS} actions", allowed="no more: start it anew")
        self._act(action)
        return action

    def advance(self, until: float, points_per_second: float, *, switches: bool = True) -> Push:
        """Advance to a time; return what shows on the way.

        Parameters
        ----------
        until : float
            Not before the bench's time [s].
        points_per_second : float
            How often to look [Hz].
        switches : bool
            Whether there is a point just before and one just after a bridge switches, too.

        Raises
        ------
        SimulationError
            If a servo cannot continue.
        """
        if not (is_finite(until) and self.time <= until <= LONGEST):
            raise InputError("advance(until)", got=until, allowed=f"a time from {self.time:g} to {LONGEST:g} s")
        rows: list[list[Row]] = [[] for _ in self._stations]
        pulses: list[list[tuple[float, float]]] = [[] for _ in self._stations]
        events: list[tuple[float, str, int]] = []
        self._catch_up()
        while not (self.reached(until) or self.due):
            end = self._sender.snapped(min(until, self._todo[0].time) if self._todo else until)
            end = min(end, *self._looks())
            if end <= self.time:
                break
            self._go_on(end, points_per_second, switches, rows, pulses, events)
            self._look()
            self._catch_up()
        return Push(self.time, tuple(map(ServoPush, self.columns, rows, pulses)), events)

    def _go_on(self, until: float, rate: float, switches: bool, rows: list[list[Row]],
               pulses: list[list[tuple[float, float]]], events: list[tuple[float, str, int]]) -> None:
        if until > self.time:
            edges = self._sender.until(until)
            for k, station in enumerate(self._stations):
                pulses[k] += station.told.hear(edges)
            for k, seen in enumerate(self._seen(until, rate, switches)):
                rows[k] += seen.rows
                self.rows[k] = rows[k][-1] if rows[k] else self.rows[k]
                events += [(time, kind, k) for time, kind in seen.events]
                events += [(until, said, k) for said in self._watches[k].see(seen.rows)]
            self.time = until

    def _looks(self) -> list[float]:
        """Return when the control circuit of each station looks at its command next [s]; inf without one."""
        return [math.inf if one.told.control is None else
                self._sender.snapped(one.told.control.next_look(self._sender.next_edge)) for one in self._stations]

    def _look(self) -> None:
        """Let the control circuits look whose time it is."""
        for station, when, columns, row in zip(self._stations, self._looks(), self.columns, self.rows, strict=True):
            if when <= self.time:
                full = station.model.value("supply.open_circuit_voltage")
                station.told.look(self.time, row[columns.index("bus_voltage")], full)

    def _seen(self, until: float, rate: float, switches: bool) -> list[Seen]:
        if self._supply is not None:
            return self._supply.advance(until, rate, switches=switches)
        return [station.advance(until, rate, switches=switches) for station in self._stations]

    def _catch_up(self, most: float = math.inf) -> None:
        """Do what the scene says was done by now, or, in a hurry, some of it."""
        count = 0
        while self.due and count < most and not (count and self._hurry is not None and self._hurry()):
            self._act(self._todo.popleft())
            count += 1

    def _act(self, action: Action) -> None:
        """Do something to all servos that it fits, or to none; keep it."""
        put = _WAYS[action.kind](self, action)
        for one in put:
            one()
        for watch in self._watches:
            watch.begin(self.time)
        last = self._done[-1] if len(self._done) > self._begun else None
        if last is not None and action.kind in WHOLE and (last.time, last.kind, last.servo) == (
                action.time, action.kind, action.servo):
            self._done.pop()  # a slider that is dragged while time stands
        self._done.append(action)

    def _first_ones(self) -> int:
        """Return how many actions at the front say where all servos begin."""
        left = set(range(len(self.models)))
        for n, action in enumerate(self._todo):
            if not left:
                return n
            if action.kind == "command":
                left -= set(left) if action.servo is None else {action.servo}
        return len(self._todo)

    def _those(self, action: Action) -> list[Station]:
        return self._stations if action.servo is None else [self._stations[action.servo]]

    def _command(self, action: Action) -> list[Callable[[], object]]:
        found = [(one, one.told.takes(one.model, action.value, action.time)) for one in self._those(action)]
        return [partial(one.told.put, command) for one, command in found]

    def _set(self, action: Action) -> list[Callable[[], object]]:
        shared = self._supply is not None and any(name in OF_BUS for name in action.value)
        those = self._stations if shared else self._those(action)
        found = [(one, own) for one in those if (own := numbers_for(one.model, action.value))]
        if not found:
            raise InputError(", ".join(action.value), got="no servo here reads it", allowed="what a model here reads")
        changes = [(one, one.changed(own)) for one, own in found]
        loads_set = {name: value for name, value in action.value.items() if name in LOAD_NAMES}
        return [*(partial(one.put, change) for one, change in changes), partial(self.load_numbers.update, loads_set)]

    def _register(self, action: Action) -> list[Callable[[], object]]:
        those = [k for k in range(len(self._stations)) if action.servo in (None, k)
                 and (action.servo == k or family_of(self.models[k].servo) is not None)]
        if not those:
            raise InputError(", ".join(action.value), got="no bus servo", allowed="registers of a bus servo")
        put: list[Callable[[], object]] = []
        for k in those:
            written = {**self._written[k], **action.value}
            before, after = self.register_servo(k), with_registers(self.models[k].servo, written)
            own = {name: after.get(name) for name in dict.fromkeys((*before.names(), *after.names()))
                   if before.get(name) != after.get(name)}
            put += [partial(self._stations[k].put, self._stations[k].changed(own))] if own else []
            put.append(partial(self._written[k].update, action.value))
        return put

    def _push(self, action: Action) -> list[Callable[[], object]]:
        return [partial(setattr, one, "push", action.value) for one in self._those(action)]

    def _frames(self, action: Action) -> list[Callable[[], object]]:
        def put() -> None:
            if "rate" in action.value:
                self._sender.tune(action.value["rate"])
            if "lost" in action.value:
                self._sender.lose(action.value["lost"])
        self._check_rate(action.value.get("rate", 0.0))
        return [put]

    def _check_rate(self, rate: float) -> None:
        if any(one.told.widest * rate >= 1.0 for one in self._stations):
            raise InputError("frame rate", got=f"{rate:g} Hz", allowed="frames that a pulse fits into")

    def _control(self, action: Action) -> list[Callable[[], object]]:
        those = [one.told.control for one in self._stations if one.told.control is not None]
        if not those:
            raise InputError("control circuit", got=", ".join(action.value), allowed="a bench that has one")
        if any(one.longest_with(action.value) * self._sender.rate >= 1.0 for one in those):
            raise InputError("sampling_delay of the control circuit", got=action.value["sampling_delay"],
                             allowed="less than what a frame leaves after its longest pulse [s]")
        return [partial(one.numbers.update, action.value) for one in those]

    def _torque(self, action: Action) -> list[Callable[[], object]]:
        those = [one for one in self._those(action) if action.servo is not None or "duty" in one.columns]
        if not those:
            raise InputError("torque", got=action.value, allowed="nothing: no servo here has such a switch")
        changes = [(one, one.changed(None, action.value)) for one in those]
        return [partial(one.put, change) for one, change in changes]


_WAYS: dict[str, Callable[[LiveBench, Action], list[Callable[[], object]]]] = {
    "command": LiveBench._command, "set": LiveBench._set, "push": LiveBench._push, "frames": LiveBench._frames,
    "register": LiveBench._register, "torque": LiveBench._torque,
    "control": LiveBench._control}


def numbers_for(model: Model, values: dict[str, Any]) -> dict[str, Any]:
    """Return those of some numbers that a model, or its load, reads.

    Raises
    ------
    UnknownNameError
        If no servo has a parameter of this name.
    """
    read = {*model.requires, *model.optional, *LOAD_NAMES}
    for name in values:
        if name not in LOAD_NAMES:
            model.servo.get(name)
    return {name: value for name, value in values.items() if name in read}
