"""Play: what follows another thing only when its flank is met, and what happens when two bodies meet.

A servo has two plays. That of the gear train lies between two bodies with inertia, rotor side and output side, which
move on their own inside it. That between output and potentiometer has nothing behind it to swing: the wiper is dragged.
"""

from __future__ import annotations


def play(follower: float, leader: float, width: float) -> float:
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
    >>> out = play(0.0, 1.0, 0.5)
    >>> out, play(out, 0.75, 0.5), play(out, 0.25, 0.5)
    (0.75, 0.75, 0.5)
    """
    return min(max(follower, leader - 0.5 * width), leader + 0.5 * width)


def impact_speed(inertia: float, speed: float, other_inertia: float, other_speed: float) -> float:
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


def rebound_speed(speed: float, restitution: float) -> float:
    """Return the speed with which a shaft leaves an end stop.

    Parameters
    ----------
    speed : float or array
        With which it meets the stop [rad/s].
    restitution : float or array
        From 0, where it stays there, to 1 [1].

    Returns
    -------
    float or array
        −restitution times the speed [rad/s].

    Examples
    --------
    >>> rebound_speed(2.0, 0.25)
    -0.5
    """
    return -restitution * speed


def impact_energy(inertia: float, speed: float, other_inertia: float, other_speed: float) -> float:
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
