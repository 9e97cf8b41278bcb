"""The bench that a page shows first."""

from __future__ import annotations

from servotwin.web.live import Scene, SceneServo

SERVO = "hitec-hs-755hb"
"""The paper's servo."""


def first_scene() -> Scene:
    """Return the paper's servo, pulse by pulse and in the mean of its pulses, side by side.

    Examples
    --------
    >>> [one.model for one in first_scene().servos]
    ['PulseServo', 'BoundedServo']
    """
    return Scene(servos=tuple(SceneServo(id=SERVO, model=model) for model in ("PulseServo", "BoundedServo")),
                 load={"inertia": 1e-4})
