"""`simulate_bus`: several servos on one supply, and what that supply may be."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, SimulationError, UnknownNameError
from servotwin.models import DigitalServo, Model, PulseServo, PulseServoInductive
from servotwin.models.outputs import SIGNALS
from servotwin.models.terms.elastic import Elastic, behind, present
from servotwin.models.terms.source import Source
from servotwin.parameters.groups import Supply
from servotwin.signals import Signal
from servotwin.simulation import bus_run, frames, result
from servotwin.simulation.bus_run import events_of, motions_of
from servotwin.simulation.engine import Plan
from servotwin.simulation.frames import times_asked
from servotwin.simulation.lanes.inputs import pick
from servotwin.simulation.metrics import Energy
from servotwin.simulation.remarks import Sag, ServoRemark, sag_of, warn_of
from servotwin.simulation.result import Result
from servotwin.simulation.simulator import Simulator
from servotwin.simulation.start import Status
from servotwin.simulation.trajectory import Bus, Trajectory
from servotwin.units import is_finite

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from servotwin.simulation.lanes.inputs import LaneInputs
    Array = NDArray[np.float64]


# --- The supply that several servos share -----------------------------------------------------------------------------

Indices = NDArray[np.int64]
OF_BUS = ("supply.open_circuit_voltage", "supply.internal_resistance", "supply.current_limit")
"""The supply's numbers on a bus in place of the servo's own."""
MODELS = (PulseServo, PulseServoInductive, DigitalServo)
MODEL_NAMES = "PulseServo, PulseServoInductive or DigitalServo"
_OF_SERVO = ("bridge_drop_voltage", "bridge_drop_resistance")


def check_supply(what: str, supply: object) -> None:
    """Raise InputError unless this is a supply that servos can share."""
    if not isinstance(supply, Supply) or supply.open_circuit_voltage is None:
        raise InputError(what, got=supply, allowed="a Supply with open_circuit_voltage, such as "
                         "Supply(open_circuit_voltage=6.0, internal_resistance=0.5)")
    for name in _OF_SERVO:
        if getattr(supply, name) is not None:
            raise InputError(f"supply.{name} of a bus", got=getattr(supply, name), allowed="it belongs to each servo")


def source_of(supply: Supply) -> Source:
    """Return a supply as the engine has it."""
    V_oc, R_b, I_max = supply.open_circuit_voltage, supply.internal_resistance, supply.current_limit
    return Source(V_oc or 0.0, R_b or 0.0, math.inf if I_max is None else I_max)


def check_rigid(what: str, numbers: Elastic) -> None:
    """Raise InputError if a servo that shall share a supply has a spring between two bodies."""
    if present(numbers):
        raise InputError(what, got="a body behind an elastic shaft" if behind(numbers) else "gear.stiffness",
                         allowed="a stiff gear and shaft: on a shared supply there are no springs between two bodies")


def on_supply(model: Model, supply: Supply) -> Model:
    """Return a model with this supply instead of its own."""
    values = {name: getattr(supply, name.partition(".")[2]) for name in OF_BUS}
    return type(model)(model.servo.replace(values, source="the supply that all share"))


@dataclass(frozen=True, eq=False)
class Supplies:
    """The supplies that lanes share.

    Parameters
    ----------
    supplies : tuple of Supply
    lanes : tuple of ndarray of int64
        Which lanes hang on each.
    count : int
        Number of all lanes.
    """

    supplies: tuple[Supply, ...]
    lanes: tuple[Indices, ...]
    count: int

    @cached_property
    def bus_of(self) -> Indices:
        """Number of each lane's bus, shape (count,); −1 where it hangs on none."""
        found = np.full(self.count, -1)
        for k, lanes in enumerate(self.lanes):
            found[lanes] = k
        return found

    def parts(self, inputs: LaneInputs, which: Indices) -> Iterator[tuple[LaneInputs, Indices]]:
        """Return lanes by the supply that they have, with their inputs."""
        bus_of = self.bus_of[which]
        for k in np.unique(bus_of).tolist():
            yield (inputs if k < 0 else self._fed(inputs, k)), which[bus_of == k]

    def _fed(self, inputs: LaneInputs, k: int) -> LaneInputs:
        own = {name: column for name, column in inputs.numbers.items() if name not in OF_BUS}
        return replace(inputs, model=on_supply(inputs.model, self.supplies[k]), numbers=own)

    def check_parameters(self, names: Sequence[str], which: Indices) -> None:
        """Raise InputError if a number of the supply shall change for a lane that is on a bus."""
        on_bus = which[self.bus_of[which] >= 0]
        for name in names:
            if name in OF_BUS and len(on_bus):
                raise InputError(f"{name} of lane {on_bus[0]}", got="a new value",
                                 allowed="no other than that of its bus, which it shares")


def supplies_of(bus: Any, model: object, count: int) -> Supplies:
    """Return the supplies that `bus` of a `VectorSimulator` with so many lanes means.

    Raises
    ------
    InputError
        On bad input; names bus and lane.
    """
    if bus is None:
        return Supplies((), (), count)
    if not isinstance(model, MODELS):
        raise InputError("model of servos on a bus", got=model, allowed=MODEL_NAMES)
    given = [(bus, np.arange(count))] if isinstance(bus, Supply) else bus
    if not isinstance(given, Sequence) or not given or not all(
            isinstance(one, Sequence) and len(one) == 2 for one in given):
        raise InputError("bus", got=bus, allowed="a Supply that all lanes share, or a list of (Supply, lanes)")
    seen = np.full(count, -1)
    found = []
    for k, (supply, some) in enumerate(given):
        check_supply(f"supply of bus {k}", supply)
        lanes = _lanes_of(k, some, count)
        if (seen[lanes] >= 0).any():
            lane = int(lanes[np.argmax(seen[lanes] >= 0)])
            raise InputError(f"lane {lane} of bus {k}", got=f"a lane of bus {seen[lane]} too",
                             allowed="each lane on one bus at most")
        seen[lanes] = k
        found.append(lanes)
    return Supplies(tuple(supply for supply, _ in given), tuple(found), count)


def _lanes_of(k: int, some: Any, count: int) -> Indices:
    try:
        lanes = np.arange(0) if np.size(some) == 0 else pick(some, count)
    except InputError as error:
        raise InputError(f"lanes of bus {k}", got=error.got, allowed=error.allowed) from None
    if not len(lanes) or some is None:
        raise InputError(f"lanes of bus {k}", got=some if some is None else "none", allowed="at least one lane")
    return lanes


# --- `simulate_bus`: several servos on one supply, joined by its voltage ----------------------------------------------

_BUS_UNITS = {"bus_voltage": "V", "bus_current": "A"}


@dataclass(frozen=True, eq=False, repr=False)
class Fleet(Mapping[str, Result]):
    """The outcome of a simulation of several servos on one supply: a mapping of their results.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Output times [s].
    results : mapping of str to Result
        Of each servo, by its name.
    status : Status
        How the run ended; `cause` says it in words, `ended` when [s].
    bus : Bus
        Voltage of the supply under load [V] at any times [s], an array; `sag`, how far it fell.

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
    >>> command = st.signals.step(0.0, 60.0, at=0.1, unit="deg")
    >>> fleet = st.simulate_bus({"left": (model, command), "right": (model, command)}, duration=0.3,
    ...                         supply=st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5))
    >>> bool(4.0 < fleet.bus_voltage.min() < 5.0), fleet["left"].status.ok
    (True, True)
    """

    time: Array
    results: Mapping[str, Result]
    status: Status
    ended: float
    cause: str
    bus: Bus

    def __repr__(self) -> str:
        return f"Fleet({', '.join(self.results)}; {self.ended:g} s, {self.status.name}, {len(self.time)} times)"

    def __getitem__(self, name: str) -> Result:
        """Return the result of a servo."""
        if name not in self.results:
            raise UnknownNameError("servo of the fleet", name, tuple(self.results))
        return self.results[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.results)

    def __len__(self) -> int:
        """Return the number of servos."""
        return len(self.results)

    @cached_property
    def bus_voltage(self) -> Array:
        """Voltage of the supply under load [V], shape (n,)."""
        return self.bus(self.time)

    @cached_property
    def supply_current(self) -> Array:
        """Current that the supply gives to all servos [A], shape (n,); negative where some comes back."""
        return np.asarray(sum(result["supply_current"] for result in self.results.values()))

    @property
    def sag(self) -> Sag | None:
        """How far the supply fell; None where it stayed as it is."""
        return self.bus.sag

    @cached_property
    def remarks(self) -> tuple[ServoRemark, ...]:
        """Remarks on each servo, (servo, kind, time [s]), as `Result.remarks`."""
        return tuple(ServoRemark(name, *remark) for name, result in self.results.items() for remark in result.remarks)

    @cached_property
    def energy(self) -> Energy:
        """Energy balance of all servos together [J]; its `supply` is what the bus has delivered."""
        parts = [result.energy for result in self.results.values()]
        return Energy(*(sum(getattr(part, one.name) for part in parts) for one in fields(Energy)))

    @property
    def units(self) -> Mapping[str, str]:
        """SI unit of each signal of tables and files."""
        return {"time": "s", **{name: SIGNALS[name].unit for name in self._signals}, **_BUS_UNITS}

    @cached_property
    def _signals(self) -> dict[str, Array]:
        """All signals of the servos, shape (servos, n); nan where a servo lacks one."""
        names = dict.fromkeys(name for result in self.results.values() for name in result.names if name != "time")
        none = np.full(len(self.time), np.nan)
        return {name: np.array([result[name] if name in result else none for result in self.results.values()])
                for name in names if name not in _BUS_UNITS}

    def _table(self) -> dict[str, Array]:
        """Return all signals, and voltage and current of the bus as each servo's."""
        shape = (len(self), len(self.time))
        return self._signals | {"bus_voltage": np.broadcast_to(self.bus_voltage, shape),
                                "bus_current": np.broadcast_to(self.supply_current, shape)}

    def to_dataframe(self) -> pd.DataFrame:
        """Return all signals (SI) as a pandas DataFrame, a row for each servo and time.

        `supply_current` is what a servo draws; `bus_voltage`, and `bus_current` of all servos, stand with each. A
        signal that a servo lacks is nan.

        Examples
        --------
        >>> import servotwin as st
        >>> model = st.PulseServo(st.load_servo("hitec-hs-755hb"))
        >>> command = st.signals.step(0.0, 60.0, unit="deg")
        >>> fleet = st.simulate_bus({"left": (model, command), "right": (model, command)}, duration=0.1,
        ...                         supply=st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5))
        >>> frame = fleet.to_dataframe()
        >>> frame.index.names, len(frame.loc["left"]) == len(fleet.time), "bus_voltage" in frame
        (FrozenList(['servo', 'time']), True, True)
        """
        return frames.dataframe("servo", list(self.results), self.time, self._table(), self.units)

    def to_xarray(self) -> xr.Dataset:
        """Return all signals (SI) as an xarray Dataset over `servo` and `time`; those of the bus over `time` alone.

        `supply_current` is what a servo draws, `bus_current` that of all. A signal that a servo lacks is nan.
        """
        bus = {"bus_voltage": (self.bus_voltage, SIGNALS["bus_voltage"].meaning),
               "bus_current": (self.supply_current, "current that the supply gives to all servos")}
        models = [result.model for result in self.results.values()]
        return frames.dataset(
            "servo", list(self.results), self.time, self._signals,
            more={name: ("time", values, {"units": _BUS_UNITS[name], "long_name": meaning})
                  for name, (values, meaning) in bus.items()},
            coords={"model": ("servo", [type(model).__name__ for model in models]),
                    "servo_name": ("servo", [model.servo.name for model in models])}, attrs={})

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write all signals to a CSV or Parquet file, a row for each servo and time.

        Columns are `servo`, `time_s`, the signals, and voltage and current of the bus, the unit of each in its name. A
        signal that a servo lacks, and what a failed run has not reached, is nan.

        Parameters
        ----------
        path : str or Path
            Ends in .csv or .parquet; the latter needs pyarrow.
        overwrite : bool
            Whether a file that is there may be replaced.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        result.save_lanes(path, self.time, self._table(), self.units, {"servo": np.array(list(self.results))},
                         what="a fleet", overwrite=overwrite)

    def raise_if_failed(self) -> Fleet:
        """Return the fleet itself, or raise SimulationError if the run ended before its time."""
        if not self.status.ok:
            raise SimulationError(self.status.name, self.ended, self.cause)
        return self


def simulate_bus(servos: Mapping[str, Sequence[Any]], *, supply: Supply, duration: float,
                 output_step: float | None = None, output_times: ArrayLike | None = None,
                 initial: Mapping[str, Mapping[str, float]] | None = None, seed: int = 0) -> Fleet:
    """Simulate several servos on one supply from t = 0 to `duration`.

    The supply's voltage follows from all their currents at every instant; what it is feeds back into each motor, and
    through `electronics.supply_coupling` into what each chip measures. A servo alone on the bus moves as with
    `simulate`.

    Parameters
    ----------
    servos : mapping of str to tuple
        (model, command) or (model, command, load) by a name of your choice; the models are `PulseServo`,
        `PulseServoInductive` or `DigitalServo`. The source of their servo files is replaced by `supply`.
    supply : Supply
        Its open_circuit_voltage, internal_resistance and current_limit; the drop of a bridge is the servo's own.
    duration : float
        Positive [s].
    output_step, output_times
        As in `simulate`.
    initial : mapping, optional
        Initial values of each servo by its name, as in `simulate`.
    seed : int
        Of all noise; the k-th servo has the seed `seed` + k.

    Returns
    -------
    Fleet

    Raises
    ------
    InputError
        On bad input; names the servo.

    Warns
    -----
    UserWarning
        As `simulate` does.
    """
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("duration", got=duration, allowed="a positive number of seconds")
    times = times_asked(duration, output_step, output_times)
    given = _checked(servos, supply, duration, initial)
    sims, plans, states = {}, [], []
    for k, (name, (model, command, load)) in enumerate(given.items()):
        sim = Simulator(on_supply(model, supply), load, int(seed) + k)
        sim.load.check_span(0.0, duration)
        check_rigid(f"servo {name!r} on a bus", sim.model.plant(sim.load).elastic)
        states.append(sim.initial(command, (initial or {}).get(name)))
        plans.append(sim.plan(command))
        sims[name] = sim
    for name, (_, command, _) in given.items():
        warn_of(sims[name].model.servo, [command], duration)
    source = source_of(supply)
    rows = bus_run.run(plans, states, source, duration)
    status = Status.of_code(rows.status)
    ended = duration if status.ok else rows.ended
    motions, events = motions_of(plans, rows), events_of(plans, rows)
    alone = [Trajectory(own) for own in motions]
    bus = _AllAlong(source, plans, alone, supply)
    results = {
        name: Result(model=sims[name].model, command=command, load=sims[name].load, drive=sims[name].drive(command),
                     time=times, trajectory=Trajectory(own, bus), events=happened, status=status, ended=ended,
                     cause=status.message)
        for (name, (_, command, _)), own, happened in zip(given.items(), motions, events, strict=True)}
    return Fleet(times, results, status, ended, status.message, bus)


def _checked(servos: Mapping[str, Sequence[Any]], supply: Supply, duration: float,
             initial: Mapping[str, Mapping[str, float]] | None) -> dict[str, tuple[Model, Signal, Any]]:
    allowed = "a mapping of names to (model, command) or (model, command, load)"
    if not isinstance(servos, Mapping) or not servos:
        raise InputError("servos", got=servos, allowed=allowed)
    check_supply("supply", supply)
    for name in initial or {}:
        if name not in servos:
            raise UnknownNameError("servo of initial", name, tuple(servos))
    found: dict[str, tuple[Model, Signal, Any]] = {}
    for name, parts in servos.items():
        if not isinstance(parts, Sequence) or isinstance(parts, str) or len(parts) not in (2, 3):
            raise InputError(f"servo {name!r}", got=parts, allowed="(model, command) or (model, command, load)")
        if not isinstance(parts[0], MODELS):
            raise InputError(f"model of servo {name!r}", got=parts[0], allowed=MODEL_NAMES)
        command = parts[0].framed(parts[1], duration) if isinstance(parts[1], Signal) else parts[1]
        found[str(name)] = (parts[0], command, parts[2] if len(parts) == 3 else None)
    return found


@dataclass(frozen=True, eq=False)
class _AllAlong:
    """The voltage of the bus at any time, from the states of all servos."""

    source: Source
    plans: Sequence[Plan]
    trajectories: Sequence[Trajectory]
    supply: Supply

    @cached_property
    def sag(self) -> Sag | None:
        return sag_of(self.trajectories, lambda samples: self(samples.time), self.supply)

    def __call__(self, time: Array) -> Array:
        return bus_run.voltages(self.plans, self.source, [trajectory.at(time) for trajectory in self.trajectories])
