"""The shapes that a command can have; each returns a `Signal`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from servotwin import units
from servotwin.errors import CommandError, InputError
from servotwin.physics.pieces import Piece, Pieces, constant_pieces
from servotwin.signals.signal import KINDS, Signal, filled, in_si, kind_of, spans, warn_of_time_base
from servotwin.tables import TextTable, read_table
from servotwin.units import is_masked

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


# --- The shapes that a command can have; each returns a `Signal` ------------------------------------------------------

_TURN = 2.0 * math.pi


def constant(value: float, *, unit: str, frame_period: float | None = None) -> Signal:
    """Return a command that never changes.

    Examples
    --------
    >>> constant(1500.0, unit="us").initial
    0.0015
    """
    y = in_si(value, unit, "constant(value)")
    return Signal(pieces=constant_pieces(y), unit=unit, initial=y, frame_period=frame_period)


def step(before: float, after: float, *, at: float = 0.0, unit: str, frame_period: float | None = None) -> Signal:
    """Return a step from `before` to `after` at the time `at` [s].

    Examples
    --------
    >>> step(1500.0, 2000.0, at=0.1, unit="us").pieces.table[1].value
    0.002
    """
    y0, y1 = in_si(before, unit, "step(before)"), in_si(after, unit, "step(after)")
    at = _time(at, "step(at)")
    rows = (Piece(_before(at), y0), Piece(at, y1))
    return Signal(pieces=Pieces(rows), unit=unit, initial=y1 if at < 0.0 else y0, frame_period=frame_period)


def ramp(before: float, after: float, *, at: float = 0.0, over: float, unit: str,
         frame_period: float | None = None) -> Signal:
    """Return a ramp that starts at the time `at` [s] and takes `over` seconds.

    Examples
    --------
    >>> round(float(ramp(0.0, 1.0, at=1.0, over=2.0, unit="rad")(2.0)), 12)
    0.5
    """
    y0, y1 = in_si(before, unit, "ramp(before)"), in_si(after, unit, "ramp(after)")
    at, over = _time(at, "ramp(at)"), _positive(over, "ramp(over)")
    if at + over == at:
        raise CommandError("ramp(over)", got=over, allowed=f"a time that shows beside at = {at:g} s")
    rows = (Piece(_before(at), y0), Piece(at, y0, (y1 - y0) / over), Piece(at + over, y1))
    pieces = Pieces(rows)
    initial = y0 if at >= 0.0 else float(pieces(0.0))
    return Signal(pieces=pieces, unit=unit, initial=initial, frame_period=frame_period)


def sine(*, mean: float, amplitude: float, frequency: float, phase: float = 0.0, unit: str,
         frame_period: float | None = None) -> Signal:
    """Return mean + amplitude sin(2π frequency t + phase), frequency in hertz, phase in radians.

    Examples
    --------
    >>> float(sine(mean=1.2, amplitude=0.3, frequency=2.0, unit="V")(0.125))
    1.5
    """
    row = Piece(0.0, in_si(mean, unit, "sine(mean)"), 0.0, in_si(amplitude, unit, "sine(amplitude)"),
                _TURN * _positive(frequency, "sine(frequency)"), _time(phase, "sine(phase)"))
    return _smooth((row,), unit, frame_period)


def chirp(*, mean: float, amplitude: float, start_frequency: float, end_frequency: float, duration: float,
          unit: str, frame_period: float | None = None) -> Signal:
    """Return a sine whose frequency [Hz] goes linearly from start to end in `duration` [s], then stays.

    Examples
    --------
    >>> s = chirp(mean=1.2, amplitude=0.3, start_frequency=0.1, end_frequency=5.0, duration=10.0, unit="V")
    >>> round(float(s(0.0)), 9)
    1.2
    """
    y, a = in_si(mean, unit, "chirp(mean)"), in_si(amplitude, unit, "chirp(amplitude)")
    T = _positive(duration, "chirp(duration)")
    w0 = _TURN * _positive(start_frequency, "chirp(start_frequency)")
    w1 = _TURN * _positive(end_frequency, "chirp(end_frequency)")
    rows = (Piece(0.0, y, 0.0, a, w0, 0.0, (w1 - w0) / T), Piece(T, y, 0.0, a, w1, 0.5 * (w0 + w1) * T % _TURN))
    return _smooth(rows, unit, frame_period)


def prbs(low: float, high: float, *, bit_time: float, duration: float, order: int = 9, seed: int = 0, unit: str,
         frame_period: float | None = None) -> Signal:
    """Return a pseudo-random binary sequence of maximal length 2^order − 1, repeated for `duration` [s].

    Parameters
    ----------
    low, high : float
        The two values, in `unit`.
    bit_time, duration : float
        [s]
    order : int
        Length of the shift register, 2 to 20.
    seed : int
        Where in its cycle the register starts.

    Raises
    ------
    CommandError
        If a number is not finite, `order` or `seed` no integer, or there are more than ten million bits.

    Examples
    --------
    >>> s = prbs(1400.0, 1600.0, bit_time=0.05, duration=1.0, unit="us")
    >>> sorted({round(1e6 * float(v)) for v in s(np.arange(0.0, 1.0, 0.05))})
    [1400, 1600]
    """
    if not (isinstance(order, int) and 2 <= order <= 20):
        raise CommandError("prbs(order)", got=order, allowed="an integer from 2 to 20")
    if isinstance(seed, bool) or not isinstance(seed, int):
        raise CommandError("prbs(seed)", got=seed, allowed="an integer")
    from scipy.signal import max_len_seq

    length = 2**order - 1
    bits = max_len_seq(order, state=[(1 + seed % length) >> k & 1 for k in range(order)])[0]
    T = _positive(bit_time, "prbs(bit_time)")
    bits_long = _positive(duration, "prbs(duration)") / T
    if bits_long > 10_000_000:
        raise CommandError("prbs(duration / bit_time)", got=f"{bits_long:.6g} bits", allowed="at most 10 000 000 bits")
    count = max(1, math.ceil(bits_long - 1e-9))
    y0, y1 = in_si(low, unit, "prbs(low)"), in_si(high, unit, "prbs(high)")
    time = np.asarray(np.arange(count) * T, dtype=np.float64)
    return _held(time, np.where(np.resize(bits, count) == 1, y1, y0), unit, frame_period)


def samples(time: ArrayLike, value: ArrayLike, *, unit: str, hold: str = "previous",
            frame_period: float | None = None) -> Signal:
    """Return a sampled command: held ("previous") or interpolated ("linear"), with the last value kept.

    Parameters
    ----------
    time : array_like, shape (n,)
        Increasing [s].
    value : array_like, shape (n,)
        In `unit`. Of pulses and angles that are held, nan means that no pulses are sent from this sample to the next
        one with a value: frames count on without them.
    hold : {"previous", "linear"}

    Raises
    ------
    CommandError
        If the arrays are empty, of unequal length, unsorted or not finite, a linear slope is beyond all numbers, or
        nan stands for a voltage, between linear samples, or everywhere.

    Warns
    -----
    UserWarning
        If the times look as if they were a thousand times too long or too short.

    Examples
    --------
    >>> float(samples([0.0, 1.0], [0.0, 1.0], unit="rad", hold="linear")(0.25))
    0.25
    >>> samples([0.0, 0.5, 1.0], [1500.0, float("nan"), 1600.0], unit="us").silences
    ((0.5, 1.0),)
    """
    t, y = _arrays(time, value, unit, "samples", silent=kind_of(unit) != "voltage" and hold == "previous")
    silences = spans(t, np.isnan(y))
    y = filled(y)
    warn_of_time_base(t, y, kind_of(unit), "the command")
    made = sampled(t, y, unit=unit, hold=hold, frame_period=frame_period)
    return replace(made, silences=silences) if silences else made


def sampled(t: NDArray[np.float64], y: NDArray[np.float64], *, unit: str, hold: str,
            frame_period: float | None = None) -> Signal:
    """Return what `samples` does of arrays in SI that were checked before; `unit` is what the caller gave."""
    if hold == "previous":
        return _held(t, y, unit, frame_period)
    if hold != "linear":
        raise CommandError("samples(hold)", got=hold, allowed="previous, linear")
    with np.errstate(over="ignore"):
        slope = np.append(np.diff(y) / np.diff(t), 0.0)
    steep = np.flatnonzero(~np.isfinite(slope))
    if steep.size:
        raise CommandError(f"samples: slope after sample {steep[0]}", got=float(slope[steep[0]]),
                           allowed="a finite number")
    rows = [Piece(*row) for row in zip(t.tolist(), y.tolist(), slope.tolist(), strict=True)]
    if t[0] > 0.0:
        rows.insert(0, Piece(0.0, float(y[0])))
    return _smooth(tuple(rows), unit, frame_period)


def pulse_train(edges: ArrayLike, widths: ArrayLike, *, unit: str = "us") -> Signal:
    """Return pulses given one by one: rising edges [s] and widths (in `unit`), each width held until the next edge.

    Examples
    --------
    >>> pulse_train([0.0, 0.02], [1500.0, 1600.0]).edges
    (0.0, 0.02)
    """
    if kind_of(unit) != "pulse_width":
        raise CommandError("unit of a pulse width", got=unit, allowed="us, ms, s")
    t, y = _arrays(edges, widths, unit, "pulse_train")
    warn_of_time_base(t, y, "pulse_width", "the pulses")
    late = np.flatnonzero(y[:-1] >= np.diff(t))
    if late.size:
        raise CommandError(f"pulse {late[0]}", got=f"width {y[late[0]]:g} s",
                           allowed="a pulse that ends before the next")
    held = _held(t, y, unit, None)
    return Signal(pieces=held.pieces, unit=unit, initial=held.initial, edges=tuple(t.tolist()))


def held_pulses(t: NDArray[np.float64], y: NDArray[np.float64], edges: NDArray[np.float64], *, unit: str,
                initial: float) -> Signal:
    """Return values in SI, each held until the next, that pulses carry from their edges on; all checked before."""
    return Signal(pieces=_steps(t, y), unit=unit, initial=initial, edges=tuple(edges.tolist()))


def _held(t: NDArray[np.float64], y: NDArray[np.float64], unit: str, frame_period: float | None) -> Signal:
    before = max(int(np.searchsorted(t, 0.0)) - 1, 0)  # the sample in force just before t = 0, else the first
    return Signal(pieces=_steps(t, y), unit=unit, initial=float(y[before]), frame_period=frame_period)


def _steps(t: NDArray[np.float64], y: NDArray[np.float64]) -> Pieces:
    keep = np.append(True, np.diff(y) != 0.0)  # equal neighbours are one piece
    return Pieces(tuple(map(Piece, t[keep].tolist(), y[keep].tolist())))


def _smooth(rows: tuple[Piece, ...], unit: str, frame_period: float | None) -> Signal:
    pieces = Pieces(rows)
    return Signal(pieces=pieces, unit=unit, initial=float(pieces(0.0)), frame_period=frame_period)


def _arrays(time: ArrayLike, value: ArrayLike, unit: str, what: str, *,
            silent: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and values (SI); nan among the values counts where samples may be `silent`."""
    kind_of(unit)
    try:
        t, y = np.asarray(time, dtype=np.float64), np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise CommandError(what, got="values that are no numbers", allowed="arrays of numbers") from None
    if t.ndim != 1 or t.shape != y.shape:
        raise CommandError(what, got=f"shapes {t.shape} and {y.shape}", allowed="two arrays of one length")
    if t.size == 0:
        raise CommandError(what, got="no samples", allowed="at least one")
    for name, a, given in (("time", t, time), ("value", y, value)):
        if is_masked(given):  # what a mask hides would count
            raise CommandError(f"{what}: {name}", got="a masked array", allowed="numbers, none of them masked")
        nan = np.isnan(a) if silent and a is y else np.zeros(a.shape, np.bool_)
        if nan.all():
            raise CommandError(what, got="no value that is a number", allowed="at least one: nan means no pulses")
        bad = np.flatnonzero(~np.isfinite(a) & ~nan)
        if bad.size:
            more = _without_nan(unit) if what == "samples" and a is y and np.isnan(a[bad[0]]) else ""
            raise CommandError(f"{what}: {name} of sample {bad[0]}", got=float(a[bad[0]]),
                               allowed=f"a finite number{more}")
    bad = np.flatnonzero(np.diff(t) <= 0.0)
    if bad.size:
        raise CommandError(f"{what}: time of sample {bad[0] + 1}", got=float(t[bad[0] + 1]),
                           allowed=f"more than {t[bad[0]]:g} s, the one before")
    return t, np.asarray(units.to_si(y, unit, KINDS[unit][1]))


def _without_nan(unit: str) -> str:
    """Return what an error says of a sample without a value that needs one."""
    if kind_of(unit) == "voltage":
        return "; only pulses and angles (us, ms, s, deg, rad) may have nan, for no pulses"
    return '; only with hold="previous" does nan mean no pulses'


def _time(value: float, what: str) -> float:
    if not units.is_finite(value):
        raise CommandError(what, got=value, allowed="a finite number")
    return float(value)


def _before(at: float) -> float:
    """Return a time before `at` [s] that is another number also where `at` is large."""
    return at - max(1.0, abs(at))


def _positive(value: float, what: str) -> float:
    if _time(value, what) <= 0.0:
        raise CommandError(what, got=value, allowed="a positive number")
    return float(value)


# --- Commands from a CSV file: a time column and one command column, each with its unit in its name -------------------

# column of the file -> unit of the signal; a name without suffix is in SI
_COLUMNS = {
    "pulse_width_us": "us", "pulse_width_ms": "ms", "pulse_width_s": "s", "pulse_width": "s",
    "command_angle_deg": "deg", "command_angle_rad": "rad", "command_angle": "rad",
    "command_voltage_V": "V", "command_voltage_mV": "mV", "command_voltage": "V",
    "armature_voltage_V": "V", "armature_voltage": "V",
}
_TIMES = {"time_s": 1.0, "time_ms": 1e-3, "time": 1.0}


def from_csv(path: str | Path, *, column: str | None = None, hold: str = "previous",
             frame_period: float | None = None) -> Signal:
    r"""Read a command from a CSV file with a header, whatever separates its cells.

    Parameters
    ----------
    path : str or Path
        File with a column `time_s` (or `time_ms`, `time`) and one of `pulse_width_us`, `command_angle_deg`,
        `command_voltage_V`, … Names without a unit are SI. Where a cell of pulses or angles is empty or says nan,
        no pulses are sent until the next one with a value.
    column : str, optional
        Which column to take, where the file has several commands.
    hold : {"previous", "linear"}
    frame_period : float, optional
        [s]

    Raises
    ------
    CommandError
        If the file cannot be read, is empty, lacks a column or has it twice, or has a value that is no number.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "pulses.csv"
    >>> _ = file.write_text("time_s,pulse_width_us\n0,1500\n0.5,1600\n")
    >>> round(1e6 * float(from_csv(file)(0.6)))
    1600
    """
    table = _table(Path(path))
    time_name = next((name for name in _TIMES if name in table.header), None)
    if time_name is None:
        raise CommandError(f"{path}: columns", got=", ".join(table.header),
                           allowed="a time column: " + ", ".join(_TIMES))
    found = [name for name in table.header if name in _COLUMNS]
    if column is not None and column not in found:
        raise CommandError(f"{path}: column", got=column, allowed=", ".join(found or _COLUMNS))
    if column is None and len(found) != 1:
        raise CommandError(f"{path}: command columns", got=", ".join(found) or ", ".join(table.header),
                           allowed=("one of them, chosen by column=" if found else "one of " + ", ".join(_COLUMNS)))
    name = column or found[0]
    try:
        _check_whole(table, name)
        time = table.numbers(time_name).tolist()
        silent = kind_of(_COLUMNS[name]) != "voltage"
        value = table.numbers(name, missing=math.nan if silent else None).tolist()
    except InputError as error:
        raise CommandError(error.what, got=error.got, allowed=error.allowed) from None
    try:
        return samples([_TIMES[time_name] * t for t in time], value, unit=_COLUMNS[name], hold=hold,
                       frame_period=frame_period)
    except CommandError as error:
        raise CommandError(f"{path}: {error.what}", got=error.got, allowed=error.allowed) from None


def _check_whole(table: TextTable, name: str) -> None:
    """Raise where a row ends before the command: cut off, it says nothing of pulses."""
    at = table.header.index(name)
    cut = next((row for row in table.rows if len(row.cells) <= at), None)
    if cut is not None:
        raise InputError(f"{table.path}: line {cut.line}, {name}", got="nothing", allowed="a number")


def _table(path: Path) -> TextTable:
    known = {*_TIMES, *_COLUMNS}
    try:
        table = read_table(path, lambda name: name in known)
        table.check_lengths(shorter=True)
        for name in known.intersection(table.header):
            table.cells(name)  # raises where the header has it twice
    except InputError as error:
        raise CommandError(error.what, got=error.got, allowed=error.allowed) from None
    return table
