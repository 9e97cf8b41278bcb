"""The tables of the report."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

from servotwin import units
from servotwin.look import escape, fixed, number, table, with_error
from servotwin.paper.study import LABELS, LOAD_INERTIA, MODELS, PaperStudy
from servotwin.parameters import GROUPS

if TYPE_CHECKING:
    from servotwin.bench import ModelShares
    from servotwin.paper.findings import Passage
    from servotwin.parameters import Quantity

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
        rows.append([_code(name), _symbol(str(metadata["symbol"])), value, spread,
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


def _code(name: str) -> str:
    """Return the name of a parameter, to be broken between its words only."""
    broken = re.sub(r"([._])", r"\1<wbr>", escape(name))
    return f"<code>{broken}</code>"


def _symbol(symbol: str) -> str:
    """Return a symbol such as F_ec1 with its index below."""
    return re.sub(r"_([A-Za-z0-9]+)", r"<sub>\1</sub>", escape(symbol))
