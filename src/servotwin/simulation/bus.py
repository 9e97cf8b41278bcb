"""`simulate_bus`: several servos on one supply, joined by its voltage."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.errors import InputError, SimulationError, UnknownNameError
from servotwin.models import Model
from servotwin.models.outputs import SIGNALS
from servotwin.models.terms.source import Source
from servotwin.parameters.groups import Supply
from servotwin.signals import Signal
from servotwin.simulation import bus_run, files, frames
from servotwin.simulation.bus_rows import events_of, motions_of
from servotwin.simulation.bus_supply import MODEL_NAMES, MODELS, check_rigid, check_supply, on_supply, source_of
from servotwin.simulation.energy import Energy
from servotwin.simulation.engine import Plan
from servotwin.simulation.oddities import warn_of
from servotwin.simulation.remarks import ServoRemark
from servotwin.simulation.result import Result
from servotwin.simulation.sag import Sag, sag_of
from servotwin.simulation.simulator import Simulator
from servotwin.simulation.status import Status
from servotwin.simulation.times import times_asked
from servotwin.simulation.trajectory import Bus, Trajectory
from servotwin.units import is_finite

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

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
        """What is to be said of each servo, (servo, kind, time [s]), as `Result.remarks`."""
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
        files.save_lanes(path, self.time, self._table(), self.units, {"servo": np.array(list(self.results))},
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
        `PulseServoInductive` or `DigitalServo`. What their servo files say of the source is replaced by `supply`.
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
