"""The straight lines through a table of loads, with what stands still or does not rise any more left out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.load_columns import LEAST_ROWS, LoadTable, Reading
from servotwin.bench.table_columns import LineFit, fit_line
from servotwin.errors import InputError

CURRENT, SPEED, SAG, VOLTAGE = "current(load)", "speed(load)", "sag(load)", "speed(voltage)"
_ROUNDS = 6  # of weights that go with the line
_FLAT_RISE = 0.4  # of what the line rises: less is flat
_FLAT_NOISE = 4.0  # standard deviations by which a flat top lies below the line


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadLine:
    """A line through two columns in SI.

    Parameters
    ----------
    name : str
    x, y : Reading
    line : LineFit
    rows : ndarray of int
        That it goes through.
    """

    name: str
    x: Reading = field(repr=False)
    y: Reading = field(repr=False)
    line: LineFit
    rows: NDArray[np.intp] = field(repr=False)


@dataclass(frozen=True, kw_only=True)
class FlatTop:
    """Currents that do not rise any more with the load: a supply that gives no more, or a servo that stands.

    Parameters
    ----------
    current : float
        Mean [A].
    load : float
        From which on [N m].
    rows : tuple of int
    """

    current: float
    load: float
    rows: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class LoadLines:
    """The lines of a table of loads.

    Parameters
    ----------
    lines : dict of str to LoadLine
    flat : FlatTop, optional
    stalled : float, optional
        The least load at which the shaft stood still [N m].
    """

    lines: dict[str, LoadLine]
    flat: FlatTop | None = None
    stalled: float | None = None


def load_lines(table: LoadTable) -> LoadLines:
    """Return the lines of a table: current, speed and sag over load, speed over voltage.

    Raises
    ------
    InputError
        If too few rows are left, a line falls that must rise or rises that must fall, or a current without load is less
        than nothing.
    """
    lines: dict[str, LoadLine] = {}
    flat, stalled, rows = None, None, np.arange(table.rows)
    if table.torque is not None and table.speed is not None and (table.speed.values == 0.0).any():
        stalled = float(table.torque.values[table.speed.values == 0.0].min())
        rows = rows[(table.speed.values > 0.0) & (table.torque.values < stalled)]
    if table.torque is not None and table.current is not None:
        flat = _flat_top(table, rows)
        rows = rows if flat is None else np.array([row for row in rows if row not in flat.rows])
        lines[CURRENT] = _line(table, CURRENT, table.torque, table.current, rows, rises=True)
        _check_start(table, lines[CURRENT])
    if table.torque is not None and table.speed is not None:
        lines[SPEED] = _line(table, SPEED, table.torque, table.speed, rows, rises=False)
    if table.torque is not None and table.sag is not None:
        lines[SAG] = _line(table, SAG, table.torque, table.sag, np.arange(table.rows), rises=True)
    if table.torque is None and table.voltage is not None and table.speed is not None:
        turning = np.flatnonzero(table.speed.values > 0.0)
        lines[VOLTAGE] = _line(table, VOLTAGE, table.voltage, table.speed, turning, rises=True)
    return LoadLines(lines=lines, flat=flat, stalled=stalled)


def _line(table: LoadTable, name: str, x: Reading, y: Reading, rows: NDArray[np.intp], *, rises: bool) -> LoadLine:
    if rows.size < LEAST_ROWS:
        raise InputError(f"{table.source}: rows in which {y.name} follows {x.name}", got=int(rows.size),
                         allowed=f"at least {LEAST_ROWS}; some stand still or are flat")
    if np.ptp(x.values[rows]) == 0.0:
        raise InputError(f"{table.source}: {x.name}", got="the same in all rows", allowed="values that differ")
    line = _through(x, y, rows)
    if line.slope == 0.0 or (line.slope > 0.0) != rises:
        got = "is flat" if line.slope == 0.0 else "falls" if rises else "rises"
        raise InputError(f"{table.source}: {y.name} over {x.name}", got=f"a line that {got}",
                         allowed=f"one that {'rises' if rises else 'falls'}: are the columns and their signs right?")
    return LoadLine(name=name, x=x, y=y, line=line, rows=rows)


def _check_start(table: LoadTable, found: LoadLine) -> None:
    """Raise if a servo would draw less than nothing without load, which no scatter explains."""
    line = found.line
    upper = line.intercept + line.wide(line.intercept_error)
    if upper < 0.0:
        raise InputError(f"{table.source}: {found.y.name} without load, by the line over {found.x.name}",
                         got=f"{line.intercept:.4g} A, at most {upper:.4g} A", allowed="more than 0: is each column "
                         "what its name says, and does the load count what hung there always?")


def _through(x: Reading, y: Reading, rows: NDArray[np.intp]) -> LineFit:
    """Return the line; a speed that was written as a time has weights that go with the line itself."""
    a, b = x.values[rows], y.values[rows]
    line = fit_line(a, b)
    if not y.timed:
        return fit_line(a, b, least_variance=(y.step**2 + (line.slope * x.step) ** 2) / 12.0)
    for _ in range(_ROUNDS):
        speed = np.maximum(line(a), 0.05 * float(b.max()))
        # dw = w^2/turn dt; a time t is turn/w, so that its error about the line is that of w to first order only:
        # the line goes through w (2 - w t/turn), which has the times' own residuals
        shifted = speed * (2.0 - speed / b)
        line = fit_line(a, shifted, weights=(y.turn / speed**2) ** 2, least_variance=y.step**2 / 12.0)
    return line


def _flat_top(table: LoadTable, rows: NDArray[np.intp]) -> FlatTop | None:
    """Return the largest loads of a table under which the current does not rise, where the others say that it should.

    At least two of them, beside three others whose line passes above all of them.
    """
    if table.torque is None or table.current is None or rows.size < LEAST_ROWS + 2:
        return None
    load, current, step = table.torque.values, table.current.values, table.current.step
    order = rows[np.argsort(load[rows])]
    for first in range(LEAST_ROWS, order.size - 1):
        below, top = order[:first], order[first:]
        if np.ptp(load[top]) == 0.0:
            continue
        line = fit_line(load[below], current[below])
        noise = max(float(np.sqrt(np.sum(np.square(line.residuals)) / line.freedom)), step / np.sqrt(12.0))
        beside = fit_line(load[top], current[top]).slope if top.size > 2 else float(
            np.diff(current[top])[0] / np.diff(load[top])[0])
        missing = line(load[top]) - current[top]
        far = noise * _FLAT_NOISE * np.sqrt(1.0 + 1.0 / first + (load[top] - load[below].mean()) ** 2 / (
            (load[below] - load[below].mean()) ** 2).sum())
        if line.slope > 0.0 and abs(beside) < _FLAT_RISE * line.slope and np.all(missing[1:] > far[1:]):
            kept = top if missing[0] > far[0] else top[1:] if top.size > 2 else top
            return FlatTop(current=float(current[kept].mean()), load=float(load[kept].min()),
                           rows=tuple(int(row) for row in kept))
    return None
