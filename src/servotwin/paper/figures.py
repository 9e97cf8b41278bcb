"""The pictures of the report, each with the numbers behind it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from servotwin import plotting
from servotwin.look import fixed
from servotwin.paper.reproduction import APPROACH_ROW, LABELS, BenchStudy, PaperStudy
from servotwin.plotting import Curve, Limit

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

Column = Sequence[float] | Sequence[str]


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """A figure of the report.

    Parameters
    ----------
    name : str
        Of its files, such as ``"figure-13"``.
    title, caption : str
        The caption is HTML.
    figure : Figure
    columns : mapping
        Drawn data, by column name with unit; empty for block diagrams.
    """

    name: str
    title: str
    caption: str
    figure: Figure
    columns: Mapping[str, Column] = field(default_factory=dict)

    def drawn(self, formats: Sequence[str]) -> Drawing:
        """Return it as the contents of files."""
        return Drawing(name=self.name, title=self.title, caption=self.caption, columns=self.columns,
                       width=float(self.figure.get_size_inches()[0]),
                       files={name: plotting.to_bytes(self.figure, name) for name in formats})


@dataclass(frozen=True, eq=False, kw_only=True)
class Drawing:
    """A picture that is drawn: the same, with its width [in] and the contents of its files by format."""

    name: str
    title: str
    caption: str
    columns: Mapping[str, Column]
    width: float
    files: Mapping[str, bytes]


_LAST = (0.65, 1.1)  # s: where the step of the two servos with a supply ends
_SAMPLED = "Drawn once a millisecond, so a shorter pulse of the pulse servo may be missing."
_BESIDE = 0.015  # of the horizontal axis, between bars that belong to one row
_NEAR = 4.0  # °: more than any standing band, so the approach itself is left out

# number of the figure or name -> (title, signal, label of the axis, unit in the column, caption)
_RESPONSES: tuple[tuple[str, str, str, str, str, str], ...] = (
    ("figure-13", "Figure 13: spindle position", "output_angle", "output angle $q$ (°)", "deg",
     "The paper's Figure 13. The command steps from 0 to 180° at 0.1 s."),
    ("figure-14", "Figure 14: spindle speed", "output_speed", r"output speed $\dot{q}$ (°/s)", "deg_per_s",
     "The paper's Figure 14. The averaged servo has no top speed; the two others have that of a motor at full supply "
     "voltage. Near the target the pulse servo goes from pulse to pulse."),
    ("figure-15", "Figure 15: torque at the spindle", "load_torque", r"spindle torque $\tau_L$ (N m)", "Nm",
     "The paper's Figure 15: the torque that the servo delivers to its load, here what accelerates an inertia. "
     + _SAMPLED),
    ("figure-16", "Figure 16: feedback voltage", "feedback_voltage", "feedback voltage $v_o$ (V)", "V",
     "The paper's Figure 16: the voltage of the potentiometer."),
    ("figure-armature-voltage", "Not in the paper: armature voltage", "armature_voltage",
     "armature voltage $v_a$ (V)", "V", ""),
)


def pictures(study: PaperStudy, progress: Callable[[float], None]) -> tuple[Picture, ...]:
    """Return all pictures; `progress` is called with the fraction that is drawn."""
    makers: list[Callable[[], Picture]] = [lambda row=row: _response(study, *row) for row in _RESPONSES]  # type: ignore[misc]
    makers += [lambda: _last_degrees(study), lambda: _feedback_over_position(study)]
    makers += [lambda number=number, row=row: _pulses(study, number, row)  # type: ignore[misc]
               for number, row in ((22, 0), (23, 2), (24, 4))]
    makers += [lambda: _over_voltage(study), lambda: _over_pulse(study), lambda: _over_angle(study),
               lambda: _standing(study)]
    makers += [lambda number=number: _diagram(number) for number in plotting.PAPER_DIAGRAMS]  # type: ignore[misc]
    done = []
    for k, make in enumerate(makers):
        progress(k / len(makers))
        done.append(make())
    return tuple(done)


def _response(study: PaperStudy, name: str, title: str, signal: str, label: str, unit: str, caption: str) -> Picture:
    time = study.steps["bounded"].time
    values = {model: plotting.shown(signal, step[signal]) for model, step in study.steps.items()}
    limits: list[Limit] = []
    if signal == "armature_voltage":
        limits = [Limit(f"supply, {study.supply:.3g} V", study.supply)]
        times = study.peak_voltage["averaged"] / study.supply
        caption = (f"What drives the curves above. (38) knows no supply: the printed model puts "
                   f"{study.peak_voltage['averaged']:.1f} V on a motor that {study.supply:.3g} V feed, "
                   f"<strong>{times:.1f} times the supply</strong>. The two others stop at "
                   f"{study.peak_voltage['bounded']:.2f} V, the supply less the drop of the bridge. {_SAMPLED}")
    if signal == "output_angle":
        limits = [Limit("command 180°", 180.0)]
    drawn = [Curve(LABELS[model], time, values[model]) for model in values]
    figure = plotting.curves(drawn, x_label="time (s)", y_label=label, limits=limits)
    columns: dict[str, Column] = {"time_s": time.tolist()}
    columns |= {f"{model}_{signal}_{unit}": values[model].tolist() for model in values}
    return Picture(name=name, title=title, caption=caption, figure=figure, columns=columns)


def _last_degrees(study: PaperStudy) -> Picture:
    """Draw how the servos that have a supply come to a stand, and the pulses that bring one of them there."""
    time = np.linspace(*_LAST, 2001)
    columns: dict[str, Column] = {"time_s": time.tolist()}
    angles, voltages = [], []
    for style, model in ((1, "bounded"), (2, "pulse")):
        q, v_a = (plotting.shown(name, study.steps[model].at(name, time))
                  for name in ("output_angle", "armature_voltage"))
        columns |= {f"{model}_output_angle_deg": q.tolist(), f"{model}_armature_voltage_V": v_a.tolist()}
        angles.append(Curve(LABELS[model], time, q, style=style))
        voltages.append(Curve("", time, v_a, style=style))
    figure = plotting.curves(angles, x_label="time (s)", y_label="output angle $q$ (°)",
                             below=voltages, below_label="$v_a$ (V)", height=4.0)
    caption = ("The end of the same step to 180°. The bounded servo gets a mean voltage, and comes to a stand where "
               "that is too weak for the friction. The pulse servo gets pulses of the full voltage, ever shorter "
               "ones, and each of them moves it.")
    return Picture(name="figure-last-degrees", title="Not in the paper: the last degrees", caption=caption,
                   figure=figure, columns=columns)


def _standing(study: PaperStudy) -> Picture:
    """Draw what is left to the target of one row, from below and from above, one curve for each model."""
    columns: dict[str, Column] = {}
    drawn = []
    for model, one in study.on_bench.items():
        target = math.degrees(one.rows[APPROACH_ROW].target_angle)
        time = one.approaches[0].time
        left = [plotting.shown("output_angle", run["output_angle"]) - target for run in one.approaches]
        columns["time_s"] = time.tolist()
        columns |= {f"{model}_from_{side}_deg": values.tolist()
                    for side, values in zip(("below", "above"), left, strict=True)}
        near = np.concatenate([left[0], [math.nan], left[1]])
        near[np.abs(near) > _NEAR] = math.nan
        drawn.append(Curve(LABELS[model], np.concatenate([time, [math.nan], time]), near))
    row = study.on_bench["pulse"].rows[APPROACH_ROW]
    edge = math.degrees(row.deadband_band)
    figure = plotting.curves(drawn, x_label="time (s)", y_label="angle less target (°)", height=3.4,
                             limits=[Limit(f"edge of the deadband, ±{edge:.2f}°", edge), Limit("", -edge)])
    angle = study.table["q_deg"][APPROACH_ROW]
    bounded = study.on_bench["bounded"].rows[APPROACH_ROW]
    caption = (f"How each standing band comes about, in the row of {angle:.0f}°: from 30° below and above. The bounded "
               f"servo stops {fixed(math.degrees(bounded.standing_band), 2)}° short. The pulse servo creeps on in ever "
               f"smaller steps; after 5 s it is {fixed(math.degrees(row.standing_band), 2)}° short, and inside the "
               "deadband nothing drives it.")
    return Picture(name="figure-standing", title=f"Not in the paper: coming to a stand at {angle:.0f}°",
                   caption=caption, figure=figure, columns=columns)


def _feedback_over_position(study: PaperStudy) -> Picture:
    angle, voltage = study.table["q_deg"], study.table["V_o_V"]
    columns: dict[str, Column] = {}
    drawn = []
    for model, step in study.steps.items():
        q, v_o = (plotting.shown(name, step[name]) for name in ("output_angle", "feedback_voltage"))
        columns |= {f"{model}_output_angle_deg": q.tolist(), f"{model}_feedback_voltage_V": v_o.tolist()}
        drawn.append(Curve(f"simulated, {LABELS[model]}", q, v_o))
    drawn.append(Curve("Table I", study.ranges["q_deg"], study.ranges["V_o_V"]))
    drawn.append(Curve("measured, Table II", angle, voltage, points=True, style=0))
    columns |= {"measured_q_deg": angle.tolist(), "measured_V_o_V": voltage.tolist(),
                "table_1_q_deg": study.ranges["q_deg"].tolist(), "table_1_V_o_V": study.ranges["V_o_V"].tolist()}
    figure = plotting.curves(drawn, x_label="output angle $q$ (°)", y_label="feedback voltage $v_o$ (V)", height=3.4)
    caption = ("The paper's Figure 17. All models share one potentiometer, so their lines coincide; it is calibrated "
               "with Table II. The line of Table I, the range that the paper states for analog servos, is steeper.")
    return Picture(name="figure-17", title="Figure 17: feedback voltage over position", caption=caption,
                   figure=figure, columns=columns)


def _pulses(study: PaperStudy, number: int, row: int) -> Picture:
    from servotwin import signals

    bench = study.on_bench["bounded"].bench
    voltage = float(study.table["V_i_V"][row])
    period = bench.generator.frame_period
    run = bench.run(signals.constant(voltage, unit="V"), 2.5 * period)
    edges = run.pulses.edges or ()
    widths = [bench.generator.width(count) for count in run.counts]
    angle = float(study.table["q_deg"][row])
    return Picture(
        name=f"figure-{number}", title=f"Figure {number}: pulses at {angle:.0f}°",
        caption=f"The paper's Figure {number}, from the bench's generator: V<sub>i</sub> = {voltage:.3f} V is read as "
                f"{run.counts[0]} counts and becomes {1e6 * widths[0]:.0f} µs at {1.0 / period:.3f} Hz "
                f"(Table II: {study.table['t_a_us'][row]:.0f} µs, {study.table['f_Hz'][row]:.0f} Hz).",
        figure=plotting.pulses(edges, widths, frame_period=period),
        columns={"rising_edge_s": list(edges), "falling_edge_s": [e + w for e, w in zip(edges, widths, strict=True)],
                 "pulse_width_us": [1e6 * w for w in widths]})


def _over_voltage(study: PaperStudy) -> Picture:
    return _comparison(study, "figure-25", "Figure 25: position over command voltage", "q(V_i)", "output_angle",
                       "command voltage $V_i$ (V)", "The paper's Figure 25.")


def _over_pulse(study: PaperStudy) -> Picture:
    test = study.fits["q(t_a)"].curvature
    return _comparison(study, "figure-26", "Figure 26: position over pulse width", "q(t_a)", "output_angle",
                       "pulse width $t_a$ (µs)",
                       f"The paper's Figure 26. The measured points bend: a parabola fits better than the line with "
                       f"p = {test.p_value:.3f}, and in the middle lies {test.sagitta:.1f}° off the chord between its "
                       "ends. The simulated servos are straight.")


def _over_angle(study: PaperStudy) -> Picture:
    worst = study.fits["V_o(q)"].line.max_residual
    return _comparison(study, "figure-27", "Figure 27: feedback voltage over position", "V_o(q)", "feedback_voltage",
                       "output angle $q$ (°)",
                       f"The paper's Figure 27. The measured points lie within {1e3 * worst:.1f} mV of the line.")


def _comparison(study: PaperStudy, name: str, title: str, fit_name: str, quantity: str, x_label: str,
                caption: str) -> Picture:
    """Draw measured points, their line and both simulated tables, and below how far all of these are off the line."""
    fit = study.fits[fit_name]
    is_angle = quantity == "output_angle"
    x, y = fit.x, fit.y
    scale, unit = (1.0, "°") if is_angle else (1e3, "mV")
    ends = np.array([x.min(), x.max()])
    drawn = [Curve("line through the measured points", ends, fit.line(ends), style=0)]
    below = []
    across_name, up_name = fit.x_column.name, fit.y_column.name
    columns: dict[str, Column] = {across_name: x.tolist(), f"measured_{up_name}": y.tolist(),
                                  f"line_{up_name}": fit.line(x).tolist()}
    for style, (model, one) in enumerate(study.on_bench.items(), start=1):
        across = _across(across_name, one)
        values = plotting.shown(quantity, [getattr(row.reading, quantity) for row in one.rows])
        bands = [math.degrees(row.standing_band) for row in one.rows] if is_angle else None
        columns |= {f"{model}_{across_name}": across.tolist(), f"{model}_{up_name}": values.tolist()}
        if bands is not None:
            columns[f"{model}_standing_band_deg"] = bands
        drawn.append(Curve(f"simulated, {LABELS[model]}", across, values, points=True, style=style))
        beside = (style - 2) * _BESIDE * (ends[1] - ends[0]) if is_angle else 0.0  # so that no bar hides another
        below.append(Curve("", across + beside, scale * (values - fit.line(across)), points=True, error=bands,
                           style=style))
    drawn.append(Curve("measured, Table II", x, y, points=True, style=0))
    below.append(Curve("", x, scale * (y - fit.line(x)), points=True, style=0))
    figure = plotting.curves(
        drawn, x_label=x_label, y_label="output angle $q$ (°)" if is_angle else "feedback voltage $v_o$ (V)",
        below=below, below_label=f"off the line ({unit})", height=4.4)
    if is_angle:
        caption += " Bars: the standing band, where the shaft stops coming from below and from above, set side by side."
    return Picture(name=name, title=title, caption=caption, figure=figure, columns=columns)


def _across(column: str, one: BenchStudy) -> NDArray[np.float64]:
    """Return what a simulated table has in the column of the horizontal axis."""
    if column == "V_i_V":
        return np.array([row.reading.command_voltage for row in one.rows])
    if column == "t_a_us":
        return np.array([1e6 * row.reading.pulse_width for row in one.rows])
    return np.array([math.degrees(row.reading.output_angle) for row in one.rows])


_DIAGRAM_TITLES = {
    2: ("a DC motor", "The paper's Figure 2: the motor alone."),
    4: ("a DC motor with a load behind a gear", "The paper's Figure 4. The hatched part is Figure 5."),
    5: ("the load seen from the motor's shaft", "The paper's Figure 5: the load's inertia and friction act on the "
        "motor through the gear."),
    6: ("the equivalent of Figure 4", "The paper's Figure 6: all inertia and friction at the motor's shaft."),
    8: ("the servo on a robot's joint", "The paper's Figure 8, with the friction of (37). The two offsets that the "
        "measured servo needs are added behind k<sub>p2</sub> and p."),
}


def _diagram(number: int) -> Picture:
    title, caption = _DIAGRAM_TITLES[number]
    return Picture(name=f"figure-{number:02d}", title=f"Figure {number}: {title}", caption=caption,
                   figure=plotting.block_diagram(number))
