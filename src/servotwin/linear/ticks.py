"""The loop of a digital servo at its ticks: P, I and D of what it measures, each duty held for a tick.

The derivative is renewed every m-th tick and held between, so the loop is the same again after m ticks, not after one:
its fundamental is taken over m of them. Counts, dead zone, limits and profile are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.linear.plant import Plant
from servotwin.linear.steps import step_of
from servotwin.models.terms.firmware import Firmware

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_SAME = 1e-9  # of a tick


class _Tick(NamedTuple):
    """z' = transition z + drive d + told r, and the duty u = law z + direct r on which the program decides."""

    transition: Array
    drive: Array
    told: Array
    law: Array
    direct: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Ticks:
    """What decides at every tick, and what that does to the plant.

    Parameters
    ----------
    plant : Plant
    firmware : Firmware
    voltage : float
        Of the bridge at a duty of 1 [V].
    command : (float, float)
        Delay of the command [s], and for how long it is held [s].
    """

    plant: Plant
    firmware: Firmware
    voltage: float
    command: tuple[float, float]

    @property
    def period(self) -> float:
        """T_c [s]."""
        return self.firmware.T_c

    @property
    def ticks(self) -> int:
        """After how many ticks the loop is the same again."""
        return round(self.firmware.m) if self.firmware.k_d > 0.0 else 1

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return minus the fundamental of the duty decided over that of the duty applied, shape of `omega`."""
        return -self._fundamental(np.asarray(omega), closed=False)

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output angle over a commanded angle's, shape of `omega`."""
        omega = np.asarray(omega, dtype=np.float64)
        delay, held = self.command
        told = np.exp(-1j * omega * (delay + 0.5 * held)) * np.sinc(omega * held / (2.0 * np.pi))
        applied = np.exp(-1j * omega * (self.firmware.T_d + 0.5 * self.period)) * np.sinc(
            omega * self.period / (2.0 * np.pi))
        found: Complex = (self.plant.response(omega) * self.voltage * applied * told
                          * self._fundamental(omega, closed=True))
        return found

    def _fundamental(self, omega: Array, *, closed: bool) -> Complex:
        """Return the fundamental of the duty decided, over a command's or, with the loop open, over a duty's."""
        ticks = self._all
        size, flat = len(ticks[0].drive), np.ravel(omega)
        turn = np.exp(1j * flat * self.period)
        z, moved = np.zeros((len(flat), size), complex), np.broadcast_to(np.eye(size), (len(flat), size, size))
        steps = [(t.transition + np.outer(t.drive, t.law), t.told + t.drive * t.direct) if closed else
                 (t.transition, t.drive) for t in ticks]
        for k, (transition, told) in enumerate(steps):  # from nothing; then what has to be there for it to go on
            z, moved = z @ transition.T + np.outer(turn**k, told), transition @ moved
        z = np.linalg.solve(turn[:, None, None] ** len(ticks) * np.eye(size) - moved, z[..., None])[..., 0]
        duty: Complex = np.zeros(len(flat), np.complex128)
        for k, (tick, (transition, told)) in enumerate(zip(ticks, steps, strict=True)):
            duty += (z @ tick.law) * turn**-k + (tick.direct if closed else 0.0)
            z = z @ transition.T + np.outer(turn**k, told)
        return (duty / len(ticks)).reshape(np.shape(omega))

    def over_a_turn(self) -> tuple[Array, Array]:
        """Return the closed loop until it is the same again, under an angle r held meanwhile: z' = A z + B r."""
        A, B = np.eye(len(self._all[0].drive)), np.zeros(len(self._all[0].drive))
        for tick in self._all:
            closed = tick.transition + np.outer(tick.drive, tick.law)
            A, B = closed @ A, closed @ B + tick.told + tick.drive * tick.direct
        return A, B

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop until it is the same again, its gain `gain` times its own."""
        found = np.eye(len(self._all[0].drive))
        for tick in self._all:
            found = (tick.transition + gain * np.outer(tick.drive, tick.law)) @ found
        return found

    @cached_property
    def _all(self) -> list[_Tick]:
        """The ticks until the loop is the same again: the first one renews the derivative."""
        return [self._tick(renews=self.firmware.k_d > 0.0), *[self._tick(renews=False)] * (self.ticks - 1)]

    def _tick(self, *, renews: bool) -> _Tick:
        fw, plant, n = self.firmware, self.plant, len(self.plant.B)
        late = int((fw.T_d + _SAME * fw.T_c) // fw.T_c)  # whole ticks by which a duty comes late
        rest = max(fw.T_d - late * fw.T_c, 0.0)
        y_at, D_at, x_at, J_at, first = n, n + 1, n + 2, n + 3, n + 4
        size = first + late + 1  # duties that wait: of the latest tick first
        unit = np.eye(size + 2)
        r, d = unit[size], unit[size + 1]
        q = np.concatenate([plant.angle, np.zeros(size + 2 - n)])
        y = (1.0 - fw.weight) * unit[y_at] + fw.weight * q
        e = r - y
        x = -y if fw.of_measurement > 0.0 else e
        D = fw.k_d * (x - unit[x_at]) / (fw.m * fw.T_c) if renews else unit[D_at] * (fw.k_d > 0.0)
        integrates = fw.k_i > 0.0 and fw.at_rest == 0.0
        J = unit[J_at] + fw.k_i * fw.T_c * e if integrates else 0.0 * e
        u = fw.k_p * e + J + D
        waiting = [d, *unit[first:size]]
        before, after = step_of(plant.A, plant.B, rest), step_of(plant.A, plant.B, fw.T_c - rest)
        state = np.zeros((n, size + 2))
        state[:, :n] = after.transition @ before.transition
        state += self.voltage * (np.outer(after.transition @ before.gain, waiting[late + 1])
                                 + np.outer(after.gain, waiting[late]))
        then = x if renews else unit[x_at] * (fw.k_d > 0.0)
        new = np.vstack([state, y, D, then, J, *waiting[:late + 1]])
        return _Tick(new[:, :size], new[:, size + 1], new[:, size], u[:size], float(u[size]))
