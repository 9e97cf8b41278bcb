"""The closed form of one frame over arrays, as the array peers and the count of work use it; `pulse.c` says the same.

`xp` is NumPy or jax.numpy. A braked bridge, no inductance, no stops; between switchings dw/dt = f − sgn(w) F − λ w.
"""

from typing import Any, NamedTuple

from fleet import FRAME

Array = Any


class State(NamedTuple):
    """At the edge of a frame: angle, speed, sign of the drive and how long it still lasts [s]."""

    angle: Array
    speed: Array
    drive: Array
    left: Array


class Legs(NamedTuple):
    """Which lanes moved: before the speed reached zero, and from rest on."""

    sliding: Array
    stopped: Array
    released: Array


def phase(xp: Any, lane: dict[str, Array], q: Array, w: Array, f: Array, rate: Array, t: Array) -> tuple[Array, ...]:
    """Move for a time t under constant drive: slide until the speed is zero, then stick or start anew."""
    tau = 1.0 / rate
    v = (f - xp.where(w > 0.0, lane["forward"], -lane["backward"])) * tau  # where the speed would settle
    turns = w * v < 0.0
    t_stop = xp.where(turns, xp.log(1.0 - w / xp.where(turns, v, 1.0)) * tau, t)
    stops = turns & (t_stop <= t)
    t_1 = xp.where(w == 0.0, 0.0, xp.minimum(t_stop, t))
    E = 1.0 - xp.exp(-rate * t_1)
    q = q + v * t_1 + (w - v) * E * tau
    sliding, resting = t_1 > 0.0, (w == 0.0) | stops
    w = xp.where(resting, 0.0, w + (v - w) * E)
    g = xp.where(f > lane["breakaway"] * lane["forward"], f - lane["forward"],
                 xp.where(f < -lane["breakaway"] * lane["backward"], f + lane["backward"], 0.0))
    t_2 = t - t_1
    v = xp.where(resting, g, 0.0) * tau
    E = 1.0 - xp.exp(-rate * t_2)
    q, w = q + v * (t_2 - E * tau), w + v * E
    return q, w, Legs(sliding, stops, (v != 0.0) & (t_2 > 0.0))


def frame(xp: Any, lane: dict[str, Array], state: State, t_in: Array) -> tuple[State, tuple[Legs, ...]]:
    """Advance by one frame: the drive left over, brake until the decision, the new drive, brake."""
    q, w, s, left = state
    T_os = xp.maximum(0.0, lane["offset"] + lane["slope"] * q)
    e = t_in - T_os
    u = xp.abs(e) - lane["half_deadband"]
    t_on = xp.where(u > 0.0, lane["minimum"] + lane["gain"] * u, 0.0)
    d = xp.maximum(t_in, T_os)
    legs = []
    t = xp.minimum(left, d)
    q, w, moved = phase(xp, lane, q, w, s * lane["push"] - lane["torque"], lane["drive_rate"], t)
    legs.append(moved)
    q, w, moved = phase(xp, lane, q, w, -lane["torque"], lane["brake_rate"], d - t)
    legs.append(moved)
    s = xp.where(e > 0.0, xp.ones_like(e), -xp.ones_like(e))
    t = xp.minimum(t_on, FRAME - d)
    q, w, moved = phase(xp, lane, q, w, s * lane["push"] - lane["torque"], lane["drive_rate"], t)
    legs.append(moved)
    q, w, moved = phase(xp, lane, q, w, -lane["torque"], lane["brake_rate"], FRAME - d - t)
    legs.append(moved)
    return State(q, w, s, xp.maximum(0.0, t_on - (FRAME - d))), tuple(legs)
