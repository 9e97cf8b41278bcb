"""How lanes with play in the gear go through a phase: lane by lane, for hardly two of them have the same legs."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.batch import tiles, warm_backlash
from servotwin.models.engine.legs import legs
from servotwin.models.engine.legs.legs import Gone
from servotwin.models.state.modes import Vector
from servotwin.models.terms import heat
from servotwin.models.terms.numbers import Numbers

CALLED = ("gone",)  # one lane: with copies it takes four times as long to compile

def phase(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive."""
    for j in range(size):
        if plan.time[j] > 0.0:
            alone(tile, plan, j)


def alone(tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    servo = tile.servo
    y = Vector(servo.q[j], servo.w[j], servo.i[j], servo.T_w[j], servo.T_h[j], servo.q_m[j], servo.w_m[j])
    moved = gone(tiles.numbers_at(tile.own, j), tile.hung.torque[j], plan.power[j], y, int(servo.mesh[j]),
                 servo.wiper[j], plan.time[j], tile.hung.tolerance[j])
    servo.q[j], servo.w[j], servo.wiper[j] = moved.y.q, moved.y.w, moved.wiper
    servo.q_m[j], servo.w_m[j], servo.mesh[j] = moved.y.q_m, moved.y.w_m, moved.mode.mesh
    servo.T_w[j], servo.T_h[j] = moved.y.T_w, moved.y.T_h
    plan.lost[j] = plan.lost[j] if moved.done > 0.0 else 1.0


def gone(numbers: Numbers, torque: float, drive: float, y: Vector, mesh: int, wiper: float, time: float,
         tolerance: float) -> Gone:
    """Return where a servo goes within a time [s] under one drive (−1, 0, +1) and an external torque [N m]."""
    u = drive * numbers.source.V
    if heat.present(numbers.heat):
        return warm_backlash.go(numbers, torque, u, y, mesh, wiper, time, tolerance)
    return legs.go(numbers, torque, u, y, legs.mode_from(numbers, torque, u, y, mesh), wiper, time)
