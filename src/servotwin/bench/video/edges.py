"""Corners of a square to a few hundredths of a pixel: where the straight lines through its four edges meet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.bench.video.marker import CELLS

_POINTS = 32  # across each edge
_ENDS = 0.1  # of an edge at each end, where the next one blurs it
_ROUNDS = 2
_FAR = 3.0  # standard deviations: a point off its line


def sharpened(cv2: Any, grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the corners of a dark square on white, to better than a pixel.

    Along the normal of an edge the grey goes from dark to white. The place of a sharp step with the same area between
    is that of the edge, however far lens or motion blur it. A motion blurs opposite edges to opposite sides, so that
    the angle is that in the middle of the exposure.

    Parameters
    ----------
    cv2 : module
    grey : ndarray of uint8, shape (height, width)
    corners : ndarray, shape (4, 2)
        To a pixel or two, one after the other around the square [pixels]

    Returns
    -------
    ndarray, shape (4, 2), or None
        None where an edge is not dark on one side and light on the other.
    """
    for _ in range(_ROUNDS):
        lines = _lines(cv2, grey, corners)
        if lines is None:
            return None
        meet = np.cross(np.roll(lines, 1, axis=0), lines)
        corners = meet[:, :2] / meet[:, 2:]
        if not np.isfinite(corners).all():
            return None
    return corners


def _lines(cv2: Any, grey: NDArray[np.uint8], corners: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the line through each edge, shape (4, 3), in homogeneous coordinates."""
    start, along = corners, np.roll(corners, -1, axis=0) - corners
    length = np.hypot(along[:, 0], along[:, 1])
    if length.min() < CELLS:  # less than a pixel a cell
        return None
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
    middle = start + 0.5 * along
    normal *= np.sign(np.sum((middle - corners.mean(axis=0)) * normal, axis=1))[:, None]  # out of the square
    reach = max(2.0, 0.5 * float(length.mean()) / CELLS)
    across = np.linspace(-reach, reach, max(9, 2 * int(2.0 * reach) + 1))
    shares = np.linspace(_ENDS, 1.0 - _ENDS, _POINTS)
    places = (start[:, None, None] + along[:, None, None] * shares[None, :, None, None]
              + normal[:, None, None] * across[None, None, :, None])
    flat = places.reshape(4 * _POINTS, across.size, 2).astype(np.float32)
    seen = cv2.remap(grey, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    seen = seen.astype(float).reshape(4, _POINTS, across.size)
    end = max(1, across.size // 8)
    dark = np.median(seen[..., :end], axis=(1, 2))[:, None, None]
    light = np.median(seen[..., -end:], axis=(1, 2))[:, None, None]
    if (light - dark).min() < 8.0:  # grey levels: no edge there
        return None
    step = across[1] - across[0]
    share = (light - seen) / (light - dark)
    offset = (share.sum(axis=2) - 0.5 * (share[..., 0] + share[..., -1])) * step - reach
    return np.array([_line(start[k], along[k], normal[k], shares, offset[k]) for k in range(4)])


def _line(start: NDArray[np.float64], along: NDArray[np.float64], normal: NDArray[np.float64],
          shares: NDArray[np.float64], offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the line through points at an edge, without those far off it."""
    x = shares - 0.5
    weight = np.ones_like(x)
    mean = slope = 0.0
    for _ in range(3):
        total, first = weight.sum(), weight @ x / weight.sum()
        slope = (weight * (x - first)) @ offset / ((weight * (x - first)) @ x)
        mean = weight @ offset / total - slope * first
        residual = np.abs(offset - mean - slope * x)
        # 1.48: from the median of a normal distribution's residuals to its standard deviation
        weight = (residual <= _FAR * 1.48 * np.median(residual) + 1e-9).astype(float)
    ends = (start + (mean - 0.5 * slope) * normal, start + along + (mean + 0.5 * slope) * normal)
    return np.asarray(np.cross(np.append(ends[0], 1.0), np.append(ends[1], 1.0)))
