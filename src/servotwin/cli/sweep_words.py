"""A study in tables: quantiles of the metrics, the tornado of one, and what failed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from servotwin import plotting, units
from servotwin.cli.summary import names
from servotwin.cli.terminal import pairs, table
from servotwin.simulation.remarks import words
from servotwin.studies import dimension_of

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.studies import Study

_MOST_BARS = 12
_MOST_FAILURES = 3
_MOST_LANES = 5  # of a kind of remark


def sections(study: Study, metric: str, files: Sequence[str], given: Sequence[str] = ()) -> list[RenderableType]:
    """Return what is printed of a study; `metric` is that of the tornado, and `given` what the user set."""
    definition = study.definition
    head = f"{definition['servo']}, {definition['model']}, {len(study)} lanes, {definition['duration']:g} s"
    follow = [("follow", ", ".join(study.followed))] if study.followed else []
    rows = [("varied", ", ".join(study.parameters)), *follow, ("failed", _failed(study)), *_remarks(study),
            *([("set", names(given))] if given else []), *(("written", name) for name in files)]
    return [head, pairs(rows), "", _quantiles(study), "", f"what moves {plotting.metric_shown(metric).words}, one at a "
            "time, and its share of the variance", *_tornado(study, metric)]


def _failed(study: Study) -> str:
    failures = study.failures
    named = "; ".join(f"lane {f.lane} at {f.time:g} s: {f.cause}" for f in failures[:_MOST_FAILURES])
    more = f"; and {len(failures) - _MOST_FAILURES} more" if len(failures) > _MOST_FAILURES else ""
    return f"{len(failures)}: {named}{more}" if failures else "none"


def _remarks(study: Study) -> list[tuple[str, str]]:
    found = []
    for kind, lanes in study.remarked().items():
        first = ", ".join(map(str, lanes[:_MOST_LANES])) + (" ..." if len(lanes) > _MOST_LANES else "")
        found.append(("remark", f"{words(kind)}: {len(lanes)} of {len(study)} (lane{'s'[:len(lanes) > 1]} {first})"))
    return found


def _quantiles(study: Study) -> RenderableType:
    found = study.quantiles()
    header = ["metric", "unit", "nominal", *(f"{100 * p:g} %" for p in next(iter(found.values())))]
    rows = []
    for name, values in found.items():
        shown = plotting.metric_shown(name)
        nominal = study.tornado(name).nominal
        rows.append([shown.words, shown.label, _text(nominal, name), *(_text(x, name) for x in values.values())])
    return table(header, rows)


def _tornado(study: Study, metric: str) -> list[RenderableType]:
    shown = plotting.metric_shown(metric)
    unit = f" ({shown.label})" if shown.label else ""
    rows, found = [], study.tornado(metric)
    for bar in found.bars[:_MOST_BARS]:
        low, high = (plotting.readable(value, dimension_of(bar.name)) for value in (bar.low, bar.high))
        share = "" if math.isnan(bar.share) else f"{100.0 * bar.share:.1f} %"
        rows.append([bar.name, low, high, _text(bar.at_low, metric), _text(bar.at_high, metric), share])
    left = [f"{len(names)} {words}" for words, names in (
        ("more move it less", found.bars[_MOST_BARS:]), ("others that vary do not move it", found.still)) if names]
    if not rows:
        return ["nothing that varies moves it, so there is no tornado"]
    return [table(["parameter", "from (5 %)", "to (95 %)", f"gives{unit}", "and", "share"], rows), *left]


def _text(value: float, metric: str) -> str:
    shown = plotting.metric_shown(metric)
    return "-" if math.isnan(value) else f"{units.from_si(value, shown.unit, shown.dimension):z.4g}"
