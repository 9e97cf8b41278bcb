"""A loop around a pulse servo: an integrator that moves the command, once a frame, by what the tap says is missing.

c[n+1] = c[n] + g (r − q[n]): what a microcontroller can do about droop, dead zone and friction. The servo itself gets
the angle c as a pulse; g is the part of the error that is made good in a frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from servotwin import signals
from servotwin.linear.bursts import Bursts
from servotwin.loads import Load
from servotwin.models import PulseServo, PulseServoInductive
from servotwin.simulation import Simulator

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class OuterLoop:
    """The loop of a servo at its frames, and an integrator around it.

    Parameters
    ----------
    inner : Bursts
    gain : float
        g, of the error that the command makes good in a frame [1].
    """

    inner: Bursts
    gain: float

    @property
    def ticks(self) -> int:
        """Every frame is the same."""
        return 1

    @property
    def period(self) -> float:
        """T_f [s]."""
        return self.inner.period

    @cached_property
    def _steps(self) -> tuple[Array, Array]:
        """Return transition and input of plant and command, for what is added to the command at an edge."""
        n, jump = len(self.inner.plant.B), self.inner.jump()
        transition = np.zeros((n + 1, n + 1))
        transition[:n, :n], transition[:n, n], transition[n, n] = self.inner.monodromy(), jump, 1.0
        return transition, np.append(jump, 1.0)  # what is added counts in this very frame

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return the loop, angle at the edges over the error that is integrated, shape of `omega`."""
        transition, told = self._steps
        z = np.exp(1j * np.asarray(omega) * self.period)[..., np.newaxis, np.newaxis] * np.eye(len(told))
        moved = np.linalg.solve(z - transition, self.gain * told[:, np.newaxis])[..., 0]
        return np.asarray(moved @ np.append(self.inner.plant.angle, 0.0), np.complex128)

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output angle over a wanted angle's, shape of `omega`."""
        omega = np.asarray(omega, dtype=np.float64)
        z = np.exp(1j * omega * self.period)
        added = self.gain * z / (z - 1.0) / (1.0 + self.open_loop(omega))  # command over wanted angle
        return np.asarray(added * self.inner.closed_loop(omega), np.complex128)

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop over a frame, its gain `gain` times its own."""
        transition, told = self._steps
        return transition - gain * self.gain * np.outer(told, np.append(self.inner.plant.angle, 0.0))


def stepped(model: PulseServo | PulseServoInductive, load: Load, gain: float, *, start: float, step: float,
            frames: int) -> Array:
    """Return the output angle at the edges of a simulated step of the wanted angle, all terms counted.

    Parameters
    ----------
    model : PulseServo or PulseServoInductive
    load : Load
    gain : float
        g [1]
    start, step : float
        Where the servo rests, and by how much the wanted angle steps [rad].
    frames : int
    """
    simulator, T_f = Simulator(model, load=load), model.frame_period
    asked, wanted = start, start + step
    state = simulator.initial(signals.constant(asked, unit="rad"))
    angles = [state["output_angle"]]
    low, high = (model.value_or(f"stops.{side}_angle", side_at) for side, side_at in (
        ("lower", -np.inf), ("upper", np.inf)))
    for k in range(frames):
        asked = min(max(asked + gain * (wanted - state["output_angle"]), low), high)
        state = simulator.advance(state, (k + 1) * T_f, signals.constant(asked, unit="rad"))
        angles.append(state["output_angle"])
    return np.array(angles)
