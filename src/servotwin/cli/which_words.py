"""Limits and prices out of words and files, and candidates as rows and facts."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.cli.option_values import numbers
from servotwin.cli.summary import rest_words
from servotwin.cli.terminal import with_span
from servotwin.datasheet.choice import Limits
from servotwin.errors import InputError, UnknownNameError
from servotwin.tables import read_table
from servotwin.units.quantities import quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from servotwin.datasheet import Lift
    from servotwin.datasheet.choice import AtRest, Candidate
    from servotwin.datasheet.holding import Span
    from servotwin.physics._typing import Real
    from servotwin.robots.choice import Tried

_DIMENSIONS = {"current": "current", "mass": "mass", "voltage": "voltage", "travel": "angle", "time": "time"}
_KINDS = ("analog", "digital", "bus")
_NAMES = ("servo", "id")
_PRICE = "price"
_FORM = "NAME=VALUE, such as current=1A, mass=60g, voltage=7.4V, travel=180deg, time=0.2s, kind=digital or price=20"
_ZERO_CELSIUS = 273.15
_BURNT = 300.0  # °C
_MANY = 100.0  # times; beyond it a margin is not stated in numbers


class Prices(NamedTuple):
    """Prices of servos by the file's names, and in which currency."""

    of: dict[str, float]
    currency: str


def limits_of(words: Sequence[str], time: str | None = None) -> Limits:
    """Return the limits of `--limit`, and of `--time`.

    Raises
    ------
    InputError
        If one has another form or unit, or comes twice.
    UnknownNameError
        If there is none of a name.

    Examples
    --------
    >>> limits_of(["current=1A,mass=60g"], "0.2")
    Limits(current=1.0, mass=0.06, voltage=None, travel=None, time=0.2, kind=None, price=None)
    """
    found: dict[str, Any] = {}
    if time is not None:
        found["time"] = quantity("--time", time, "time", bare=True, positive=True)
    for word in (part for each in words for part in each.split(",")):
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text) or name[-1] in "<>":
            raise InputError("--limit", got=word, allowed=_FORM)
        if name in found:
            raise InputError(f"--limit {name}", got="two values", allowed="one")
        found[name] = _limit(name, text)
    return Limits(**found)


def _limit(name: str, text: str) -> float | str:
    what = f"--limit {name}"
    if name in _DIMENSIONS:
        return quantity(what, text, _DIMENSIONS[name], bare=name in ("current", "voltage", "time"), positive=True)
    if name == "kind":
        if text not in _KINDS:
            raise InputError(what, got=text, allowed=", ".join(_KINDS))
        return text
    if name != _PRICE:
        raise UnknownNameError("limit of --limit", name, (*_DIMENSIONS, "kind", _PRICE))
    return numbers(what, text, (_PRICE,))[0]


def prices_of(path: Path) -> Prices:
    r"""Return the prices in a table with a column `servo` and one `price`, or `price_EUR`.

    Raises
    ------
    InputError
        If it cannot be read, lacks a column, or a price is none.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "shop.csv"
    >>> _ = file.write_text("servo,price_EUR\ntowerpro-sg90,2.5\n")
    >>> prices_of(file)
    Prices(of={'towerpro-sg90': 2.5}, currency='EUR')
    """
    table = read_table(path, lambda name: name in _NAMES or name.partition("_")[0] == _PRICE)
    servos = next((name for name in table.header if name in _NAMES), None)
    price = next((name for name in table.header if name.partition("_")[0] == _PRICE), None)
    if servos is None or price is None:
        raise InputError(f"{path}: columns", got=", ".join(table.header),
                         allowed="servo, and price or such as price_EUR")
    table.check_lengths()
    found: dict[str, float] = {}
    for row, name, value in zip(table.rows, table.cells(servos), table.numbers(price).tolist(), strict=True):
        if not (math.isfinite(value) and value >= 0.0) or not name.strip():
            raise InputError(f"{path}: line {row.line}", got=", ".join(row.cells), allowed="a servo and its price")
        found[name.strip()] = value
    return Prices(found, price.partition("_")[2])


class Judged(NamedTuple):
    """A candidate with what was simulated of it, as far as that was."""

    candidate: Candidate
    rest: AtRest | None = None
    tried: Tried | None = None


def suiting_table(found: Sequence[Judged], prices: Prices | None, *, current: bool) -> tuple[
        list[str], list[list[str]]]:
    """Return header and rows of candidates side by side; `current`: whether that of a stall matters beside a lift."""
    return side_by_side([_row(each, prices, current=current) for each in found])


def side_by_side(rows: Sequence[dict[str, str]]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows without the columns that are empty.

    Examples
    --------
    >>> side_by_side([{"id": "a", "mass, g": "", "margin": "2"}, {"id": "b", "mass, g": "", "margin": ""}])
    (['id', 'margin'], [['a', '2'], ['b', '']])
    """
    kept = [name for name in (rows[0] if rows else {}) if any(row[name] for row in rows)]
    return kept, [[row[name] for name in kept] for row in rows]


def _row(each: Judged, prices: Prices | None, *, current: bool) -> dict[str, str]:
    made, tried, rest = each.candidate, each.tried, each.rest
    price = "price" + ("" if prices is None or not prices.currency else f", {prices.currency}")
    found = {"id": made.servo.name, "mass, g": mass_cell(made.mass), price: _number(made.price, ".2f")}
    if tried is not None:
        found |= _motion_cells(tried)
    else:
        free = math.isnan(made.margin)
        found |= {"margin": times(made.margin), "torque, N m": _number(made.most_torque, ".3g") if free else "",
                  "60 deg, s": _number(made.time, ".2f"),
                  "stalls at, A": _number(made.stall_current, ".2f") if free or current else "",
                  **lift_cells(None if rest is None else rest.lift)}
    return found | {"least move, deg": "" if rest is None else degrees(rest.smallest_move, rest.move_span, ".2f")}


def lift_cells(lift: Lift | None) -> dict[str, str]:
    """Return how a servo holds a lift, by the names of columns."""
    holds = lift is not None and lift.held.stands
    warming = None if lift is None else lift.warming
    return {"holds at, A": _number(lift.held.current, ".2f") if lift is not None else "",
            "10 min, deg C": celsius(warming.now.winding) if warming is not None and warming.duration > 0.0 else "",
            "droop, deg": degrees(lift.held.error, lift.held.span, ".1f") if lift is not None and holds
            else "" if lift is None else "sinks"}


def _motion_cells(tried: Tried) -> dict[str, str]:
    run, worst, now = tried.run, tried.worst, tried.hottest()
    names = ("margin", "least at", "off by, deg", "draws, A", "10 min, deg C")
    if run is None or worst is None:
        return dict.fromkeys(names, "")
    tracking = [run.tracking[joint] for joint in tried.sizing]
    cells = (times(tried.margin), worst.joint if len(tried.sizing) > 1 else "",
             degrees(max(each.rms for each in tracking), None, ".2f"),
             _number(max(map(tried.peak, tried.sizing)), ".2f"), "" if now is None else celsius(now.winding))
    return dict(zip(names, cells, strict=True))


def note_pairs(found: Sequence[Judged]) -> list[tuple[str, str]]:
    """Return the notes on candidates to read before buying, as pairs of name and text."""
    said = ((each.candidate.servo.name, "; ".join((*each.candidate.notes, *remarks(each)))) for each in found)
    return [(name, text) for name, text in said if text]


def remarks(each: Judged) -> list[str]:
    """Return what was seen of a candidate that matters to a buyer: that it gets too hot, gives way, or buzzes."""
    if each.rest is None:
        return []
    lift, found = each.rest.lift, []
    if lift is not None and not lift.held.stands:
        found.append(f"trips by {lift.held.trip} where it holds" if lift.held.trip else "sinks where it holds")
    elif lift is not None and lift.warming is not None:
        warming = lift.warming
        if not warming.warm.stands:
            found.append(f"gives way after {warming.duration / 60.0:.0f} min of holding")
        elif not math.isnan(warming.limit_time):
            found.append(f"above 130 deg C after {warming.limit_time / 60.0:.1f} min of holding")
    if each.rest.rest is not None and each.rest.rest.restless:
        found.append(f"at rest, free: {rest_words(each.rest.rest)}")
    return found


def mass_cell(mass: float) -> str:
    """Return a mass [kg] in grams.

    Examples
    --------
    >>> mass_cell(0.0558), mass_cell(math.nan)
    ('55.8', 'unknown')
    """
    return _number(1e3 * mass, ".4g") or "unknown"


def celsius(kelvin: Real) -> str:
    """Return a temperature [K] in degrees Celsius; what has burnt long before is not stated in numbers.

    Examples
    --------
    >>> celsius(298.15), celsius(900.0)
    ('25', '> 300')
    """
    found = float(kelvin) - _ZERO_CELSIUS
    return f"> {_BURNT:g}" if found > _BURNT else f"{found:.0f}"


def degrees(angle: float, span: Span | None, form: str) -> str:
    """Return an angle [rad] in degrees, with its range; nothing where it is not known."""
    return "" if math.isnan(angle) else with_span(math.degrees(angle), span, form, "", scale=math.degrees(1.0)).replace(
        "  ", " ").rstrip()


def times(margin: float) -> str:
    """Return how many times what is needed a servo has; nothing where that is not known."""
    return "" if math.isnan(margin) else f"> {_MANY:g}" if margin > _MANY else f"{margin:.2f}"


def _number(value: float, form: str) -> str:
    return "" if math.isnan(value) else f"{value:{form}}"


def why(each: Candidate) -> str:
    """Return every reason why a servo does not suit."""
    return "; ".join(reason.text for reason in each.reasons)


def candidate_facts(each: Judged) -> dict[str, Any]:
    """Return a candidate in SI, ready for JSON."""
    from servotwin.datasheet.holding import highest_voltage, lowest_voltage
    from servotwin.parameters import operating_voltages

    made, rest, tried = each.candidate, each.rest, each.tried
    found: dict[str, Any] = {
        "id": made.servo.name, "title": made.servo.title, "kind": made.servo.kind, "mass": made.mass,
        "price": made.price, "travel": made.travel, "margin": made.margin if tried is None else tried.margin,
        "most_torque": made.most_torque, "time_60": made.time, "stall_current": made.stall_current,
        "voltage": {"lowest": lowest_voltage(made.servo), "highest": highest_voltage(made.servo),
                    "stated": operating_voltages(made.servo) is not None},
        "notes": [*made.notes, *remarks(each)], "reasons": [reason._asdict() for reason in made.reasons]}
    if rest is not None:

        found |= {"smallest_move": rest.smallest_move, "smallest_move_span": rest.move_span,
                  "at_rest": None if rest.rest is None else rest.rest._asdict(),
                  "lift": None if rest.lift is None else lift_facts(rest.lift)}
    if tried is not None and tried.run is not None:
        now = tried.hottest()
        found["after_ten_minutes"] = None if now is None else {"winding": now.winding, "housing": now.housing}
        found["joints"] = {joint: {
            "margin": sized.margin, "verdict": sized.verdict, "rms_error": tried.run.tracking[joint].rms,
            "largest_error": tried.run.tracking[joint].largest, "peak_current": tried.peak(joint),
        } for joint, sized in tried.sizing.items()}
    return found


def lift_facts(lift: Lift) -> dict[str, Any]:
    """Return what a lift comes to in SI, ready for JSON."""
    found: dict[str, Any] = {
        "mass": lift.mass, "arm": lift.arm, "torque": lift.torque, "most_torque": lift.most_torque,
        "lifts": lift.lifts, "margin": lift.margin, "blocked": lift.blocked, "time_60": lift.swing.time,
        "mean_current": lift.swing.mean_current, "holding": lift.held._asdict()}
    if lift.warming is not None:
        warming = lift.warming
        found["warming"] = {
            "duration": warming.duration, "winding_temperature": warming.now.winding,
            "housing_temperature": warming.now.housing, "holds": warming.warm.stands,
            "limit_time": warming.limit_time, "thermal": dataclasses.asdict(warming.masses)}
    return found
