"""The report of a fit: one HTML page that needs nothing but itself."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.identification.fitting.holdout import fit_percent
from servotwin.identification.report import parts as report_parts
from servotwin.identification.report import pictures as report_pictures
from servotwin.identification.report import tables as report_tables
from servotwin.identification.report.parts import STYLE, figure, space
from servotwin.identification.report.pictures import (
    error_shown,
    error_unit,
    estimate_lines,
    percent,
    share_text,
    tables_of,
)
from servotwin.look import MINUS, document, escape, number, table
from servotwin.parameters import write_file

if TYPE_CHECKING:
    from servotwin.identification.arms.arm_fit import ArmFit
    from servotwin.identification.fitting.fit import Fit
    from servotwin.identification.fitting.ladder import Ladder
    from servotwin.robots import RobotValidation


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
    sections = (
        *((("verdict", "Verdict", _verdict(fit)),) if fit.verdict is not None else ()),
        ("summary", "Summary", _summary(fit)), ("estimates", "Parameters", _estimates(fit)),
        ("unknown", "What the logs cannot say", _unknown(fit)),
        *((("structures", "What was compared", _compared(ladder)),) if ladder is not None else ()),
        ("errors", "Errors beside simpler models", _errors(fit)),
        ("logs", "Measured and simulated", report_parts.trace_list(fit.traces)),
        ("residuals", "What is left", _residuals(fit)),
        ("correlation", "Correlation of the estimates", _correlation(fit)), ("search", "The search", _search(fit)),
        ("reading", "How to read this page", _reading(fit)),
    )
    contents = "".join(f'<li><a href="#{key}">{title}</a></li>' for key, title, _ in sections)
    body = "".join(f'<section id="{key}"><h2>{title}</h2>\n{text}</section>\n' for key, title, text in sections)
    name = fit.servo.title or fit.servo.name
    held = sum(trace.held_out for trace in fit.traces)
    return document(f"{name}: fit", f"""<h1>{escape(name)}: fitted to {_count(len(fit.traces), "log")}</h1>
<p class="lead">{escape(type(fit.model).__name__)}, {_count(len(fit.space), "searched parameter")},
{_count(held, "log")} held out. Everything on this page follows from the data <code>{escape(_short(fit))}</code>.</p>
<nav aria-label="Contents"><ol>{contents}</ol></nav>
{body}""", style=STYLE)


def _short(fit: Fit) -> str:
    return str(fit.servo.fit.get("data", ""))[:19]


def _count(number_of: int, what: str) -> str:
    return f"{number_of} {what}{'' if number_of == 1 else 's'}"


def _verdict(fit: Fit) -> str:
    """Return the verdict in a box, green where it holds, and the causes that were tried."""
    if fit.verdict is None:
        return ""
    good = " good" if fit.verdict.holds else ""
    words = escape(fit.verdict.sentence[:1].upper() + fit.verdict.sentence[1:])
    box = f'<div class="note verdict{good}"><p><strong>{words}.</strong></p></div>\n'
    return box + (report_tables.causes(fit) if fit.verdict.causes else "")


def _summary(fit: Fit) -> str:
    factor, unit = error_shown(fit.traces)
    cards = []
    for errors, words in ((fit.holdout, "rms error on logs that were held out"),
                          (fit.training, "rms error on fitted logs")):
        if errors:
            total = errors.total()
            own, *others = errors.models
            beside = "; ".join(f"{escape(name)} {number(total[name] * factor, 3)}{space(unit)}" for name in others)
            words += f" (fit {percent(errors.total(fit_percent)[own]).replace('-', MINUS)} %)"
            words += f". Beside: {beside}" if beside else ""
            cards.append((f"{number(total[own] * factor, 3)}{space(unit)}", words))
    known = [line for line in estimate_lines(fit) if line.interval != line.method and not line.nuisance]
    cards.append((f"{len(known)} of {len(fit.space)}", "searched parameters have an interval"))
    widest = _widest(fit)
    if widest:
        cards.append((f"± {share_text(widest[1])}", f"widest of these intervals: <code>{escape(widest[0])}</code>"))
    if len(fit.starts) > 1:
        number_of, words = fit.searches
        cards.append((f"{number_of} of {len(fit.starts)}", escape(words)))
    listed = "".join(f"<li><b>{value}</b>{words}</li>" for value, words in cards)
    notes = "".join(f'<div class="note"><p>{escape(text)}</p></div>\n' for text in fit.warnings
                    if fit.verdict is None or text != fit.verdict.sentence)
    if fit.interrupted:
        nothing = "" if known else ", and there are no intervals"
        notes = ('<div class="note"><p><strong>The fit was interrupted.</strong> This is the best that it had found; '
                 f"there may be better values{nothing}.</p></div>\n") + notes
    return f'<ul class="numbers">{listed}</ul>\n{notes}'


def _widest(fit: Fit) -> tuple[str, float] | None:
    """Return the parameter with the widest interval, and half of it relative to its value."""
    found = {}
    for name in fit.space.names:
        interval, value = fit.intervals()[name], fit.estimates[name]
        if math.isfinite(interval.lower) and value:
            found[name] = 0.5 * (interval.upper - interval.lower) / abs(value)
    return max(found.items(), key=lambda item: item[1]) if found else None


def _estimates(fit: Fit) -> str:
    forest = report_pictures.forest(fit)
    drawn = "" if forest is None else figure(
        forest, f"Estimates and {100 * fit.level:g} % intervals. Grey: what the servo file's own spread allows (95 %). "
                "An open diamond has no interval.")
    return drawn + report_tables.estimates(fit)


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


def _compared(ladder: Ladder) -> str:
    return report_tables.rungs(ladder) + f"<p>{escape(ladder.chosen)}: {escape(ladder.reason)}.</p>"


def _errors(fit: Fit) -> str:
    return report_parts.errors(tables_of(fit), fit.traces, "Logs that were held out were simulated with the fitted "
                               "servo, started where they were measured.")


def _residuals(fit: Fit) -> str:
    drawn = report_parts.residuals(fit.traces, fit.noise, None if fit.verdict is None else fit.verdict.command)
    if fit.doubt is None:
        return drawn
    if fit.doubt.method == "independent residuals":
        words = "Neighbouring residuals are independent."
    else:
        words = (f"Neighbouring residuals follow each other (correlation {number(fit.doubt.autocorrelation, 2)}). The "
                 f"intervals allow for that ({escape(fit.doubt.method)}; {number(fit.doubt.inflation, 2)} times as "
                 "wide as for independent residuals), but not for a model that is wrong in the mean.")
    if fit.verdict is not None:
        sensor = next(iter(fit.verdict.noise))
        factor, unit = error_unit(sensor)
        words += (f" They are {number(fit.verdict.ratio, 2)} times the noise that needs no model, "
                  f"{number(fit.verdict.noise[sensor] * factor, 2)}{space(unit)}.")
    return drawn + f"<p>{words}</p>\n"


def _correlation(fit: Fit) -> str:
    drawn = report_pictures.correlation(fit)
    if drawn is None:
        return "<p>Fewer than two numbers have an interval, so there is nothing to correlate.</p>\n"
    return figure(drawn, "Blue: two estimates are high together. Orange: one is high where the other is low. Near ±1 "
                          "the logs hardly tell the two apart. Numbers without an interval are left out.")


def _search(fit: Fit) -> str:
    return (report_tables.starts(fit) + "<h3>Bounds and priors</h3>" + report_tables.bounds(fit) + "<h3>Settings</h3>"
            + report_tables.settings(fit))


def _reading(fit: Fit) -> str:
    level = f"{100 * fit.level:g} %"
    return f"""<ul>
<li><b>Interval.</b> If the model is right, {level} of such intervals hold the true value. “Normal law”: the cost is a
parabola near its minimum. “Profile”: it is not, so the ends were found by fixing the number and fitting all
others. “Linearised”: the fit was stopped; the ends are those of the problem made straight at the best so far, twice as
far off and beyond where a whole step would lead.</li>
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


def arm_page(fit: ArmFit, pictures: str = "") -> str:
    """Return the report as HTML; `pictures` are figures that stand beside it."""
    title = "The servos of a robot, from its episodes"
    said = [*(cause.sentence for cause in fit.causes), *map(str, fit.unidentifiable), *map(str, fit.left_out),
            *fit.warnings]
    notes = "".join(f"<li>{escape(text)}</li>" for text in said)
    body = (f'<h1>{title}</h1>\n<p class="lead">{escape(fit.sentence)}.</p>\n'
            + (f'<div class="note"><ul>{notes}</ul></div>\n' if notes else "")
            + f"<h2>Joint by joint</h2>\n{errors_table(fit)}{pictures}<h2>What was found</h2>\n{estimates_table(fit)}"
            + _READING)
    return document(title, body)


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


def errors_table(fit: ArmFit) -> str:
    """Return the errors of all joints as HTML."""
    head, rows = error_rows(fit)
    return table([escape(cell) for cell in head], [[escape(cell) for cell in row] for row in rows],
                 caption="Simulated less measured angle, rms (°)")


def estimate_rows(fit: ArmFit) -> list[list[str]]:
    """Return a row for each number: name, value, interval, how that was found."""
    made = []
    for name, (lower, upper, method) in fit.intervals().items():
        spread = "–" if math.isnan(lower) else f"{lower:.4g} to {upper:.4g}"
        made.append([name, f"{fit.estimates[name]:.4g} {fit.units[name]}".removesuffix(" 1"), spread, method])
    return made


def estimates_table(fit: ArmFit) -> str:
    """Return the estimates as HTML."""
    return table(["number", "value", f"{100 * fit.level:g} % interval", "known"],
                 [[escape(cell) for cell in row] for row in estimate_rows(fit)], text_columns=4)


_READING = """<section><h2>How to read this page</h2><ul>
<li><b>Unseen</b>: episodes that were not fitted. <b>Before</b>: by the servos and the robot as their files have them,
at the latency that fits these best.</li>
<li><b>mass.…</b> are factors on the masses of the robot's file; <b>zero.…</b> is by how much a joint of the robot's
model is ahead of what was measured; <b>latency</b> is from the reading of positions to when the goal of the same row
acts; <b>clock</b> is the share by which turns of the loop take longer than stamps say that only count them.</li>
<li><b>by beliefs</b>: episodes alone do not tell it; the interval stands on what the files of servo and robot say, and
on how far masses may be off.</li></ul></section>
"""
