"""The plane in which a mark turns, as the camera sees it, and the angles in it: out of all pictures of a clip at once.

A camera that stands still maps the plane onto its picture by one homography, whatever its tilt, focal length and
distance. In the plane the mark turns rigidly about one axis. So all corners of all pictures have eight numbers of the
homography and the two of the axis in common, and each picture adds one angle to them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SQUARE = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
"""Corners of a mark with side 1 as it is printed, x to the right and y upwards: upper left, and on to the right."""
_SHARED = 10  # eight of the homography, two of the axis
_MOST_STEPS = 60
_SMALL = 1e-10  # of the sum of squares, in one step
_HUBER = 2.0  # standard deviations above which a picture counts less


@dataclass(frozen=True, eq=False)
class Plane:
    """Where a mark turned.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        From the plane, the axis at its origin and the side of the mark its unit, to the picture [pixels].
    offset : ndarray, shape (2,)
        From the axis to the middle of the mark at angle 0, in sides.
    angle : ndarray, shape (n,)
        Counter-clockwise as the camera sees it, from any zero, within a turn [rad].
    residual : ndarray, shape (n,)
        Root mean square of each picture's corners [pixels].
    angle_std : ndarray, shape (n,)
        Standard error of each angle by the residuals of all [rad].
    """

    homography: NDArray[np.float64]
    offset: NDArray[np.float64]
    angle: NDArray[np.float64]
    residual: NDArray[np.float64]
    angle_std: NDArray[np.float64]

    def direction(self, corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how marks in this plane, or in a parallel one near it, are turned: corners (n, 4, 2) to (n,) [rad]."""
        return turned(mapped(inverse(self.homography), corners))

    @property
    def local(self) -> NDArray[np.float64]:
        """What the homography is near the axis: the derivative there, shape (2, 2) [pixels per side]."""
        h = self.homography
        return np.asarray((h[:2, :2] - np.outer(h[:2, 2] / h[2, 2], h[2, :2])) / h[2, 2])

    @property
    def level(self) -> float:
        """How a mark is turned whose arrow points to the right in the picture [rad]."""
        along = np.linalg.solve(self.local, [1.0, 0.0])
        return float(np.arctan2(along[1], along[0]))


def fit_plane(corners: NDArray[np.float64]) -> Plane:
    """Return the plane, the axis and the angles of a mark by nonlinear least squares.

    Parameters
    ----------
    corners : ndarray, shape (n, 4, 2)
        Finite, n ≥ 1 [pixels]

    Notes
    -----
    A picture whose corners fit badly counts less (Huber's weights). Of a mark that does not turn the axis is not known;
    the steps of least norm leave it where the start had it, and the angles do not depend on it.
    """
    middle = corners.mean(axis=(0, 1))
    scale = float(np.mean(np.hypot(*np.moveaxis(np.diff(corners, axis=1), -1, 0))))
    seen = (corners - middle) / scale
    shared, angle = _start(seen)
    damping, weight = 1e-3, np.ones(len(seen))
    error, by_shared, by_angle = _linearised(seen, shared, angle)
    cost = _cost(error, weight)
    for _ in range(_MOST_STEPS):
        step, turn = _step(error, by_shared, by_angle, weight, damping)
        tried = _linearised(seen, shared + step, angle + turn)
        new = _cost(tried[0], weight)
        if not new < cost:
            damping *= 10.0
            if damping > 1e6:
                break
            continue
        shared, angle, damping = shared + step, angle + turn, 0.1 * damping
        error, by_shared, by_angle = tried
        small = cost - new < _SMALL * cost
        weight = _weights(error)
        cost = _cost(error, weight)
        if small:
            break
    return _plane(shared, angle, error, by_angle, middle, scale)


def inverse(homography: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the way back of a homography, shape (3, 3)."""
    return np.asarray(np.linalg.inv(homography), dtype=np.float64)


def mapped(homography: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (..., 2) as a homography maps them."""
    lifted = points @ homography[:, :2].T + homography[:, 2]
    return np.asarray(lifted[..., :2] / lifted[..., 2:])


def turned(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return by how much squares (n, 4, 2) are turned against `SQUARE`, by least squares [rad], shape (n,).

    Examples
    --------
    >>> turned(np.array([[[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]]])).round(4)
    array([1.5708])
    """
    centred = corners - corners.mean(axis=1, keepdims=True)
    return np.asarray(np.angle((centred[..., 0] + 1j * centred[..., 1]) @ (SQUARE[:, 0] - 1j * SQUARE[:, 1])))


def _start(seen: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the search begins: the plane of the first picture, and the axis by the middles of all."""
    first = _square_to(seen[0])
    flat = mapped(inverse(first), seen)
    angle = turned(flat)
    middles = flat.mean(axis=1)
    # middle = axis + R(angle) offset, linear in axis and offset
    c, s = np.cos(angle), np.sin(angle)
    one, none = np.ones_like(c), np.zeros_like(c)
    rows = np.concatenate([np.stack([one, none, c, -s], axis=1), np.stack([none, one, s, c], axis=1)])
    found = np.linalg.lstsq(rows, np.concatenate([middles[:, 0], middles[:, 1]]), rcond=1e-3)[0]
    shift = np.eye(3)
    shift[:2, 2] = found[:2]
    homography = first @ shift
    homography /= homography[2, 2]
    return np.concatenate([homography.ravel()[:8], found[2:]]), angle


def _square_to(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the homography from `SQUARE` to four corners."""
    rows = []
    for (x, y), (u, v) in zip(SQUARE, corners, strict=True):
        rows += [[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y]]
    return np.append(np.linalg.solve(np.array(rows), corners.ravel()), 1.0).reshape(3, 3)


def _linearised(seen: NDArray[np.float64], shared: NDArray[np.float64], angle: NDArray[np.float64],
                ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return model minus picture (n, 8) and its derivatives by the shared numbers (n, 8, 10) and the angle (n, 8)."""
    n = len(seen)
    h = np.append(shared[:8], 1.0).reshape(3, 3)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    body = SQUARE + shared[8:]
    flat = np.einsum("nij,kj->nki", turn, body)
    lifted = flat @ h[:, :2].T + h[:, 2]
    depth = lifted[..., 2:]
    picture = lifted[..., :2] / depth
    local = (h[:2, :2] - picture[..., :, None] * h[2, :2]) / depth[..., None]
    by_shared = np.zeros((n, 4, 2, _SHARED))
    point = np.concatenate([flat, np.ones((n, 4, 1))], axis=-1) / depth
    by_shared[..., 0, 0:3] = point
    by_shared[..., 1, 3:6] = point
    by_shared[..., 6:8] = -picture[..., :, None] * point[..., None, :2]
    by_shared[..., 8:] = np.einsum("nkij,njl->nkil", local, turn)
    across = np.stack([-flat[..., 1], flat[..., 0]], axis=-1)
    by_angle = np.einsum("nkij,nkj->nki", local, across)
    return (picture - seen).reshape(n, 8), by_shared.reshape(n, 8, _SHARED), by_angle.reshape(n, 8)


def _step(error: NDArray[np.float64], by_shared: NDArray[np.float64], by_angle: NDArray[np.float64],
          weight: NDArray[np.float64], damping: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a damped Gauss-Newton step; the angles, each of one picture, are eliminated first."""
    w = weight[:, None]
    own = np.sum(w * by_angle**2, axis=1) * (1.0 + damping)
    cross = np.einsum("n,ni,nij->nj", weight, by_angle, by_shared)
    slope_own = np.sum(w * by_angle * error, axis=1)
    full = np.einsum("n,nij,nik->jk", weight, by_shared, by_shared)
    slope = np.einsum("n,nij,ni->j", weight, by_shared, error)
    reduced = full + damping * np.diag(np.diag(full)) - cross.T @ (cross / own[:, None])
    step = -np.linalg.lstsq(reduced, slope - cross.T @ (slope_own / own), rcond=1e-12)[0]
    return step, -(slope_own + cross @ step) / own


def _cost(error: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    return float(np.sum(weight[:, None] * error**2))


def _weights(error: NDArray[np.float64]) -> NDArray[np.float64]:
    size = np.sqrt(np.mean(error**2, axis=1))
    usual = float(np.median(size))
    return np.asarray(np.minimum(1.0, _HUBER * usual / np.maximum(size, 1e-300))) if usual > 0.0 else np.ones(len(size))


def _plane(shared: NDArray[np.float64], angle: NDArray[np.float64], error: NDArray[np.float64],
           by_angle: NDArray[np.float64], middle: NDArray[np.float64], scale: float) -> Plane:
    """Return the plane in pixels."""
    back = np.array([[scale, 0.0, middle[0]], [0.0, scale, middle[1]], [0.0, 0.0, 1.0]])
    size = np.sqrt(np.mean(error**2, axis=1))
    # of the eight numbers of a picture one went into its angle
    spread = float(np.median(size)) * np.sqrt(8.0 / 7.0)
    return Plane(homography=back @ np.append(shared[:8], 1.0).reshape(3, 3), offset=shared[8:].copy(), angle=angle,
                 residual=size * scale, angle_std=spread / np.sqrt(np.sum(by_angle**2, axis=1)))
