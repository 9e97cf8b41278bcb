"""The search of a robot's numbers: bounded least squares with a robust loss (Levenberg, Marquardt)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.rows import (
    Copies,
    Episode,
    Linear,
    Mask,
    Noise,
    linear_at,
    parts_of,
    residuals,
    steps_by,
    usual_steps,
)
from servotwin.identification.fitting.arrow import Loss, Prior, block

Array = NDArray[np.float64]
Tell = Callable[[int, Array], object]  # the number of a step, and the best point so far
_DAMPINGS = (1e-4, 0.1, 10.0)  # tried side by side
_LEAST_GAIN = 3e-3  # of the cost: servos that count make it rough
_LEAST_GAIN_ALONG = 3e-4  # likewise, where a step costs little
_ROUGH = 2e-3  # of the cost: what counting servos scatter it by
_RETRIES, _FIRMER = 2, 300.0  # of steps that gained nothing, with so many times the damping


class Trial(NamedTuple):
    """A point that a step leads to, its cost, and the residuals of all episodes there."""

    x: Array
    cost: float
    residuals: list[Array]


class ArmSearch:
    """A least-squares problem over episodes of a robot.

    Parameters
    ----------
    simulated : Copies
    episodes : sequence of Episode
    used : sequence of ndarray of bool
        Which samples of each count.
    noise : Noise
    loss : Loss
    prior : Prior
    held : ndarray of bool
        Numbers that stay.
    steps : ndarray, optional
        For derivatives, on the scales of the numbers; the longest ones unless given. Each derivative mends them.
    """

    def __init__(self, simulated: Copies, episodes: Sequence[Episode], used: Sequence[Mask], noise: Noise,
                 loss: Loss, prior: Prior, held: Mask, steps: Array | None = None) -> None:
        self.simulated, self.episodes, self.used = simulated, list(episodes), list(used)
        self.noise, self.loss, self.prior, self.held = noise, loss, prior, held
        self.steps = usual_steps(simulated.numbers) if steps is None else steps

    def cost(self, x: Array, found: Sequence[Array]) -> float:
        """Return the cost of a point whose residuals are known; inf where a lane failed."""
        total = self.prior.cost(x)
        for episode, residual, used in zip(self.episodes, found, self.used, strict=True):
            total += sum(self.loss.cost(part.residual) for part in parts_of(episode, residual, None, self.noise, used))
        return total if math.isfinite(total) else math.inf

    def costs(self, points: Array) -> list[float]:
        """Return the costs of several points."""
        return [self.cost(x, found) for x, found in zip(points, self.left(points), strict=True)]

    def left(self, points: Array) -> list[list[Array]]:
        """Return the residuals of all episodes at several points."""
        found = [residuals(self.simulated, episode, points) for episode in self.episodes]
        return [[one[k] for one in found] for k in range(len(points))]

    def linear(self, x: Array, *, central: bool = False) -> list[Linear]:
        """Return residuals and derivatives of all episodes at a point."""
        found = [linear_at(self.simulated, episode, x, self.held, self.steps, central=central)
                 for episode in self.episodes]
        self.steps = steps_by(usual_steps(self.simulated.numbers), np.concatenate(
            [part.shared for episode, one, used in zip(self.episodes, found, self.used, strict=True)
             for part in parts_of(episode, one.residual, one.slopes, self.noise, used)]))
        return found

    def normal(self, x: Array, found: Sequence[Array], slopes: Sequence[Array]) -> tuple[Array, Array]:
        """Return gradient and matrix of the normal equations."""
        g, H = (x - self.prior.mean) * self.prior.weight**2, np.diag(self.prior.weight**2)
        for episode, residual, slope, used in zip(self.episodes, found, slopes, self.used, strict=True):
            for part in parts_of(episode, residual, slope, self.noise, used):
                one = block(part, self.loss)
                g, H = g + one.g_s, H + one.H_ss
        return g, H

    def tried(self, x: Array, g: Array, H: Array, scale: float) -> list[Trial]:
        """Return points of steps that are damped more and more, their costs and residuals."""
        lower, upper = self.simulated.numbers.lower, self.simulated.numbers.upper
        points = np.stack([stepped(x, g, H, scale * damping, lower, upper, self.held) for damping in _DAMPINGS])
        return [Trial(point, self.cost(point, found), found)
                for point, found in zip(points, self.left(points), strict=True)]

    def along(self, x: Array, slopes: Sequence[Array], *, most: int, tell: Tell = lambda step, x: None) -> Array:
        """Return the best point that steps by the same derivatives come to."""
        scale, found = 1.0, self.left(x[None])[0]
        best = self.cost(x, found)
        for turn in range(most):
            tell(turn, x)
            trials = self.tried(x, *self.normal(x, found, slopes), scale)
            k = int(np.argmin([one.cost for one in trials]))
            if turn == 0 and trials[0].cost < best * (1.0 + _ROUGH):  # what no data hold goes back to what is believed
                k = 0
            elif not trials[k].cost < best * (1.0 - _LEAST_GAIN_ALONG):
                break
            (x, best, found), scale = trials[k], scale * (1.0 if k < 2 else 10.0)
        return x

    def run(self, x: Array, *, most: int, tell: Tell = lambda step, x: None) -> Array:
        """Return the best point that a search from another one comes to."""
        best, scale = math.inf, 1.0
        for step in range(most):
            tell(step, x)
            linear = self.linear(x)
            found = [one.residual for one in linear]
            best = self.cost(x, found)
            normal = self.normal(x, found, [one.slopes for one in linear])
            for _ in range(_RETRIES):
                trials = self.tried(x, *normal, scale)
                k = int(np.argmin([one.cost for one in trials]))
                if trials[k].cost < best:
                    break
                scale *= _FIRMER
            else:
                break
            gain = best - trials[k].cost
            x, scale = trials[k].x, max(scale * (0.3 if k == 0 else 1.0), 1e-3)
            if gain < _LEAST_GAIN * best:
                break
        return x


def stepped(x: Array, g: Array, H: Array, damping: float, lower: Array, upper: Array, held: Mask) -> Array:
    """Return the next point of a damped step within bounds."""
    damped = H + damping * np.diag(np.maximum(np.diag(H), 1e-9))
    stays = held | ((x <= lower) & (g > 0.0)) | ((x >= upper) & (g < 0.0))
    change = np.zeros(len(x))
    for _ in range(len(x) + 1):
        moves = ~stays
        if not moves.any():
            break
        fixed = damped[np.ix_(moves, stays)] @ change[stays]
        change[moves] = -np.linalg.lstsq(damped[np.ix_(moves, moves)], g[moves] + fixed, rcond=1e-14)[0]
        over = moves & ((x + change < lower) | (x + change > upper))
        if not over.any():
            break
        change[over] = np.clip(x + change, lower, upper)[over] - x[over]
        stays = stays | over
    return np.asarray(np.clip(x + change, lower, upper))
