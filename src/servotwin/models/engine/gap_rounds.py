"""How lanes with play in the gear go through a phase: lane by lane, for hardly two of them have the same legs."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine import gaps, tiles
from servotwin.models.engine.modes import Vector


def phase(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive."""
    for j in range(size):
        if plan.time[j] > 0.0:
            alone(tile, plan, j)


def alone(tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    servo = tile.servo
    y = Vector(servo.q[j], servo.w[j], servo.i[j], servo.T_w[j], servo.T_h[j], servo.q_m[j], servo.w_m[j])
    gone = gaps.go(tiles.numbers_at(tile.own, j), tile.hung.torque[j], plan.power[j], y, int(servo.mesh[j]),
                   servo.wiper[j], plan.time[j])
    servo.q[j], servo.w[j], servo.wiper[j] = gone.y.q, gone.y.w, gone.wiper
    servo.q_m[j], servo.w_m[j], servo.mesh[j] = gone.y.q_m, gone.y.w_m, gone.mode.mesh
    plan.lost[j] = plan.lost[j] if gone.done > 0.0 else 1.0
