"""The report as one HTML page that needs nothing but itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin import __version__
from servotwin.look import document, escape, fixed, number, picture, plain
from servotwin.paper import linear, robots_page, tables, vibration_page
from servotwin.paper.findings import corrections, disagreements
from servotwin.paper.study import LABELS, LOAD_INERTIA, SERVO, BenchStudy, PaperStudy

if TYPE_CHECKING:
    from servotwin.paper.figures import Drawing
    from servotwin.paper.robots_page import RobotsPart

    Images = Mapping[str, Drawing]

_SECTIONS = (
    ("summary", "Summary"), ("values", "What the paper does not give"), ("step", "The step from 0 to 180°"),
    ("bench", "The bench"), ("measured", "Measured beside simulated"), ("fits", "Straight lines through Table II"),
    ("vibration", "The vibration of the first implementation"),
    ("robots", "The robots that it is for"),
    ("models", "Block diagrams and transfer functions"), ("corrections", "Corrections to the paper"),
    ("disagreements", "Disagreements and gaps in its data"), ("parameters", "Parameters and where they come from"),
    ("files", "Files beside this report"),
)


def page(study: PaperStudy, robots: RobotsPart, drawings: Sequence[Drawing]) -> str:
    """Return the whole report."""
    images = {drawn.name: drawn for drawn in drawings}
    parts = {
        "summary": _summary(study), "values": _values(study), "step": _step(study, images),
        "bench": _bench(study, images), "measured": _measured(study, images),
        "fits": _fits(study), "vibration": vibration_page.section(study, lambda names: _figures(names, images)),
        "robots": robots.words.replace(robots_page.FIGURES,
                                       _figures([drawn.name for drawn in robots.drawings], images)),
        "models": _models(study, images),
        "corrections": tables.findings_table(corrections(study), "What the equations need"),
        "disagreements": tables.findings_table(disagreements(study), "What the data say"),
        "parameters": _parameters(study), "files": _files(drawings),
    }
    contents = "".join(f'<li><a href="#{key}">{title}</a></li>' for key, title in _SECTIONS)
    body = "".join(f'<section id="{key}"><h2>{title}</h2>\n{parts[key]}</section>\n' for key, title in _SECTIONS)
    return document("A New Model for Analog Servo Motors: simulated again", f"""\
<h1>A New Model for Analog Servo Motors: simulated again</h1>
<p class="lead">The figures, tables and equations of C. Urrea and J. Kern, “A New Model for Analog Servo Motors.
Simulations and Experimental Results”, <cite>Canadian Journal on Automation, Control and Intelligent Systems</cite>
2(2), March 2011 (“the paper”), computed with servotwin {escape(__version__)} for the servo
<code>{escape(SERVO)}</code>. Numbers in round brackets are equations of the paper.</p>
<nav aria-label="Contents"><ol>{contents}</ol></nav>
{body}""")


def _summary(study: PaperStudy) -> str:
    peak = study.peak_voltage["averaged"]
    bounded, pulse = study.on_bench["bounded"], study.on_bench["pulse"]
    common, apart = (study.vibration.circuits[name].still for name in ("common", "separate"))
    cards = []
    for name, one in study.on_bench.items():
        cards.append((f"{fixed(math.degrees(one.worst('output_angle')), 2)}°, "
                      f"{fixed(1e3 * one.worst('feedback_voltage'), 1)} mV",
                      f"largest difference to Table II of the {escape(LABELS[name])}: angle, feedback voltage; pulse "
                      f"width {fixed(1e6 * one.worst('pulse_width'), 1)} µs, ADC<sub>o</sub> "
                      f"{one.worst('feedback_count'):.0f} counts"))
    cards += [
        (f"{fixed(peak, 1)} V = {fixed(peak / study.supply, 1)} × supply",
         "what the printed model puts on the motor in a step of 180°: (38) has no bound"),
        (f"{fixed(study.metrics['averaged'].rise_time, 2)} s against {fixed(study.metrics['bounded'].rise_time, 2)} s",
         "rise time of that step, printed model against a servo whose supply ends"),
        (f"{fixed(math.degrees(study.metrics['bounded'].slew_rate), 0)} °/s",
         f"top speed of the bounded and the pulse servo{_sheet_speed(study)}"),
        (f"± {fixed(math.degrees(bounded.widest), 2)}° against ± {fixed(math.degrees(pulse.widest), 2)}°",
         "how far from its target the shaft may stand, with the mean voltage of the pulses and with the pulses"),
        (f"{bounded.rows[0].reading.pulse_rate:.3f} Hz",
         "pulse rate of the bench, 1024 steps of 16 µs; the paper prints 61"),
    ]
    cards.append((f"{fixed(math.degrees(common.swing), 1)}° at {fixed(common.frequency, 0)} Hz against "
                  f"{fixed(math.degrees(apart.swing), 2)}°",
                  "swing of the shaft at a constant command, with servo and control circuit on one soft supply and "
                  "with separate ones"))
    listed = "".join(f"<li><b>{value}</b>{words}</li>" for value, words in cards)
    share = max(abs(s.rest) + abs(s.standing) for one in (bounded, pulse) for s in one.angle_shares)
    return f"""<ul class="numbers">{listed}</ul>
<ul><li>All five rows of Table II are met by all three models. What is left is the curvature of the measured angle over
pulse width; everything else together stays below {fixed(math.degrees(share), 2)}° for the bounded and the pulse servo.
The potentiometer and the command chain were calibrated with the same table, so this shows that the chain is consistent;
it is no independent test.</li>
<li>The static characteristic, which is what the paper measured, cannot tell the models apart. The step tells the
printed model from the others: it is
{fixed(study.metrics['bounded'].rise_time / study.metrics['averaged'].rise_time, 1)} times as fast, because its armature
voltage has no bound.</li>
<li>Where the shaft comes to a stand tells pulses from their mean: friction holds a servo of the mean voltage up to
{fixed(math.degrees(bounded.friction), 2)}° before the edge of its deadband, the pulse servo only
{fixed(math.degrees(pulse.friction), 2)}°. Until then the two move alike.</li>
<li>{len(corrections(study))} places of the equations need a correction or a remark, and {len(disagreements(study))}
places of the data disagree with each other or leave something out; each is listed with the number that shows
it.</li></ul>
"""


def _sheet_speed(study: PaperStudy) -> str:
    seconds = study.sheet_seconds_per_60deg
    return f" (the maker's sheet: {number(seconds)} s for 60°, {fixed(60.0 / seconds, 0)} °/s)" if seconds else ""


def _values(study: PaperStudy) -> str:
    count = tables.origins(study)
    words = ", ".join(f"{n} {origin}" for origin, n in sorted(count.items(), key=lambda item: -item[1]))
    return f"""<div class="note"><p><strong>The paper publishes no parameter values.</strong> It gives no number for
k<sub>a</sub>, k<sub>b</sub>, R<sub>a</sub>, L<sub>a</sub>, J<sub>m</sub>, B<sub>m</sub>, n, A, k<sub>s</sub>,
k<sub>p</sub>, p, F<sub>ec</sub> or k. Its simulated curves (Figures 13 to 17) therefore cannot be compared with the
ones here, curve for curve, and nothing here was tuned to look like them. What can be compared is Table II and Figures
22 to 27, which were measured.</p></div>
<p>The {sum(count.values())} values used here come from elsewhere: {words}. “Measured” is a least-squares fit to Table
II. “Datasheet” is the maker's sheet of the HS-755HB, or follows from it. “Assumed” is a prior that no source gives;
most have a range, and they have to be identified for a real unit. <a href="#parameters">The list</a> names each.</p>
"""


def _step(study: PaperStudy, images: Images) -> str:
    names = ("figure-13", "figure-14", "figure-15", "figure-16", "figure-armature-voltage", "figure-last-degrees",
             "figure-17")
    return f"""<p>The command goes from 0 to 180° at 0.1 s. The load is an inertia of {number(LOAD_INERTIA)} kg m²
(assumed; the paper does not say what its simulated servo carried). All models have the same servo file. The averaged
servo is the paper's model, (35) to (41) with the two offsets that the measured servo needs. The bounded servo has in
addition a supply that ends, a deadband, friction that holds, and end stops. The pulse servo does not average: in every
frame its bridge gives the full voltage for as long as the error asks, and brakes for the rest.</p>
<div class="figures">{_figures(names, images)}</div>
{tables.step_table(study)}"""


def _bench(study: PaperStudy, images: Images) -> str:
    apparatus = study.on_bench["bounded"].bench
    low, high = study.offsets
    servo = apparatus.model.servo
    before, after = study.value("electronics.bridge_gain"), servo.get("electronics.bridge_gain")
    gain = f"{fixed(before, 1)} to {fixed(float(after), 1)}" if isinstance(after, int | float) else "its value"
    return f"""<p>The simulated bench repeats the paper's: V<sub>i</sub> → 10-bit converter (2.5 V) → pulses → servo →
potentiometer → 10-bit converter → the seven readings of the display.</p>
<ul><li>The converter at the command has {fixed(apparatus.input_converter.gain, 1)} counts/V. Its zero offset is
<strong>identified from Table II</strong>: only from {fixed(low, 2)} to below {fixed(high, 2)} counts do the printed
V<sub>i</sub> give all five printed pulse widths; the middle, {fixed(study.offsets.middle, 2)}, is used.</li>
<li>The generator makes 16 m + 6 µs with m = ⌊(ADC<sub>i</sub> − 1)/6⌋ − 1, once in
{fixed(1e3 * apparatus.generator.frame_period, 3)} ms (inferred from the five rows).</li>
<li>The converter at the potentiometer is the fitted line ADC<sub>o</sub> = 432.65 V<sub>o</sub> − 44.1, rounded. It
is a description and no circuit.</li>
<li>The servo file is for frames of 20 ms. By the averaging theory A k<sub>s</sub> goes as 1/T<sub>f</sub>, so on the
bench A goes from {gain} V/V. The pulse servo needs no such rule: it takes the generator's frames and widths as they
come.</li>
<li>A servo stops short, from either side. Each angle is approached from 30° below and from 30° above (less where the
travel ends), with a wait until the shaft stands or for 5 s; a row is the mean, and half the difference is its
standing band. The smoothed friction (41) never quite stands, and the pulses move the shaft by ever smaller
steps: the averaged and the pulse servo are read while they still creep.</li></ul>
<div class="figures">{_figures(("figure-22", "figure-23", "figure-24"), images)}</div>
{tables.ranges_table(study)}"""


def _measured(study: PaperStudy, images: Images) -> str:
    shares = "".join(tables.model_shares_table(study, name) for name in study.on_bench)
    return f"""<div class="figures">{_figures(("figure-25", "figure-26", "figure-27"), images)}</div>
{tables.comparison_table(study)}
{tables.difference_table(study)}
<h3>How far from its target a servo may stand</h3>
<div class="figures">{_figures(("figure-standing",), images)}</div>
{tables.band_table(study)}
{_band_words(study)}
<h3>What the differences are made of</h3>
<p>The 16 µs steps move the measured and the simulated servo alike, so they are seen against a straight line over
V<sub>i</sub> and not between the two:</p>
{tables.measured_shares_table(study)}
<p>Between simulated and measured there remain: another pulse width than the printed one (none), the curvature that a
straight servo cannot have, an unequal stop from either side, and the calibration of the servo file (V<sub>o</sub> over
t<sub>a</sub> and V<sub>o</sub> over q, rounded, against q over t<sub>a</sub>). The shares add up.</p>
{shares}"""


def _band_words(study: PaperStudy) -> str:
    """Return what the bands say about the paper's points, and why pulses narrow them."""
    bounded, pulse = study.on_bench["bounded"], study.on_bench["pulse"]
    dead = study.shortest_pulse
    swallowed = dead / (study.value("electronics.stretcher_gain") * study.value("electronics.one_shot_slope")
                        * study.value("potentiometer.feedback_gain"))
    return f"""<p>The paper does not say from which side its angles were approached. Its points lie within
{fixed(study.fits['q(V_i)'].line.max_residual, 1)}° of a line, yet a servo that gets the mean of its pulses may stop
anywhere within ± {fixed(math.degrees(bounded.widest), 1)}°. <strong>The pulse servo, with the same parameters, stops
within ± {fixed(math.degrees(pulse.widest), 2)}°: its band is {fixed(bounded.widest / pulse.widest, 1)} times
narrower.</strong> The electrical deadband is the same for both; the share of friction falls from ±
{fixed(math.degrees(bounded.friction), 2)}° to ± {fixed(math.degrees(pulse.friction), 2)}°, and the longer one waits,
the less remains of it.</p>
<p>The reason: a pulse, however short, has the full voltage, good for {number(study.full_torque, 3)} N m at a shaft at
rest, against {number(study.friction_torque, 2)} N m of dry friction. So every pulse moves the shaft, while the mean of
short pulses moves nothing. The wide band is a property of the mean and not of the servo; the paper's points do not ask
for a higher loop gain.</p>
<p>A narrow band leaves less to chance. The band of the bounded servo holds {_inside(bounded)} of the five measured
angles, so that friction alone might have bent the line through them; the band of the pulse servo holds
{_inside(pulse)}. With pulses the bend is not where friction happened to hold the shaft, and the paper says nothing of
what else it may be: the potentiometer, the one-shot, or the reading of the dial.</p>
<p>All this holds for the values of the servo file, most of which are not measured. The armature
inductance, which this servo neglects, would swallow pulses of less than about {fixed(1e6 * dead, 0)} µs:
{fixed(math.degrees(swallowed), 2)}° more.</p>"""


def _inside(one: BenchStudy) -> str:
    """Return how many measured angles lie within the standing band of the simulated row."""
    count = sum(abs(d.output_angle) <= row.standing_band for d, row in zip(one.differences, one.rows, strict=True))
    return "none" if count == 0 else "all" if count == len(one.rows) else f"{count}"


def _fits(study: PaperStudy) -> str:
    curved = [tables.pretty(name) for name, fit in study.fits.items() if fit.curvature.p_value < 0.05]
    verdict = f"At the 5 % level curved: {', '.join(curved)}." if curved else "None is curved at the 5 % level."
    return f"""{tables.fits_table(study)}<p>Five points leave three degrees of freedom to a line and two to a
parabola. p is the probability of such an F or a larger one if the truth were straight. {verdict}</p>
"""


def _models(study: PaperStudy, images: Images) -> str:
    parts = ["<p>The paper's diagrams, redrawn, with their transfer functions. The numbers are those of the servo "
             "file; dry friction has no transfer function and is left out.</p>"]
    for which, formulas in linear.FORMULAS.items():
        lines = [f"<p>{linear.formula(text)}<span>{equation}</span></p>" for equation, text in formulas]
        numeric = linear.numeric(study, which)
        if numeric is not None:
            poles = ", ".join(_pole(p) for p in numeric.poles if p.imag >= 0.0)
            shown = linear.formula(numeric.text)
            lines.append(f"<p>{shown}<span>{numeric.words}; poles (1/s): {poles}</span></p>")
        after = f'<div class="formulas">{"".join(lines)}</div>'
        parts.append(_figure(images[f"figure-{which:02d}"], after=after, wide=True))
    return "\n".join(parts)


def _pole(p: complex) -> str:
    if abs(p.imag) < 1e-9 * max(abs(p), 1.0):
        return fixed(p.real, 1) if p.real else "0"
    return f"{fixed(p.real, 1)} ± {fixed(p.imag, 1)} j"


def _parameters(study: PaperStudy) -> str:
    return f"""<p>No value here is one of the paper's authors. A range belongs to an assumed or derived value, ± one
standard error to a fitted one.</p>
{tables.parameter_table(study)}"""


def _files(drawings: Sequence[Drawing]) -> str:
    formats = " and ".join(name.upper() for name in drawings[0].files)
    return f"""<p>Beside this page lie {len(drawings)} pictures as {formats} in <code>figures/</code>, and the numbers
behind each plot in <code>data/</code>, with the unit in every column's name: one CSV file per plot,
<code>table-2.csv</code> (measured and simulated), <code>fits.csv</code> and <code>parameters.csv</code>.</p>
<p>Made by <code>servotwin paper</code>.</p>
"""


def _figures(names: Sequence[str], images: Images) -> str:
    return "\n".join(_figure(images[name]) for name in names)


def _figure(made: Drawing, *, after: str = "", wide: bool = False) -> str:
    image = picture(made.files["png"], f"{made.title}. {plain(made.caption)}", kind="drawing", media="image/png",
                    style=f"--w:{96.0 * made.width:.0f}px" if wide else "")
    kind = ' class="wide"' if wide else ""
    return (f'<figure{kind} id="{made.name}"><div>{image}</div>\n{after}<figcaption><b>{made.title}.</b> '
            f"{made.caption}</figcaption></figure>")
