"""`VectorSimulator` on a GPU: a thread for each lane, arrays of other libraries in place, work on their streams."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.models.engine.memory import ACCURACY, Memories
from servotwin.models.engine.one_lane import COMMAND_ANGLE, FOLLOWED, PULSE_WIDTH
from servotwin.simulation.compile.threads import SEEN
from servotwin.simulation.lanes.batch import Failure
from servotwin.simulation.lanes.cuda import GpuArray, is_guest
from servotwin.simulation.lanes.inputs import pick
from servotwin.simulation.lanes.lane_numbers import LaneNumbers
from servotwin.simulation.lanes.lane_threads import REMEMBERED, ThreadedLanes, period_of
from servotwin.simulation.lanes.many import real_type
from servotwin.simulation.lanes.vector import VectorSimulator, check_duration, numbers_of, seeds_of
from servotwin.simulation.lanes.whole_runs import VectorMemory
from servotwin.simulation.start import Status

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, DTypeLike

    from servotwin import loads
    from servotwin.models.base import Model
KINDS = {"pulse_width": PULSE_WIDTH, "command_angle": COMMAND_ANGLE}
_SHAFT = {"output_angle": "stand.y.q", "output_speed": "stand.y.w"}


class VectorSimulatorOnGpu(VectorSimulator):
    """The lanes of a `VectorSimulator` on a GPU, made by `VectorSimulator(..., device="cuda")`.

    Arguments may be numbers, arrays of numpy, or arrays on the GPU by DLPack (PyTorch, JAX, CuPy, Warp): these have
    one number of the simulator's `dtype` for each lane, are read in place on the `stream` of the call, and are not
    checked beforehand: a lane that gets a command which its servo does not take has failed (`Status.REFUSED`). With
    them a call allocates nothing and waits for nothing, so that a CUDA graph takes it in.

    Signals are arrays on the GPU, in place: their numbers change with the next call.

    Pulse servos and digital ones advance so that neither inductance nor spring, pendulum, recorded torque or shared
    supply has a part, and no friction that fades beside heat or behind play of the gear; others are refused by name.
    A lane in which motor and output part and meet too often within a tick fails (`Status.DIVERGED`). `threads` and
    `accuracy` say nothing here: a thread has one lane, and where friction fades a creep is right to 1e-12 rad in
    float64, and to rounding in float32; nothing else is integrated.

    Raises
    ------
    InputError
        As `VectorSimulator`, and where there is no such device, no driver for it, or no compiler (clang, zig).
    """

    def __init__(
        self, model: Model, lanes: int, *, load: loads.Load | loads.Part | list[Any] | None = None,
        parameters: Mapping[str, Any] | None = None, bus: Any = None, dtype: DTypeLike = "float64",
        threads: int | None = None, seed: int = 0, accuracy: float = ACCURACY, watch_supply: bool = False,
        variants: Mapping[str, ArrayLike] | None = None, device: str = "cuda",
    ) -> None:
        if watch_supply:
            raise _refused("watch_supply")
        numbers = self._laid_out(model, seeds_of(lanes, seed), load, parameters, bus, accuracy, variants)
        variety = None if self._variants is None else self._variants.numbers
        if variety is not None:
            _check_common(variety, load, parameters or {})
        self._lanes, self._device = ThreadedLanes(numbers, real_type(dtype), device, variety), device
        self._given, self._fresh = numbers, False
        self._lanes.tell(numbers.neutral)
        self._lanes.begin()

    @property
    def _numbers(self) -> LaneNumbers:
        return self._given

    @property
    def variant(self) -> GpuArray:
        """Which of its `variants` each lane is, on the GPU, in place."""
        if self._variants is None:
            raise self._no_variants()
        found: GpuArray = self._lanes.array("variant")
        return found

    def _as_now(self) -> LaneNumbers:
        """Return the numbers of the lanes as they are now; with variants this asks the GPU."""
        if self._variants is not None:
            draws = self._lanes.array("draws").read().astype(np.int64)
            others = np.flatnonzero(draws != self._variants.draws)
            self._variants.draws[:] = draws
            if others.size:
                self._given.take(others, self._variants.numbers, (), self._variants.of(others))
        return self._given

    def __repr__(self) -> str:
        return f"VectorSimulator({self._numbers.model!r}, lanes={len(self)}, device={self._device!r})"

    # --- time ---------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> Any:
        """Time of each lane since it was reset [s], on the GPU."""
        return self["time"]

    @property
    def status(self) -> Any:
        """Code of each lane's `Status`, on the GPU, in place; a lane that has failed is nan until it is reset."""
        return self._lanes.status

    @property
    def kernels(self) -> NDArray[np.str_]:
        """The way in which each lane advances, shape (lanes,)."""
        return np.full(len(self), f"{self._lanes.text.way}_{self._lanes.text.real.name}", "U32")

    @property
    def failures(self) -> tuple[Failure, ...]:
        """(lane, time [s], cause) of all lanes that have failed; asks the GPU."""
        status, time = self.status.read(), self._lanes.time
        return tuple(Failure(lane, float(time[lane]), Status.of_code(int(status[lane])).message)
                     for lane in np.flatnonzero(status).tolist())

    def advance(self, duration: float, *, pulse_width: Any = None, command_angle: Any = None,
                command_voltage: Any = None, external_torque: Any = None, stream: Any = None) -> None:
        """Advance by a time [s], all lanes at once; arguments as of `VectorSimulator.advance`.

        Work is put on a `stream`, the one before unless given: a handle, or a stream of PyTorch, CuPy or Warp.
        """
        check_duration(duration)
        command, kind = self._command(pulse_width, command_angle, command_voltage, None)
        torque = external_torque
        if torque is not None and not is_guest(torque):
            torque = numbers_of("external_torque", torque, np.arange(len(self)))
        self._on(stream)
        self._lanes.advance(duration, command, torque, kind=kind)

    def reset(self, *, pulse_width: Any = None, command_angle: Any = None, command_voltage: Any = None,
              output_angle: Any = None, lanes: Any = None, stream: Any = None) -> None:
        """Put lanes at rest; arguments as of `VectorSimulator.reset`.

        Arrays on the GPU have a number for each lane, whatever `lanes` says; that may be there too: a mask of bool or
        uint8, or numbers of lanes, whole ones of 32 or 64 bits, of which those beyond all lanes do not count.
        """
        which = None if is_guest(lanes) else pick(lanes, len(self))
        command, kind = self._command(pulse_width, command_angle, command_voltage, which)
        angle = self._spread("output_angle", output_angle, which)
        self._check_given(angle, None, None, which)
        self._on(stream)
        mask = self._mask(lanes, which)
        self._draw(mask)
        self._begin(mask, angle, command, kind)

    def _draw(self, mask: Any) -> None:
        """Let lanes of a mask be others of their variants, if they have such."""
        if self._variants is not None:
            self._lanes.change(mask=mask)

    def _begin(self, mask: Any, angle: Any, command: Any, kind: int) -> None:  # type: ignore[override]
        """Put lanes of a mask to rest, under a command of a kind if one is given."""
        if command is not None:
            self._lanes.tell(command, kind=kind, mask=mask)
        self._lanes.begin(angle, mask=mask)

    def set(self, *, output_angle: Any = None, output_speed: Any = None, load_inertia: Any = None,
            bus_voltage: Any = None, parameters: Mapping[str, Any] | None = None, torque_enable: Any = None,
            lanes: Any = None, bus: Any = None, stream: Any = None) -> None:
        """Impose what another simulator decides, as `VectorSimulator.set` does; nan in an array on the GPU: not.

        A lane whose bridge would drop all of its bus voltage has failed until another comes. `parameters` are refused:
        `variants` has other numbers for lanes.
        """
        for name, value in (("parameters", parameters), ("bus", bus)):
            if value is not None:
                raise _refused(name)
        which = None if is_guest(lanes) else pick(lanes, len(self))
        given = {name: self._spread(argument, value, which) for name, argument, value in (
            ("angle", "output_angle", output_angle), ("speed", "output_speed", output_speed),
            ("inertia", "load_inertia", load_inertia), ("voltage", "bus_voltage", bus_voltage))}
        if torque_enable is not None and not (is_guest(torque_enable) and self._numbers.digital):
            places = np.arange(len(self)) if which is None else which
            whole = np.zeros(len(self), np.uint8)
            whole[places] = self._torque_switch(torque_enable, places)
            torque_enable = whole
        self._check_given(given["angle"], given["inertia"], given["voltage"], which)
        self._on(stream)
        self._lanes.impose(**given, torque_enable=torque_enable, mask=self._mask(lanes, which))

    # --- what can be seen ---------------------------------------------------------------------------------------------

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of what can be looked at, `time` apart."""
        return tuple(name for name in self._numbers.available if name in SEEN or name in _SHAFT)

    def __getitem__(self, name: str) -> GpuArray:  # type: ignore[override]
        """Return a signal (SI) of all lanes at their present time, shape (lanes,), on the GPU, in place."""
        if name in _SHAFT:
            found: GpuArray = self._lanes.column(_SHAFT[name])
            return found
        if name != "time" and name not in self.signals:
            raise UnknownNameError(f"signal of {type(self._numbers.model).__name__} on a GPU", name,
                                   ("time", *self.signals))
        seen = self._lanes.array("seen")
        if not self._fresh:
            seen, self._fresh = self._lanes.look(), True
        row: GpuArray = seen.row(SEEN.index(name))
        return row

    def shown(self, names: Any) -> NoReturn:
        """Refuse: signals are rows of one array on the GPU, each in place."""
        raise _refused("shown()")

    @property
    def impulse_work(self) -> NoReturn:
        """Refuse: nobody adds it up."""
        raise _refused("impulse_work")

    @property
    def lowest_voltage(self) -> NoReturn:
        """Refuse: nobody watches it."""
        raise _refused("lowest_voltage")

    def watch(self, lanes: Any = None) -> NoReturn:
        """Refuse: nobody watches."""
        raise _refused("watch()")

    def c_entry(self) -> NoReturn:
        """Refuse: it is for programs on a processor."""
        raise _refused("c_entry()")

    # --- memory -------------------------------------------------------------------------------------------------------

    def save(self) -> VectorMemory:
        """Return all that the lanes remember, as it is now, on the processor; picklable, and for `device="cpu"` too."""
        count, followed = len(self), self._lanes.array("followed").read().astype(np.float64)
        columns = self._as_now().columns
        torque = self._lanes.array("total").read().astype(np.float64) - columns.torque
        status, time = self.status.read().astype(np.int8), self._lanes.time
        return VectorMemory(type(self._numbers.model).__name__, *self._lanes.memories(np.arange(count)), followed,
                            torque, status, np.where(status != 0, time, 0.0), np.zeros(count),
                            columns.numbers.copy(), None)

    def restore(self, memory: VectorMemory, *, lanes: Any = None) -> None:
        """Go back to what was saved; as `VectorSimulator.restore`."""
        self._check_memory(memory)
        if lanes is not None:
            memory = self.save().with_lanes(memory, pick(lanes, len(self)))
        self._fresh = False
        self._lanes.put(np.arange(len(self)), Memories(memory.records, memory.firms))
        self._lanes.status.write(memory.status.astype(np.int32))
        self._lanes.tell(memory.command, memory.torque)

    def columns(self) -> dict[str, GpuArray]:
        """Return all that the lanes remember, in place: the last axis is that of lanes, of `rings` the first."""
        return {name: self._lanes.array(name) for name in REMEMBERED}

    # --- arguments ----------------------------------------------------------------------------------------------------

    def _on(self, stream: Any) -> None:
        """Let work be put on a stream from now on, where one is given; what was looked at is no more."""
        if stream is not None:
            self._lanes.put_on(stream)
        self._fresh = False

    def _command(self, pulse_width: Any, command_angle: Any, command_voltage: Any,
                 which: NDArray[np.int64] | None) -> tuple[Any, int]:
        """Return a command and its kind: one on the GPU as it is, others checked and as the engine follows them."""
        given = {"pulse_width": pulse_width, "command_angle": command_angle, "command_voltage": command_voltage}
        there = [name for name, value in given.items() if value is not None and is_guest(value)]
        if there and sum(value is not None for value in given.values()) == 1:
            if there[0] not in KINDS:
                raise InputError(there[0], got="an array on a GPU", allowed=" or ".join(KINDS))
            return given[there[0]], KINDS[there[0]]
        names = [name for name, value in given.items() if value is not None]
        if self._variants is not None and names:  # which servo a lane is, stands on the GPU
            if len(names) > 1 or names[0] not in KINDS:
                raise InputError("command of lanes with variants on a GPU", got=" and ".join(names),
                                 allowed=" or ".join(KINDS))
            return self._spread(names[0], given[names[0]], which), KINDS[names[0]]
        found = self._numbers.translate.command(pulse_width, command_angle, command_voltage, which)
        return self._spread("command", found, which), FOLLOWED

    def _spread(self, name: str, values: Any, which: NDArray[np.int64] | None) -> Any:
        """Return what is given of some lanes as numbers of all, nan where it is not; on the GPU it is so already."""
        if values is None or is_guest(values):
            return values
        found = np.full(len(self), np.nan)
        places = np.arange(len(self)) if which is None else which
        found[places] = numbers_of(name, values, places)
        return found

    def _check_given(self, angle: Any, inertia: Any, voltage: Any, which: NDArray[np.int64] | None) -> None:
        """Check numbers that are not on the GPU: of some lanes, or of all where a mask there says of which."""
        places = np.arange(len(self)) if which is None else which
        angle, inertia, voltage = (x[places] if isinstance(x, np.ndarray) else None for x in (angle, inertia, voltage))
        self._check_imposed(None if self._variants is not None else angle, inertia, voltage, places)

    def _mask(self, lanes: Any, which: NDArray[np.int64] | None) -> Any:
        if which is None:
            return self._lanes.mask_of(lanes)
        if lanes is None:
            return None
        mask = np.zeros(len(self), np.uint8)
        mask[which] = 1
        return mask


def _check_common(variants: LaneNumbers, load: Any, parameters: Mapping[str, Any]) -> None:
    """Raise InputError if lanes differ beside their variants, or these in how long frames last, or ticks."""
    several = [name for name, value in parameters.items() if np.ndim(value)]
    if several or isinstance(load, list | tuple):
        raise InputError(f"{several[0] if several else 'loads'} beside variants on a GPU", got="one for each lane",
                         allowed="one for all lanes")
    if np.ptp(period_of(variants)) > 0.0:
        raise InputError("variants on a GPU", got="frames, or ticks, that last longer in some",
                         allowed="servos that have them in common")


def _refused(name: str) -> InputError:
    return InputError(f"{name} on a GPU", allowed='nothing: device="cpu" has it')
