"""What rows of a bench show of a model, and how what it follows stands for commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from servotwin.models.base import KINDS
from servotwin.models.engine.live.screen import COLUMNS, Lines

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model


def names_of(model: Model, load: Load) -> tuple[str, ...]:
    """Return the names of all signals that rows show of a model under a load.

    Examples
    --------
    >>> import servotwin as st
    >>> names_of(st.DCMotor(st.load_servo("hitec-hs-755hb")), st.loads.Load())[:2]
    ('armature_voltage', 'armature_current')
    """
    return tuple(name for name in model.signals_with(load) if name in COLUMNS)


def lines_of(model: Model) -> Lines:
    """Return how what a model follows stands for commands.

    Examples
    --------
    >>> import servotwin as st
    >>> lines = lines_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> lines.per_width, lines.width, lines.reduction
    (1.0, 0.0, 280.0)
    """
    volts, angles, widths = (_line(model, name) for name in KINDS)
    reduction = model.value("gear.gear_reduction") if "gear.gear_reduction" in model.requires else 1.0
    return Lines(*volts, *angles, *widths, reduction)


def _line(model: Model, name: str) -> tuple[float, float]:
    """Return slope and value at 0 of a command over what the model follows; 0 where it has none."""
    if name not in model.available:
        return 0.0, 0.0
    at = model.command_signal(name, np.array([0.0, 1.0]))
    return float(at[1] - at[0]), float(at[0])
