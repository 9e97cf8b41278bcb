"""A computed sheet as rows of text and as facts for JSON; what the sheet prints stands beside."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin import units
from servotwin.cli.loop_words import loop_facts
from servotwin.cli.rest_words import buzz_facts, remedy_words, rest_words
from servotwin.cli.span_words import with_span

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from servotwin.datasheet import DataSheet, Held, Lift, OperatingPoint, SpeedCurve, SpeedMap, VoltageSheet
    from servotwin.parameters import PrintedPoint
    from servotwin.physics._typing import Real

_PULSES = (-400e-6, -200e-6, -100e-6, -50e-6, 50e-6, 100e-6, 200e-6, 400e-6)  # s from neutral, for a table
_SHARES = (0.25, 0.5, 0.75)  # of the stall torque, whose errors of holding a table shows
NEVER = "–"


class CurveRow(NamedTuple):
    """A line of the table: what, cold and hot, what the sheet prints, and how far the cold value is off it."""

    label: str
    cold: str
    hot: str = ""
    printed: str = ""
    off: str = ""


class _Quantity(NamedTuple):
    """A number of a speed curve that sheets print too."""

    label: str
    unit: str
    dimension: str
    form: str
    computed: Callable[[SpeedCurve], float]
    printed: Callable[[PrintedPoint], float | None]


_PRINTED = (
    _Quantity("stall torque", "N m", "torque", ".3f", lambda c: c.stall_torque, lambda p: p.stall_torque),
    _Quantity("stall current", "A", "current", ".2f", lambda c: c.stall_current, lambda p: p.stall_current),
    _Quantity("speed without load", "deg/s", "speed", ".0f", lambda c: c.no_load_speed,
              lambda p: math.pi / 3.0 / p.time_60 if p.time_60 else None),
    _Quantity("time for 60 deg", "s", "time", ".3f", lambda c: c.time_60, lambda p: p.time_60),
    _Quantity("current without load", "A", "current", ".2f", lambda c: c.no_load_current, lambda p: p.no_load_current),
)


def rows(part: VoltageSheet, others: Sequence[PrintedPoint], torque: float | None = None) -> list[CurveRow]:
    """Return the table of one voltage.

    Parameters
    ----------
    part : VoltageSheet
    others : sequence of PrintedPoint
        What the sheet prints at any voltage: shown, without a difference, where it prints nothing at this one.
    torque : float, optional
        A load whose point on the curves is shown as well [N m].
    """
    found = [_beside(each, part, others) for each in _PRINTED]
    stall = "stall torque, kgf cm"
    in_kgf = [f"{units.from_si(curve.stall_torque, 'kgf cm', 'torque'):.1f}" for curve in (part.cold, part.hot)]
    found.insert(1, CurveRow(stall, *in_kgf))
    found += [CurveRow("most power to a load", *(_point(curve.most_power, curve.most_power.power, "W", ".2f")
                                                 for curve in (part.cold, part.hot))),
              CurveRow("best efficiency", *(_point(curve.best_efficiency, 100.0 * curve.best_efficiency.efficiency, "%",
                                                   ".0f") for curve in (part.cold, part.hot)))]
    if torque is not None:
        found.append(CurveRow(f"against {torque:.3g} N m", *(_at(curve, torque) for curve in (part.cold, part.hot))))
    return found + _standing(part)


def _beside(each: _Quantity, part: VoltageSheet, others: Sequence[PrintedPoint]) -> CurveRow:
    cold, hot = (_number(each.computed(curve), each) for curve in (part.cold, part.hot))
    label = f"{each.label}, {each.unit}"
    here = [value for point in part.printed if (value := each.printed(point)) is not None]
    if here:
        printed = "; ".join(_number(value, each) for value in here)
        off = "; ".join(f"{100.0 * (each.computed(part.cold) / value - 1.0):+.0f} %" for value in here)
        return CurveRow(label, cold, hot, printed, off.replace("-0 %", "+0 %"))
    elsewhere = [f"{_number(value, each)} at {point.supply_voltage:g} V" for point in others
                 if (value := each.printed(point)) is not None and point.supply_voltage is not None]
    return CurveRow(label, cold, hot, "; ".join(elsewhere), "")


def _number(value: float, each: _Quantity) -> str:
    return format(units.from_si(value, each.unit, each.dimension), each.form)


def _point(point: OperatingPoint, value: float, unit: str, form: str) -> str:
    return f"{value:{form}} {unit} at {point.torque:.2f} N m, {_speed(point.speed)}"


def _at(curve: SpeedCurve, torque: float) -> str:
    point = curve.at(torque)
    if point.speed == 0.0:
        return f"stands; {point.current:.2f} A"
    return f"{_speed(point.speed)}, {point.current:.2f} A, {100.0 * point.efficiency:.0f} %"


def _speed(speed: float) -> str:
    return f"{units.from_si(speed, 'deg/s', 'speed'):.0f} deg/s"


def _standing(part: VoltageSheet) -> list[CurveRow]:
    if not part.holding:  # a servo that turns without end holds nothing
        return [] if part.turning is None else _turning(part.turning, part.still)
    move = NEVER if math.isnan(part.smallest_move) else with_span(
        math.degrees(part.smallest_move), part.move_span, ".2f", "deg", scale=math.degrees(1.0))
    pulse = "" if math.isnan(part.smallest_pulse) else f" ({1e6 * part.smallest_pulse:.1f} us)"
    found = [CurveRow("smallest move", move + pulse)]
    held = {round(each.torque / part.cold.stall_torque, 6): each for each in part.holding}
    for share in _SHARES:
        each = held.get(share)
        if each is not None:
            said = (f"{_off(each)}, {each.current:.2f} A" if each.stands else
                    f"does not hold: it trips by {each.trip}" if each.trip else "does not hold")
            found.append(CurveRow(f"holding {each.torque:.2g} N m, error", said))
    for band in part.bandwidth:
        said = ("below 1 Hz" if band.frequency == 0.0 else
                "20 Hz and more" if math.isinf(band.frequency) else f"{band.frequency:.1f} Hz")
        found.append(CurveRow(f"bandwidth at {math.degrees(band.amplitude):.0f} deg", said))
    return found


def rest_pairs(part: VoltageSheet) -> list[tuple[str, str]]:
    """Return what the free servo does at rest, and what would stop it, as pairs of label and text."""
    if part.buzz is None:
        return []
    return [(label, said) for label, said in (("at rest, free", rest_words(part.buzz.rest)),
                                              ("would stop it", remedy_words(part.buzz.remedies))) if said]


def _turning(found: SpeedMap, still: tuple[float, float] | None) -> list[CurveRow]:
    """Return the pulses at which a servo stands, and its speed at some others."""
    rows = [CurveRow("stands at", NEVER if still is None else f"{1e6 * still[0]:.0f} to {1e6 * still[1]:.0f} us")]
    widths = [found.neutral + off for off in _PULSES if found.pulses[0] <= found.neutral + off <= found.pulses[-1]]
    return rows + [CurveRow(f"speed at {1e6 * width:.0f} us", f"{rpm(float(found.speed(width))):z.1f} rpm")
                   for width in widths]


def rpm(speed: float) -> float:
    """Return a speed in turns a minute, as servos that turn endlessly are sold by."""
    return units.from_si(speed, "rpm", "speed")


def lift_pairs(lift: Lift) -> list[tuple[str, str]]:
    """Return what a lift comes to, as pairs of label and text."""
    asked = f"{1e3 * lift.mass:.4g} g on {1e2 * lift.arm:.4g} cm: {lift.torque:.3g} N m where the arm is horizontal"
    found = [("lift", asked), ("lifts", _lifts(lift))]
    if not math.isnan(lift.swing.time):
        found += [("time for 60 deg", f"{lift.swing.time:.2f} s, from 30 deg below the horizontal to 30 deg above, "
                                      "from rest"),
                  ("current moving", f"{lift.swing.mean_current:.2f} A in the mean of that")]
    if not lift.held.stands:
        why = f"it trips by {lift.held.trip}" if lift.held.trip else "it sinks"
        return [*found, ("holds", f"not with the arm horizontal: {why}")]
    found.append(("current holding", f"{lift.held.current:.2f} A, {_off(lift.held)} below its command"))
    return [*found, ("after ten minutes", _warm(lift))]


def beside(sheets: Sequence[DataSheet]) -> list[dict[str, str]]:
    """Return several servos side by side, a row for each voltage, by the names of columns."""
    from servotwin.cli.which_words import degrees, lift_cells, mass_cell, times
    from servotwin.parameters import printed_fact

    several = len({part.voltage for sheet in sheets for part in sheet.voltages}) > 1
    found = []
    for sheet in sheets:
        mass = printed_fact(sheet.servo.sheet, "mass")
        for part in sheet.voltages:
            free = part.lift is None
            held = next((each for each in part.holding
                         if math.isclose(each.torque, 0.25 * part.cold.stall_torque, rel_tol=1e-6)), None)
            rest = None if part.buzz is None else part.buzz.rest
            found.append({
                "id": sheet.servo.name, "at, V": f"{part.voltage:g}" if several else "",
                "mass, g": mass_cell(math.nan if mass is None else mass), "stall, N m": f"{part.cold.stall_torque:.3g}",
                "stall, A": f"{part.cold.stall_current:.2f}" if free else "", "60 deg, s": f"{part.cold.time_60:.3f}",
                "margin": "" if part.lift is None else times(part.lift.margin), **lift_cells(part.lift),
                "quarter load, deg off": degrees(held.error, None, ".1f") if held is not None and free else "",
                "at rest, A": f"{rest.current:.3f}" if rest is not None and free else "",
                "least move, deg": degrees(part.smallest_move, part.move_span, ".2f")})
    return found


def _off(held: Held) -> str:
    """Return how far a load pulls a servo off its command."""
    return with_span(math.degrees(held.error), held.span, ".1f", "deg", scale=math.degrees(1.0))


def _lifts(lift: Lift) -> str:
    if lift.lifts:
        return f"yes, at all angles, with a margin of {lift.margin:.3g}: it lifts {lift.most_torque:.3g} N m"
    angle = math.degrees(lift.blocked)
    return (f"no: it lifts {lift.most_torque:.3g} N m, {100.0 * lift.margin:.0f} % of that. From hanging it comes up "
            f"to {angle:.0f} deg below the horizontal; {angle:.0f} deg above, it lifts again")


def _warm(lift: Lift) -> str:
    if lift.warming is None:
        return "not known: neither file nor sheet gives thermal numbers or a mass"
    warming = lift.warming
    assumed = "; thermal numbers assumed by the servo's mass" if warming.masses.assumed else ""
    if not warming.warm.stands:
        return f"gives way after {warming.duration / 60.0:.0f} min, winding at {_celsius(warming.now.winding)}{assumed}"
    limit = "" if math.isnan(warming.limit_time) else (
        f", above 130 deg C (class B wire, assumed) after {_while(warming.limit_time)}")
    return f"winding {_celsius(warming.now.winding)}, housing {_celsius(warming.now.housing)} in air of " \
           f"{_celsius(warming.masses.ambient)}{limit}{assumed}"


def _celsius(kelvin: Real) -> str:
    return f"{float(kelvin) - 273.15:.0f} deg C"


def _while(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.1f} min"


def notes(sheet: DataSheet) -> list[str]:
    """Return what one has to know to read a sheet: flags of what the maker prints, and what the model is."""
    from servotwin.datasheet.conditions import highest_voltage, is_below_sheet, lowest_voltage
    from servotwin.datasheet.guesses import guesses
    from servotwin.datasheet.rotor import slow_rotor
    from servotwin.models import BoundedServo, DigitalServo
    from servotwin.parameters import printed_flags

    servo, most = sheet.servo, highest_voltage(sheet.servo)
    found = [f"{part.voltage:g} V is above what the sheet prints ({most:g} V)" for part in sheet.voltages
             if 0.0 < most < part.voltage]
    found += [f"{part.voltage:g} V is below what the sheet prints ({lowest_voltage(servo):g} V)"
              for part in sheet.voltages if is_below_sheet(servo, part.voltage)]
    digital = isinstance(sheet.model, DigitalServo)
    if servo.kind != "analog" and not digital:
        found.append(f"a {servo.kind} servo, computed as an analog one: its program is left out")
    if digital:
        guessed = [name.removeprefix("firmware.") for name in servo.names()
                   if name.startswith("firmware.") and servo.source(name).origin == "assumed"]
        found += [f"guessed of its program: {', '.join(guessed)}"] if guessed else []
    behind = guesses(sheet.model) if not sheet.model.endless else ()
    if behind:
        found.append(f"ranges in brackets: with {', '.join(behind)}, assumed within a range, at the ends of theirs; "
                     "bandwidths have none")
    slow = slow_rotor(servo)
    found += [slow] if slow is not None else []
    if isinstance(sheet.model, BoundedServo):
        found.append("computed as a bounded servo, with the mean voltage of its pulses")
    return found + [f"its sheet: {flag}" for flag in printed_flags(servo) if flag != servo.kind]


def hot_words(part: VoltageSheet) -> str:
    """Return the temperatures of the hot curves in words."""
    warm = part.hot.temperatures
    return f"winding {_celsius(warm.winding)}, magnets {_celsius(warm.housing)}"


def facts(sheet: DataSheet, torque: float | None = None) -> dict[str, Any]:
    """Return a sheet in SI, ready for JSON."""
    from servotwin.cli.summary import model_name

    return {"servo": sheet.servo.name, "title": sheet.servo.title, "kind": sheet.servo.kind,
            "model": model_name(sheet.model), "notes": notes(sheet),
            "voltages": [_facts(part, torque) for part in sheet.voltages]}


def _facts(part: VoltageSheet, torque: float | None) -> dict[str, Any]:
    found: dict[str, Any] = {
        "supply_voltage": part.voltage, "cold": _curve(part.cold, torque), "hot": _curve(part.hot, torque),
        "smallest_move": part.smallest_move, "smallest_pulse": part.smallest_pulse,
        "smallest_move_span": part.move_span,
        "holding": [each._asdict() for each in part.holding],
        "bandwidth": [{"amplitude": band.amplitude, "frequency": band.frequency,
                       "beyond": math.isinf(band.frequency)} for band in part.bandwidth],
        "printed": [dataclasses.asdict(point) for point in part.printed]}
    if part.turning is not None:
        found["turning"] = {"neutral_pulse": part.turning.neutral, "still": part.still,
                            "pulse_width": part.turning.pulses.tolist(), "output_speed": part.turning.speeds.tolist()}
    if part.loop is not None:
        found["loop"] = loop_facts(part.loop, torque)
    if part.buzz is not None:
        found["at_rest"] = buzz_facts(part.buzz)
    if part.lift is not None:
        found["lift"] = lift_facts(part.lift)
    return found


def _curve(curve: SpeedCurve, torque: float | None) -> dict[str, Any]:
    found: dict[str, Any] = {
        "winding_temperature": curve.temperatures.winding, "housing_temperature": curve.temperatures.housing,
        "stall_torque": curve.stall_torque, "stall_current": curve.stall_current,
        "starting_torque": curve.drive.starting_torque, "no_load_speed": curve.no_load_speed,
        "no_load_current": curve.no_load_current, "time_60": curve.time_60,
        "most_power": curve.most_power._asdict(), "best_efficiency": curve.best_efficiency._asdict()}
    if torque is not None:
        found["at_load"] = curve.at(torque)._asdict()
    return found | {name: getattr(curve, name).tolist() for name in (
        "speed", "torque", "current", "power", "efficiency")}


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
