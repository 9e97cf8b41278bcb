"""What a table of loads says of a servo, in sentences: beside its sheet, what it fixes, and what it cannot tell."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from servotwin.bench.fits import curvature_test
from servotwin.bench.lift_records import LiftRecord
from servotwin.bench.load_columns import LoadTable
from servotwin.bench.load_figures import HEAVIEST, STALL_TORQUE, LoadFigure, SheetShare
from servotwin.bench.load_lines import CURRENT, SAG, SPEED, VOLTAGE, LoadLines
from servotwin.bench.load_parameters import Circuit, Solved, efficiency_of
from servotwin.bench.table_words import plus_minus, residual_pattern
from servotwin.physics.sheet import LEAST_EFFICIENCY

_KGF_CM = 0.0980665  # N m
_CURVED = 0.05
_WEAK = 0.6  # of a printed torque: from here down the supply is asked about
_SHOWN = {"A": (1e3, "mA"), "rad/s": (180.0 / math.pi, "°/s"), "rad": (180.0 / math.pi, "°"),
          "rad/(N m)": (180.0 / math.pi, "°/(N m)")}


def shown(value: float, unit: str) -> tuple[float, str]:
    """Return a number in the unit that people read, from SI.

    Examples
    --------
    >>> shown(0.45, "A"), shown(0.5, "N m")
    ((450.0, 'mA'), (0.5, 'N m'))
    """
    factor, name = _SHOWN.get(unit, (1.0, unit))
    return factor * value, name


def torque_words(torque: float) -> str:
    """Return a torque in both units that people have.

    Examples
    --------
    >>> torque_words(0.0441)
    '0.0441 N m (0.45 kgf cm)'
    """
    return f"{torque:.3g} N m ({torque / _KGF_CM:.3g} kgf cm)"


def sheet_words(shares: Sequence[SheetShare], found: LoadLines, voltage: float | None) -> Iterator[str]:
    """Yield how much of its sheet a servo has, figure by figure; of several printed ones the rest in brackets.

    The first is that of the nearest voltage, where somebody said at which the table was made; else the kindest.
    """
    def off(one: SheetShare) -> float:
        if voltage is not None and one.voltage is not None:
            return abs(one.voltage - voltage)
        return abs(math.log(one.share)) if one.share > 0.0 else math.inf

    for name in dict.fromkeys(one.name for one in shares):
        rows = [one for one in shares if one.name == name]
        first = min(rows, key=off)
        also = [f"{100.0 * one.share:.3g} % of {_printed(one)}" for one in rows if one is not first]
        more = f" ({', '.join(also)})" if also else ""
        if name == HEAVIEST:
            sure = found.flat is not None or found.stalled is not None
            yield (f"your servo has {100.0 * first.share:.3g} % of what its sheet says"
                   f"{'' if sure else ', if it stalls there'}: the heaviest load, {torque_words(first.measured)}, "
                   f"beside a stall torque of {_printed(first)}{more}")
            continue
        yield (f"your servo has {100.0 * first.share:.3g} % ({100.0 * first.lower:.3g} to {100.0 * first.upper:.3g} %) "
               f"of what its sheet says: {_titled(first)} beside {_printed(first)}{more}")


def _titled(one: SheetShare) -> str:
    return f"{one.name} {_number(one, one.measured)}"


def _printed(one: SheetShare) -> str:
    at = "" if one.voltage is None else f" at {one.voltage:g} V"
    return f"{_number(one, one.printed)}{at}"


def _number(one: SheetShare, value: float) -> str:
    if one.name in (STALL_TORQUE, HEAVIEST):
        return torque_words(value)
    number, unit = shown(value, "rad/s" if one.name == "no-load speed" else "A")
    return f"{number:.3g} {unit}"


def line_words(found: LoadLines) -> Iterator[str]:
    """Yield which lines are curved, so that a straight one says less than its interval."""
    for name, one in found.lines.items():
        x, y = one.x.values[one.rows], one.y.values[one.rows]
        if x.size < 5 or len(set(x.tolist())) < 3:
            continue
        test = curvature_test(x, y)
        if test.p_value * len(found.lines) < _CURVED and test.sagitta > max(one.y.step, 1e-9 * abs(float(y.max()))) \
                and not one.y.timed:
            sag, unit = shown(test.sagitta, {CURRENT: "A", SAG: "rad"}.get(name, "rad/s"))
            yield (f"{name} is visibly curved: a parabola fits better with p = {test.p_value:.2g} and bends by "
                   f"{sag:.2g} {unit}; {residual_pattern(x.tolist(), one.line.residuals)}. Numbers beyond the rows are "
                   "then off by more than their intervals")


def supply_words(table: LoadTable, found: LoadLines, shares: Sequence[SheetShare], circuit: Circuit | None
                 ) -> Iterator[str]:
    """Yield the question whether the supply limits the current, where it may."""
    if found.flat is not None:
        load, current = torque_words(found.flat.load), f"{1e3 * found.flat.current:.4g} mA"
        yield (f"from {load} on the current stays at {current}, and these rows are in no line: does the supply give no "
               f"more? Then say --set supply.current_limit={1e3 * found.flat.current:.4g}mA, which belongs to the "
               "bench; if the servo stands there, it is the stall current")
    elif found.stalled is None and CURRENT in found.lines and SPEED not in found.lines and table.current is not None:
        weak = [one for one in shares if one.name == HEAVIEST and one.share < _WEAK]
        most = float(table.current.values.max())
        if weak and circuit is not None:
            yield (f"if the servo stalls at its heaviest load, either the supply gives no more than {1e3 * most:.4g} "
                   f"mA (does it? then --set supply.current_limit={1e3 * most:.4g}mA), or the sheet is wrong and the "
                   f"motor's circuit has {(circuit.V - circuit.V_d) / most:.3g} ohm at {circuit.V:g} V and not "
                   f"{circuit.R:.3g}: a table of load and current cannot tell, a stronger supply can")
    if found.stalled is not None:
        yield f"the shaft stood still from {torque_words(found.stalled)} on; these rows are in no line"


def told_words(found: LoadLines, solved: Solved | None, circuit: Circuit | None) -> Iterator[str]:
    """Yield what the table fixes of the servo, with what is kept, and what it cannot tell."""
    if solved is not None and circuit is not None:
        yield from _told(found, solved, circuit)
    if SAG in found.lines:
        yield ("a sag tells how stiff the loop is where the shaft stands, not what moves it: torque constant and "
               "resistance are not told; lift the weights and read the current or the speed for these")


def _told(found: LoadLines, solved: Solved, circuit: Circuit) -> Iterator[str]:
    values = solved.values
    if CURRENT in found.lines and SPEED in found.lines:
        eta = efficiency_of(values, circuit)
        yield (f"at {circuit.V:g} V and with the drop of {circuit.V_d:.3g} V kept from the servo, speed tells the "
               f"torque constant, {plus_minus(values['K'], solved.errors['K'])} N m/A at the output, and current the "
               f"efficiency of the gear, {eta:.3g}, and the friction; rotor, gains and deadband are not told")
    elif CURRENT in found.lines:
        yield from _told_by_current(found, solved, circuit)
    elif SPEED in found.lines:
        yield (f"at {circuit.V:g} V (another: --set supply.open_circuit_voltage=5V) weights and speeds tell torque "
               f"constant and resistance; kept from the servo are the drop, {circuit.V_d:.3g} V, the friction, "
               f"{circuit.tau_c:.3g} N m, and the efficiency of the gear, {circuit.efficiency:.3g}, which a column of "
               "current would tell; resistance counts bridge, wires and supply")
    elif VOLTAGE in found.lines:
        line = found.lines[VOLTAGE].line
        yield (f"the drop of bridge and brushes and the friction are told as a sum, V_d + R I_0 = "
               f"{-line.intercept / line.slope:.3g} V: with V_d {circuit.V_d:.3g} V and R {circuit.R:.3g} ohm of the "
               "servo the rest is friction; a current without load tells them apart; resistance and gear efficiency "
               "are not told")


def _told_by_current(found: LoadLines, solved: Solved, circuit: Circuit) -> Iterator[str]:
    line = found.lines[CURRENT].line
    product = plus_minus(1.0 / line.slope, line.slope_error / line.slope**2)
    rest = ("a column of speed tells them apart; resistance, drop and supply are not told, nor friction apart from "
            "what it draws without load")
    if "K" in solved.values:
        yield (f"weights and currents tell torque constant times gear efficiency, {product} N m/A: more than the "
               f"torque constant {circuit.K:.3g} N m/A of the servo, which therefore grows, and its speed falls with "
               f"it; the efficiency {circuit.efficiency:.3g} of the servo is kept; {rest}")
        return
    eta = efficiency_of(solved.values, circuit)
    poor = f", less than a gear has ({LEAST_EFFICIENCY:g}): its speed, or the arm, is not what was said" \
        if eta < LEAST_EFFICIENCY else ""
    yield (f"weights and currents tell torque constant times gear efficiency, {product} N m/A, not each: the torque "
           f"constant {circuit.K:.3g} N m/A of the servo, which rests on its speed, is kept, and the efficiency is "
           f"then {eta:.2g}{poor}; {rest}")


def figure_words(one: LoadFigure) -> tuple[str, str, str, str, str]:
    """Return name, value, interval, unit and line of a figure, as a row of a table."""
    value, unit = shown(one.value, one.unit)
    (lower, _), (upper, _) = shown(one.lower, one.unit), shown(one.upper, one.unit)
    interval = "" if one.error == 0.0 else f"{lower:z.4g} to {upper:z.4g}"
    more = f"  ({one.value / _KGF_CM:.3g} kgf cm)" if one.unit == "N m" else ""
    return one.name, f"{value:.4g}", interval, unit + more, one.line


def record_words(one: LiftRecord) -> tuple[str, str, str, str, str]:
    """Return what the record of a lift says, as a row of a table."""
    current = "" if math.isnan(one.current) else f"{1e3 * one.current:.4g} mA"
    return (Path(one.file).name, f"{one.load:g}", f"{math.degrees(one.speed):.4g} °/s", current,
            f"{1e3 * one.dead_time:.3g} ms")
