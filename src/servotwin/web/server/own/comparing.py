"""The work of laying a log over its twin."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.web.live.overlay import compared, of_the_bench
from servotwin.web.live.scene import model_named
from servotwin.web.server.own.frames import run_of

if TYPE_CHECKING:
    from servotwin.web.server.own.work import Tell


def work(given: dict[str, Any], tell: Tell) -> tuple[dict[str, Any], list[bytes]]:
    """Return a log over a servo as the page draws it.

    Parameters
    ----------
    given : dict
        `logs` (packed), `run`, `servo`, `model` (name), `load`, `frame_rate`, `rig`.
    tell : callable
    """
    tell(0.0, "simulating")
    model, servo = model_named(given["model"]), given["servo"]
    log = of_the_bench(run_of(given["logs"], given["run"]), model, servo, given["load"], given["frame_rate"])
    return compared(log, servo, model, fit_rig=given["rig"]), []
