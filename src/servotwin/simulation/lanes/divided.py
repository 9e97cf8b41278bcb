"""A law for one servo asked of many lanes: those that answer all its questions alike are asked together.

Quicker than its array form where lanes are of few kinds and most columns do not matter.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.state.records import mapped

_Which = list[NDArray[np.int64]]


class _DividedError(Exception):
    """Lanes of a group answer differently: some yes, as `holds` says."""

    def __init__(self, holds: NDArray[np.bool_]) -> None:
        self.holds = holds
        super().__init__()


class _Column(np.ndarray[Any, np.dtype[Any]]):
    """Numbers of lanes of which a group is asked, the one in `which`."""

    which: _Which

    def __array_finalize__(self, other: Any) -> None:
        self.which = getattr(other, "which", [])

    def __bool__(self) -> bool:
        holds = self.view(np.ndarray)[self.which[0]]
        yes = np.count_nonzero(holds)
        if 0 < yes < len(holds):
            raise _DividedError(holds != 0)
        return bool(yes)


def by_groups(law: Callable[..., int], lanes: int, *arguments: Any) -> NDArray[np.int64] | int:
    """Return what a law says of each lane, or of all of them if its questions do not divide them.

    Its arguments are named tuples of numbers and of columns of so many lanes.
    """
    group: _Which = [np.arange(lanes)]
    found, waiting = np.empty(lanes, np.int64), [group[0]]

    def column(values: Any) -> Any:
        if not isinstance(values, np.ndarray):
            return values
        own = values.reshape(-1).view(_Column)
        own.which = group
        return own

    given = [mapped(column, argument) for argument in arguments]
    while waiting:
        group[0] = which = waiting.pop()
        try:
            said = law(*given)
            if len(which) == lanes:
                return said
            found[which] = said
        except _DividedError as divided:
            waiting += [which[divided.holds], which[~divided.holds]]
    return found
