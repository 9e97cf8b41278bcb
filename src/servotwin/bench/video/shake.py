"""A camera that moves: what the mark on the case says of it is taken out of the picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_SEEN = 0.5  # of the pictures: a mark on the case that counts
_STILL = 0.3  # pixels: less than that is no motion, and taking it out would only add noise


def steadied(corners: NDArray[np.float64], case: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the corners as a camera at rest would have seen them, and by how much it moved.

    Shift, turn and scale of the mark on the case are taken back; a camera that swings by degrees does more than that.

    Parameters
    ----------
    corners, case : ndarray, shape (n, 4, 2)
        Of the mark on the horn and on the case, nan where they were not seen [pixels]

    Returns
    -------
    corners : ndarray, shape (n, 4, 2)
        As they were where the camera stood still, or the case was hardly ever seen.
    moved : float
        Root mean square of the case's corners around their usual place; nan where it was not seen [pixels].
    """
    there = np.isfinite(case).all(axis=(1, 2))
    if there.mean() < _SEEN:
        return corners, float("nan")
    usual = np.median(case[there], axis=0)
    moved = float(np.sqrt(np.mean((case[there] - usual)**2)))
    if moved < _STILL:
        return corners, moved
    z, z0 = case[..., 0] + 1j * case[..., 1], usual[:, 0] + 1j * usual[:, 1]
    middle = z.mean(axis=1)
    back = z0 - z0.mean()
    grow = (z - middle[:, None]) @ back.conj() / np.sum(np.abs(back)**2)  # turn and scale in one complex number
    seen = corners[..., 0] + 1j * corners[..., 1]
    steady = (seen - middle[:, None]) / grow[:, None] + z0.mean()
    return np.stack([steady.real, steady.imag], axis=-1), moved
