"""The tables of a fit's report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin.identification.fitting.holdout import fit_percent
from servotwin.identification.report.pictures import (
    MODELS,
    dimension_of_free,
    error_rows,
    error_shown,
    error_unit,
    estimate_lines,
    percent,
    sensor_dimension,
)
from servotwin.look import MINUS, escape, figure_in, label_of, number, readable, table, unit_for

if TYPE_CHECKING:
    from servotwin.identification.fitting.fit import Fit, Trace
    from servotwin.identification.fitting.holdout import ErrorTable
    from servotwin.identification.fitting.ladder import Ladder

_HOW = {"normal": "normal law", "profile": "profile of the cost", "at bound": "none: at a bound",
        "undetermined": "none: not determined", "not sought": "none: not asked for"}


def estimates(fit: Fit) -> str:
    """Return the estimates with intervals, and what the servo said before."""
    rows = []
    for line in estimate_lines(fit):
        ends = ["–", "–"] if line.interval == line.method else [line.lower, line.upper]
        numbers = [text.replace("-", MINUS) for text in (line.value, *ends, line.sheet)]
        rows.append([f"<code>{escape(line.name)}</code>", *numbers, escape(line.unit),
                     _HOW.get(line.method, line.method), line.prior])
    level = f"{100 * fit.level:g} %"
    return table(("parameter", "value", f"{level} from", "to", "before", "unit", "interval by", "prior"), rows,
                 caption="“Before” is the value of the servo file; delay and angle offset belong to the rig. “Prior”: "
                         "how much of what is known is the servo file's range or a prior that was given, not data.") \
        + _yielded(fit)


def _yielded(fit: Fit) -> str:
    """Return the priors that were dropped beside what the logs say; nothing where there are none."""
    rows = []
    for one in fit.yielded:
        dimension = dimension_of_free(one.name)
        unit = unit_for(one.logs or one.file, dimension)
        known = math.isfinite(one.logs_std)
        numbers = (figure_in(one.file, unit, dimension), figure_in(one.file_std, unit, dimension),
                   figure_in(one.logs, unit, dimension, within=one.logs_std) if known else "–",
                   *(figure_in(x, unit, dimension, within=one.logs_std) if known else "–"
                     for x in (one.logs_lower, one.logs_upper)))
        rows.append([f"<code>{escape(one.name)}</code>", *(text.replace("-", MINUS) for text in numbers),
                     escape(label_of(unit)), number(one.apart, 2)])
    head = ("parameter", "prior", "±", "logs", f"{100 * fit.level:g} % from", "to", "unit", "standard errors apart")
    return table(head, rows, caption="Priors that the logs contradict: the fit goes without them.") if rows else ""


def causes(fit: Fit) -> str:
    """Return what was tried and explains a bad verdict, the best first."""
    if fit.verdict is None:
        return ""
    factor, unit = error_unit(next(iter(fit.verdict.noise)))
    rows = [[escape(cause.name), number(cause.before * factor, 3), number(cause.after * factor, 3),
             escape(cause.remedy)] for cause in fit.verdict.causes]
    return table(("cause", f"error without it ({unit})", f"with it ({unit})", "what to do"), rows,
                 caption="Rms errors on parts of the logs that took no part in the trial.")


def errors(tables: Mapping[str, ErrorTable], label: str, factor: float, unit: str) -> str:
    """Return rms errors by the values of a label, of all models."""
    models = next(iter(tables.values())).models
    rows = [[escape(row.value), row.which, *(_error(row.errors.get(model, math.nan) * factor) for model in models),
             _percent(row.fits.get(models[0], math.nan))] for row in error_rows(tables, label)]
    for which, held in tables.items():
        total = held.total()
        rows.append(["<b>all</b>", which, *(_error(total.get(model, math.nan) * factor) for model in models),
                     _percent(held.total(fit_percent)[models[0]])])
    words = escape(label.replace("_", " "))
    return table((words, "logs", *(f"{escape(MODELS.get(m, m))} ({unit})" for m in models), "fit (%)"),
                 rows, caption=f"Rms error by {words}, over all samples; fit of the servo.", text_columns=2)


def logs(tables: Mapping[str, ErrorTable], traces: Sequence[Trace]) -> str:
    """Return the errors log by log, the worst ones first."""
    signals = {trace.log.name: trace.signal for trace in traces}
    every = [(error, which) for which, held in tables.items() for error in held.errors[held.models[0]]]
    rows = []
    for error, which in sorted(every, key=lambda item: -item[0].rms if math.isfinite(item[0].rms) else -math.inf):
        factor, unit = error_unit(signals.get(error.log, "output_angle"))
        rows.append([escape(error.log), escape(error.motion or "other"), which,
                     f"{_error(error.rms * factor)} {unit}", f"{_error(error.largest * factor)} {unit}",
                     _percent(error.fit_percent), str(error.samples)])
    return table(("log", "motion", "part", "rms error", "largest error", "fit (%)", "samples"), rows, text_columns=3)


def starts(fit: Fit) -> str:
    """Return where the searches from all starts ended."""
    best = min((start.cost for start in fit.starts), default=math.nan)
    rows = [[str(k), number(start.cost), number(start.cost / best if best else math.nan, 3),
             "yes" if start.converged else "no"] for k, start in enumerate(fit.starts, 1)]
    return table(("start", "cost", "times the best", "converged"), rows,
                 caption="Cost: half the sum of squared residuals in units of noise, large ones in proportion only "
                         "where the loss is Huber's. With several starts these are the rough searches on some logs.")


def rungs(ladder: Ladder) -> str:
    """Return all fits of a ladder, and which one is chosen."""
    factor, unit = error_shown(ladder.fit.traces)
    rows = [[escape(rung.name), str(len(rung.fit.space)), f"{_error(rung.training * factor)} {unit}",
             f"{_error(rung.holdout * factor)} {unit}" if math.isfinite(rung.holdout) else "–",
             number(rung.criterion, 5), "chosen" if rung.name == ladder.chosen else ""] for rung in ladder.rungs]
    return table(("structure", "parameters", "fitted", "held out", "information criterion", ""), rows)


def bounds(fit: Fit) -> str:
    """Return bounds, prior and end of every searched parameter."""
    rows = []
    for p in fit.space.parameters:
        dimension = dimension_of_free(p.name)
        unit = unit_for(fit.estimates[p.name] or p.start, dimension)
        prior = "–" if p.prior is None else f"{figure_in(p.prior[0], unit, dimension, within=p.prior[1])} ± " \
                                            f"{figure_in(p.prior[1], unit, dimension)}"
        rows.append([f"<code>{escape(p.name)}</code>", figure_in(p.lower, unit, dimension),
                     figure_in(p.upper, unit, dimension), prior, escape(label_of(unit)),
                     "at a bound" if p.name in fit.at_bound else "inside"])
    return table(("parameter", "from", "to", "prior", "unit", "ended"), rows)


def settings(fit: Fit) -> str:
    """Return what was fitted, and by what."""
    record = fit.servo.fit
    noise = ", ".join(f"{name.replace('_', ' ')} {readable(value, sensor_dimension(name))}"
                      for name, value in fit.noise.items())
    doubt = fit.doubt
    rows = [
        ("servo", escape(f"{fit.servo.title or fit.servo.name} ({fit.servo.name})")),
        ("model", escape(type(fit.model).__name__)),
        ("logs", f"{len(fit.traces)}, of which {sum(t.held_out for t in fit.traces)} held out"),
        ("data", f"<code>{escape(str(record.get('data', '–')))}</code>"),
        ("version", escape(f"servotwin {record.get('version', '')}")),
        ("noise of the residuals (σ)", escape(noise)),
        ("intervals", "none" if doubt is None else escape(
            f"{100 * fit.level:g} %, {doubt.method}, standard errors {doubt.inflation:.2g} times those of independent "
            f"residuals (correlation of neighbours {doubt.autocorrelation:.2f})")),
        ("time", f"{fit.seconds:.3g} s"),
    ]
    return table(("what", "value"), [[f"<b>{what}</b>", words] for what, words in rows], text_columns=2)


def _error(value: float) -> str:
    return number(value, 3)


def _percent(value: float) -> str:
    return percent(value).replace("-", MINUS)
