"""Kinks of friction that fades: a step by time ends where one is.

Friction that fades with speed is a magnitude of several torques through the gear: K_m τ_m − K_e τ_e, and while any
static friction is left K_ms τ_m − K_es τ_e, and τ_e or τ_m + τ_e for what is quadratic in them. Where one of them
changes its sign, rates have a kink, or jump. A step that leads across is less accurate than its error says, and so is
what is interpolated within it.
"""

from __future__ import annotations

from servotwin.models.engine.dynamics import currents, spring_contact
from servotwin.models.engine.dynamics.guards import creeping, geared
from servotwin.models.state.modes import INSIDE, Mode, Vector, slides
from servotwin.models.terms import elastic
from servotwin.models.terms.friction import Friction, fades, share, static_share
from servotwin.models.terms.load import external_torque
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.physics.load_friction import torque_on_gear

_CLOSE = 1e-6  # of a step: a kink that close to one of its ends is at that end
_NOTHING = 1e-12  # of the torques: less than that has no sign
IN_FLOATS = {"_CLOSE": 1e-3, "_NOTHING": 1e-5}


def part_before(numbers: Numbers, mode: Mode, u: tuple[float, float], tau: tuple[float, float], before: Vector,
                after: Vector) -> float:
    """Return the part of a step by time after which there is a kink; 1 where there is none.

    `u` and `tau` are the inputs at both ends.
    """
    if not fades(numbers.friction) or not slides(geared(numbers, mode)):
        return 1.0
    own = numbers.friction
    m_0, e_0 = _through_gear(numbers, mode, u[0], tau[0], before)
    m_1, e_1 = _through_gear(numbers, mode, u[1], tau[1], after)
    none = _NOTHING * (abs(m_0) + abs(e_0) + abs(m_1) + abs(e_1))
    part = _part(share(own, m_0, e_0), share(own, m_1, e_1), none)
    if creeping(numbers, mode, before) or creeping(numbers, mode, after):
        part = min(part, _part(static_share(own, m_0, e_0), static_share(own, m_1, e_1), none))
        if _is_quadratic(own):
            part = min(part, _part(e_0, e_1, none), _part(m_0 + e_0, m_1 + e_1, none))
    return part


def _is_quadratic(friction: Friction) -> bool:
    return friction.K_mq > 0.0 or friction.K_eq > 0.0


def _part(begin: float, end: float, none: float) -> float:
    """Return the part of a step after which a torque changes its sign that goes from one value to another."""
    if not ((begin < -none and end > none) or (end < -none and begin > none)):
        return 1.0
    part = begin / (begin - end)
    return part if _CLOSE < part < 1.0 - _CLOSE else 1.0


def _through_gear(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector) -> tuple[float, float]:
    """Return the torques of motor and load on the gear [N m], in +q."""
    numbers = warm(numbers, y)
    tau_m = currents.drive_torque(numbers, mode.zone, u, y)
    if elastic.present(numbers.elastic):
        return tau_m, spring_contact.on_gear(numbers, mode.mesh, tau, y)
    if mode.mesh == INSIDE:
        return tau_m, 0.0
    return tau_m, torque_on_gear(external_torque(numbers.load, tau, y.q), y.w, numbers.shaft.b_out)
