"""The kind of number that every law takes and returns."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Real: TypeAlias = float | NDArray[np.float64]
"""A number or an array of them; arguments of one call broadcast, and numbers alone give a number."""
