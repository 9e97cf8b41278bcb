"""The report of a fit: one HTML page that needs nothing but itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.identification.fitting.fit import LINEARISED_TIMES
from servotwin.identification.fitting.traces import fit_percent
from servotwin.identification.report import pictures as report_pictures
from servotwin.identification.report.pictures import (
    MODELS,
    dimension_of_free,
    error_shown,
    error_unit,
    estimate_lines,
    percent,
    rig_text,
    sensor_dimension,
    share_text,
    tables_of,
)
from servotwin.identification.report.pictures import error_rows as error_bars
from servotwin.look import (
    escape,
    figure_in,
    label_of,
    number,
    pages,
    picture,
    readable,
    to_bytes,
    unit_for,
)
from servotwin.look.reports import Cards, Html, Part, Picture, Report, Section, Table
from servotwin.parameters import write_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from servotwin.identification.arms.arm_fit import ArmFit
    from servotwin.identification.fitting.fit import Fit, Ladder, Validation
    from servotwin.identification.fitting.residual_noise import CrossCorrelation
    from servotwin.identification.fitting.traces import ErrorTable, Trace
    from servotwin.robots import RobotValidation


# --- The tables of a fit's report -------------------------------------------------------------------------------------

def estimates(fit: Fit) -> Table:
    """Return the estimates with intervals, and what the servo said before."""
    rows = [(line.name, line.value, line.interval, line.unit, line.method if line.interval != line.method else "",
             line.prior, "rig" if line.nuisance else line.sheet) for line in estimate_lines(fit)]
    return Table(("parameter", "value", f"{100 * fit.level:g} % interval", "unit", "found by", "prior", "before"), rows,
                 "“Before” is the value of the servo file; delay and angle offset belong to the rig. “Prior”: how much "
                 "of what is known is the servo file's range or a prior that was given, not data.", kind="names")


def _yielded(fit: Fit) -> list[Part]:
    """Return the priors that were dropped beside what the logs say; nothing where there are none."""
    rows = []
    for one in fit.yielded:
        dimension = dimension_of_free(one.name)
        unit = unit_for(one.logs or one.file, dimension)
        known = math.isfinite(one.logs_std)
        rows.append([one.name, figure_in(one.file, unit, dimension), figure_in(one.file_std, unit, dimension),
                     figure_in(one.logs, unit, dimension, within=one.logs_std) if known else "–",
                     *(figure_in(x, unit, dimension, within=one.logs_std) if known else "–"
                       for x in (one.logs_lower, one.logs_upper)), label_of(unit), f"{one.apart:.2g}"])
    head = ("parameter", "prior", "±", "logs", f"{100 * fit.level:g} % from", "to", "unit", "standard errors apart")
    words = "Priors that the logs contradict: the fit goes without them."
    return [Table(head, rows, words, kind="names")] if rows else []


def causes(fit: Fit) -> list[Table]:
    """Return the candidates that explain a bad verdict, the best first; nothing without any."""
    if fit.verdict is None or not fit.verdict.causes:
        return []
    factor, unit = error_unit(next(iter(fit.verdict.noise)))
    rows = [(cause.name, f"{cause.before * factor:.3g}", f"{cause.after * factor:.3g}", cause.remedy)
            for cause in fit.verdict.causes]
    return [Table(("cause", f"error ({unit})", f"with it ({unit})", "what to do"), rows,
                  "Rms errors without a cause and with it, on parts of the logs that took no part in its trial.")]


def errors(tables: Mapping[str, ErrorTable], traces: Sequence[Trace], label: str) -> Table:
    """Return rms errors by the values of a label, of all models; tables without names have no column of them."""
    models = next(iter(tables.values())).models
    factor, unit = error_shown(traces)
    rows = [(row.value, row.which, *(_error(row.errors.get(model, math.nan) * factor) for model in models),
             percent(row.fits.get(models[0], math.nan))) for row in error_bars(tables, label)]
    rows += [("all", which, *(_error(held.total().get(model, math.nan) * factor) for model in models),
              percent(held.total(fit_percent)[models[0]])) for which, held in tables.items()]
    words = label.replace("_", " ")
    head = (words, "logs", *(f"{MODELS.get(name, name)} ({unit})" for name in models), "fit (%)")
    if not any(tables):
        head, rows = (head[0], *head[2:]), [(row[0], *row[2:]) for row in rows]
    return Table(head, rows, f"Rms error by {words}, over all samples; fit of the servo.", 2 if any(tables) else 1)


def logs(tables: Mapping[str, ErrorTable], traces: Sequence[Trace], most: int | None = None) -> Table:
    """Return the errors log by log, the worst ones first; perhaps so many."""
    signals = {trace.log.name: trace.signal for trace in traces}
    every = [(error, which) for which, held in tables.items() for error in held.errors[held.models[0]]]
    every.sort(key=lambda item: -item[0].rms if math.isfinite(item[0].rms) else math.inf)
    rows = []
    for error, which in every[:most]:
        factor, unit = error_unit(signals.get(error.log, "output_angle"))
        rows.append((error.log, error.motion or "other", *([which] if any(tables) else []),
                     f"{_error(error.rms * factor)} {unit}", f"{_error(error.largest * factor)} {unit}",
                     percent(error.fit_percent), str(error.samples)))
    left = f" ({most} worst of {len(every)})" if most is not None and len(every) > most else ""
    return Table((f"log{left}", "motion", *(["part"] if any(tables) else []), "rms error", "largest", "fit (%)",
                  "samples"), rows, text_columns=3 if any(tables) else 2)


def _starts(fit: Fit) -> Table:
    """Return where the searches from all starts ended."""
    best = min((start.cost for start in fit.starts), default=math.nan)
    rows = [(str(k), number(start.cost), number(start.cost / best if best else math.nan, 3),
             "yes" if start.converged else "no") for k, start in enumerate(fit.starts, 1)]
    return Table(("start", "cost", "times the best", "converged"), rows,
                 "Cost: half the sum of squared residuals in units of noise, large ones in proportion only where the "
                 "loss is Huber's. With several starts these are the rough searches on some logs.")


def rungs(ladder: Ladder) -> Table:
    """Return all fits of a ladder, and which one is chosen."""
    factor, unit = error_shown(ladder.fit.traces)
    rows = [(rung.name, str(len(rung.fit.space)), _error(rung.training * factor), _error(rung.holdout * factor),
             f"{rung.criterion:.1f}", ", ".join(["chosen"] * (rung.name == ladder.chosen)
                                                + ["overfitted"] * rung.overfits)) for rung in ladder.rungs]
    what = "structure" if "," in ladder.chosen else "friction"
    return Table((what, "parameters", f"fitted ({unit})", f"held out ({unit})", "information criterion", ""), rows)


def chosen(ladder: Ladder) -> list[str]:
    """Return which fit of a ladder is chosen and why, and the error that the choice did not see."""
    said = [f"{ladder.chosen}: {ladder.reason}"]
    if math.isfinite(ladder.error):
        factor, unit = error_shown(ladder.fit.traces)
        halves = (f" (held-out logs in two halves, which choose {' and '.join(ladder.choices)})" if ladder.choices
                  else "")
        said.append(f"error on logs that had no say in the choice: {ladder.error * factor:.3g} {unit}{halves}")
    return said


def _bounds(fit: Fit) -> Table:
    """Return bounds, prior and end of every searched parameter."""
    rows = []
    for p in fit.space.parameters:
        dimension = dimension_of_free(p.name)
        unit = unit_for(fit.estimates[p.name] or p.start, dimension)
        prior = "–" if p.prior is None else f"{figure_in(p.prior[0], unit, dimension, within=p.prior[1])} ± " \
                                            f"{figure_in(p.prior[1], unit, dimension)}"
        rows.append((p.name, figure_in(p.lower, unit, dimension), figure_in(p.upper, unit, dimension), prior,
                     label_of(unit), "at a bound" if p.name in fit.at_bound else "inside"))
    return Table(("parameter", "from", "to", "prior", "unit", "ended"), rows, kind="names")


def _settings(fit: Fit) -> Table:
    """Return what was fitted, and by what."""
    record = fit.servo.fit
    noise = ", ".join(f"{name.replace('_', ' ')} {readable(value, sensor_dimension(name))}"
                      for name, value in fit.noise.items())
    doubt = fit.doubt
    return Table(("setting", "value"), [
        ("servo", f"{fit.servo.title or fit.servo.name} ({fit.servo.name})"),
        ("model", type(fit.model).__name__),
        ("logs", f"{len(fit.traces)}, of which {sum(t.held_out for t in fit.traces)} held out"),
        ("data", str(record.get("data", "–"))),
        ("version", f"servotwin {record.get('version', '')}"),
        ("noise of the residuals (σ)", noise),
        ("intervals", "none" if doubt is None else
         f"{100 * fit.level:g} %, {doubt.method}, standard errors {doubt.inflation:.2g} times those of independent "
         f"residuals (correlation of neighbours {doubt.autocorrelation:.2f})"),
        ("time", f"{fit.seconds:.3g} s")], text_columns=2)


def _error(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"


# --- Common parts of the reports of fits and validations: frames of pictures, errors, and logs side by side -----------

_MOST_LOGS = 21  # that are drawn folded
STYLE = """
.logs figure{margin:.7rem 0}#logs figure{padding:.4rem}#logs figure.held{border-color:#d55e00;background:#fff6ef}
#logs figcaption{margin:0 0 .2rem;color:var(--ink);font-size:.85rem;overflow-wrap:anywhere}
.tag{border-radius:4px;padding:0 .35rem;font-size:.8rem;background:#d55e00;color:#fff;white-space:nowrap}
.key{display:inline-block;width:1.6rem;border-top:3px solid;vertical-align:middle;margin:0 .3rem 0 .8rem}
.names td:first-child{font-family:ui-monospace,Consolas,monospace;font-size:.9em}
figure img.drawing{width:100%;max-width:42rem}#logs figure img{width:100%}
.verdict{font-size:1.1rem}.good{border-left-color:#009e73;background:#f0faf6}
details{margin:.8rem 0}summary{cursor:pointer;color:var(--blue)}
@media print{#logs figure{break-inside:avoid}
figure img.drawing{max-width:27rem}}
"""


def space(unit: str) -> str:
    """Return a unit with the space before it that it needs."""
    return unit if unit == "°" else f" {unit}"


def errors_section(tables: Mapping[str, ErrorTable], traces: Sequence[Trace], words: str) -> list[Part]:
    """Return pictures and tables of the errors, by motion and by every other label; `words` say how they were found."""
    factor, unit = error_shown(traces)
    parts: list[Part] = []
    for label in dict.fromkeys(label for each in tables.values() for label in each.labels()):
        values = {value for each in tables.values() for value in each.by(label)}
        if len(values) > 1 or label == "motion":
            drawn = pages(len(values), report_pictures.VALUES_A_PAGE)
            parts.append(Picture(partial(_error_pictures, tables, label, factor, unit, drawn),
                                 f"Rms error by {escape(label.replace('_', ' '))}. {words}"))
        parts.append(errors(tables, traces, label))
    return [*parts, Html(f"<details><summary>Log by log</summary>{logs(tables, traces).html}</details>\n")]


def _error_pictures(tables: Mapping[str, ErrorTable], label: str, factor: float, unit: str,
                    drawn: Sequence[int]) -> list[Figure]:
    return [report_pictures.errors(tables, label, factor, unit, page) for page in drawn]


def trace_list(traces: Sequence[Trace]) -> str:
    """Return measured and simulated log by log: the worst, the middle and the best open, the others folded."""
    first = report_pictures.shown_first(traces)
    others = [trace for trace in report_pictures.by_error(traces) if not any(trace is one for one in first)]
    mixed = len({trace.held_out for trace in traces}) > 1
    lines = (("#999", "measured"), ("#0072b2", "simulated"), ("#d55e00", "simulated − measured"))
    key = ('<p>' + "".join(f'<span class="key" style="border-color:{colour}"></span>{words}' for colour, words in lines)
           + '. Below each: the yellow window, in which they differ most'
           + (' &nbsp; <span class="tag">held out</span> not fitted</p>' if mixed else "</p>"))
    note = ("<p>The log that is furthest off, the one in the middle and the nearest; all others are folded below.</p>\n"
            if others else "")
    drawn = "".join(_one(trace, tagged=mixed and trace.held_out) for trace in first)
    kept = others[:_MOST_LOGS]
    folded = "".join(f"<details><summary>{_caption(trace, tagged=mixed and trace.held_out)}</summary>"
                     f"{_one(trace, tagged=mixed and trace.held_out)}</details>\n" for trace in kept)
    left = (f"<p>{len(others) - len(kept)} further logs, nearer than these, are in the table of errors only.</p>\n"
            if len(others) > len(kept) else "")
    return f'{key}{note}<div class="logs">{drawn}</div>\n{folded}{left}'


def _caption(trace: Trace, *, tagged: bool) -> str:
    factor, unit = error_unit(trace.signal)
    rms = math.sqrt(float((trace.residual**2).mean())) * factor
    tag = ' <span class="tag">held out</span>' if tagged else ""
    kind = f", {escape(trace.log.motion)}" if trace.log.motion else ""
    return f"<b>{escape(trace.log.name)}</b>{kind}: {number(rms, 3)}{space(unit)} rms{tag}"


def _one(trace: Trace, *, tagged: bool) -> str:
    drawn = picture(to_bytes(report_pictures.beside(trace), "svg"), f"{trace.log.name}, measured and simulated")
    kind = ' class="held"' if tagged else ""
    return f"<figure{kind}><figcaption>{_caption(trace, tagged=tagged)}</figcaption><div>{drawn}</div></figure>\n"


def residuals(traces: Sequence[Trace], noise: Mapping[str, float], command: CrossCorrelation | None = None) -> Picture:
    """Return the picture of what is left; of logs that were fitted with what the verdict says of the command before."""
    return Picture(lambda: [report_pictures.residuals(traces, noise, command)],
                   "Simulated less measured, in units of each sensor's noise σ. From above: over time; their "
                   "distribution beside the normal law; how far residuals follow each other; how far they follow the "
                   "command of some time before, both filtered so that noise has no memory. Grey: where 99 of 100 lags "
                   "lie if what is left is noise.")


# --- The report of a validation: one HTML page that needs nothing but itself ------------------------------------------

def write_validation(found: Validation, path: Path, *, overwrite: bool = False) -> Path:
    """Write the report of a validation.

    Raises
    ------
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    write_file(path, validation_page(found).encode(), overwrite=overwrite)
    return Path(path)


def validation_page(found: Validation) -> str:
    """Return the report as HTML."""
    name, count = found.servo.title or found.servo.name, len(found.traces)
    lead = (f"{escape(type(found.model).__name__)}, <code>{escape(found.servo.name)}</code>. No parameter was fitted "
            "here.")
    return Report(f"{name}: validated on {_count(count, 'log')}", lead, [
        Section("Summary", _validation_summary(found), key="summary"),
        Section("Errors", errors_section({"": found.errors}, found.traces, "Every log starts where it was measured."),
                key="errors"),
        Section("Measured and simulated", [Html(trace_list(found.traces))], key="logs"),
        Section("What is left", [residuals(found.traces, found.noise)], key="residuals")],
        style=STYLE, contents=True).page


def _validation_summary(found: Validation) -> list[Part]:
    factor, unit = error_shown(found.traces)
    errors = found.errors.errors[type(found.model).__name__]
    told = percent(found.errors.total(fit_percent)[found.errors.models[0]])
    worst = max(errors, key=lambda error: error.rms)
    cards = [(f"{number(found.total * factor, 3)}{space(unit)}", f"rms error over all samples (fit {told} %)"),
             (f"{number(worst.rms * factor, 3)}{space(unit)}", f"rms error of the worst log, {worst.log}"),
             (f"{number(max(error.largest for error in errors) * factor, 3)}{space(unit)}", "largest error of all")]
    for name, value in found.nuisance.items():
        how = "fitted to these logs" if name in found.fitted else "as the servo file's fit recorded it"
        cards.append((rig_text(name, value), how))
    return [Cards(cards), *map(_note, found.warnings)]


def _note(text: str) -> Html:
    return Html(f'<div class="note"><p>{escape(text)}</p></div>\n')


# --- The report of a fit: one HTML page that needs nothing but itself -------------------------------------------------

def write_report(fit: Fit, path: Path, *, ladder: Ladder | None = None, overwrite: bool = False) -> Path:
    """Write the report of a fit.

    Parameters
    ----------
    fit : Fit
    path : Path
        Of the HTML file.
    ladder : Ladder, optional
        Of friction laws or structures, of which this fit is one.
    overwrite : bool
        Whether a file that is there may be replaced.

    Returns
    -------
    Path

    Raises
    ------
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    write_file(path, page(fit, ladder).encode(), overwrite=overwrite)
    return Path(path)


def page(fit: Fit, ladder: Ladder | None = None) -> str:
    """Return the report as HTML."""
    held = sum(trace.held_out for trace in fit.traces)
    lead = (f"{escape(type(fit.model).__name__)}, {_count(len(fit.space), 'searched parameter')}, "
            f"{_count(held, 'log')} held out. Everything on this page follows from the data "
            f"<code>{escape(_short(fit))}</code>.")
    compared = [] if ladder is None else [
        Section("What was compared", [rungs(ladder), *(f"{text}." for text in chosen(ladder))], key="structures")]
    return Report(f"{fit.servo.title or fit.servo.name}: fitted to {_count(len(fit.traces), 'log')}", lead, [
        *([Section("Verdict", _verdict(fit), key="verdict")] if fit.verdict is not None else []),
        Section("Summary", _summary(fit), key="summary"),
        Section("Parameters", [*_forest(fit), estimates(fit), *_yielded(fit)], key="estimates"),
        Section("What the logs cannot say", [Html(_unknown(fit))], key="unknown"), *compared,
        Section("Errors beside simpler models", errors_section(
            tables_of(fit), fit.traces, "Logs that were held out were simulated with the fitted servo, started where "
            "they were measured."), key="errors"),
        Section("Measured and simulated", [Html(trace_list(fit.traces))], key="logs"),
        Section("What is left", _residuals(fit), key="residuals"),
        Section("Correlation of the estimates", [_correlation(fit)], key="correlation"),
        Section("The search", [_starts(fit), Html("<h3>Bounds and priors</h3>"), _bounds(fit),
                               Html("<h3>Settings</h3>"), _settings(fit)], key="search"),
        Section("How to read this page", [Html(_reading(fit))], key="reading")], style=STYLE, contents=True).page


def _short(fit: Fit) -> str:
    return str(fit.servo.fit.get("data", ""))[:19]


def _count(number_of: int, what: str) -> str:
    return f"{number_of} {what}{'' if number_of == 1 else 's'}"


def _verdict(fit: Fit) -> list[Part]:
    """Return the verdict in a box, green where it holds, and the causes that were tried."""
    if fit.verdict is None:
        return []
    good = " good" if fit.verdict.holds else ""
    words = escape(fit.verdict.sentence[:1].upper() + fit.verdict.sentence[1:])
    return [Html(f'<div class="note verdict{good}"><p><strong>{words}.</strong></p></div>\n'), *causes(fit)]


def _summary(fit: Fit) -> list[Part]:
    factor, unit = error_shown(fit.traces)
    cards = []
    for errors, words in ((fit.holdout, "rms error on logs that were held out"),
                          (fit.training, "rms error on fitted logs")):
        if errors:
            total = errors.total()
            own, *others = errors.models
            beside = "; ".join(f"{name} {number(total[name] * factor, 3)}{space(unit)}" for name in others)
            words += f" (fit {percent(errors.total(fit_percent)[own])} %)"
            words += f". Beside: {beside}" if beside else ""
            cards.append((f"{number(total[own] * factor, 3)}{space(unit)}", words))
    known = [line for line in estimate_lines(fit) if line.interval != line.method and not line.nuisance]
    cards.append((f"{len(known)} of {len(fit.space)}", "searched parameters have an interval"))
    widest = _widest(fit)
    if widest:
        cards.append((f"± {share_text(widest[1])}", f"widest of these intervals: {widest[0]}"))
    if len(fit.starts) > 1:
        number_of, words = fit.searches
        cards.append((f"{number_of} of {len(fit.starts)}", words))
    said = [_note(text) for text in fit.warnings if fit.verdict is None or text != fit.verdict.sentence]
    if fit.interrupted:
        nothing = "" if known else ", and there are no intervals"
        said.insert(0, Html('<div class="note"><p><strong>The fit was interrupted.</strong> This is the best that it '
                            f"had found; there may be better values{nothing}.</p></div>\n"))
    return [Cards(cards), *said]


def _widest(fit: Fit) -> tuple[str, float] | None:
    """Return the parameter with the widest interval, and half of it relative to its value."""
    found = {}
    for name in fit.space.names:
        interval, value = fit.intervals()[name], fit.estimates[name]
        if math.isfinite(interval.lower) and value:
            found[name] = 0.5 * (interval.upper - interval.lower) / abs(value)
    return max(found.items(), key=lambda item: item[1]) if found else None


def _forest(fit: Fit) -> list[Part]:
    forest = report_pictures.forest(fit)
    return [] if forest is None else [Picture(
        lambda: [forest], f"Estimates and {100 * fit.level:g} % intervals. Grey: what the servo file's own spread "
        "allows (95 %). An open diamond has no interval.")]


def _unknown(fit: Fit) -> str:
    parts = []
    if fit.unidentifiable:
        items = "".join(f"<li>{escape(str(item))}.</li>" for item in fit.unidentifiable)
        parts.append("<p>These numbers have no interval. The values shown are one possibility of many: use them "
                     f"together only, and under conditions like those of the logs.</p><ul>{items}</ul>")
    stuck = [name for name in fit.at_bound if name in fit.space.names]
    if "delay" in fit.at_bound and fit.estimates["delay"] == 0.0:
        parts.append("<p>No delay is seen: it ended at 0.</p>")
    if stuck:
        names = ", ".join(f"<code>{escape(name)}</code>" for name in stuck)
        parts.append(f'<div class="note"><p>At a bound of the search: {names}. The logs want more than '
                     "the bound allows; widen it, or ask what the model lacks.</p></div>")
    if fit.doubt is None:
        parts.append("<p>This fit was made without intervals, so it does not say what is determined.</p>")
    return "\n".join(parts) or ('<div class="note good"><p>Every searched number is determined, none stands at a '
                                "bound.</p></div>")


def _residuals(fit: Fit) -> list[Part]:
    drawn = residuals(fit.traces, fit.noise, None if fit.verdict is None else fit.verdict.command)
    if fit.doubt is None:
        return [drawn]
    if fit.doubt.method == "independent residuals":
        words = "Neighbouring residuals are independent."
    else:
        words = (f"Neighbouring residuals follow each other (correlation {number(fit.doubt.autocorrelation, 2)}). The "
                 f"intervals allow for that ({fit.doubt.method}; {number(fit.doubt.inflation, 2)} times as "
                 "wide as for independent residuals), but not for a model that is wrong in the mean.")
    if fit.verdict is not None:
        sensor = next(iter(fit.verdict.noise))
        factor, unit = error_unit(sensor)
        words += (f" They are {number(fit.verdict.ratio, 2)} times the noise that needs no model, "
                  f"{number(fit.verdict.noise[sensor] * factor, 2)}{space(unit)}.")
    return [drawn, words]


def _correlation(fit: Fit) -> Part:
    drawn = report_pictures.correlation(fit)
    if drawn is None:
        return "Fewer than two numbers have an interval, so there is nothing to correlate."
    return Picture(lambda: [drawn], "Blue: two estimates are high together. Orange: one is high where the other is "
                   "low. Near ±1 the logs hardly tell the two apart. Numbers without an interval are left out.")


def _reading(fit: Fit) -> str:
    level = f"{100 * fit.level:g} %"
    return f"""<ul>
<li><b>Interval.</b> If the model is right, {level} of such intervals hold the true value. “Normal”: the cost is a
parabola near its minimum. “Profile”: it is not, so the ends were found by fixing the number and fitting all
others. “Linearised”: the fit was stopped; the ends are those of the problem made straight at the best so far,
{LINEARISED_TIMES:g} times as wide, and beyond where a whole step would lead.</li>
<li><b>Held out.</b> These logs took no part in the fit. Their error is what to expect of the next log of that kind. An
error that is much smaller on fitted logs means that the others show what these do not, or that these are too few.</li>
<li><b>Fit (%).</b> 100 (1 − |y − ŷ|/|y − ȳ|): 100 is all of the measured motion, 0 no more than its mean.</li>
<li><b>Verdict.</b> Residuals beside noise that needs no model: of a shaft that stands, of neighbouring samples, of
counts; and whether they follow the command of up to a second before. Causes are tried on a few logs; their errors are
those of samples that took no part in the trial.</li>
<li><b>Simpler models.</b> “delay + slew + lag” has no physics. “M1” is this servo with Coulomb and viscous friction
only. What does not beat them is not worth its parameters.</li>
<li><b>At a bound, not determined.</b> Such a number is not measured by these logs. Do not carry it to another
servo.</li>
<li><b>Rig.</b> Delay and angle offset describe how the logs were taken. A start angle belongs to each log.</li></ul>
"""


# --- The report of a robot's fit: one HTML page that needs nothing but itself -----------------------------------------

def write_arm_report(fit: ArmFit, path: Path, *, overwrite: bool = False) -> Path:
    """Write the report of a robot's fit; raises if the file exists and may not be replaced."""
    write_file(path, arm_page(fit).encode(), overwrite=overwrite)
    return Path(path)


def arm_page(fit: ArmFit, pictures: Sequence[Part] = ()) -> str:
    """Return the report as HTML; `pictures` are figures that stand beside it."""
    title = "The servos of a robot, from its episodes"
    said = [*(cause.sentence for cause in fit.causes), *map(str, fit.unidentifiable), *map(str, fit.left_out),
            *fit.warnings]
    return Report(title, f"{escape(fit.sentence)}.", [
        Section("Joint by joint", [Table(*error_rows(fit), "Simulated less measured angle, rms (°)"), *pictures]),
        Section("What was found", [
            Table(("number", "value", f"{100 * fit.level:g} % interval", "known"), estimate_rows(fit), text_columns=4),
            Html(_READING)])], said).page


def degrees(value: float) -> str:
    """Return an angle [rad] in degrees."""
    return "–" if math.isnan(value) else f"{math.degrees(value):.2f}"


def error_rows(fit: ArmFit) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of the errors of all joints, fitted and unseen, before and after [deg]."""
    columns: list[tuple[str, RobotValidation]] = [("fitted, before", fit.before), ("fitted", fit.training)]
    if fit.holdout is not None and fit.before_holdout is not None:
        columns += [("unseen, before", fit.before_holdout), ("unseen", fit.holdout)]
    rows = [[joint, *(degrees(found.errors["servos"][joint]["all"].rms) for _, found in columns),
             degrees(fit.noise[joint])] for joint in fit.training.joints]
    return ["joint", *(name for name, _ in columns), "noise"], rows


def estimate_rows(fit: ArmFit) -> list[list[str]]:
    """Return a row for each number: name, value, interval, how that was found."""
    made = []
    for name, (lower, upper, method) in fit.intervals().items():
        spread = "–" if math.isnan(lower) else f"{lower:.4g} to {upper:.4g}"
        made.append([name, f"{fit.estimates[name]:.4g} {fit.units[name]}".removesuffix(" 1"), spread, method])
    return made


_READING = """<section><h2>How to read this page</h2><ul>
<li><b>Unseen</b>: episodes that were not fitted. <b>Before</b>: by the servos and the robot as their files have them,
at the latency that fits these best.</li>
<li><b>mass.…</b> are factors on the masses of the robot's file; <b>zero.…</b> is by how much a joint of the robot's
model is ahead of what was measured; <b>latency</b> is from the reading of positions to when the goal of the same row
acts; <b>clock</b> is the share by which turns of the loop take longer than stamps say that only count them.</li>
<li><b>by beliefs</b>: episodes alone do not tell it; the interval stands on what the files of servo and robot say, and
on how far masses may be off.</li></ul></section>
"""
