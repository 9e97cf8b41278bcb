"""A forecast without a servo: residuals and derivatives are plain functions, so that others can solve the same."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from servotwin.identification.fitting.search.case import STEP, LogPart, Point

Array = Any


class Toy:
    """`logs` functions of shared numbers and of a log's own ones; derivatives by complex steps, exact to rounding.

    `belief` (mean and weight of every own number) is none unless given.
    """

    def __init__(self, functions: Sequence[Callable[[Array, Array], Array]], size: int, own: int,
                 belief: tuple[float, float] = (0.0, 0.0)) -> None:
        self.functions, self.size, self.own, self.belief = list(functions), size, own, belief
        self.cases = tuple(range(len(self.functions)))
        self.calls, self.step = 0, STEP

    def own_belief(self, case: int) -> tuple[Array, Array]:
        return np.full(self.own, self.belief[0]), np.full(self.own, self.belief[1])

    def own_reach(self, case: int) -> Array:
        return np.full(self.own, np.inf)

    def at(self, point: Point, *, derivatives: bool = True, cases: Sequence[int] | None = None, **_: Any,
           ) -> list[LogPart]:
        self.calls += 1
        found = []
        for k in self.cases if cases is None else cases:
            f, x, y = self.functions[k], np.asarray(point.shared, complex), np.asarray(point.own[k], complex)
            residual = np.real(f(x, y))
            width = derivatives * self.size, derivatives * self.own
            shared = np.zeros((len(residual), width[0]))
            own = np.zeros((len(residual), width[1]))
            for i in range(width[0]):
                shared[:, i] = np.imag(f(x + 1e-30j * np.eye(self.size)[i], y)) / 1e-30
            for i in range(width[1]):
                own[:, i] = np.imag(f(x, y + 1e-30j * np.eye(self.own)[i])) / 1e-30
            found.append(LogPart(residual, shared, own))
        return found

    def at_all(self, points: Sequence[Point], *, cases: Sequence[int] | None = None,
               derivatives: bool | Sequence[bool] = False, **_: Any) -> list[list[LogPart]]:
        each = [derivatives] * len(points) if isinstance(derivatives, bool) else derivatives
        return [self.at(point, derivatives=asked, cases=cases) for point, asked in zip(points, each, strict=True)]
