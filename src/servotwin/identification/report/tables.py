"""The tables of a fit's report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from servotwin.identification.report.shown import (
    MODELS,
    dimension_of_free,
    error_rows,
    error_unit,
    estimate_lines,
    sensor_dimension,
)
from servotwin.units.look import MINUS, escape, figure_in, label_of, number, readable, table, unit_for

if TYPE_CHECKING:
    from servotwin.identification.fitting.fit import Fit, Trace
    from servotwin.identification.fitting.holdout import ErrorTable

_HOW = {"normal": "normal law", "profile": "profile of the cost", "at bound": "none: at a bound",
        "undetermined": "none: not determined", "not sought": "none: not asked for"}


def estimates(fit: Fit) -> str:
    """Return the estimates with intervals, and what the servo said before."""
    rows = []
    for line in estimate_lines(fit):
        ends = ["–", "–"] if line.interval == line.method else [line.lower, line.upper]
        numbers = [text.replace("-", MINUS) for text in (line.value, *ends, line.sheet)]
        rows.append([f"<code>{escape(line.name)}</code>", *numbers, escape(line.unit),
                     _HOW.get(line.method, line.method)])
    level = f"{100 * fit.level:g} %"
    return table(("parameter", "value", f"{level} from", "to", "before", "unit", "interval by"), rows,
                 caption="“Before” is the value of the servo file; delay and angle offset belong to the rig.")


def errors(tables: Mapping[str, ErrorTable], label: str, factor: float, unit: str) -> str:
    """Return rms errors by the values of a label, of all models."""
    models = next(iter(tables.values())).models
    rows = [[escape(value), which, *(_error(by.get(model, math.nan) * factor) for model in models)]
            for value, which, by in error_rows(tables, label)]
    for which, held in tables.items():
        total = held.total()
        rows.append(["<b>all</b>", which, *(_error(total.get(model, math.nan) * factor) for model in models)])
    words = escape(label.replace("_", " "))
    return table((words, "logs", *(f"{escape(MODELS.get(m, m))} ({unit})" for m in models)), rows,
                 caption=f"Rms error by {words}, over all samples.", text_columns=2)


def logs(tables: Mapping[str, ErrorTable], traces: Sequence[Trace]) -> str:
    """Return the errors log by log, the worst ones first."""
    signals = {trace.log.name: trace.signal for trace in traces}
    every = [(error, which) for which, held in tables.items() for error in held.errors[held.models[0]]]
    rows = []
    for error, which in sorted(every, key=lambda item: -item[0].rms if math.isfinite(item[0].rms) else -math.inf):
        factor, unit = error_unit(signals.get(error.log, "output_angle"))
        rows.append([escape(error.log), escape(error.motion or "other"), which,
                     f"{_error(error.rms * factor)} {unit}", f"{_error(error.largest * factor)} {unit}",
                     str(error.samples)])
    return table(("log", "motion", "part", "rms error", "largest error", "samples"), rows, text_columns=3)


def starts(fit: Fit) -> str:
    """Return where the searches from all starts ended."""
    best = min((start.cost for start in fit.starts), default=math.nan)
    rows = [[str(k), number(start.cost), number(start.cost / best if best else math.nan, 3),
             "yes" if start.converged else "no"] for k, start in enumerate(fit.starts, 1)]
    return table(("start", "cost", "times the best", "converged"), rows,
                 caption="Cost: half the sum of squared residuals in units of noise, large ones in proportion only "
                         "where the loss is Huber's. With several starts these are the rough searches on some logs.")


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
