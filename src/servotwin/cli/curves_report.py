"""The page of one or more computed sheets: HTML that needs nothing but itself."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin import plotting, units
from servotwin.cli.summary import buzz_facts, model_name, remedy_words, rest_words
from servotwin.cli.terminal import with_span
from servotwin.cli.which_words import degrees, lift_cells, lift_facts, mass_cell, times
from servotwin.datasheet.holding import Span, guesses, highest_voltage, is_below_sheet, lowest_voltage
from servotwin.look import document, escape, reports
from servotwin.parameters import printed_fact, printed_flags, printed_points

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

    from servotwin.datasheet import (
        DataSheet,
        Held,
        Lift,
        Loop,
        OperatingPoint,
        Protection,
        SpeedCurve,
        SpeedMap,
        VoltageSheet,
    )
    from servotwin.parameters import PrintedPoint
    from servotwin.physics._typing import Real


# --- The loop of a digital servo at rest, in words and as facts for JSON ----------------------------------------------

_ZERO_CELSIUS = 273.15


def loop_pairs(loop: Loop, torque: float | None = None) -> list[tuple[str, str]]:
    """Return stiffness, dead zone, friction, cap and protections as pairs of label and text.

    Parameters
    ----------
    loop : Loop
    torque : float, optional
        A load whose droop is stated as well [N m].

    Examples
    --------
    >>> import servotwin as st
    >>> model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    >>> loop_pairs(st.curves(model, bandwidth=False).voltages[0].loop)[0]
    ('stiffness', '32.3 N m/rad (0.564 N m/deg)')
    """
    guessed = loop.spans

    def angle(name: str) -> str:
        return _deg(getattr(loop, name), guessed.get(name))

    stiffness = (f"{with_span(loop.stiffness, guessed.get('stiffness'), '.3g', 'N m/rad')} "
                 f"({math.radians(loop.stiffness):.3g} N m/deg)")
    zone = f"{angle('dead_zone')} either way" if loop.dead_zone > 0.0 else "none"
    found = [("stiffness", stiffness), ("dead zone", zone)]
    if loop.count > 0.0:
        found.append(("sees its angle in steps of", _deg(loop.count)))
    if loop.minimum_duty > 0.0:
        found.append(("startup force", _startup(loop)))
    start = ("no error moves the free shaft" if math.isnan(loop.start_error) else
             f"an error of {angle('start_error')} moves the free shaft")
    found.append(("friction", f"{loop.friction_torque:.3g} N m: a band of {angle('friction_error')} either way; "
                              f"{start}"))
    found.append(("torque at the cap", f"{loop.cap_torque:.3g} N m of the motor, of which it lifts "
                                       f"{loop.cap_lifts:.3g}, at {_percent(loop.most_duty)} of the duty"))
    found.append(("reaches the cap at", angle("cap_error")))
    if loop.has_integral:
        found.append(("integral", "takes away in time what the load leaves of the error"))
    if torque is not None and torque >= 0.0:
        found.append((f"droop for {torque:.3g} N m", _droop(loop, torque)))
    found += [(f"trips by {each.kind}", _protection(each)) for each in loop.protections]
    return found if loop.protections else [*found, ("trips", "by nothing that is known of it")]


def _startup(loop: Loop) -> str:
    """Return the torque of the smallest duty, and that it moves the free shaft where it exceeds friction."""
    torque, friction = loop.motor_torque(loop.minimum_duty), loop.friction_torque
    span = loop.spans.get("minimum_duty")
    torques = None if span is None else Span(*map(loop.motor_torque, span))
    said = f"{_percent(loop.minimum_duty, span)} of the duty: {with_span(torque, torques, '.3g', 'N m')}"
    if not loop.startup_moves:
        return said
    return f"{said}, more than the friction of {friction:.3g} N m: every duty that is not 0 moves the free shaft"


def _droop(loop: Loop, torque: float) -> str:
    held, lifted = loop.droop(torque)
    if math.isnan(held):
        return "does not hold it"
    guessed = loop.droop_spans(torque)
    up = f"{_deg(lifted, guessed.get('lifted'))} after coming up" if not math.isnan(lifted) else "it does not come up"
    return f"{_deg(held, guessed.get('held'))} where friction helps, {up}"


def _protection(each: Protection) -> str:
    """Return what starts a protection, after how long, what is left, and what ends it."""
    if each.kind == "heat":
        return (f"above {each.threshold - _ZERO_CELSIUS:.0f} deg C of the housing: no duty until it is 5 K cooler; "
                "needs thermal numbers")
    if each.kind == "undervoltage":
        return f"below {each.threshold:.3g} V at the servo"
    after = f" over {each.time:.3g} s" if each.time > 0.0 else ""
    where = "which a fast shaft never draws" if math.isnan(each.error) else (
        f"held fast {_deg(each.error)} off, {each.torque:.3g} N m")
    if each.kind == "current":
        return f"{each.threshold:.3g} A{after} ({where}): limp until the next goal"
    left = (f"{_percent(each.left)} of the duty are left, {each.left_torque:.3g} N m" if each.left > 0.0 else "limp")
    ends = ("a power cycle" if each.latches else "torque off" if math.isnan(each.release_error) or each.left == 0.0 else
            f"the error is below {_deg(each.release_error)}")
    where = "which no error asks for" if math.isnan(each.error) else where
    return f"{_percent(each.threshold)} of the duty asked for{after} ({where}): {left}, until {ends}"


def loop_facts(loop: Loop, torque: float | None = None) -> dict[str, Any]:
    """Return the same in SI, ready for JSON."""
    found: dict[str, Any] = {name: getattr(loop, name) for name in (
        "stiffness", "dead_zone", "count", "minimum_duty", "most_duty", "has_integral", "friction_torque",
        "friction_error", "start_error", "startup_moves", "cap_error", "cap_torque", "cap_lifts")}
    if torque is not None and torque >= 0.0:
        found["droop"] = dict(zip(("held", "lifted"), loop.droop(torque), strict=True))
        found["droop_spans"] = loop.droop_spans(torque)
    return found | {"spans": loop.spans} | {"protections": [each._asdict() for each in loop.protections]}


def _deg(angle: float, span: Span | None = None) -> str:
    return with_span(math.degrees(angle), span, ".2f", "deg", scale=math.degrees(1.0))


def _percent(share: float, span: Span | None = None) -> str:
    return with_span(100.0 * share, span, ".3g", "%", scale=100.0)


# --- A computed sheet as rows of text and as facts for JSON; what the sheet prints stands beside ----------------------

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
        Printed points at any voltage: shown, without a difference, where the sheet prints nothing at this one.
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
    """Return the notes that a sheet needs: flags of what the maker prints, and what the model is."""
    from servotwin.datasheet.turning import slow_rotor
    from servotwin.models import BoundedServo, DigitalServo

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


# --- The page of one or more computed sheets: HTML that needs nothing but itself --------------------------------------

_STYLE = """
figure img.drawing{width:100%;max-width:30rem}figure.wide img.drawing{width:100%;max-width:54rem}
.sheet td:nth-child(n+2),.sheet th:nth-child(n+2){text-align:right;font-variant-numeric:tabular-nums}
.sheet td:nth-child(5){font-weight:600}.pairs td:first-child{white-space:nowrap;color:var(--soft)}
.yes{border-left-color:#009e73;background:#f0faf6}
@media print{section.servo{break-before:page}section.servo:first-of-type{break-before:auto}}
"""


def page(sheets: Sequence[DataSheet], torque: float | None = None) -> str:
    """Return the page of some sheets; `torque` is a load whose point on the curves is shown as well [N m]."""
    names = [sheet.servo.title or sheet.servo.name for sheet in sheets]
    title = names[0] if len(sheets) == 1 else f"{len(sheets)} servos beside each other"
    top = "" if len(sheets) == 1 else _contents(sheets, names)
    body = "".join(_servo(sheet, torque, alone=len(sheets) == 1) for sheet in sheets)
    lead = ("What the parameters of the servo file say, computed; what the maker's sheet prints stands beside it, and "
            "how far the computed value is off. Deviations are findings: of the sheet, of the file, or of both.")
    return document(f"{title}: computed sheet", f"<h1>{escape(title)}</h1>\n<p class=\"lead\">{lead}</p>\n{top}{body}"
                    f"<section><h2>How to read this page</h2>{_READING}</section>\n", style=_STYLE)


def _contents(sheets: Sequence[DataSheet], names: Sequence[str]) -> str:
    items = "".join(f'<li><a href="#{escape(sheet.servo.name)}">{escape(name)}</a></li>'
                    for sheet, name in zip(sheets, names, strict=True))
    drawn = _figure([plotting.compared_curves(sheets, page=page)
                     for page in plotting.pages(len(sheets), plotting.CURVES_A_PAGE)],
                    "Torque and current over speed at full drive, cold, each servo at the first of its voltages. Open "
                    "marks are what the sheets print for it.", wide=True)
    return f'<nav aria-label="Contents"><ol>{items}</ol></nav>\n{drawn}'


def _servo(sheet: DataSheet, torque: float | None, *, alone: bool) -> str:
    servo = sheet.servo
    heading = "" if alone else f"<h2>{escape(servo.title or servo.name)}</h2>\n"
    said = reports.notes(notes(sheet))
    parts = reports.report_html(sections(sheet, torque))
    pages = plotting.pages(len(sheet.voltages), plotting.CURVES_A_PAGE)
    hot = escape(reports.signs(hot_words(sheet.voltages[0])))
    drawn = _figure([plotting.speed_curves(sheet, page=page) for page in pages], "At full drive over speed: cold "
                    f"(25 °C) and hot ({hot}). Open marks are what the sheet prints.", wide=True)
    small = _figure([plotting.holding_curves(sheet, page=page) for page in pages], "How far a constant load pulls the "
                    "servo off its command, 1.5 to 2 s after it was put on, or longer by what a protection waits.")
    loops = [part.loop for part in sheet.voltages if part.loop is not None]
    if loops:
        drawn += _figure([plotting.loop_curve(loops, page=page)
                          for page in plotting.pages(len(loops), plotting.LOOPS_A_PAGE)],
                         "The torque that the program gives while an error stands. A load in the grey stays where it "
                         "is, held by friction; the right half is the middle of the left one.", wide=True)
    if any(part.bandwidth for part in sheet.voltages):
        small += _figure([plotting.bandwidth_curves(sheet, page=page) for page in pages], "Up to which frequency the "
                         "free servo follows sines within 3 dB, over their amplitude. What is not followed at 1 Hz has "
                         "no mark.")
    lifts = [(part.voltage, part.lift) for part in sheet.voltages if part.lift is not None]
    if lifts:
        small += _figure([plotting.lift_curve(lifts)], "What the mass takes over the angle of its arm, and the most "
                         "that the servo lifts.")
    facts = f"<code>{escape(servo.name)}</code>, {escape(servo.kind)}, computed by {type(sheet.model).__name__}"
    return (f'<section class="servo" id="{escape(servo.name)}">{heading}<p class="lead">{facts}</p>\n{said}{drawn}'
            f'{parts}<div class="figures">{small}</div></section>\n')


def sections(sheet: DataSheet, torque: float | None = None) -> list[reports.Section]:
    """Return the numbers of each voltage; `torque` is a load whose point on the curves is shown as well [N m]."""
    printed = printed_points(sheet.servo)
    return [reports.Section(f"At {part.voltage:g} V", [
        _cards(part), reports.Table(
            (f"at {part.voltage:g} V", "cold", "hot", "sheet", "off"), rows(part, printed, torque),
            f"At {part.voltage:g} V. Cold: 25 deg C. Hot: {hot_words(part)}.", kind="sheet"),
        *([reports.Pairs(found, "at rest")] if (found := rest_pairs(part)) else []),
        *([reports.Pairs(loop_pairs(part.loop, torque), "the loop at rest")] if part.loop is not None else []),
        *(_lifting(part, part.lift) if part.lift is not None else [])], level=3) for part in sheet.voltages]


def _cards(part: VoltageSheet) -> reports.Cards:
    shown = [(f"{part.cold.stall_torque:.2f} N m", "stall torque"),
             (f"{part.cold.time_60:.2f} s", "for 60° without load"),
             (f"{part.cold.stall_current:.2f} A", "standing at full drive")]
    if not math.isnan(part.smallest_move):
        shown.append((f"{math.degrees(part.smallest_move):.2f} deg", "smallest move"))
    return reports.Cards(shown)


def _lifting(part: VoltageSheet, lift: Lift) -> list[reports.Part]:
    verdict = "lifts it" if lift.lifts else "does not lift it at all angles"
    box = f'<div class="note{" yes" * lift.lifts}"><p>At {part.voltage:g} V the servo {verdict}.</p></div>\n'
    return [reports.Html(box), reports.Pairs(lift_pairs(lift), "lifting")]


def _figure(drawn: Sequence[Figure], words: str, *, wide: bool = False) -> str:
    """Return the pages of a picture, one below the other, with words below them."""
    return reports.Picture(lambda: drawn, words, wide).html


_READING = """<ul>
<li><b>Full drive.</b> Far from its goal a servo drives without a pause, a digital one at the most duty that its
program gives. Speed, torque and current are those
of steady motion: motor, bridge, source, current limit and the friction of the gear, which grows with the load.</li>
<li><b>Stall torque.</b> Where the shaft just stands. Sheets print the same, some rounded up, some impossible.</li>
<li><b>Time for 60°.</b> At the speed without load, as sheets print it; a real step also speeds up and settles.</li>
<li><b>Hot.</b> Copper gains 0.385 % of resistance per kelvin; magnets lose 0.15 %, assumed, where the file does not
say.</li>
<li><b>Smallest move.</b> The smallest step of the command that the free shaft follows to half within a second, from
where there is no error.</li>
<li><b>Holding.</b> The load is put on where there is no error; an analog servo gives way until its pulses are long
enough, a digital one until its duty is large enough, or it trips.</li>
<li><b>After ten minutes.</b> Where the file has no thermal numbers they are assumed by mass: 5 % of it copper, the rest
800 J/(kg K), time constants of 17 s and 8.7 min at 45 g that grow with the cube root of mass.</li></ul>
"""
