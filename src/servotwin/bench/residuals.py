"""Simulated against measured: the differences row by row, and what each is made of."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from servotwin.bench.fits import TableFit
from servotwin.bench.reading import Reading, TableRow
from servotwin.errors import InputError


class Comparison(NamedTuple):
    """Simulated less measured, one row of the table.

    Parameters
    ----------
    output_angle : float
        [rad]
    feedback_voltage : float
        [V]
    pulse_width : float
        [s]
    command_count, feedback_count : int
        [counts]
    """

    output_angle: float
    feedback_voltage: float
    pulse_width: float
    command_count: int
    feedback_count: int


class Shares(NamedTuple):
    """Why a measured angle lies off the straight line q(V_i); the shares add up to `total` [rad].

    Parameters
    ----------
    total : float
        Measured angle minus the line q(V_i).
    quantum : float
        The generator's 16 µs steps: what t_a minus the line t_a(V_i) turns.
    curvature : float
        Measured angle minus the line q(t_a).
    rest : float
        The line q(t_a) of the line t_a(V_i) is not quite the line q(V_i).
    """

    total: float
    quantum: float
    curvature: float
    rest: float


class ModelShares(NamedTuple):
    """Why a simulated value differs from the measured one; the shares add up to `total` [rad] or [V].

    Parameters
    ----------
    total : float
        Simulated less measured.
    generator : float
        A pulse width other than the measured one.
    curvature : float
        The straight line over t_a less the measured value: a linear servo cannot bend.
    standing : float
        Mean of both approaches less the value without error: an unequal stop from either side.
    rest : float
        Calibration of the servo less the straight line over t_a.
    """

    total: float
    generator: float
    curvature: float
    standing: float
    rest: float


class Row(Protocol):
    """A row of a table that shows a reading."""

    @property
    def reading(self) -> Reading:
        """What the display shows."""


def compare(rows: Sequence[Row], columns: Mapping[str, ArrayLike]) -> tuple[Comparison, ...]:
    """Return simulated less measured.

    Parameters
    ----------
    rows : sequence, length n
        Of `TableRow` or `ChainRow`.
    columns : mapping
        The measured table: q_deg, V_o_V, t_a_us, ADC_i, ADC_o, each of length n.

    Raises
    ------
    InputError
        If the lengths differ.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import Bench, bench_servo
    >>> table = st.load_dataset("urrea-kern-table-2").columns
    >>> bench = Bench(st.BoundedServo(bench_servo(st.load_servo("hitec-hs-755hb"))))
    >>> max(abs(row.pulse_width) for row in compare(bench.measure(table["V_i_V"]), table)) < 1e-6
    True
    """
    measured = zip(*(_column(columns, name, len(rows)) for name in ("q_deg", "V_o_V", "t_a_us", "ADC_i", "ADC_o")),
                   strict=True)
    return tuple(
        Comparison(one.output_angle - math.radians(q), one.feedback_voltage - v_o, one.pulse_width - 1e-6 * t_a,
                   one.command_count - round(n_i), one.feedback_count - round(n_o))
        for one, (q, v_o, t_a, n_i, n_o) in zip((row.reading for row in rows), measured, strict=True))


def measured_shares(fits: Mapping[str, TableFit]) -> tuple[Shares, ...]:
    """Return, row by row, why the measured angles lie off the straight line q(V_i) [rad].

    Parameters
    ----------
    fits : mapping
        Of `table_fits`.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import table_fits
    >>> shares = measured_shares(table_fits(st.load_dataset("urrea-kern-table-2").columns))
    >>> all(abs(s.total - s.quantum - s.curvature - s.rest) < 1e-12 for s in shares)
    True
    """
    by_voltage, by_width, widths = fits["q(V_i)"].line, fits["q(t_a)"].line, fits["t_a(V_i)"].line
    volts = fits["t_a(V_i)"].x
    parts = (by_voltage.residuals, by_width.slope * np.array(widths.residuals), by_width.residuals,
             by_width(widths(volts)) - by_voltage(volts))
    return tuple(Shares(*row) for row in np.radians(np.array(parts).T).tolist())


def model_shares(rows: Sequence[TableRow], fits: Mapping[str, TableFit], *,
                 quantity: str = "output_angle") -> tuple[ModelShares, ...]:
    """Return, row by row, why a simulated value differs from the measured one.

    Parameters
    ----------
    rows : sequence of TableRow
        For the voltages of the table, in its order.
    fits : mapping
        Of `table_fits`.
    quantity : {"output_angle", "feedback_voltage"}
        [rad] or [V]

    Raises
    ------
    InputError
        If the quantity is another, or the rows are not those of the table.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench import Bench, bench_servo, table_fits
    >>> table = st.load_dataset("urrea-kern-table-2").columns
    >>> bench = Bench(st.BoundedServo(bench_servo(st.load_servo("hitec-hs-755hb"))))
    >>> shares = model_shares(bench.measure(table["V_i_V"]), table_fits(table))
    >>> all(abs(s.total - s.generator - s.curvature - s.standing - s.rest) < 1e-12 for s in shares)
    True
    """
    names = {"output_angle": "q(t_a)", "feedback_voltage": "V_o(t_a)"}
    if quantity not in names:
        raise InputError("quantity", got=quantity, allowed=", ".join(names))
    fit = fits[names[quantity]]
    if len(rows) != len(fit.x):
        raise InputError("rows of the simulated table", got=len(rows), allowed=f"{len(fit.x)}, as measured")
    unit = math.pi / 180.0 if quantity == "output_angle" else 1.0
    shares = []
    for k, row in enumerate(rows):
        simulated = getattr(row.reading, quantity)
        target = row.target_angle if quantity == "output_angle" else row.target_voltage
        width = 1e6 * row.reading.pulse_width
        shares.append(ModelShares(
            total=simulated - unit * fit.y[k], generator=unit * fit.line.slope * (width - fit.x[k]),
            curvature=-unit * fit.line.residuals[k], standing=simulated - target,
            rest=target - unit * fit.line(width)))
    return tuple(shares)


def _column(columns: Mapping[str, ArrayLike], name: str, length: int) -> list[float]:
    values = np.atleast_1d(np.asarray(columns[name], dtype=np.float64)) if name in columns else np.empty(0)
    if values.size != length:
        raise InputError(f"column {name} of the measured table", got=f"{values.size} values", allowed=f"{length}")
    return [float(v) for v in values]
