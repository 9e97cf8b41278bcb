"""The report of a validation: one HTML page that needs nothing but itself."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.identification.fitting.holdout import fit_percent
from servotwin.identification.report import parts as report_parts
from servotwin.identification.report.parts import STYLE, space
from servotwin.identification.report.pictures import error_shown, percent, rig_text
from servotwin.look import MINUS, document, escape, number
from servotwin.parameters import write_file

if TYPE_CHECKING:
    from servotwin.identification.fitting.validate import Validation


def write_validation(found: Validation, path: Path, *, overwrite: bool = False) -> Path:
    """Write the report of a validation.

    Raises
    ------
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    write_file(path, page(found).encode(), overwrite=overwrite)
    return Path(path)


def page(found: Validation) -> str:
    """Return the report as HTML."""
    tables = {"": found.errors}
    sections = (
        ("summary", "Summary", _summary(found)),
        ("errors", "Errors", report_parts.errors(tables, found.traces, "Every log starts where it was measured.")),
        ("logs", "Measured and simulated", report_parts.trace_list(found.traces)),
        ("residuals", "What is left", report_parts.residuals(found.traces, found.noise)),
    )
    contents = "".join(f'<li><a href="#{key}">{title}</a></li>' for key, title, _ in sections)
    body = "".join(f'<section id="{key}"><h2>{title}</h2>\n{text}</section>\n' for key, title, text in sections)
    name, count = found.servo.title or found.servo.name, len(found.traces)
    logs = f"{count} log" + ("" if count == 1 else "s")
    return document(f"{name}: validation", f"""<h1>{escape(name)}: validated on {logs}</h1>
<p class="lead">{escape(type(found.model).__name__)}, <code>{escape(found.servo.name)}</code>. No parameter was fitted
here.</p>
<nav aria-label="Contents"><ol>{contents}</ol></nav>
{body}""", style=STYLE)


def _summary(found: Validation) -> str:
    factor, unit = error_shown(found.traces)
    errors = found.errors.errors[type(found.model).__name__]
    told = percent(found.errors.total(fit_percent)[found.errors.models[0]]).replace("-", MINUS)
    worst = max(errors, key=lambda error: error.rms)
    cards = [(f"{number(found.total * factor, 3)}{space(unit)}", f"rms error over all samples (fit {told} %)"),
             (f"{number(worst.rms * factor, 3)}{space(unit)}", f"rms error of the worst log, {escape(worst.log)}"),
             (f"{number(max(error.largest for error in errors) * factor, 3)}{space(unit)}", "largest error of all")]
    for name, value in found.nuisance.items():
        how = "fitted to these logs" if name in found.fitted else "as the servo file's fit recorded it"
        cards.append((escape(rig_text(name, value)), how))
    listed = "".join(f"<li><b>{value}</b>{words}</li>" for value, words in cards)
    notes = "".join(f'<div class="note"><p>{escape(text)}</p></div>\n' for text in found.warnings)
    return f'<ul class="numbers">{listed}</ul>\n{notes}'
