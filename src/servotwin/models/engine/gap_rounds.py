"""How lanes with play in the gear go through a window: lane by lane, for hardly two of them have the same legs."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine import gaps, tiles
from servotwin.models.engine.gaps import Gone


def phases(size: int, keep: bool, tile: Any, plan: Any) -> None:
    """Move all lanes through the four phases; keep the state at the start of each where it is wanted."""
    loose = tile.loose
    for j in range(size):
        _note(loose.q_m1, loose.w_m1, loose.mesh1, loose, j)
    for j in range(size):
        if plan.window[j] > 0.0:
            for phase in range(4):
                if keep:
                    _keep(phase, tile, plan, j)
                time = plan.time1[j] if phase == 0 else plan.time2[j] if phase == 1 else plan.time3[j]
                time = time if phase < 3 else plan.time4[j]
                if time > 0.0:
                    _go(plan.drive1[j] if phase == 0 else plan.drive3[j] if phase == 2 else 0.0, time, tile, plan, j)


def _go(drive: float, time: float, tile: Any, plan: Any, j: int) -> None:
    """Move one lane through one phase."""
    servo, loose = tile.servo, tile.loose
    y = (servo.q[j], servo.w[j], 0.0, 0.0, 0.0, loose.q_m[j], loose.w_m[j])
    gone = gaps.go(tiles.numbers_at(tile.own, j), tile.hung.torque[j], drive, y, int(loose.mesh[j]), servo.wiper[j],
                   time)
    servo.q[j], servo.w[j], servo.wiper[j] = gone.y[0], gone.y[1], gone.wiper
    loose.q_m[j], loose.w_m[j], loose.mesh[j] = gone.y[5], gone.y[6], gone.mode.mesh
    plan.lost[j] = plan.lost[j] if gone.done > 0.0 else 1.0


def look(phase: int, drive: float, q: float, w: float, wiper: float, time: float, tile: Any, j: int) -> Gone:
    """Return where a lane is, so much time [s] after it entered a phase that is numbered from 0 on."""
    loose = tile.loose
    q_m, w_m, mesh = loose.q_m1[j], loose.w_m1[j], loose.mesh1[j]
    if phase == 1:
        q_m, w_m, mesh = loose.q_m2[j], loose.w_m2[j], loose.mesh2[j]
    elif phase == 2:
        q_m, w_m, mesh = loose.q_m3[j], loose.w_m3[j], loose.mesh3[j]
    elif phase == 3:
        q_m, w_m, mesh = loose.q_m4[j], loose.w_m4[j], loose.mesh4[j]
    return gaps.go(tiles.numbers_at(tile.own, j), tile.hung.torque[j], drive, (q, w, 0.0, 0.0, 0.0, q_m, w_m),
                   int(mesh), wiper, time)


def give_back(size: int, tile: Any, plan: Any) -> None:
    """Put motors and meshes of lanes that are given up back to where the window began."""
    loose = tile.loose
    for j in range(size):
        if plan.lost[j] > 0.0:
            loose.q_m[j], loose.w_m[j], loose.mesh[j] = loose.q_m1[j], loose.w_m1[j], loose.mesh1[j]


def _note(angle: Any, speed: Any, mesh: Any, loose: Any, j: int) -> None:
    angle[j], speed[j], mesh[j] = loose.q_m[j], loose.w_m[j], loose.mesh[j]


def _keep(phase: int, tile: Any, plan: Any, j: int) -> None:
    """Keep the state of a lane at the start of a phase; motor and mesh at that of the first are kept anyway."""
    loose, q, w, wiper = tile.loose, tile.servo.q[j], tile.servo.w[j], tile.servo.wiper[j]
    if phase == 0:
        plan.q1[j], plan.w1[j], plan.wiper1[j] = q, w, wiper
    elif phase == 1:
        plan.q2[j], plan.w2[j], plan.wiper2[j] = q, w, wiper
        _note(loose.q_m2, loose.w_m2, loose.mesh2, loose, j)
    elif phase == 2:
        plan.q3[j], plan.w3[j], plan.wiper3[j] = q, w, wiper
        _note(loose.q_m3, loose.w_m3, loose.mesh3, loose, j)
    else:
        plan.q4[j], plan.w4[j], plan.wiper4[j] = q, w, wiper
        _note(loose.q_m4, loose.w_m4, loose.mesh4, loose, j)
