"""A fit in tables, and as facts for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from servotwin.cli.summary import names as dotted
from servotwin.cli.summary import was_set
from servotwin.cli.terminal import pairs, table
from servotwin.identification.fitting.holdout import fit_percent
from servotwin.identification.report.pictures import (
    MODELS,
    error_rows,
    error_shown,
    estimate_lines,
    nominal_of,
    percent,
    tables_of,
)

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.identification import Advice, Fit, Ladder
    from servotwin.identification.fitting.fit import Trace
    from servotwin.identification.fitting.holdout import ErrorTable
    from servotwin.identification.fitting.yielding import Yielded

_MOST_EXPERIMENTS = 8


def sections(fit: Fit, files: Sequence[str]) -> list[RenderableType]:
    """Return what is printed of a fit."""
    held = sum(trace.held_out for trace in fit.traces)
    head = f"{fit.servo.title or fit.servo.name} ({fit.servo.name}), {type(fit.model).__name__}, " \
           f"{len(fit.traces)} logs, {held} of them held out, {fit.seconds:.1f} s"
    parts: list[RenderableType] = [head, *_verdict(fit)]
    if fit.interrupted:
        parts.append(f"INTERRUPTED: the best so far; not known are {', '.join(fit.unknown)}")
    parts += ["", _estimates(fit), ""]
    if fit.register_values:
        rows = [(one.name, f"{one.value:.3g}", one.interval) for one in fit.register_values]
        parts += [table(("register", "raw value", f"{100.0 * fit.level:g} % interval"), rows), ""]
    parts += [f"- {item}" for item in fit.unidentifiable]
    parts += ["- no delay is seen: it ended at 0" if name == "delay" and fit.estimates[name] == 0.0
              else f"- {name} ended at a bound of the search" for name in fit.at_bound]
    parts += [f"- {line}" for line in fit.allowing]
    parts += [""] if fit.unidentifiable or fit.at_bound or fit.allowing else []
    parts.append(errors(tables_of(fit), fit.traces, "motion"))
    said = [text for text in fit.warnings if (fit.verdict is None or text != fit.verdict.sentence)
            and not (fit.interrupted and text.startswith("stopped: the best"))]
    if said:
        parts += ["", *[f"! {text}" for text in said]]
    given = was_set(fit.model)
    if given or files:
        parts += ["", pairs([*([("set", dotted(given))] if given else []), *_written(files)])]
    return parts


def _verdict(fit: Fit) -> list[RenderableType]:
    """Return the verdict, and the causes that explain it, in two lines or a table."""
    if fit.verdict is None:
        return []
    mark = "" if fit.verdict.holds else "! "
    lines: list[RenderableType] = [f"{mark}{fit.verdict.sentence}"]
    if fit.verdict.causes:
        factor, unit = error_shown(fit.traces)
        rows = [(cause.name, f"{cause.before * factor:.3g}", f"{cause.after * factor:.3g}", cause.remedy)
                for cause in fit.verdict.causes]
        lines += ["", table(("what may be the matter", f"error ({unit})", f"with it ({unit})", "what to do"), rows)]
    return lines


def written(files: Sequence[str]) -> RenderableType:
    """Return the names of files that were written."""
    return pairs(_written(files))


def _written(files: Sequence[str]) -> list[tuple[str, str]]:
    return [("written", name) for name in files]


def _estimates(fit: Fit) -> RenderableType:
    rows = []
    for line in estimate_lines(fit):
        found_by = line.method if line.interval != line.method else ""
        rows.append((line.name, line.value, line.interval, line.unit, found_by, line.prior,
                     "rig" if line.nuisance else line.sheet))
    level = f"{100.0 * fit.level:g} % interval"
    return table(("parameter", "value", level, "unit", "found by", "prior", "before"), rows)


def errors(tables: Mapping[str, ErrorTable], traces: Sequence[Trace], label: str) -> RenderableType:
    """Return a table of rms errors by the values of a label, all models beside each other."""
    models = next(iter(tables.values())).models
    factor, unit = error_shown(traces)
    rows = [(row.value, row.which, *(_error(row.errors, model, factor) for model in models),
             percent(row.fits.get(models[0], math.nan))) for row in error_rows(tables, label)]
    rows += [("all", which, *(_error(held.total(), model, factor) for model in models),
              percent(held.total(fit_percent)[models[0]])) for which, held in tables.items()]
    named = any(tables)
    header = (label.replace("_", " "), "logs", *(f"{MODELS.get(name, name)} ({unit})" for name in models), "fit (%)")
    if not named:
        header, rows = (header[0], *header[2:]), [(row[0], *row[2:]) for row in rows]
    return table(header, rows)


def _error(errors_of: Mapping[str, float], model: str, factor: float) -> str:
    value = errors_of.get(model, math.nan) * factor
    return f"{value:.3g}" if math.isfinite(value) else "–"


def facts(fit: Fit, files: Sequence[str]) -> dict[str, Any]:
    """Return a fit as plain data for JSON, in SI."""
    found = fit.intervals()
    estimates = {name: {
        "value": fit.estimates[name], "unit": fit.units[name], "lower": float(found[name].lower),
        "upper": float(found[name].upper), "method": found[name].method, "prior_share": fit.prior_share.get(name),
        "before": nominal_of(fit, name)}
        for name in fit.names}
    return {
        "servo": fit.servo.name, "model": type(fit.model).__name__, "logs": len(fit.traces),
        "held_out": [trace.log.name for trace in fit.traces if trace.held_out], "level": fit.level,
        "estimates": estimates, "covariance": {"names": list(fit.names), "rows": fit.covariance.tolist()},
        "undetermined": [{
            "parameters": list(item.parameters), "direction": list(item.direction),
            "combinations": list(item.combinations), "remedies": list(item.remedies), "words": str(item)}
            for item in fit.unidentifiable],
        "registers": None if fit.registers is None else {
            **fit.registers.facts, "values": [one._asdict() for one in fit.register_values]},
        "foreseen": [vars(one) | {"words": str(one)} for one in fit.foreseen],
        "assumptions": [{**asdict(one), "moves": dict(one.moves), "beside": dict(one.beside)}
                        for one in fit.assumptions],
        "at_bound": list(fit.at_bound), "yielded": [_yielded(one) for one in fit.yielded],
        "errors": {which.replace(" ", "_"): error_facts(held) for which, held in tables_of(fit).items()},
        "noise": {name: float(value) for name, value in fit.noise.items()}, "warnings": list(fit.warnings),
        "verdict": None if fit.verdict is None else {
            "sentence": fit.verdict.sentence, "holds": fit.verdict.holds, "ratio": fit.verdict.ratio,
            "noise": dict(fit.verdict.noise), "autocorrelation": fit.verdict.autocorrelation,
            "odds": dict(fit.verdict.odds), "outliers": fit.verdict.outliers, "word": fit.verdict.word,
            "rival": None if fit.verdict.rival is None else vars(fit.verdict.rival),
            "command_lag": fit.verdict.command_lag,
            "cross_correlation": None if fit.verdict.command is None else {
                name: getattr(fit.verdict.command, name).tolist() for name in ("lag", "value", "band")},
            "causes": [{"name": cause.name, "sentence": cause.sentence, "before": cause.before, "after": cause.after,
                        "remedy": cause.remedy} for cause in fit.verdict.causes]},
        "starts": [{"cost": float(start.cost), "converged": bool(start.converged)} for start in fit.starts],
        "data": fit.servo.fit.get("data"), "seconds": fit.seconds, "interrupted": fit.interrupted,
        "unknown": list(fit.unknown),
        "set": was_set(fit.model), "files": list(files),
    }


def _yielded(one: Yielded) -> dict[str, Any]:
    return {"parameter": one.name, "unit": one.unit, "file": one.file, "file_std": one.file_std, "logs": one.logs,
            "logs_std": one.logs_std, "logs_lower": one.logs_lower, "logs_upper": one.logs_upper, "apart": one.apart,
            "of_file": one.of_file, "others": list(one.others), "words": str(one)}


def error_facts(held: ErrorTable) -> dict[str, Any]:
    """Return errors as plain data (SI): in all, by every label, and of each log."""
    return {
        "all": held.total(), "by": {label: held.by(label) for label in held.labels()},
        "fit_percent": held.total(fit_percent),
        "logs": {model: [{"log": e.log, "motion": e.motion, "conditions": dict(e.conditions), "rms": e.rms,
                          "largest": e.largest, "samples": e.samples, "fit_percent": e.fit_percent}
                         for e in held.errors[model]]
                 for model in held.models}}


def ladder_table(ladder: Ladder) -> list[RenderableType]:
    """Return the rungs of a friction ladder, and which one is chosen."""
    factor, unit = error_shown(ladder.fit.traces)
    rows = []
    for rung in ladder.rungs:
        said = ["chosen"] if rung.name == ladder.chosen else []
        said += ["overfitted"] if rung.overfits else []
        rows.append((rung.name, str(len(rung.fit.space)), f"{rung.training * factor:.3g}",
                     f"{rung.holdout * factor:.3g}" if math.isfinite(rung.holdout) else "–", f"{rung.criterion:.1f}",
                     ", ".join(said)))
    what = "structure" if "," in ladder.chosen else "friction"
    return [table((what, "parameters", f"fitted ({unit})", f"held out ({unit})", "information criterion", ""), rows),
            f"{ladder.chosen}: {ladder.reason}", *_told(ladder, factor, unit), ""]


def _told(ladder: Ladder, factor: float, unit: str) -> list[str]:
    """Return the error that the choice did not see."""
    if not math.isfinite(ladder.error):
        return []
    said = f"error on logs that had no say in the choice: {ladder.error * factor:.3g} {unit}"
    if ladder.choices:
        said += f" (held-out logs in two halves, which choose {' and '.join(ladder.choices)})"
    return [said]


def ladder_facts(ladder: Ladder) -> dict[str, Any]:
    """Return a friction ladder as plain data."""
    return {"chosen": ladder.chosen, "reason": ladder.reason, "error": ladder.error,
            "choices": list(ladder.choices), "rungs": [
        {"name": rung.name, "training": rung.training, "holdout": rung.holdout, "criterion": rung.criterion,
         "overfits": rung.overfits, "estimates": dict(rung.fit.estimates)} for rung in ladder.rungs]}


def advice_table(advice: Advice) -> list[RenderableType]:
    """Return the next experiments, the best first, with the predicted half width of the worst-known parameters."""
    worst = sorted(advice.now, key=lambda name: -advice.now[name])[:3]
    rows: list[tuple[str, ...]] = [("as it is now", *_widths(advice.now, worst))]
    rows += [(str(experiment), *_widths(experiment.widths, worst))
             for experiment in advice.experiments[:_MOST_EXPERIMENTS]]
    if any(_width(advice.alone[name]) != _width(advice.now[name]) for name in advice.now):
        rows.insert(1, ("as it is now, by logs alone, without priors", *_widths(advice.alone, worst)))
        best = advice.experiments[0]
        rows.insert(3, ("the same, by logs alone, without priors", *_widths(best.alone, worst)))
    return ["next experiments, and how surely what is known worst would be known with them (half a 95 % interval)",
            table(("experiment", *worst, "widest"), rows), str(advice)]


def _widths(widths: Mapping[str, float], names: Sequence[str]) -> tuple[str, ...]:
    return (*(_width(widths[name]) for name in names), _width(max(widths.values())))


def advice_facts(advice: Advice) -> dict[str, Any]:
    """Return advice as plain data; widths are relative."""
    return {"now": dict(advice.now), "alone": dict(advice.alone), "widest": advice.widest, "experiments": [
        {"motion": one.motion, "load": one.load, "voltage": one.voltage, "sensors": list(one.sensors),
         "widths": dict(one.widths), "alone": dict(one.alone), "widest": one.widest} for one in advice.experiments]}


def _width(share: float) -> str:
    if share > 10.0:
        return "unknown"
    return f"±{100.0 * share:.2g} %" if share < 1.0 else f"±{100.0 * share:.0f} %"
