"""`VectorSimulator`: many servos that stop and continue, tick by tick, under commands and loads given at each."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from servotwin import physics
from servotwin.errors import InputError, UnknownNameError
from servotwin.models import DigitalServo
from servotwin.models.base import KINDS, Model
from servotwin.models.engine.cosim import LONGEST
from servotwin.models.engine.memory import ACCURACY
from servotwin.models.engine.observe import Observed
from servotwin.models.terms.wiring import PULSE_RANGE
from servotwin.signals import Signal, constant
from servotwin.simulation.bus import supplies_of
from servotwin.simulation.lanes.batch import Failure
from servotwin.simulation.lanes.inputs import LAWS, lanes_of, pick
from servotwin.simulation.lanes.lane_numbers import LaneNumbers, Variants
from servotwin.simulation.lanes.many import real_type
from servotwin.simulation.lanes.store import SHAFT, Store
from servotwin.simulation.lanes.whole_runs import VectorMemory, known_lowest
from servotwin.simulation.progress import memory_limit, own_threads, workers_of
from servotwin.simulation.start import Status, accuracy_of
from servotwin.units import is_finite, is_masked

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, DTypeLike

    from servotwin import loads
    from servotwin.simulation.lanes.c_entry import CEntry

Array = NDArray[np.float64]
_BYTES = 4000  # of a lane, and of what is made of it now and then
_COLUMNS = {name: k for k, name in enumerate(Observed._fields)}
AT_MOTOR = {"motor_angle": physics.motor_from_output, "motor_speed": physics.motor_from_output,
             "motor_torque": lambda torque, reduction: torque / reduction}
"""From what is seen at the output shaft, with the reduction of the gear."""


class VectorSimulator:
    """Many servos (lanes) side by side that remember where they are between calls.

    Every lane has a clock of its own: its frames begin when it is reset. Commands and torques stay as they were given
    last; before the first command it is a pulse, or a goal, in the middle of those that the servo takes.
    `simulate_many` runs lanes from start to end with outputs in between; here one call is one tick of a robot, an
    environment or a page.

    Parameters
    ----------
    model : Model
        Any servo.
    lanes : int
        Number of servos.
    load : Load or sequence of Load, optional
        As in `simulate_many`.
    parameters : mapping, optional
        Number or array (lanes,) (SI) by dotted name, of the servo or of the load.
    bus : Supply or sequence of tuple (Supply, lanes), optional
        A supply that all lanes share, or several, each with the lanes on it: a mask, or numbers of lanes. It replaces
        what their servo files say of the source. A lane on none has its own.
    dtype : str
        "float64" or "float32"; the latter for lanes that run side by side.
    threads : int, optional
        How many share the lanes; all cores unless given. Results do not depend on it.
    seed : int
        Of all noise; the k-th lane has the seed `seed` + k.
    accuracy : float
        Of what is integrated, as in `Simulator` [rad].
    watch_supply : bool
        Whether `lowest_voltage` is kept, for which lanes go from event to event: it takes six times as long.
    variants : mapping, optional
        Servos of which each reset gives a lane another one: arrays (n,) (SI) by dotted name, as
        `st.distributions.drawn_parameters` and `draw` of a fit return them. `variant` is which of the n a lane is now;
        it follows from its seed and the number of its resets.
    device : str
        "cpu", or "cuda" with or without ":" and the number of a GPU, where `VectorSimulatorOnGpu` has the lanes.

    Raises
    ------
    InputError
        On bad input; names lane and parameter.

    Examples
    --------
    >>> import servotwin as st
    >>> sims = st.VectorSimulator(st.PulseServo(st.load_servo("hitec-hs-755hb")), lanes=3)
    >>> sims.reset(command_angle=0.5)
    >>> for _ in range(400):
    ...     sims.advance(1e-3, command_angle=[0.5, 0.6, 0.7], external_torque=0.1)
    >>> sims["output_angle"].round(2).tolist(), sims.time.round(9).tolist()
    ([0.5, 0.58, 0.67], [0.4, 0.4, 0.4])
    """

    def __new__(cls, model: Model, lanes: int, *, device: str = "cpu", **_: Any) -> VectorSimulator:
        """Return a simulator for a device, which `__init__` fills."""
        if cls is VectorSimulator and device != "cpu":
            from servotwin.simulation.lanes.vector_gpu import VectorSimulatorOnGpu

            cls = VectorSimulatorOnGpu
        return object.__new__(cls)

    def __init__(
        self, model: Model, lanes: int, *, load: loads.Load | loads.Part | list[Any] | None = None,
        parameters: Mapping[str, Any] | None = None, bus: Any = None, dtype: DTypeLike = "float64",
        threads: int | None = None, seed: int = 0, accuracy: float = ACCURACY, watch_supply: bool = False,
        variants: Mapping[str, ArrayLike] | None = None, device: str = "cpu",
    ) -> None:
        numbers = self._laid_out(model, seeds_of(lanes, seed), load, parameters, bus, accuracy, variants)
        self._store = Store(numbers, real_type(dtype),
                            _whole("threads", threads, 1) if threads is not None else workers_of(None),
                            own_threads(os.getpid()), bool(watch_supply))
        self._entry: CEntry | None = None

    def _laid_out(self, model: Model, seeds: NDArray[np.int64], load: Any, parameters: Mapping[str, Any] | None,
                  bus: Any, accuracy: float, variants: Any) -> LaneNumbers:
        """Return the numbers of the lanes, or raise InputError."""
        if LAWS.get(type(model), "voltage") == "voltage":
            raise InputError("model of a VectorSimulator", got=model,
                             allowed=" or ".join(kind.__name__ for kind, law in LAWS.items() if law != "voltage"))
        supplies, accuracy = supplies_of(bus, model, len(seeds)), accuracy_of(accuracy)
        command, self._variants = _first_command(model), None
        if variants is not None:
            self._variants = Variants(variants, seeds, model=model, command=command, load=load,
                                      parameters=parameters or {}, accuracy=accuracy)
            parameters = {**(parameters or {}), **self._variants.now()}
        inputs = lanes_of(model, command, load, parameters, None, seeds)
        if inputs.count != len(seeds):
            raise InputError("numbers of lanes", got=f"lanes: {len(seeds)}, parameters or loads: {inputs.count}",
                             allowed="arrays of one number for each lane")
        return LaneNumbers(inputs, accuracy, supplies)

    @property
    def _numbers(self) -> LaneNumbers:
        return self._store.numbers

    def __repr__(self) -> str:
        return f"VectorSimulator({self._numbers.model!r}, lanes={len(self)})"

    def __len__(self) -> int:
        """Return the number of lanes."""
        return self._numbers.count

    # --- time ---------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> Array:
        """Time of each lane since it was reset [s], shape (lanes,)."""
        return self._store.time

    @property
    def status(self) -> NDArray[np.int8]:
        """Code of each lane's `Status`, shape (lanes,); a lane that has failed is nan until it is reset."""
        return self._store.status.copy()

    @property
    def kernels(self) -> NDArray[np.str_]:
        """The name of the kernels by which each lane advances, shape (lanes,), as `Batch.stats` has it."""
        found = np.empty(len(self), "U24")
        for some in self._store.sets:
            found[some.which] = some.kernel
        return found

    @property
    def variant(self) -> Any:
        """Which of its `variants` each lane is, shape (lanes,).

        Raises
        ------
        InputError
            If it has none.
        """
        if self._variants is None:
            raise self._no_variants()
        return self._variants.of(slice(None))

    def _no_variants(self) -> InputError:
        return InputError("variant", got="a simulator without", allowed="VectorSimulator(..., variants={...})")

    @property
    def lowest_voltage(self) -> Array:
        """The least voltage of each lane's supply since its reset, or since `watch` [V], and when it came [s].

        Shape (2, lanes). It is that of all instants, between two calls too; where it lies flat, to 1e-6 V, the time is
        that of its beginning. nan where nothing is known: of lanes whose supply nobody watches, or that have not moved.
        """
        return known_lowest(self._store.lowest).T

    def watch(self, lanes: ArrayLike | None = None) -> None:
        """Look for the least voltages of some lanes' supplies, or of all, from now on.

        Raises
        ------
        InputError
            If it is not a simulator that watches them.
        """
        if not self._store.watched:
            raise InputError("watch()", got="a simulator without it", allowed="VectorSimulator(..., watch_supply=True)")
        self._store.watch(pick(lanes, len(self)))

    @property
    def failures(self) -> tuple[Failure, ...]:
        """(lane, time [s], cause) of all lanes that have failed."""
        status, ended = self._store.status, self._store.ended
        return tuple(Failure(lane, float(ended[lane]), Status.of_code(int(status[lane])).message)
                     for lane in np.flatnonzero(status).tolist())

    def advance(self, duration: float, *, pulse_width: ArrayLike | None = None, command_angle: ArrayLike | None = None,
                command_voltage: ArrayLike | None = None, external_torque: ArrayLike | None = None) -> None:
        """Advance by a time, all lanes at once.

        Parameters
        ----------
        duration : float
            At least 0 [s].
        pulse_width, command_angle, command_voltage : float or array, shape (lanes,), optional
            The command from now on, one of them [s], [rad] or [V]; the one before unless given. A goal that stays is
            not written again: a servo with `firmware.signal_timeout` waits in vain for one.
        external_torque : float or array, shape (lanes,), optional
            Constant torque beside the load from now on; positive pushes towards −q [N m].

        Raises
        ------
        InputError
            On bad input, before any lane moves; names lane and argument. A lane that fails later says so in `status`.
        """
        check_duration(duration)
        store = self._store
        if store.numbers.recorded:
            store.numbers.check_recorded(self.time, float(duration))
        store.fresh[0] = 0
        torque = self._torque_of(external_torque) if external_torque is not None else None
        command = store.numbers.translate.command(pulse_width, command_angle, command_voltage, None)
        if command is not None:
            store.command[:] = command
        if torque is not None and not np.array_equal(torque, store.torque):
            store.hang(torque)
        if duration > 0.0:
            store.advance(float(duration))

    def reset(self, *, pulse_width: ArrayLike | None = None, command_angle: ArrayLike | None = None,
              command_voltage: ArrayLike | None = None, output_angle: ArrayLike | None = None,
              lanes: ArrayLike | None = None) -> None:
        """Put lanes at rest and their clocks to 0, their torque on; noise continues where it was.

        With `variants` each is another servo from then on.

        Parameters
        ----------
        pulse_width, command_angle, command_voltage : float or array, optional
            The command from now on, as in `advance`; one for each of `lanes`.
        output_angle : float or array, optional
            Where they rest [rad]; at the zero-error angle of their command unless given.
        lanes : array of bool, shape (lanes,), or of int, optional
            Which; all unless given.
        """
        which = pick(lanes, len(self))
        angle = None if output_angle is None else numbers_of("output_angle", output_angle, which)
        self._draw(which)
        self._begin(which, angle, pulse_width, command_angle, command_voltage)

    def _draw(self, which: NDArray[np.int64]) -> None:
        """Let some lanes be others of their variants, if they have such."""
        if self._variants is not None and len(which):
            self.set(parameters=self._variants.drawn(which), lanes=which)

    def _begin(self, which: NDArray[np.int64], angle: Array | None, pulse_width: Any = None, command_angle: Any = None,
               command_voltage: Any = None) -> None:
        """Put some lanes to rest, under a command that is given."""
        self._store.fresh[0] = 0
        command = self._store.command.copy()
        found = self._numbers.translate.command(pulse_width, command_angle, command_voltage, which)
        if found is not None:
            command[which] = found
        self._store.start(which, self._numbers.start(which, command, angle))
        self._store.command[:] = command

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of what can be looked at, `time` apart."""
        return self._numbers.available

    # --- what can be seen and set -------------------------------------------------------------------------------------

    def __getitem__(self, name: str) -> Array:
        """Return a signal (SI) of all lanes at their present time, shape (lanes,)."""
        if name == "time":
            return self.time
        if name in SHAFT:
            return self._store.shaft(name)
        numbers = self._numbers
        if name not in numbers.available:
            raise UnknownNameError(f"signal of {type(numbers.model).__name__}", name, ("time", *numbers.available))
        if name in KINDS:
            return np.where(self._store.status != 0, math.nan, numbers.commanded(name, self._store.command))
        values = self._store.look()[:, _COLUMNS[name]]
        return np.asarray(AT_MOTOR[name](values, numbers.reduction)) if name in AT_MOTOR else values.copy()

    def shown(self, names: Sequence[str]) -> Array:
        """Return several signals (SI) of all lanes at their present time, shape (lanes, names): one look for all.

        Raises
        ------
        UnknownNameError
            If one is none that is looked up: commands, and the motor's own, are not.
        """
        unknown = next((name for name in names if name not in _COLUMNS or name not in self._numbers.available), None)
        if unknown is not None:
            raise UnknownNameError("signal that is looked up", unknown,
                                   [name for name in _COLUMNS if name in self._numbers.available])
        return self._store.look()[:, [_COLUMNS[name] for name in names]]

    @property
    def impulse_work(self) -> Array:
        """Kinetic energy that speeds which were set have given to each lane since its reset [J], shape (lanes,)."""
        return self._store.work.copy()

    def set(self, *, output_angle: ArrayLike | None = None, output_speed: ArrayLike | None = None,
            load_inertia: ArrayLike | None = None, bus_voltage: ArrayLike | None = None,
            parameters: Mapping[str, Any] | None = None, torque_enable: ArrayLike | None = None,
            lanes: ArrayLike | None = None, bus: Any = None) -> None:
        """Impose what another simulator decides, or change numbers; all else that lanes remember stays.

        Parameters
        ----------
        output_angle, output_speed : float or array, optional
            Of the shaft [rad], [rad/s]. A speed is an impulse, whose work `impulse_work` adds up; with play in the gear
            the motor keeps its own. It keeps its angle as far as the play allows; with both, as another simulator
            gives them that moves the shaft, it goes along, and the play stays as it is.
        load_inertia : float or array, optional
            J_L instead of the load's [kg m²]; the gear's own stays.
        bus_voltage : float or array, optional
            Voltage at the bridge instead of what the supply would leave, positive [V]; not of a lane on a bus.
        parameters : mapping, optional
            Number or array by dotted name, as at the beginning.
        torque_enable : bool or array of bool, optional
            Whether the torque of digital servos is on.
        lanes : array of bool, shape (lanes,), or of int, optional
            For which lanes; arrays have one number for each of them.
        bus : Supply or sequence of tuple (Supply, lanes), optional
            Supplies in place of those that all lanes share, on which the same lanes are as before.

        Raises
        ------
        InputError
            On bad input, before anything changes; names lane and argument.
        """
        which = pick(lanes, len(self))
        if bus is not None:
            self._check_bus(bus, which)
        self._store.fresh[0] = 0
        torque = None if torque_enable is None else self._torque_switch(torque_enable, which)
        angle, speed, inertia, voltage = (
            None if value is None else numbers_of(name, value, which) for name, value in (
                ("output_angle", output_angle), ("output_speed", output_speed), ("load_inertia", load_inertia),
                ("bus_voltage", bus_voltage)))
        self._check_imposed(angle, inertia, voltage, which)
        anew = bus is not None or (bool(parameters) and not self._numbers.retuned(which, parameters or {}))
        if anew:
            part = self._numbers.repacked(which, parameters) if parameters and bus is None else None
            if part is None or not self._store.takes(part, which, parameters or {}):
                self._store.renew(self._numbers.changed(which, parameters or {}, bus), which)
        otherwise = False
        if inertia is not None or voltage is not None:
            otherwise = self._numbers.impose(which, inertia, voltage)
            self._store.refit(which, otherwise)
        if self._entry is not None and (anew or otherwise):
            self._entry.refresh()
        if angle is not None or speed is not None:
            self._store.impose(which, angle, speed)
        if torque is not None:
            self._store.enable(which, torque)

    def _check_bus(self, bus: Any, which: NDArray[np.int64]) -> None:
        before = self._numbers.supplies.bus_of
        after = supplies_of(bus, self._numbers.model, len(self)).bus_of
        if len(which) < len(self) or not np.array_equal(before, after):
            raise InputError("set(bus=...)", got=f"lanes on buses {after.tolist()}",
                             allowed=f"all lanes at once, on the buses that they are on: {before.tolist()}")

    def _check_imposed(self, angle: Array | None, inertia: Array | None, voltage: Array | None,
                       which: NDArray[np.int64]) -> None:
        if inertia is not None:
            _check_lanes("load_inertia", inertia, which, inertia >= 0.0, "at least 0 kg m²")
        if angle is not None:
            self._numbers.check_angles(angle, which)
        if voltage is not None:
            _check_lanes("bus_voltage", voltage, which, voltage > 0.0, "a positive voltage")
            _check_lanes("bus_voltage", voltage, which, self._numbers.supplies.bus_of[which] < 0,
                         "nothing: what all on its bus draw decides it")

    # --- memory -------------------------------------------------------------------------------------------------------

    def save(self) -> VectorMemory:
        """Return all that the lanes remember, as it is now; picklable."""
        return self._store.save()

    def restore(self, memory: VectorMemory, *, lanes: Any = None) -> None:
        """Go back to what was saved, here or in another simulator of this model with as many lanes.

        Parameters, inertias and bus voltages that were set belong to the simulator: they stay as they are.

        Parameters
        ----------
        memory : VectorMemory
        lanes : sequence of int, mask or slice, optional
            Lanes that go back; all unless given.

        Raises
        ------
        InputError
            If it is the memory of another model or of another number of lanes, or some lanes of those on shared
            supplies are to go back.
        """
        self._check_memory(memory)
        if lanes is not None:
            if self._numbers.supplies.lanes:
                raise InputError("restore(lanes=...)", got="lanes on shared supplies", allowed="all lanes at once")
            memory = self.save().with_lanes(memory, pick(lanes, len(self)))
        self._store.fresh[0] = 0
        self._store.restore(memory)

    def _check_memory(self, memory: Any) -> None:
        kind = type(self._numbers.model).__name__
        if not isinstance(memory, VectorMemory):
            raise InputError("restore(memory)", got=memory, allowed="what save() has returned")
        if memory.model != kind or len(memory.records) != len(self):
            raise InputError("restore(memory)", got=f"{len(memory.records)} lanes of {memory.model}",
                             allowed=f"{len(self)} lanes of {kind}")

    # --- from C -------------------------------------------------------------------------------------------------------

    def __reduce__(self) -> NoReturn:
        """Refuse to be pickled or copied: its arrays belong to compiled code of this process."""
        raise InputError("pickling or copying of a VectorSimulator", allowed="its memory: what save() returns goes "
                         "into another one of the same arguments by restore()")

    def c_entry(self) -> CEntry:
        """Return what a program in C needs to advance this simulator: an address, a struct and its header.

        All that its lanes may need is compiled now, once on a machine.
        """
        if self._entry is None:
            from servotwin.simulation.lanes.c_entry import CEntry

            self._entry = CEntry(self._store)
        return self._entry

    # --- arguments ----------------------------------------------------------------------------------------------------

    def _torque_switch(self, torque_enable: Any, which: NDArray[np.int64]) -> Array:
        if not self._numbers.digital:
            raise InputError(f"torque_enable of {type(self._numbers.model).__name__}", got=torque_enable,
                             allowed="nothing: an analog servo has no such switch")
        array = np.asarray(torque_enable)
        if array.dtype != np.bool_ or array.shape not in ((), (len(which),)):
            raise InputError("torque_enable", got=torque_enable, allowed=f"True or False, or an array ({len(which)},)")
        return np.broadcast_to(array, which.shape).astype(np.float64)

    def _torque_of(self, torque: Any) -> Any:
        if type(torque) is float and math.isfinite(torque):
            return torque
        return numbers_of("external_torque", torque, np.arange(len(self)))


def seeds_of(lanes: int, seed: int) -> NDArray[np.int64]:
    """Return the seed of each lane, or raise InputError."""
    count = _whole("lanes", lanes, 1)
    if count * _BYTES > 0.8 * memory_limit():
        raise InputError("lanes", got=count, allowed="what fits into memory: take fewer")
    return _whole("seed", seed, None) + np.arange(count)


def check_duration(duration: float) -> None:
    """Raise InputError if a call cannot advance by this [s]."""
    if not (type(duration) is float or is_finite(duration)) or not 0.0 <= duration <= LONGEST:
        raise InputError("advance(duration)", got=duration,
                         allowed=f"a number of seconds, from 0 to {LONGEST:.0e} in one call")


def _first_command(model: Model) -> Signal:
    """Return a servo's command until the first is given: a pulse in the middle of those that it takes, or a goal."""
    if isinstance(model, DigitalServo) and model.takes_goals:
        low, high = (model.value_or(f"firmware.{end}_goal", model.value_or(f"stops.{end}_angle", math.nan))
                     for end in ("lower", "upper"))
        middle = 0.5 * (low + high)
        return constant(0.0 if math.isnan(middle) else middle, unit="rad")
    return constant(1e6 * _middle(model), unit="us")


def _middle(model: Model) -> float:
    """Return a pulse width that the servo takes [s]."""
    return 0.5 * sum(model.value_or(f"electronics.pulse_width_{end}", usual)
                     for end, usual in zip(("min", "max"), PULSE_RANGE, strict=True))


def numbers_of(name: str, values: Any, which: NDArray[np.int64]) -> Array:
    """Return one finite number for each of some lanes, or raise InputError that names lane and argument."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(name, got=values, allowed="a number, or one number per lane") from None
    if is_masked(values) or array.shape not in ((), (len(which),)):
        raise InputError(name, got=f"an array of shape {array.shape}", allowed=f"a number, or an array ({len(which)},)")
    array = np.broadcast_to(array, which.shape)
    _check_lanes(name, array, which, np.isfinite(array), "a finite number")
    return array


def _check_lanes(name: str, values: Array, which: NDArray[np.int64], good: Any, allowed: str) -> None:
    if not good.all():
        k = int(np.argmin(good))
        raise InputError(f"{name} of lane {which[k]}", got=float(values[k]), allowed=allowed)


def _whole(name: str, value: Any, least: int | None) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or (least is not None and value < least):
        raise InputError(name, got=value, allowed="a whole number" + ("" if least is None else f", at least {least}"))
    return int(value)
