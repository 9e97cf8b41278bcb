"""The bench that a page shows first."""

from __future__ import annotations

from servotwin.web.live import Scene, SceneServo

SERVO = "hitec-hs-755hb"
"""The paper's servo."""


def first_scene() -> Scene:
    """Return the paper's servo, pulse by pulse.

    Examples
    --------
    >>> [one.model for one in first_scene().servos]
    ['PulseServo']
    """
    return Scene(servos=(SceneServo(id=SERVO, model="PulseServo"),), load={"inertia": 1e-4})
