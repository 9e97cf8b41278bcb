"""The tables of the report."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from servotwin import bench, units
from servotwin.look import escape, fixed, number, table, with_error
from servotwin.paper.reproduction import LABELS, LOAD_INERTIA, MODELS, PaperStudy
from servotwin.parameters import GROUPS
from servotwin.physics.friction import creep_speed

if TYPE_CHECKING:
    from servotwin.bench import ModelShares
    from servotwin.parameters import Quantity


# --- Where the paper needs a correction and where its own data disagree, each with the number that shows it -----------

_MOVED = 1542.0  # µs: the pulse width of the 90° row, one step of the generator longer


class Passage(NamedTuple):
    """A place in the paper, what is done about it (both HTML), and the number that shows why."""

    place: str
    remark: str
    shown_by: str


def corrections(study: PaperStudy) -> tuple[Passage, ...]:
    """Return what the equations need before they can be computed or believed."""
    N = study.value("gear.gear_reduction")
    F = study.value("friction.coulomb_torque_forward")
    damping = (study.value("motor.torque_constant") * study.value("motor.back_emf_constant")
               / study.value("motor.armature_resistance") + study.value("motor.motor_viscous_friction"))
    creep = float(creep_speed(0.5 * N * F, N, F, study.value("friction.coulomb_torque_backward"),
                              study.value("friction.zero_crossing_slope"), damping)) / N
    return (
        Passage("(6)", "Printed as a copy of (5). Read v<sub>b</sub> = k<sub>b</sub> θ̇<sub>m</sub>, as (9) and (24) "
                "use it.", "no number: a misprint"),
        Passage("(4), (5), (10), (41)", "Letters used twice: k is the factor of (5) and the slope of (41); "
                "τ<sub>m</sub> is the torque of the current in (4) and what the bare rotor takes in (10) and (25). "
                "Each has a name of its own here.", "no number: names"),
        *_drive(study),
        Passage("(41): no static friction", "The text announces it, the formula has none and gives no force at rest: a "
                "loaded shaft creeps. In the two other models it sticks.",
                f"with half the friction's torque on the braked, unpowered shaft (41) creeps "
                f"{fixed(60.0 * math.degrees(creep), 1)}° a minute (at the assumed slope k)"),
        Passage("(37), (41): which shaft", "(37) to (40) take f<sub>ec</sub> at the motor's shaft and of the motor's "
                "speed; (41) writes q̇. Taken as (37).",
                f"at the output it is N = {number(N)} times as large: {number(1e3 * F)} mN m become "
                f"{number(N * F)} N m"),
        Passage("(34)", "Gives τ̇<sub>L</sub> from the third derivative of q and cannot be run forward. The same "
                "physics is simulated with the current as a state.", "no number: a change of form"),
        Passage("(40)", "An inverse statement: motion in, torque out. Forward it needs a load, which the paper does "
                "not name.", f"here J<sub>L</sub> = {number(LOAD_INERTIA)} kg m² (assumed)"),
    )


def _drive(study: PaperStudy) -> tuple[Passage, ...]:
    """Return what (38) leaves out between the error and the motor."""
    k_p, p = study.fits["V_o(V_i)"].line.slope, math.degrees(1.0) * study.fits["V_o(q)"].line.slope
    at_zero = float(study.table["V_i_V"][0])
    half_band = 0.5 * study.value("electronics.voltage_deadband") / study.value("potentiometer.feedback_gain")
    return (
        Passage("(38): no offsets", "As printed, zero volts mean zero angle. The bench needs v<sub>a</sub> = A "
                "k<sub>s</sub> [(k<sub>p</sub> v<sub>i</sub> + b<sub>i</sub>) − (p q + b<sub>o</sub>)].",
                f"as printed, {at_zero:.3f} V asks for {fixed(math.degrees(k_p * at_zero / p), 1)}°; the servo stood "
                "at 0°"),
        Passage("(38): no bound", "No bridge gives more than its supply. The averaged servo keeps (38) as printed, the "
                "two others limit it.",
                f"peak |v<sub>a</sub>| {fixed(study.peak_voltage['averaged'], 1)} V on a supply of "
                f"{number(study.supply)} V: {fixed(study.peak_voltage['averaged'] / study.supply, 1)} times"),
        Passage("(38): no deadband", "The chip ignores small errors. The averaged servo has no deadband, the two "
                "others have one.", f"8 µs of full width (sheet) are ± {fixed(math.degrees(half_band), 2)}°"),
        Passage("(38): a mean", "The chip drives in pulses, one a frame, and (38) is their mean. Pulses break a "
                "friction that their mean does not. The pulse servo computes every pulse.",
                "the shaft may stand up to ± " + fixed(math.degrees(study.on_bench["bounded"].widest), 2)
                + "° from its target with the mean, ± " + fixed(math.degrees(study.on_bench["pulse"].widest), 2)
                + "° with pulses"),
    )


def disagreements(study: PaperStudy) -> tuple[Passage, ...]:
    """Return where the paper's data disagree with each other or with other sources."""
    return (*_tables(study), *_converters(study), *_generator(study), *_printed(study))


def _tables(study: PaperStudy) -> tuple[Passage, ...]:
    one, fits = study.ranges, study.fits
    rate = float(np.ptp(one["q_deg"]) / np.ptp(one["t_a_us"]))
    gain = float(np.ptp(one["V_o_V"]) / np.radians(np.ptp(one["q_deg"])))
    pulse, pot = fits["q(t_a)"].line, fits["V_o(q)"].line
    p = math.degrees(1.0) * pot.slope
    curve = fits["q(t_a)"]
    return (
        Passage("Table I and Table II: pulse gain", "The pulse gain belongs to one unit. Makers list 0.109 to 0.1125 "
                "°/µs for this type (45° per 400 µs; 202° over 556 to 2410 µs).",
                f"{rate:.4f} °/µs against {with_error(pulse.slope, pulse.slope_error, '°/µs')}: "
                f"{fixed(100.0 * (pulse.slope / rate - 1.0), 1)} %"),
        Passage("Table I and Table II: potentiometer", "The calibration used here is that of Table II.",
                f"{gain:.4f} V/rad against {with_error(p, math.degrees(1.0) * pot.slope_error, 'V/rad')}: "
                f"{fixed(100.0 * (p / gain - 1.0), 1)} %"),
        Passage("“Predominantly linear”", "Angle over pulse width is visibly curved, and the generator's steps do not "
                "explain it. A linear model cannot follow it.",
                "residuals " + ", ".join(fixed(r, 2) for r in curve.line.residuals) + "°; F-test of a parabola: "
                f"F = {fixed(curve.curvature.f_value, 1)}, p = {fixed(curve.curvature.p_value, 3)}"),
    )


def _generator(study: PaperStudy) -> tuple[Passage, ...]:
    generator = study.on_bench["bounded"].bench.generator
    moved = study.table["t_a_us"].copy()
    moved[2] = _MOVED
    straight = bench.fit_line(moved, study.table["V_o_V"])
    step = 1e6 * generator.step * study.fits["q(t_a)"].line.slope
    deadband = study.value("electronics.voltage_deadband") / study.value("potentiometer.feedback_gain")
    return (
        Passage("Pulse widths", "All five are 16 m + 6 µs with m = ⌊(ADC_i − 1)/6⌋ − 1; the frame is 1024 · 16 µs. "
                "Inferred from the numbers, the paper does not say it.",
                f"one step is {fixed(1e6 * generator.step, 0)} µs or {fixed(step, 1)}°, twice the deadband of "
                f"{fixed(math.degrees(deadband), 1)}°; f = {fixed(generator.pulse_rate, 3)} Hz, printed 61"),
        Passage("The 90° row", "Its pulse width and its counts may be of another frame than its voltages. The table is "
                "used as printed.",
                f"with {_MOVED:.0f} µs the largest residual of V_o(t_a) falls from "
                f"{fixed(1e3 * study.fits['V_o(t_a)'].line.max_residual, 1)} to "
                f"{fixed(1e3 * straight.max_residual, 1)} mV"),
    )


def _converters(study: PaperStudy) -> tuple[Passage, ...]:
    count_in, count_out = study.fits["ADC_i(V_i)"].line, study.fits["ADC_o(V_o)"].line
    generator = study.on_bench["bounded"].bench.generator
    volts, counts = study.table["V_i_V"].tolist(), study.table["ADC_i"].tolist()
    gain = bench.INPUT_CONVERTER.gain
    zero = _count_offsets(volts, counts, gain)
    others = _count_offsets(volts[:2] + volts[3:], counts[:2] + counts[3:], gain)
    span = bench.command_voltage_interval(582, gain=gain)
    read = {offset: bench.Converter(bits=10, reference=2.5, offset=offset).count(volts[2])
            for offset in (0.0, others.middle)}
    low, high = study.offsets
    return (
        Passage("ADC_i and ADC_o", "Two 10-bit converters of one bench have different gains and zeros, so voltmeter "
                "and converter did not see the same voltage. The bench here uses each as fitted.",
                f"{with_error(count_in.slope, count_in.slope_error)} counts/V and {fixed(count_in.intercept, 1)} "
                f"against {with_error(count_out.slope, count_out.slope_error)} counts/V and "
                f"{fixed(count_out.intercept, 1)}"),
        Passage("V_i and ADC_i", f"No zero offset of a converter with {fixed(gain, 1)} counts/V gives all five ADC_i: "
                f"the other four agree on {fixed(others.lower, 2)} to {fixed(others.upper, 2)} counts, the 90° row "
                "does not.",
                f"all five ask for at least {fixed(zero.lower, 2)} and less than {fixed(zero.upper, 2)} counts; "
                f"582 counts are {span.lower:.4f} to {span.upper:.4f} V, printed {volts[2]:.3f} V"),
        Passage("V_i and t_a", "The five pulse widths can be had from the five V_i, but only with a zero offset that "
                f"has no other reason. The bench uses the middle, {fixed(study.offsets.middle, 2)} counts, identified "
                "from Table II.",
                f"offset from {fixed(low, 2)} to below {fixed(high, 2)} counts; " + "; ".join(
                    f"with {fixed(offset, 2)} the 90° row reads {count} counts and gives "
                    f"{1e6 * generator.width(count):.0f} µs" for offset, count in read.items()) + "; printed 1526 µs"),
    )


def _count_offsets(volts: list[float], counts: list[float], gain: float) -> bench.Interval:
    """Return the zero offsets of a converter for which each voltage gives its count."""
    return bench.Interval(max(n - gain * v for n, v in zip(counts, volts, strict=True)),
                          min(n + 1.0 - gain * v for n, v in zip(counts, volts, strict=True)))


def _printed(study: PaperStudy) -> tuple[Passage, ...]:
    per_millivolt = 1e-3 / study.fits["V_o(t_a)"].line.slope
    angle = 1e-3 / study.fits["V_o(q)"].line.slope
    common = study.vibration.circuits["common"].still
    return (
        Passage("Fig. 12: the supply", "The circuit labels the output of an LM2940-CT5 “+6 V”; by its name this is the "
                "5 V version. The voltage at the motor is stated nowhere else.",
                f"{number(study.supply)} V is used (the label)"),
        Passage("Conclusion: vibration", "The servo vibrated until motor and electronics had separate supplies. (38) "
                "has no path from the supply to the motion. The pulse servo has one in its chip, a supply coupling, "
                "for which there is no value; it acts only where the bridge still drives as the chip measures, far "
                "from the target, and does not vibrate. The path through the command does: <a href=\"#vibration\">the "
                "experiment</a>.",
                f"the drive lasts until the next pulse only beyond an error of {fixed(_lasting_error(study), 1)}°; "
                f"scale: 1 mV at the potentiometer is {fixed(per_millivolt, 2)} µs or {fixed(angle, 3)}°; "
                f"command on the same soft supply: {fixed(math.degrees(common.swing), 1)}° at "
                f"{fixed(common.frequency, 0)} Hz"),
        Passage("A word", "ADC_i and ADC_o are called values of a “digital-analog” converter. They are counts of "
                "analog-digital converters.", "no number: a slip"),
        Passage("No parameter values", "The paper publishes no value of k<sub>a</sub>, k<sub>b</sub>, R<sub>a</sub>, "
                "L<sub>a</sub>, J<sub>m</sub>, B<sub>m</sub>, n, A, k<sub>s</sub>, k<sub>p</sub>, p, F<sub>ec</sub> or "
                "k. Its simulated curves cannot be computed from it.", "13 symbols, 0 values"),
    )


def _lasting_error(study: PaperStudy) -> float:
    """Return from which error on the drive of one frame lasts into the next, in the middle of Table II [°]."""
    row = study.on_bench["pulse"].rows[2]
    frame = 1.0 / row.reading.pulse_rate
    error = (0.5 * study.value("electronics.deadband")
             + (frame - row.reading.pulse_width) / study.value("electronics.stretcher_gain"))
    time_per_angle = study.value("electronics.one_shot_slope") * study.value("potentiometer.feedback_gain")
    return math.degrees(error / time_per_angle)


# --- The tables of the report -----------------------------------------------------------------------------------------

# dimension -> units in which a reader expects it: (smallest value in SI, unit, as printed), largest first
_READABLE: dict[str, tuple[tuple[float, str, str], ...]] = {
    "time": ((3e-3, "ms", "ms"), (0.0, "us", "µs")), "angle": ((0.0, "deg", "°"),),
    "inertia": ((0.0, "g cm2", "g cm²"),), "inductance": ((0.0, "mH", "mH"),),
    "torque": ((1e-2, "N m", "N m"), (0.0, "mN m", "mN m")), "voltage": ((0.1, "V", "V"), (0.0, "mV", "mV")),
    "torque per current": ((0.0, "mN m/A", "mN m/A"),), "voltage per speed": ((0.0, "mV s/rad", "mV s/rad"),),
    "time per voltage": ((0.0, "us/V", "µs/V"),), "resistance": ((0.0, "ohm", "Ω"),), "number": ((0.0, "1", ""),),
}


def step_table(study: PaperStudy) -> str:
    """Return the metrics of the step for all models."""
    rows: list[list[str]] = []
    one = study.metrics
    for words, unit, values in (
        ("rise time, 10 to 90 %", "s", [fixed(m.rise_time, 3) for m in one.values()]),
        ("settling time, 2 %", "s", [fixed(m.settling_time, 3) for m in one.values()]),
        ("overshoot", "%", [fixed(100.0 * m.overshoot, 2) for m in one.values()]),
        ("final angle", "°", [fixed(math.degrees(m.final), 2) for m in one.values()]),
        ("command less final angle", "°", [fixed(math.degrees(m.steady_error), 2) for m in one.values()]),
        ("top speed", "°/s", [fixed(math.degrees(m.slew_rate), 0) for m in one.values()]),
        ("peak armature current", "A", [fixed(m.peak_current, 2) for m in one.values()]),
        ("peak armature voltage", "V", [fixed(v, 2) for v in study.peak_voltage.values()]),
        ("of that, times the supply", "1", [fixed(v / study.supply, 2) for v in study.peak_voltage.values()]),
    ):
        rows.append([words, *values, unit])
    return table(["quantity", *(escape(LABELS[name]) for name in one), "unit"], rows,
                 caption=f"Step from 0 to 180°, load inertia {number(LOAD_INERTIA)} kg m² (assumed)")


def ranges_table(study: PaperStudy) -> str:
    """Return Table I of the paper."""
    rows = [[f"{q:.0f}", f"{t:.0f}", f"{v:.1f}"] for q, t, v in
            zip(*(study.ranges[name].tolist() for name in ("q_deg", "t_a_us", "V_o_V")), strict=True)]
    return table(["q (°)", "t<sub>a</sub> (µs)", "v<sub>o</sub> (V)"], rows,
                 caption="Table I of the paper: the range of operation of analog servos", text_columns=0)


def comparison_table(study: PaperStudy) -> str:
    """Return Table II, measured beside simulated."""
    t = {name: column.tolist() for name, column in study.table.items()}
    head = ["", "V<sub>i</sub> (V)", "ADC<sub>i</sub>", "t<sub>a</sub> (µs)", "f (Hz)", "q (°)", "V<sub>o</sub> (V)",
            "ADC<sub>o</sub>", "band (°)"]
    rows = []
    for k in range(len(t["q_deg"])):
        volt = f"{t['V_i_V'][k]:.3f}"
        rows.append(["<strong>measured</strong>", volt, f"{t['ADC_i'][k]:.0f}", f"{t['t_a_us'][k]:.0f}",
                     f"{t['f_Hz'][k]:.0f}", f"{t['q_deg'][k]:.0f}", f"{t['V_o_V'][k]:.3f}", f"{t['ADC_o'][k]:.0f}",
                     ""])
        for name, one in study.on_bench.items():
            row = one.rows[k]
            r = row.reading
            rows.append([name, volt, f"{r.command_count}", f"{1e6 * r.pulse_width:.0f}",
                         f"{r.pulse_rate:.3f}", fixed(math.degrees(r.output_angle), 2), f"{r.feedback_voltage:.4f}",
                         f"{r.feedback_count}", f"± {fixed(math.degrees(row.standing_band), 2)}"])
    return table(head, rows, caption="Table II of the paper, measured and simulated. The simulated rows are the mean "
                 "of an approach from below and one from above; the band is half their difference.")


def difference_table(study: PaperStudy) -> str:
    """Return simulated less measured."""
    rows = []
    for name, one in study.on_bench.items():
        for k, (d, row) in enumerate(zip(one.differences, one.rows, strict=True)):
            rows.append([name, f"{study.table['q_deg'][k]:.0f}", fixed(math.degrees(d.output_angle), 2),
                         fixed(1e3 * d.feedback_voltage, 1), fixed(1e6 * d.pulse_width, 1), f"{d.command_count:+d}",
                         f"{d.feedback_count:+d}", fixed(math.degrees(row.deadband_band), 2),
                         fixed(math.degrees(row.friction_band), 2)])
        rows.append([f"<strong>{name}, largest</strong>", "", *(
            f"<strong>{text}</strong>" for text in (
                fixed(math.degrees(one.worst("output_angle")), 2), fixed(1e3 * one.worst("feedback_voltage"), 1),
                fixed(1e6 * one.worst("pulse_width"), 1), f"{one.worst('command_count'):.0f}",
                f"{one.worst('feedback_count'):.0f}")), "", ""])
    head = ["model", "row (°)", "Δq (°)", "ΔV<sub>o</sub> (mV)", "Δt<sub>a</sub> (µs)", "ΔADC<sub>i</sub>",
            "ΔADC<sub>o</sub>", "deadband (°)", "friction (°)"]
    return table(head, [[cell.replace("-", "−") if k > 1 else cell for k, cell in enumerate(r)] for r in rows],
                 caption="Simulated less measured, and what the standing band is made of")


def band_table(study: PaperStudy) -> str:
    """Return how far from its target each model may stand, row by row, and what the pulses make of it."""
    models = study.on_bench
    bands = [[math.degrees(row.standing_band) for row in one.rows] for one in models.values()]
    rows = [[f"{q:.0f}", *(fixed(band[k], 2) for band in bands)] for k, q in enumerate(study.table["q_deg"].tolist())]
    summary = (("largest", [one.widest for one in models.values()]),
               ("of it electrical deadband", [max(row.deadband_band for row in one.rows) for one in models.values()]),
               ("of it friction", [one.friction for one in models.values()]))
    rows += [[words, *(f"<strong>{fixed(math.degrees(v), 2)}</strong>" for v in values)] for words, values in summary]
    rows.append(["at rest after 5 s", *(
        "all" if (n := sum(row.at_rest for row in one.rows)) == len(one.rows) else f"{n} of {len(one.rows)}"
        for one in models.values())])
    return table(["row (°)", *(escape(LABELS[name]) for name in models)], rows,
                 caption="Standing band (± °), how far from its target each servo may stand: half of what lies between "
                 "an approach from below and one from above. What is not at rest still creeps, and the creep counts "
                 "as friction.")


def measured_shares_table(study: PaperStudy) -> str:
    """Return why the measured angles lie off a straight line over the command voltage."""
    rows = [[f"{q:.0f}", *(fixed(math.degrees(v), 2) for v in (s.total, s.quantum, s.curvature, s.rest))]
            for q, s in zip(study.table["q_deg"], study.measured_shares, strict=True)]
    return table(["row (°)", "measured less line q(V<sub>i</sub>)", "= 16 µs steps", "+ curvature of q(t<sub>a</sub>)",
                  "+ rest"], rows, text_columns=0,
                 caption="Why the measured angles (°) scatter about a straight line over V<sub>i</sub>")


def model_shares_table(study: PaperStudy, name: str) -> str:
    """Return why one model differs from the measured table."""
    one = study.on_bench[name]

    def cells(s: ModelShares, scale: float, places: int) -> list[str]:
        return [fixed(scale * v, places) for v in (s.total, s.generator, s.curvature, s.standing, s.rest)]

    angle = [[f"{q:.0f}", "q (°)", *cells(s, math.degrees(1.0), 2)]
             for q, s in zip(study.table["q_deg"], one.angle_shares, strict=True)]
    volt = [[f"{q:.0f}", "V<sub>o</sub> (mV)", *cells(s, 1e3, 1)]
            for q, s in zip(study.table["q_deg"], one.voltage_shares, strict=True)]
    return table(["row (°)", "quantity", "simulated less measured", "= other pulse width", "+ curvature",
                  "+ unequal standing", "+ calibration"], angle + volt, text_columns=2,
                 caption=f"What the difference is made of: {escape(LABELS[name])}")


def fits_table(study: PaperStudy) -> str:
    """Return the straight lines with standard errors, and the test for curvature."""
    rows = []
    for fit in study.fits.values():
        scale, slope_unit, unit = _scaled(fit.name, fit.slope_unit, fit.unit)
        line, test = fit.line, fit.curvature
        offset = 1.0 if unit == fit.unit else 1e3
        rows.append([
            pretty(fit.name), with_error(scale * line.slope, scale * line.slope_error, slope_unit),
            with_error(line.intercept, line.intercept_error, fit.unit),
            f"{fixed(offset * line.max_residual, 2 if offset == 1.0 else 1)} {unit}", fixed(test.f_value, 2),
            fixed(test.p_value, 3), f"{fixed(offset * test.sagitta, 2 if offset == 1.0 else 1)} {unit}"])
    return table(["fit", "slope ± s.e.", "offset ± s.e.", "largest residual", "F (parabola)", "p",
                  "bend"], rows, caption="Straight lines through Table II, one standard error; F-test of a quadratic "
                 "term (1 and 2 degrees of freedom), and how far the parabola lies off its chord")


def _scaled(name: str, slope_unit: str, unit: str) -> tuple[float, str, str]:
    if name == "V_o(q)":
        return 1e3, "mV/°", "mV"
    if name == "V_o(t_a)":
        return 1e6, "V/s", "mV"
    return 1.0, slope_unit, "mV" if unit == "V" else unit


def pretty(name: str) -> str:
    """Return the name of a fit with its indices below."""
    for plain_name, pretty in (("ADC_i", "ADC<sub>i</sub>"), ("ADC_o", "ADC<sub>o</sub>"), ("V_i", "V<sub>i</sub>"),
                               ("V_o", "V<sub>o</sub>"), ("t_a", "t<sub>a</sub>")):
        name = name.replace(plain_name, pretty)
    return name


def findings_table(findings: Sequence[Passage], caption: str) -> str:
    """Return corrections or disagreements, numbered."""
    rows = [[f"{k}. {pretty(f.place)}", pretty(f.remark), pretty(f.shown_by)]
            for k, f in enumerate(findings, start=1)]
    return table(["place", "what is done about it", "the number that shows it"], rows, caption=caption, text_columns=3)


def origins(study: PaperStudy) -> dict[str, int]:
    """Return how many parameters there are of each origin."""
    return dict(Counter(study.servo.source(name).origin for name in study.servo.names()))


def parameter_table(study: PaperStudy) -> str:
    """Return every parameter with value, range, origin and source."""
    rows = []
    for name in study.servo.names():
        quantity = study.servo.source(name)
        group, field_name = name.split(".")
        metadata = next(f.metadata for f in fields(GROUPS[group]) if f.name == field_name)
        value, spread = _shown(quantity, str(metadata["dimension"]))
        read = [key for key, model in MODELS.items() if name in (*model.requires, *model.optional)]
        broken = re.sub(r"([._])", r"\1<wbr>", escape(name))
        rows.append([f"<code>{broken}</code>", _symbol(str(metadata["symbol"])), value, spread,
                     f'<span class="{quantity.origin}">{quantity.origin}</span>',
                     escape(quantity.source or "no source: a prior to be identified"),
                     ", ".join(read) or "–"])
    return table(["parameter", "symbol", "value", "range or ± s.e.", "origin", "source", "read by"], rows,
                 caption=f"The servo file <code>{escape(study.servo.name)}</code>", text_columns=7)


def _shown(quantity: Quantity, dimension: str) -> tuple[str, str]:
    """Return value and spread with the unit in which a reader expects them."""
    value = quantity.value
    if not isinstance(value, float):
        return escape(str(value)), ""
    unit, printed = next(((unit, printed) for least, unit, printed in _READABLE.get(dimension, ())
                          if abs(value) >= least), (quantity.unit, quantity.unit))

    def shown(si: float) -> float:
        return float(units.from_si(si, unit, dimension))

    if quantity.std:
        best, error = with_error(shown(value), shown(quantity.std)).split(" ± ")
        return f"{best} {printed}".rstrip(), f"± {error}"
    spread = ""
    if quantity.lower is not None or quantity.upper is not None:
        low, high = ("…" if bound is None else number(shown(bound)) for bound in (quantity.lower, quantity.upper))
        spread = f"{low} to {high}"
    return f"{number(shown(value))} {printed}".rstrip(), spread


def _symbol(symbol: str) -> str:
    """Return a symbol such as F_ec1 with its index below."""
    return re.sub(r"_([A-Za-z0-9]+)", r"<sub>\1</sub>", escape(symbol))
