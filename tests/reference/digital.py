"""Independent reference of the digital servo, written from its specification: slow, plain, one servo, one supply.

What the clock does is known beforehand and met exactly: new duty, load, tick, sample, in this order at one instant.
Between instants `digital_motion` moves the shaft, or `digital_train` motor and output where the gear has play; at ticks
`digital_firmware` decides. Elasticity of the gear is left out.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .digital_circuit import Bridge
from .digital_command import Commands
from .digital_firmware import Firmware, Sensed, Tick
from .digital_motion import ENERGIES, Shaft
from .digital_plant import make_plant
from .digital_train import Meeting, Train
from .recorded import recorded

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Any]]
SAME = 1e-9  # of a tick: instants this near are one


@dataclass(frozen=True, kw_only=True)
class Trace:
    """Arrays at the asked times, each the value just after what happens there, and one row per tick."""

    times: Array
    output_angle: Array
    output_speed: Array
    current: Array  # as reported: of a slow bridge that while it is on
    bus_voltage: Array
    winding_temperature: Array
    housing_temperature: Array
    tick_time: Array
    duty: Array  # as decided; nan: open
    goal: Array  # nan: none
    reference: Array
    trip: NDArray[np.int64]
    y: Array
    events: tuple[tuple[float, str], ...]
    energy: dict[str, float]  # by the end of the run [J]; kinetic: gained
    least_tie: float  # smallest distance of a measured angle from a change of its count [counts]
    meetings: tuple[Meeting, ...] = ()  # of motor and output, where the gear has play


class _Run:
    """One run as time goes by."""

    def __init__(self, values: Values, command: Mapping[str, Any], load: Mapping[str, Any], seed: int,
                 initial_angle: float) -> None:
        self.f, self.pot = values["firmware"], values.get("potentiometer", {})
        self.T_c, self.phase = float(self.f["control_period"]), float(self.f.get("control_phase", 0.0))
        self.delay, self.slack = float(self.f.get("compute_delay", 0.0)), SAME * self.T_c
        self.firmware = Firmware(values, Commands(values, command, self.slack), seed)
        bridge = Bridge(self.f.get("off_state", "brake"))
        self.shaft: Shaft | Train
        if values["gear"].get("backlash"):
            self.shaft = Train(values, load, initial_angle, bridge)
        else:
            self.shaft = Shaft(make_plant(values, load), initial_angle, bridge, play=self.pot.get("backlash", 0.0))
        self.torque_off = command.get("torque_off", ())
        self.pieces = deque(self.shaft.P.torque[1:])
        self.duties: deque[tuple[float, Bridge]] = deque()
        self.ticks: list[Tick] = []

    def next(self) -> float:
        """Time of the next instant that is not a sample."""
        waits = [self.phase + len(self.ticks) * self.T_c]
        waits += [self.duties[0][0]] if self.duties else []
        waits += [self.pieces[0].start] if self.pieces else []
        return min(waits)

    def happen(self, t: float) -> None:
        """Do all that is due."""
        self._apply(t)
        while self.pieces and self.pieces[0].start <= t + self.slack:
            self.shaft.piece = self.pieces.popleft()
        tick = self.phase + len(self.ticks) * self.T_c
        if tick <= t + self.slack:
            self._tick(tick)
            self._apply(t)

    def _apply(self, t: float) -> None:
        while self.duties and self.duties[0][0] <= t + self.slack:
            self.shaft.switch(self.duties.popleft()[1])

    def _tick(self, t: float) -> None:
        shaft = self.shaft
        current, bus = shaft.now()
        R_a, _, K_b = shaft.electric()
        sensed = Sensed(self._angle(), shaft.motor_speed, current, bus, shaft.T_h, R_a + shaft.P.r_c, K_b)
        torque = not any(start <= t + self.slack < end for start, end in self.torque_off)
        row, bridge = self.firmware.tick(t, sensed, torque)
        self.ticks.append(row)
        self.duties.append((t + self.delay, bridge))

    def _angle(self) -> float:
        """What the sensor gives: a potentiometer with play and linearity error, or the angle itself."""
        if "feedback_gain" not in self.pot:
            return self.shaft.q
        x, error = self.shaft.wiper, 0.0
        if self.pot.get("linearity_angle"):
            error = float(np.interp(x, self.pot["linearity_angle"], self.pot["linearity_error"]))
        return x + error / float(self.pot["feedback_gain"])

    def sample(self) -> tuple[float, ...]:
        shaft = self.shaft
        return (shaft.q, shaft.w, *shaft.now(), shaft.T_w, shaft.T_h)


@recorded
def run(values: Values, command: Mapping[str, Any], load: Mapping[str, Any], duration: float,
        times: Sequence[float] | NDArray[np.floating[Any]], seed: int = 0, initial_angle: float | None = None) -> Trace:
    """Motion of a digital servo that rests at an angle at t = 0.

    Parameters
    ----------
    values : mapping
        Values in SI by group and field.
    command : mapping
        {"kind": "pulse", "edges", "widths"} or {"kind": "goal", "pieces": [(start, value, slope), ...]}; "torque_off"
        lists the stretches (start, end) without torque.
    load : mapping
        "inertia", "viscous_friction", "torque" (a number or [(start, value, slope), ...]), "stiffness" and "rest",
        "pendulum" {"mass", "length", "gravity"}.
    duration : float
        End of the run [s].
    times : array, shape (n,)
        Rising, up to `duration` [s].
    """
    one = _Run(values, command, load, seed, 0.0 if initial_angle is None else initial_angle)
    start, rows, waiting = one.shaft.kinetic(), [], deque(float(t) for t in times)
    one.happen(0.0)
    while True:
        while waiting and waiting[0] <= one.shaft.t + one.slack:
            rows.append(one.sample())
            waiting.popleft()
        if one.shaft.t >= duration - one.slack:
            break
        until = min(one.next(), duration, waiting[0] if waiting else math.inf)
        one.shaft.advance(until)
        one.happen(until)
    return _trace(one, np.asarray(times, dtype=float), rows, start)


def _trace(one: _Run, times: Array, rows: list[tuple[float, ...]], start: float) -> Trace:
    q, w, i, V, T_w, T_h = np.array(rows).reshape(-1, 6).T
    t, duty, goal, reference, trip, y = np.array(one.ticks, dtype=float).reshape(-1, 6).T
    energy = dict(zip(ENERGIES, one.shaft.energy.tolist(), strict=True))
    return Trace(
        times=times, output_angle=q, output_speed=w, current=i, bus_voltage=V, winding_temperature=T_w,
        housing_temperature=T_h, tick_time=t, duty=duty, goal=goal, reference=reference, y=y,
        trip=trip.astype(np.int64), events=tuple(one.shaft.events),
        energy=energy | {"stops": one.shaft.impacts, "kinetic": one.shaft.kinetic() - start},
        least_tie=one.firmware.least_tie,
        meetings=tuple(one.shaft.meetings) if isinstance(one.shaft, Train) else (),
    )
