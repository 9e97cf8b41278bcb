"""`simulate`, from start to end, and `Simulator`, from state to state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.errors import CommandError, InputError, SimulationError, UnknownNameError
from servotwin.loads import Constant, as_load
from servotwin.models import DigitalServo, Model
from servotwin.models.columns import Samples
from servotwin.models.engine.memory import ACCURACY, Memory, started, with_bodies
from servotwin.models.engine.run.run import mode_of
from servotwin.models.outputs import PLAIN
from servotwin.models.state.modes import INSIDE, RIGID, Mode
from servotwin.models.terms.control import NOT_STARTED
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import NO_CHIP, Chip
from servotwin.models.terms.sensor import table_of
from servotwin.physics.pieces import Pieces
from servotwin.signals import Signal
from servotwin.simulation import engine
from servotwin.simulation.engine import Plan, RunLog, State, sign_of, told_by
from servotwin.simulation.frames import times_asked
from servotwin.simulation.lanes.inputs import LOAD_NAMES, check_name, check_number, with_numbers
from servotwin.simulation.progress import Progress, shown
from servotwin.simulation.remarks import warn_of
from servotwin.simulation.result import Result
from servotwin.simulation.start import Status, accuracy_of, check_start, start_vector
from servotwin.simulation.trajectory import Motions, Trajectory
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from servotwin.loads import Load, Part
    from servotwin.models import Model
    from servotwin.signals import Signal


# --- `Simulator`, which goes from state to state ----------------------------------------------------------------------

_MOST_OTHERS = 64  # servos with other numbers that a simulator keeps


class Simulator:
    """A model with its load, ready to be advanced; it holds no state itself.

    Parameters
    ----------
    model : Model
    load : Load, optional
        Load on the shaft; none unless given.
    seed : int
        Seed of all noise (the models without pulses have none).
    accuracy : float
        Error that angles may have where motions are integrated, not solved in closed form [rad], from 1e-13 to 1e-4. A
        decision or a stop at the very edge may fall otherwise.

    Examples
    --------
    >>> import servotwin as st
    >>> sim = st.Simulator(st.BoundedServo(st.load_servo("hitec-hs-755hb")))
    >>> command = st.signals.step(0.0, 90.0, unit="deg")
    >>> state = sim.initial(command)
    >>> state = sim.advance(state, 1.0, command)
    >>> 80 < 57.29578 * state["output_angle"] < 100
    True
    """

    def __init__(self, model: Model, load: Load | Part | None = None, seed: int = 0,
                 accuracy: float = ACCURACY) -> None:
        if not isinstance(model, Model):
            raise InputError("model", got=model, allowed="a model of a servo, such as BoundedServo(load_servo(...))")
        self.model = model
        self.load = as_load(load)
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
            raise InputError("seed", got=seed, allowed="a whole number")
        self.seed = int(seed)
        self.accuracy = accuracy_of(accuracy)
        self._numbers = model.pack(self.load)
        self._places = model.states
        self._torque = self.load.torque_pieces
        self._last: tuple[Signal, Plan] | None = None
        self._framed: tuple[Signal, float, Signal] | None = None
        self._others: dict[tuple[tuple[str, Any], ...], Simulator] = {}
        self._circuits: dict[float | None, tuple[Chip, Firmware]] = {}  # by the frame period of a command

    def __repr__(self) -> str:
        return f"Simulator({self.model!r})"

    def drive(self, command: Signal) -> Pieces:
        """Return the command as what the model follows [V]."""
        if not isinstance(command, Signal):
            raise CommandError("command", got=type(command).__name__, allowed="a signal of servotwin.signals")
        if self._last is not None and self._last[0] is command:
            return self._last[1].command
        return self.model.command(command)

    def initial(self, command: Signal, initial: Mapping[str, float] | None = None) -> State:
        """Return the state at t = 0: at rest where the command of just before asks for.

        Parameters
        ----------
        command : Signal
        initial : mapping, optional
            Values (SI) by signal name that replace this, such as ``{"output_angle": 0.1, "output_speed": 0.0}``.

        Raises
        ------
        UnknownNameError, InputError
            If a name is no state of the model, or a value is not finite or beyond a stop.
        """
        drive = self.drive(command)
        before = drive.table[0]._replace(value=command.initial, slope=0.0, amplitude=0.0)
        start = self.model.command(replace(command, pieces=Pieces((before,))))
        angle = float(self.model.start_angle(start.table[0].value))
        if initial is not None and not isinstance(initial, Mapping):
            raise InputError("initial", got=initial, allowed="a mapping of state names to numbers (SI)")
        for name, value in (initial or {}).items():
            if name not in (place.name for place in self.model.states):
                raise UnknownNameError(f"state of {type(self.model).__name__}", name,
                                       [place.name for place in self.model.states])
            if not is_finite(value):
                raise InputError(f"initial {name}", got=value, allowed="a finite number (SI)")
        y = start_vector(self.model.states, self._numbers, angle, initial or {})
        check_start(self.model.states, self._numbers, y)
        mesh = INSIDE if self._numbers.play.half > 0.0 else RIGID
        return State(time=0.0, places=self._places, memory=started(y, mesh, NOT_STARTED))

    def advance(self, state: State, until: float, command: Signal, *, external_torque: float = 0.0) -> State:
        """Return the state at `until` [s] under a command.

        Splitting an interval into several calls changes nothing beyond rounding. A command that differs takes
        effect at the time of `state`.

        Parameters
        ----------
        state : State
        until : float
            Not before the state's time [s].
        command : Signal
            Its time is that of the state.
        external_torque : float
            Constant torque during this call beside the load; positive pushes towards −q [N m].

        Raises
        ------
        SimulationError
            If the run cannot continue.
        """
        last = self._last  # all that changes from call to call, as a rule, is the time
        if (last is not None and last[0] is command and external_torque == last[1].external_torque
                and type(state) is State and state.places is self._places and not state.changes
                and type(until) is float and state.time <= until < math.inf
                and not command.silences and not self.load.recorded):
            return engine.run(last[1], state, until)
        return self.recorded(state, until, command, None, external_torque=external_torque)

    def observe(self, state: State, name: str, command: Signal, *, external_torque: float = 0.0) -> float:
        """Return a signal (SI) of a state, as it is before anything happens at its time.

        Parameters
        ----------
        state : State
        name : str
            Of any signal that a result of the model has.
        command : Signal
        external_torque : float
            As in `advance` [N m].

        Raises
        ------
        UnknownNameError
            If the model does not have it; the message lists those that it has.

        Examples
        --------
        >>> import servotwin as st
        >>> sim = st.Simulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), load=st.loads.Constant(0.1))
        >>> command = st.signals.step(0.0, 90.0, unit="deg")
        >>> state = sim.advance(sim.initial(command), 0.1, command)
        >>> round(sim.observe(state, "load_torque", command), 3)
        0.1
        """
        self._check(state, "observe(state)")
        own = self._with(state.changes)
        plan = own.plan(own.framed(command, state.time), external_torque)
        load = own.load + Constant(external_torque) if external_torque else own.load
        if name in PLAIN:
            with suppress(ArithmeticError, ValueError):  # of numbers; arrays have inf or nan instead
                return float(own.model.output(name, _sample(plan, state, None), plan.command, load))
        mode = mode_of(plan.numbers, plan.chip, plan.inputs, state.memory)
        return float(own.model.output(name, _sample(plan, state, mode), plan.command, load)[0])

    def changed(self, state: State, *, parameters: Mapping[str, Any] | None = None,
                torque_enable: bool | None = None) -> State:
        """Return a state from which the servo continues with other numbers; all that it remembers stays.

        Parameters
        ----------
        state : State
        parameters : mapping
            New values (SI) by dotted name, of the servo ("electronics.deadband") or of the load ("load.inertia"). They
            stay with the state and those that follow it.
        torque_enable : bool, optional
            Whether the torque of a digital servo is on.

        Raises
        ------
        InputError
            Or one of its kinds, if a name is unknown or a value is not possible.

        Examples
        --------
        >>> import servotwin as st
        >>> sim = st.Simulator(st.PulseServo(st.load_servo("hitec-hs-755hb")))
        >>> command = st.signals.constant(90.0, unit="deg")
        >>> state = sim.advance(sim.initial(command), 0.1, command)
        >>> heavy = sim.changed(state, parameters={"load.torque": 0.6})
        >>> bool(sim.advance(heavy, 1.0, command)["output_angle"] < state["output_angle"] - 0.05)
        True
        """
        self._check(state, "changed(state)")
        if torque_enable is not None:
            state = state.with_memory(with_torque(self.model, state.memory, torque_enable))
            if parameters is None:
                return state
        if not isinstance(parameters, Mapping) or not parameters:
            raise InputError("changed(parameters)", got=parameters, allowed="a mapping of names to numbers (SI)")
        changes = tuple(sorted({**dict(state.changes), **parameters}.items()))
        own = self._with(changes)
        self._check(state, "changed(parameters)", own.model)
        memory = with_bodies(state.memory, own._numbers.play.half, own._numbers.elastic.k > 0.0)
        return state.with_memory(memory, places=own.model.states, changes=changes)

    def of(self, state: State) -> Simulator:
        """Return the simulator with whose numbers a state continues: this one, unless `changed` gave it others.

        Examples
        --------
        >>> import servotwin as st
        >>> sim = st.Simulator(st.PulseServo(st.load_servo("hitec-hs-755hb")))
        >>> state = sim.initial(st.signals.constant(90.0, unit="deg"))
        >>> sim.of(sim.changed(state, parameters={"load.torque": 0.1})).load.torque
        0.1
        """
        return self._with(state.changes)

    def _with(self, changes: tuple[tuple[str, Any], ...]) -> Simulator:
        """Return the simulator of the servo and load with these numbers."""
        if not changes:
            return self
        if changes not in self._others:
            of_load: dict[str, Any] = {name: value for name, value in changes if name in LOAD_NAMES}
            servo = {name: value for name, value in changes if name not in LOAD_NAMES}
            for name, value in changes:
                if name in LOAD_NAMES:
                    check_number(name, value)
                else:
                    check_name(self.model, name)
            model = type(self.model)(self.model.servo.replace(servo)) if servo else self.model
            if len(self._others) >= _MOST_OTHERS:
                self._others.clear()
            self._others[changes] = Simulator(model, with_numbers(self.load, of_load), self.seed,
                                               self.accuracy)
        return self._others[changes]

    def _check(self, state: State, what: str, model: Model | None = None) -> None:
        if not isinstance(state, State):
            raise InputError(what, got=state, allowed="a state of this simulator")
        if state.places is self._places and model is None:
            return
        own = tuple(place.name for place in (model or self.model).states)
        if state.names != own:
            raise InputError(what, got=f"a state of {', '.join(state.names)}",
                             allowed=f"one of {', '.join(own)}, as {type(model or self.model).__name__} has")

    def recorded(self, state: State, until: float, command: Signal, record: RunLog | None, *,
                 external_torque: float = 0.0) -> State:
        """Return what `advance` does, and add motions and events to a record, where one is given."""
        self._check(state, "advance(state)")
        if not (is_finite(until) and until >= state.time):
            raise InputError("advance(until)", got=until, allowed=f"a finite time from {state.time:g} s on")
        if external_torque != 0.0 and not is_finite(external_torque):
            raise InputError("external_torque", got=external_torque, allowed="a finite number [N m]")
        own = self._with(state.changes) if state.changes else self
        if own.load.recorded:
            own.load.check_span(state.time, until)
        return engine.run(own.plan(own.framed(command, until), external_torque), state, float(until), record)

    def framed(self, command: Signal, until: float) -> Signal:
        """Return a command with its pulses one by one where it has silences, for longer than `until` [s]."""
        if not isinstance(command, Signal) or not command.silences:
            return command  # `drive` says what is wrong with what is no signal
        if self._framed is None or self._framed[0] is not command or self._framed[1] < until:
            self._framed = (command, 2.0 * until, self.model.framed(command, 2.0 * until))  # seldom anew
        return self._framed[2]

    def plan(self, command: Signal, external_torque: float = 0.0) -> Plan:
        """Return what the engine needs for a run under a command, and a constant torque beside the load [N m]."""
        if self._last is not None and self._last[0] is command and self._last[1].external_torque == external_torque:
            return self._last[1]
        drive = self.drive(command)
        if command.frame_period not in self._circuits:  # a controller has a new command at each of its ticks
            self._circuits = {command.frame_period: (self.model.chip(command) or NO_CHIP,
                                                     self.model.firmware(command) or NO_FIRMWARE)}
        chip, firmware = self._circuits[command.frame_period]
        plan = Plan(self._numbers, drive, self._torque, chip, self.model.edges(command), self.seed,
                    table_of(self.model.curve()), float(external_torque), self.accuracy, firmware)
        self._last = (command, plan)
        return plan


def with_torque(model: Model, memory: Memory, torque_enable: object) -> Memory:
    """Return a memory with the torque of a digital servo on or off."""
    if not isinstance(model, DigitalServo):
        raise InputError(f"torque_enable of {type(model).__name__}", got=torque_enable,
                         allowed="nothing: an analog servo has no such switch")
    if not isinstance(torque_enable, bool | np.bool_):
        raise InputError("torque_enable", got=torque_enable, allowed="True or False")
    return memory._replace(firm=(memory.firm[0]._replace(torque=int(torque_enable)),))


def _sample(plan: Plan, state: State, mode: Mode | None) -> Samples:
    """Return a state as arrays of one sample, or as numbers where the mode is not asked for."""
    point, chip = state.memory.point, state.memory.chip
    drive = sign_of(state.memory.firm[0].duty) if plan.digital else chip.drive
    fields: Any = (state.time, *point.y, point.wiper, *(mode or (0,) * 5)[:4], drive, chip.error, chip.silent, None,
                   *told_by(plan, state.memory))
    return Samples(*fields if mode is None else (None if x is None else np.array([x]) for x in fields))


# --- `simulate`: a run of one servo from start to end -----------------------------------------------------------------

_THOUSAND = 1000  # parts of a run, of which progress tells


def simulate(model: Model, command: Signal, *, duration: float, load: Load | Part | None = None,
             output_step: float | None = None, output_times: ArrayLike | None = None,
             initial: Mapping[str, float] | None = None, seed: int = 0, progress: Progress = False,
             accuracy: float = ACCURACY) -> Result:
    """Simulate from t = 0 to `duration` and return the result.

    Parameters
    ----------
    model : Model
    command : Signal
    duration : float
        Positive [s].
    load : Load, optional
        Nothing unless given.
    output_step : float, optional
        Distance of the output times [s], 1 ms unless given; outputs at 0, output_step, …, duration. It changes
        nothing but where the solution is shown.
    output_times : array_like, shape (n,), optional
        Output times instead [s], from 0 to `duration`, not decreasing.
    initial : mapping, optional
        Initial values by state name (SI), see `Simulator.initial`.
    seed : int
        Seed of all noise.
    progress : bool or callable
        True shows a bar for what lasts over a second; a callable is called with the thousandths that are done and 1000.
    accuracy : float
        Of what is integrated, as in `Simulator` [rad].

    Raises
    ------
    InputError
        On bad input only; a run that ends early says so in `Result.status`.

    Warns
    -----
    UserWarning
        If the servo's data sheet is impossible, its supply more than twice that of the sheet, or the command changes
        only after the end.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
    >>> result = st.simulate(model, st.signals.step(0.0, 90.0, at=0.1, unit="deg"), duration=1.0)
    >>> result["output_angle"].shape
    (1001,)
    """
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("duration", got=duration, allowed="a positive number of seconds")
    times = times_asked(duration, output_step, output_times)
    simulator = Simulator(model, load, seed, accuracy)
    simulator.drive(command)  # raises if the model cannot follow it
    warn_of(model.servo, [command], duration)
    return simulated(simulator, model.framed(command, duration), duration, times, initial, progress)


def simulated(simulator: Simulator, command: Signal, duration: float, times: NDArray[np.float64],
              initial: Mapping[str, float] | None, progress: Progress = False) -> Result:
    """Return what `simulate` does, of arguments that it has looked at."""
    status, ended, cause = Status.COMPLETED, duration, Status.COMPLETED.message
    with shown(progress, _THOUSAND, "simulating") as show:
        record = RunLog(_thousandths(duration, show) if progress else None)
        try:
            simulator.recorded(simulator.initial(command, initial), duration, command, record)
        except SimulationError as error:
            status, ended, cause = Status[error.status], error.time, error.cause
    return Result(model=simulator.model, command=command, load=simulator.load, drive=simulator.drive(command),
                  time=times, trajectory=Trajectory(Motions(record.parts)), events=tuple(record.events),
                  status=status, ended=ended, cause=cause)


def _thousandths(duration: float, show: Callable[[int], None]) -> Callable[[float], None]:
    """Return what shows the thousandths of the duration, each once."""
    last = 0

    def tell(time: float) -> None:
        nonlocal last
        done = int(_THOUSAND * time / duration)
        if done > last:
            last = done
            show(done)
    return tell
