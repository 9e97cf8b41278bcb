"""The loop of a pulse servo at its frames: each decision is one burst of full voltage, as long as the error asks for.

Behind the end of the pulses, d after the edge, the bridge drives for t_on = K s_µ |e|. A short burst is an impulse of
voltage, of area A k_s T_f p e. One that is not short begins with its first volt and ends with its last, so it comes
later in the mean than an impulse, the more so the larger the error; for an error that goes as E sin θ from frame to
frame, its describing function is (4/πE) ∫ f(E sin θ) sin θ dθ over a quarter of a turn, of what one burst does (Gelb &
Vander Velde, Multiple-Input Describing Functions, 1968, ch. 2). At E → 0 that is the impulse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from servotwin.linear.plant import Plant
from servotwin.linear.steps import step_of

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_NODES, _WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(24)[0] + 1.0) * 0.5 * math.pi,
                    np.polynomial.legendre.leggauss(24)[1] * 0.25 * math.pi)  # over a quarter of a turn
_ERRORS = np.geomspace(1e-3, 30.0, 60)  # of the command's amplitude, among which that of the error is looked for


@dataclass(frozen=True, kw_only=True, eq=False)
class Bursts:
    """What decides at every frame, and what that does to the plant.

    Parameters
    ----------
    plant : Plant
    period : float
        T_f [s]
    delay : float
        d, from the edge to the end of its pulse [s].
    spread : float
        By how much the later of the two pulses ends later, of the error: ½ s_µ [s/rad].
    stretch : float
        K s_µ: for how long the bridge drives, of the error [s/rad].
    voltage : float
        Behind R_a while it drives [V].
    """

    plant: Plant
    period: float
    delay: float
    spread: float
    stretch: float
    voltage: float

    @property
    def ticks(self) -> int:
        """Every frame is the same."""
        return 1

    @property
    def transition(self) -> Array:
        """Of the plant from edge to edge, shape (n, n)."""
        return step_of(self.plant.A, self.plant.B, self.period).transition

    def jump(self, error: float = 0.0) -> Array:
        """Return what a frame's burst leaves in the plant at the next edge, per error of an amplitude [rad]."""
        A, B = self.plant.A, self.plant.B
        if error == 0.0:
            found: Array = expm(A * (self.period - self.delay)) @ B * self.voltage * self.stretch
            return found
        found = np.zeros(len(B))
        for e, length, start, share in self._bursts(error):
            left = self.period - start - length
            found += share / e * self.voltage * (expm(A * left) @ step_of(A, B, length).gain)
        return found

    def spectrum(self, omega: float, error: float = 0.0) -> complex:
        """Return the fundamental of the voltage over that of the error, whose samples have an amplitude [V/rad]."""
        if error == 0.0:
            return complex(self.voltage * self.stretch / self.period * np.exp(-1j * omega * self.delay))
        found = 0j
        for e, length, start, share in self._bursts(error):
            found += share / e * (np.exp(-1j * omega * start) * (1.0 - np.exp(-1j * omega * length)) / (1j * omega))
        return complex(self.voltage / self.period * found)

    def _bursts(self, error: float) -> list[tuple[float, float, float, float]]:
        """Return error, length, start and weight of the bursts over a quarter of a turn of the error's phase."""
        sizes = error * np.sin(_NODES)
        shares = 4.0 / math.pi * np.sin(_NODES) ** 2 * _WEIGHTS
        return [(e, min(self.stretch * e, self.period), self.delay + self.spread * e, share)
                for e, share in zip(sizes.tolist(), shares.tolist(), strict=True)]

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return L*, angle at the edges over error, shape of `omega`."""
        z = np.exp(1j * np.asarray(omega) * self.period)[..., np.newaxis, np.newaxis] * np.eye(len(self.plant.B))
        moved = np.linalg.solve(z - self.transition, self.jump(error)[:, np.newaxis])[..., 0]
        return np.asarray(moved @ self.plant.angle, np.complex128)

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output angle over a commanded angle's, shape of `omega`."""
        found = [self._at(w, self._error(w, amplitude)) for w in np.ravel(omega).tolist()]
        return np.array(found).reshape(np.shape(omega))

    def _at(self, omega: float, error: float) -> complex:
        if math.isnan(error):
            return complex(math.nan, math.nan)
        one = np.array([omega])
        return complex((self.plant.response(one) * self.spectrum(omega, error)
                        / (1.0 + self.open_loop(one, error)))[0])

    def _error(self, omega: float, amplitude: float) -> float:
        """Return the amplitude of the error under a commanded sine: where E |1 + L*(E)| is that of the command."""
        if amplitude == 0.0:
            return 0.0

        def beyond(error: float) -> float:
            return error * abs(1.0 + complex(self.open_loop(np.array([omega]), error)[0])) - amplitude

        sizes = (amplitude * _ERRORS).tolist()
        above = next((k for k, size in enumerate(sizes) if beyond(size) > 0.0), 0)
        if above == 0:
            return math.nan
        return float(brentq(beyond, sizes[above - 1], sizes[above], rtol=1e-9))

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop over a frame, its gain `gain` times its own."""
        return self.transition - gain * np.outer(self.jump(), self.plant.angle)
