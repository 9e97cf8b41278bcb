"""A log: the command of one servo, what it did, and under which load and conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.loads import Load, Recorded, as_load
from servotwin.logs import log_checks as check
from servotwin.signals.shapes import sampled
from servotwin.signals.signal import filled

if TYPE_CHECKING:
    from servotwin.logs.formats import Reading
    from servotwin.signals import Signal

ANGLES = ("output_angle", "feedback_voltage")  # of the signals that tell where the shaft is, the better one first
KINDS = {"angle": "rad", "pulse_width": "s", "voltage": "V"}  # kind of command -> its SI unit
_FRAME_PERIOD = "electronics.frame_period"


@dataclass(frozen=True, kw_only=True, eq=False)
class Log:
    """One run of one servo; everything in SI, arrays read-only.

    Parameters
    ----------
    name : str
        Of the run; unique within a list of logs.
    time : ndarray, shape (n,)
        Strictly increasing, n ≥ 3; need not start at 0, may be uneven and have gaps [s].
    command : ndarray, shape (n,)
        In SI: rad, s or V. Of pulses and angles that are held, nan means that no pulse was sent from this sample to the
        next one with a value.
    command_kind : {"angle", "pulse_width", "voltage"}
    measured : mapping of str to ndarray, shape (n,)
        Signal name to values in SI, nan where nothing was measured; has `output_angle` or `feedback_voltage`.
    command_hold : {"previous", "linear"}
        Course of the command between samples.
    torque_on : ndarray of bool, shape (n,), optional
        False: from this sample to the next the servo gets no pulses, whatever `command` says. None: it is always on.
    load : Load or Part
        Load on the shaft; recorded torques count their time from the first sample.
    parameters : mapping of str to float
        Servo parameters that hold during this log, such as ``{"supply.open_circuit_voltage": 6.0}``.
    motion : str
        Kind of motion, such as "step" or "prbs", for tables of errors.
    conditions : mapping of str to float or str
        Further labels for tables of errors.
    left_out : tuple of (float, float)
        Windows start ≤ time < stop that say nothing about the servo [s].
    source : str
        Where it was read.
    reading : Reading, optional
        How: which column of a file was taken as what.

    Raises
    ------
    InputError
        If time stands still or runs backwards, there are fewer than three samples, lengths differ, a command is missing
        where it cannot be, or always, no angle was measured, or a value is so large that its unit must be another one.
    UnknownNameError
        If there is no such signal or parameter.

    Examples
    --------
    >>> log = Log(name="run", time=[0.0, 0.02, 0.04], command=[1.5e-3, 1.6e-3, 1.6e-3], command_kind="pulse_width",
    ...           measured={"output_angle": [0.0, 0.01, float("nan")]}, left_out=[(0.0, 0.01)])
    >>> log.duration, log.used("output_angle").tolist()
    (0.04, [False, True, False])
    """

    name: str
    time: NDArray[np.float64] = field(repr=False)
    command: NDArray[np.float64] = field(repr=False)
    command_kind: str
    measured: Mapping[str, NDArray[np.float64]] = field(repr=False)
    command_hold: str = "previous"
    torque_on: NDArray[np.bool_] | None = field(default=None, repr=False)
    load: Load = field(default_factory=Load, repr=False)
    parameters: Mapping[str, float] = field(default_factory=dict, repr=False)
    motion: str = ""
    conditions: Mapping[str, float | str] = field(default_factory=dict)
    left_out: tuple[tuple[float, float], ...] = ()
    source: str = ""
    reading: Reading | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        where = check.texts(self.name, self.motion, self.source)
        check.choice(f"{where}: command_kind", self.command_kind, tuple(KINDS))
        check.choice(f"{where}: command_hold", self.command_hold, ("previous", "linear"))
        time = check.times(where, self.time)
        n = time.size
        made: dict[str, object] = {
            "time": time,
            "command": check.command(where, self.command, self.command_kind, self.command_hold, n),
            "measured": MappingProxyType(check.measured(where, self.measured, n, ANGLES)),
            "torque_on": None if self.torque_on is None else check.switch(where, self.torque_on, n),
            "load": as_load(self.load),
            "parameters": MappingProxyType(check.parameters(where, self.parameters)),
            "conditions": MappingProxyType(check.conditions(where, self.conditions)),
            "left_out": check.windows(where, self.left_out),
        }
        for key, value in made.items():
            object.__setattr__(self, key, value)
        if not any(self.used(name).any() for name in ANGLES if name in self.measured):
            raise InputError(f"{where}: {' and '.join(name for name in ANGLES if name in self.measured)}",
                             got="no value outside the windows that are left out", allowed="at least one value")

    def __len__(self) -> int:
        """Return the number of samples."""
        return int(self.time.size)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by plain mappings."""
        state = {f.name: getattr(self, f.name) for f in fields(self)}
        return _rebuild, ({k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in state.items()},)

    @property
    def start(self) -> float:
        """Time of the first sample [s]; t = 0 of the command that `signal` returns."""
        return float(self.time[0])

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def held(self) -> NDArray[np.float64]:
        """The command where none is missing, shape (n,): else the one before it, or at the start the first one (SI)."""
        return check.frozen(filled(self.command))

    @cached_property
    def sent(self) -> NDArray[np.bool_]:
        """Whether pulses are sent from each sample to the next, shape (n,): there is a command, and torque is on."""
        there = ~np.isnan(self.command)
        return check.frozen(there if self.torque_on is None else there & self.torque_on)

    @cached_property
    def changes(self) -> NDArray[np.int64]:
        """Samples at which the command is another one, or pulses begin or end, than at the sample before."""
        turns = (np.diff(self.held) != 0.0) | (self.sent[1:] != self.sent[:-1])
        return check.frozen(np.flatnonzero(turns) + 1)

    def rows_at(self, time: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the samples nearest to some times [s]: those of the log itself, whatever rounding makes of them.

        Examples
        --------
        >>> log = Log(name="a", time=[0.1, 0.2, 0.3], command=[0.0, 0.5, 0.5], command_kind="angle",
        ...           measured={"output_angle": [0.0, 0.1, 0.5]})
        >>> log.rows_at(0.1 + (log.time - 0.1)).tolist()
        [0, 1, 2]
        """
        return np.searchsorted(0.5 * (self.time[1:] + self.time[:-1]), time)

    @property
    def angle_name(self) -> str:
        """The signal that tells best where the shaft is: `output_angle`, else `feedback_voltage`."""
        return next(name for name in ANGLES if name in self.measured and self.used(name).any())

    @property
    def is_constant(self) -> bool:
        """Whether the shaft was never seen to move: one value only, or nothing but noise under one command."""
        values = self.measured[self.angle_name][self.used(self.angle_name)]
        if np.ptp(values) == 0.0:
            return True
        if self.changes.size:
            return False
        # Of white noise the mean square of differences is twice the variance; of a motion it is far less
        return bool(np.mean(np.diff(values)**2) > np.var(values))

    def used(self, name: str) -> NDArray[np.bool_]:
        """Return where a measured signal counts, shape (n,): it is finite, and inside no window that is left out.

        Raises
        ------
        UnknownNameError
            If it was not measured.
        """
        if name not in self.measured:
            raise check.not_measured(self.name, name, self.measured)
        here = np.isfinite(self.measured[name])
        for start, stop in self.left_out:
            here &= (self.time < start) | (self.time >= stop)
        return here

    def signal(self, frame_period: float | None = None) -> Signal:
        """Return the command; its t = 0 is the first sample.

        Where a command is missing or torque is off there are no pulses: frames start at regular edges, without those.
        A servo without pulses then ends its drive by its `pulse_timeout`; the averaged models have no pulses.

        Parameters
        ----------
        frame_period : float, optional
            Of the edges of a log without some pulses [s]; unless given that of `parameters`, or 20 ms.

        Raises
        ------
        InputError
            If the frame period is not positive.
        """
        unit = KINDS[self.command_kind]
        made = sampled(self.time - self.time[0], self.held, unit=unit, hold=self.command_hold)
        if self.sent.all():
            return made
        period = self.parameters.get(_FRAME_PERIOD, 0.02) if frame_period is None else frame_period
        edges = check.frame_edges(self.time, self.sent, period)
        return replace(made, edges=tuple(edges.tolist()))

    def part(self, start: float, stop: float, name: str | None = None) -> Log:
        """Return the samples with start ≤ time < stop [s] as a log of its own.

        Raises
        ------
        InputError
            If fewer than three samples, or none of the angle, remain.
        """
        keep = (self.time >= start) & (self.time < stop)
        return self._cut(keep, self.name if name is None else name)

    def without_torque_off(self) -> tuple[Log, ...]:
        """Return the stretches with pulses, each a log of its own; those too short or without an angle are left out.

        Names get " (1)", " (2)", … where there are several.
        """
        if self.sent.all():
            return (self,)
        ends = np.flatnonzero(np.diff(np.concatenate(([False], self.sent, [False]))))
        seen = np.any([self.used(name) for name in ANGLES if name in self.measured], axis=0)
        spans = [(a, b) for a, b in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True)
                 if b - a >= check.FEWEST and seen[a:b].any()]
        index = np.arange(self.time.size)
        return tuple(self._cut((index >= a) & (index < b), f"{self.name} ({k})" if len(spans) > 1 else self.name)
                     for k, (a, b) in enumerate(spans, 1))

    def _cut(self, keep: NDArray[np.bool_], name: str) -> Log:
        if keep.sum() < check.FEWEST:
            raise check.too_few(f"part of log {self.name!r}", int(keep.sum()))
        shift = float(self.time[keep][0] - self.time[0])
        load = replace(self.load, recorded=tuple(Recorded([t - shift for t in r.time], r.torque)
                                                 for r in self.load.recorded))
        command, on = self.command, self.torque_on
        if np.isnan(command[keep][0]):  # the last command is only given before the part
            command, on = self.held, self.sent
        return replace(self, name=name, time=self.time[keep], command=command[keep], load=load,
                       measured={key: values[keep] for key, values in self.measured.items()},
                       torque_on=None if on is None else on[keep])


def _rebuild(state: dict[str, Any]) -> Log:
    return Log(**state)



def read_alike(logs: Sequence[Log]) -> list[list[Log]]:
    """Return logs in groups whose columns were read in the same way; those without a reading are left out."""
    groups: dict[Any, list[Log]] = {}
    for log in logs:
        if log.reading is not None:
            groups.setdefault(log.reading.columns, []).append(log)
    return list(groups.values())


def reading_facts(logs: Sequence[Log]) -> list[dict[str, Any]]:
    """Return how logs were read, as plain data: one entry for each way.

    Examples
    --------
    >>> from servotwin.logs import Log, ReadColumn, Reading
    >>> log = Log(name="run", time=[0.0, 1.0, 2.0], command=[0.0, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.5, 1.0]},
    ...           reading=Reading(columns=(ReadColumn("ms", "time", "ms", "guessed from its name"),)))
    >>> reading_facts([log])[0]["columns"]
    [{'column': 'ms', 'signal': 'time', 'unit': 'ms', 'known': 'guessed from its name'}]
    """
    return [{"logs": [log.name for log in some],
             "columns": [{"column": one.column, "signal": one.signal, "unit": one.unit, "known": one.known}
                         for one in some[0].reading.columns if some[0].reading is not None],
             "remarks": [remark for log in some if log.reading is not None for remark in log.reading.remarks]}
            for some in read_alike(logs) if some[0].reading is not None]
