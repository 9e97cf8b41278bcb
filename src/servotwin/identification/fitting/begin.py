"""How a search begins: at the servo's own values and random ones, or where another fit of the same logs ended."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from servotwin.identification.fitting.fit import Fit

Array = NDArray[np.float64]


class Begin(NamedTuple):
    """Where a search begins, beside the values of its servo, and how closely it ends.

    Parameters
    ----------
    searches : int
        How many searches: one from the servo's values, the others from random ones.
    shared : mapping of str to float
        Numbers of the rig that all logs share (SI), as another fit found them; what is usual unless given.
    own : tuple of ndarray
        Each log's own numbers (scaled), as another fit found them; what was measured unless given.
    others : tuple of mapping of str to float
        Searched numbers (SI) with which further searches begin, the others being as the servo has them; where there
        are none, the further searches begin at random.
    exactly : bool
        False ends the search where lanes that go nearly lead, if there are any; errors are of the engine either way.
        Such a fit is one of several to choose from: it has no verdict.
    """

    searches: int = 1
    shared: Mapping[str, float] = {}
    own: tuple[Array, ...] = ()
    exactly: bool = True
    others: tuple[Mapping[str, float], ...] = ()

    @classmethod
    def after(cls, fit: Fit, *, exactly: bool = True) -> Begin:
        """Return the beginning at the end of a fit: its rig, while its servo is given apart.

        When pulses come is found anew: a law that lacks something takes other commands for the right ones.
        """
        if fit.phased:
            return cls(exactly=exactly)
        return cls(1, {name: fit.estimates[name] for name in fit.scales}, fit.own, exactly)
