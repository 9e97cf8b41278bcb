"""Play: what follows another thing only when its flank is met, and what happens when two bodies meet.

A servo has two plays. That of the gear train lies between two bodies with inertia, rotor side and output side, which
move on their own inside it. That between output and potentiometer has nothing behind it to swing: the wiper is dragged.
"""

from __future__ import annotations

import numpy as np

from servotwin.physics._typing import Real


def play(follower: Real, leader: Real, width: Real) -> Real:
    """Return where a body without inertia is after its leader has moved, in one direction, to a new place.

    Parameters
    ----------
    follower : float or array
        Where it was [rad].
    leader : float or array
        Where the leader is now [rad].
    width : float or array
        The total play b, at least 0 [rad].

    Returns
    -------
    float or array
        The nearest place to `follower` from leader − b/2 to leader + b/2 [rad].

    Notes
    -----
    The play operator of Krasnosel'skii and Pokrovskii, "Systems with Hysteresis", 1989. It has a memory, so a path that
    turns back has to be followed from turning point to turning point.

    Examples
    --------
    >>> out = float(play(0.0, 1.0, 0.5))
    >>> out, float(play(out, 0.75, 0.5)), float(play(out, 0.25, 0.5))
    (0.75, 0.75, 0.5)
    """
    y: Real = np.minimum(np.maximum(follower, leader - 0.5 * width), leader + 0.5 * width)[()]
    return y


def impact_speed(inertia: Real, speed: Real, other_inertia: Real, other_speed: Real) -> Real:
    """Return the common speed of two bodies that meet and stay together.

    Parameters
    ----------
    inertia, other_inertia : float or array
        J_1 and J_2, both seen at one shaft, not both 0 [kg m²].
    speed, other_speed : float or array
        w_1 and w_2 before the impact, at the same shaft [rad/s].

    Returns
    -------
    float or array
        (J_1 w_1 + J_2 w_2)/(J_1 + J_2) [rad/s].

    Notes
    -----
    Momentum is kept. Seen at the output shaft the rotor's inertia is N² J_m and its speed q̇_m/N.

    Examples
    --------
    >>> impact_speed(3.0, 2.0, 1.0, 0.0)
    1.5
    """
    return (inertia * speed + other_inertia * other_speed) / (inertia + other_inertia)


def impact_energy(inertia: Real, speed: Real, other_inertia: Real, other_speed: Real) -> Real:
    """Return the kinetic energy that is lost when two bodies meet and stay together.

    Parameters
    ----------
    inertia, other_inertia : float or array
        J_1 and J_2, both seen at one shaft, not both 0 [kg m²].
    speed, other_speed : float or array
        w_1 and w_2 before the impact, at the same shaft [rad/s].

    Returns
    -------
    float or array
        J_1 J_2 (w_1 − w_2)²/(2 (J_1 + J_2)) [J].

    Examples
    --------
    >>> impact_energy(3.0, 2.0, 1.0, 0.0)
    1.5
    """
    J_1, J_2 = inertia, other_inertia
    return 0.5 * J_1 * J_2 / (J_1 + J_2) * (speed - other_speed) ** 2
