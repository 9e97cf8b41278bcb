"""What the reports of fits and of validations share: frames of pictures, errors, and logs side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin.identification.report import pictures as report_pictures
from servotwin.identification.report import pictures as report_traces
from servotwin.identification.report import tables as report_tables
from servotwin.identification.report.pictures import error_shown, error_unit
from servotwin.look import escape, number, pages, picture, to_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from servotwin.identification.fitting.fit import Trace
    from servotwin.identification.fitting.holdout import ErrorTable
    from servotwin.identification.fitting.noise import CrossCorrelation

_MOST_LOGS = 21  # that are drawn folded
STYLE = """
.logs figure{margin:.7rem 0}#logs figure{padding:.4rem}#logs figure.held{border-color:#d55e00;background:#fff6ef}
#logs figcaption{margin:0 0 .2rem;color:var(--ink);font-size:.85rem;overflow-wrap:anywhere}
.tag{border-radius:4px;padding:0 .35rem;font-size:.8rem;background:#d55e00;color:#fff;white-space:nowrap}
.key{display:inline-block;width:1.6rem;border-top:3px solid;vertical-align:middle;margin:0 .3rem 0 .8rem}
figure img.drawing{width:100%;max-width:42rem}#logs figure img{width:100%}
.verdict{font-size:1.1rem}.good{border-left-color:#009e73;background:#f0faf6}
details{margin:.8rem 0}summary{cursor:pointer;color:var(--blue)}
@media print{#logs figure{break-inside:avoid}
figure img.drawing{max-width:27rem}}
"""


def figure(figure: Figure, words: str) -> str:
    """Return a picture with its caption."""
    return figures([figure], words)


def figures(drawn: Sequence[Figure], words: str) -> str:
    """Return the pages of a picture, one below the other, with their caption."""
    images = "".join(picture(to_bytes(figure, "svg"), words, kind="drawing") for figure in drawn)
    return f'<figure><div>{images}</div><figcaption>{words}</figcaption></figure>\n'


def space(unit: str) -> str:
    """Return a unit with the space before it that it needs."""
    return unit if unit == "°" else f" {unit}"


def errors(tables: Mapping[str, ErrorTable], traces: Sequence[Trace], words: str) -> str:
    """Return pictures and tables of the errors, by motion and by every other label; `words` say how they were found."""
    factor, unit = error_shown(traces)
    parts = []
    for label in dict.fromkeys(label for table in tables.values() for label in table.labels()):
        values = {value for table in tables.values() for value in table.by(label)}
        if len(values) > 1 or label == "motion":
            parts.append(figures([report_pictures.errors(tables, label, factor, unit, page)
                                  for page in pages(len(values), report_pictures.VALUES_A_PAGE)],
                                 f"Rms error by {escape(label.replace('_', ' '))}. {words}"))
        parts.append(report_tables.errors(tables, label, factor, unit))
    every = report_tables.logs(tables, traces)
    return f"{''.join(parts)}<details><summary>Log by log</summary>{every}</details>\n"


def trace_list(traces: Sequence[Trace]) -> str:
    """Return measured and simulated log by log: the worst, the middle and the best open, the others folded."""
    first = report_traces.shown_first(traces)
    others = [trace for trace in report_traces.by_error(traces) if not any(trace is one for one in first)]
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
    drawn = picture(to_bytes(report_traces.beside(trace), "svg"), f"{trace.log.name}, measured and simulated")
    kind = ' class="held"' if tagged else ""
    return f"<figure{kind}><figcaption>{_caption(trace, tagged=tagged)}</figcaption><div>{drawn}</div></figure>\n"


def residuals(traces: Sequence[Trace], noise: Mapping[str, float], command: CrossCorrelation | None = None) -> str:
    """Return the picture of what is left; of logs that were fitted with what the verdict says of the command before."""
    return figure(report_traces.residuals(traces, noise, command),
                  "Simulated less measured, in units of each sensor's noise σ. From above: over time; their "
                  "distribution beside the normal law; how far residuals follow each other; how far they follow the "
                  "command of some time before, both filtered so that noise has no memory. Grey: where 99 of 100 lags "
                  "lie if what is left is noise.")
