"""Motor side and output side of one servo: who is in contact, who moves, what happens when something is hit.

`y` holds q, w of the output and x = q_m/N, v = w_m/N of the motor. Without play, or in contact with a flank, both are
one body. A guard is positive as long as the mode holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from .drivetrain_laws import Plant, Signs, sgn

REST_SPEED = 1e-6  # rad/s: slower after an impact, it rests on its stop
NO_WAY = 4e-15  # of an angle of 1 rad: so near to a stop there is nothing between them
Q, W, I, X, V, T_W, T_H = range(7)  # noqa: E741 - the letter of the current


@dataclass
class Mode:
    """What holds until the next event; `d` is the output's direction (or both bodies'), `d_m` the motor's inside."""

    drive: int = 0
    z: int = 0
    flank: int = 0
    d: int = 0
    d_m: int = 0
    signs: Signs = field(default_factory=Signs)


class Motion(NamedTuple):
    """Accelerations [rad/s²] and the power [W] that friction and load take."""

    output: float
    motor: float
    friction: float
    load: float


def joined(P: Plant, m: Mode) -> bool:
    return not P.play or m.flank != 0


def motion(P: Plant, m: Mode, y: Sequence[float], tau_m: float) -> Motion:
    """Right-hand side, in the mode as it is."""
    w, v = y[W], y[V]
    tau_e = -P.external(y[Q]) - P.B_L * w
    load = w * (m.d * P.coulomb - tau_e)
    if joined(P, m):
        if not m.d:
            return Motion(0.0, 0.0, 0.0, 0.0)
        dry = m.d * P.budget(m.d, tau_m, tau_e, P.stribeck(m.d * w), m.signs)
        a = (tau_m + tau_e - P.B_m * w - dry - m.d * P.coulomb) / P.J
        return Motion(a, a, w * (dry + P.B_m * w), load)
    a = (tau_e - m.d * P.behind) / P.J_L if m.d else 0.0
    dry = m.d_m * (P.budget(m.d_m, tau_m, 0.0, P.stribeck(m.d_m * v), m.signs) - P.bearing)
    a_m = (tau_m - P.B_m * v - dry) / P.J_m if m.d_m else 0.0
    return Motion(a, a_m, v * (dry + P.B_m * v) + w * m.d * P.bearing, load)


def blocked(P: Plant, q: float) -> tuple[bool, bool]:
    """Whether a stop bars the way back and forth."""
    return q <= P.lower, q >= P.upper


def start(total: float, holds: tuple[float, float], barred: tuple[bool, bool] = (False, False)) -> int:
    """Direction in which a resting body starts, 0 if it stays."""
    low, high = holds
    return 1 if total > high and not barred[1] else -1 if total < low and not barred[0] else 0


def split(P: Plant, y: Sequence[float], d: int, tau_m: float) -> float:
    """Acceleration of the motor minus that of the output, each on its own, which at rest (d = 0) friction may hold."""
    w = y[W]
    tau_e = -P.external(y[Q]) - P.B_L * w
    own = d or start(tau_m, P.holds(tau_m, 0.0, -P.bearing))
    load = d or start(tau_e, (-P.behind, P.behind), blocked(P, y[Q]))
    dry = own * (P.budget(own, tau_m, 0.0, P.stribeck(own * w), P.signs(tau_m, 0.0)) - P.bearing)
    a_m = (tau_m - P.B_m * w - dry) / P.J_m if own else 0.0
    return a_m - ((tau_e - load * P.behind) / P.J_L if load else 0.0)


def decide(P: Plant, m: Mode, y: list[float], tau_m: float) -> None:
    """Contact and directions at this instant, from the laws; puts the two bodies exactly together where joined."""
    if m.flank and (y[V] != y[W] or m.flank * split(P, y, sgn(y[W]), tau_m) < 0.0):
        m.flank = 0
    tau_e = -P.external(y[Q]) - P.B_L * y[W]
    if joined(P, m):
        y[X], y[V] = y[Q] + 0.5 * m.flank * P.play, y[W]
        m.d = sgn(y[W]) or start(tau_m + tau_e, P.holds(tau_m, tau_e, P.coulomb), blocked(P, y[Q]))
        m.d_m, m.signs = m.d, P.signs(tau_m, tau_e)
        return
    m.d = sgn(y[W]) or start(tau_e, (-P.behind, P.behind), blocked(P, y[Q]))
    m.d_m = sgn(y[V]) or start(tau_m, P.holds(tau_m, 0.0, -P.bearing))
    m.signs = P.signs(tau_m, 0.0)


def _rest_guards(total: float, holds: tuple[float, float], barred: tuple[bool, bool]) -> list[float]:
    low, high = holds
    return [x for x, bar in ((total - low, barred[0]), (high - total, barred[1])) if not bar]


def _sign_guards(P: Plant, m: Mode, tau_m: float, tau_e: float) -> list[float]:
    """Where a torque changes sign the friction law bends (M3 to M5) or jumps (M6)."""
    wanted: list[tuple[int, float]] = []
    if P.K_m or P.K_e:
        wanted.append((m.signs.sliding, P.K_m * tau_m - P.K_e * tau_e))
    if P.w_s is not None and (P.K_ms or P.K_es):
        wanted.append((m.signs.static, P.K_ms * tau_m - P.K_es * tau_e))
    if P.w_s is not None and (P.K_mq or P.K_eq) and joined(P, m):
        wanted += [(m.signs.motor, tau_m), (m.signs.external, tau_e), (m.signs.total, tau_m + tau_e)]
    return [s * x if s else -abs(x) for s, x in wanted]


def guards(P: Plant, m: Mode, y: Sequence[float], tau_m: float) -> list[tuple[str, float]]:
    """What ends the mode, by name."""
    q, w, v = y[Q], y[W], y[V]
    tau_e, one = -P.external(q) - P.B_L * w, joined(P, m)
    out: list[tuple[str, float]] = []
    if m.d:
        out.append(("speed", m.d * w))
        # To the last bit: the last bounces before rest are only femtoradians high.
        out.append(("stop", 100.0 * (P.upper - q if m.d > 0 else q - P.lower)))
    else:
        holds = P.holds(tau_m, tau_e, P.coulomb) if one else (-P.behind, P.behind)
        out += [("release", x) for x in _rest_guards(tau_e + (tau_m if one else 0.0), holds, blocked(P, q))]
    if not one:
        out += [("flank", 0.5 * P.play - (y[X] - q)), ("flank", 0.5 * P.play + (y[X] - q))]
        if m.d_m:
            out.append(("motor_speed", m.d_m * v))
        else:
            out += [("motor_release", x) for x in _rest_guards(tau_m, P.holds(tau_m, 0.0, -P.bearing), (False, False))]
    elif m.flank:
        out.append(("part", 1e-3 * m.flank * split(P, y, m.d, tau_m)))
    if m.d if one else m.d_m:
        out += [("torque", x) for x in _sign_guards(P, m, tau_m, tau_e if one else 0.0)]
    return out


def happen(P: Plant, m: Mode, y: list[float], name: str) -> float:
    """What an event does to the state; kinetic energy that it takes [J]."""
    if name == "speed":
        y[W] = 0.0
        if joined(P, m):
            y[V] = 0.0
    elif name == "motor_speed":
        y[V] = 0.0
    elif name == "part":
        m.flank = 0
    elif name == "stop":
        return _stop(P, m, y)
    elif name == "flank":
        return _flank(P, m, y)
    return 0.0


def _stop(P: Plant, m: Mode, y: list[float]) -> float:
    """Rebound of all that pushes towards the stop; the motor goes on where only the output does."""
    before, side = y[W], 1 if y[W] > 0.0 else -1
    y[Q] = P.upper if side > 0 else P.lower
    y[W] = -P.restitution * before
    if abs(y[W]) < REST_SPEED:
        y[W] = 0.0
    whole = not P.play or m.flank == side
    if whole:
        y[V] = y[W]
    return 0.5 * (P.J if whole else P.J_L) * (before**2 - y[W] ** 2)


def _flank(P: Plant, m: Mode, y: list[float]) -> float:
    """Plastic impact: from now on together, momentum kept; on a stop that is in the way both rebound at once."""
    m.flank = 1 if y[X] > y[Q] else -1
    w, v = y[W], y[V]
    y[X] = y[Q] + 0.5 * m.flank * P.play
    if m.flank * (v - w) < 0.0:  # not closing after all: it goes its way
        m.flank = 0
        return 0.0
    y[W] = y[V] = (P.J_L * w + P.J_m * v) / P.J
    lost = 0.5 * (P.J_L * w**2 + P.J_m * v**2 - P.J * y[W] ** 2)
    near = NO_WAY * max(1.0, abs(y[Q]))
    if w != 0.0 and (y[Q] >= P.upper - near if y[W] > 0.0 else y[Q] <= P.lower + near):
        # Motor and stop hit the output in turn, ever weaker and in no time (`test_drivetrain_stops.impacts`)
        lost += 0.5 * P.J * y[W] ** 2
        y[Q] = P.upper if y[W] > 0.0 else P.lower
        y[X], y[W], y[V] = y[Q] + 0.5 * m.flank * P.play, 0.0, 0.0
        return lost
    low, high = blocked(P, y[Q])
    if (high and y[W] > 0.0) or (low and y[W] < 0.0):
        return lost + _stop(P, m, y)
    if (high or low) and abs(y[W]) < REST_SPEED:  # a motor that cannot lift the output off its stop rests against it
        lost += 0.5 * P.J * y[W] ** 2
        y[W] = y[V] = 0.0
    return lost
