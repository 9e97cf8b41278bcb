"""The work of a fit: a log and a servo in, numbers with intervals, a verdict and a servo file out."""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.identification import Fit, Log, identify
from servotwin.identification.report.pictures import error_shown, estimate_lines
from servotwin.parameters.servo_file import servo_text
from servotwin.simulation.progress import HERE
from servotwin.text import file_stem
from servotwin.web.lessons.mystery import guess_of
from servotwin.web.live.overlay import of_the_bench, trace_facts
from servotwin.web.live.scene import model_named
from servotwin.web.server.own.frames import logs_of, run_of
from servotwin.web.server.own.reading import is_computed

if TYPE_CHECKING:
    from servotwin.web.server.own.work import Tell

MOST_VALUES = 3000
"""Values of a sensor that a fit on the page takes: more are thinned."""
_NOISE = {"output_angle": 3e-4, "feedback_voltage": 1e-3}  # rad, V: of a good potentiometer; assumed
_CURRENT_NOISE = 2e-3  # A, of a shunt's amplifier; assumed
_STOP = 0.8  # of the time that a fit may take: then it ends with the best so far


def work(given: dict[str, Any], tell: Tell) -> tuple[dict[str, Any], list[bytes]]:
    """Return what a fit found.

    Parameters
    ----------
    given : dict
        `logs` (packed), `run` (None: all), `servo`, `model` (name), `load`, `frame_rate`, `free`, `bounds`, `priors`,
        `diagnose`, `limit` [s].
    tell : callable
    """
    tell(0.0, "begins")
    model, servo = model_named(given["model"]), given["servo"]
    some = logs_of(given["logs"]) if given["run"] is None else [run_of(given["logs"], given["run"])]
    notes: dict[str, None] = {}
    logs = [_prepared(of_the_bench(log, model, servo, given["load"], given["frame_rate"]), notes) for log in some]
    end = time.monotonic() + _STOP * given["limit"]

    def told(share: float, text: str) -> None:
        tell(share, text)
        if share > 0.0 and time.monotonic() > end:
            raise KeyboardInterrupt  # the fit then gives the best so far

    cores = max(1, min(4, (os.cpu_count() or 1) - 1))
    with ThreadPoolExecutor(cores) as threads:
        fit = identify(logs, servo, model, given["free"], bounds=given["bounds"], priors=given["priors"],
                       compare_with=(), diagnose=given["diagnose"], progress=told,
                       executor=HERE if cores == 1 else threads)
    return facts_of(fit, list(notes)), []


def facts_of(fit: Fit, notes: list[str]) -> dict[str, Any]:
    """Return a fit as the page shows it; errors in the unit that is stated."""
    factor, unit = error_shown(fit.traces)
    table = fit.training or fit.holdout
    verdict = fit.verdict
    said = [text for text in fit.warnings if verdict is None or text != verdict.sentence]
    return {
        "file": servo_text(fit.servo), "name": f"{file_stem(fit.servo.name)}.toml", "model": type(fit.model).__name__,
        "seconds": fit.seconds, "interrupted": fit.interrupted, "level": fit.level, "unit": unit,
        "rms": factor * table.total()[table.models[0]],
        "held_out": factor * fit.holdout.total()[fit.holdout.models[0]] if fit.holdout else None,
        "logs": len(fit.traces), "notes": notes,
        "estimates": [{"name": line.name, "value": line.value, "interval": line.interval, "unit": line.unit,
                       "before": "rig" if line.nuisance else line.sheet, "prior": line.prior, "method": line.method,
                       "sure": line.name not in fit.undetermined and line.name not in fit.at_bound}
                      for line in estimate_lines(fit)],
        "verdict": None if verdict is None else {"sentence": verdict.sentence, "holds": verdict.holds},
        "causes": [] if verdict is None else [
            {"name": one.name, "before": factor * one.before, "after": factor * one.after, "remedy": one.remedy}
            for one in verdict.causes],
        "open": [str(one) for one in fit.unidentifiable], "at_bound": list(fit.at_bound), "warnings": said,
        "guess": guess_of(fit.servo, {*fit.undetermined, *fit.at_bound}),
        "overlay": {**trace_facts(fit.traces[0]), "servo": f"{fit.servo.title or fit.servo.name}, fitted",
                    "model": type(fit.model).__name__, "rig": [], "rig_fitted": True, "warnings": []}}


def _prepared(log: Log, notes: dict[str, None]) -> Log:
    """Return a log as it is fitted: thinned where it is long, with a sensor's noise where it was computed."""
    measured = dict(log.measured)
    if is_computed(log):
        notes["this table was computed, not measured: a sensor's noise of 0.3 mrad, 1 mV and 2 mA was added, without "
              "which nothing could be said of how sure the numbers are"] = None
        random = np.random.default_rng(0)
        for name, values in measured.items():
            size = _CURRENT_NOISE if name.endswith("_current") else _NOISE.get(name, 0.0)
            measured[name] = values + size * random.standard_normal(len(values))
    step = -(-len(log) // MOST_VALUES)
    if step > 1:
        th = {2: "second", 3: "third"}.get(step, f"{step}th")
        notes[f"every {th} value is fitted, of {len(log)}"] = None
        there = np.arange(len(log)) % step == 0
        measured = {name: np.where(there, values, np.nan) for name, values in measured.items()}
    return replace(log, measured=measured)
