"""Motion of a shaft: torques, inertia, and the torques that a load makes of its angle."""

from __future__ import annotations

from servotwin.physics.elementary import cos, sin


def shaft_acceleration(driving_torque: float, speed: float, dry_friction: float, external_torque: float,
                       viscous_friction: float, inertia: float) -> float:
    """Return the acceleration of a shaft.

    Parameters
    ----------
    driving_torque : float or array
        τ, of the motor [N m].
    speed : float or array
        w [rad/s].
    dry_friction : float or array
        f, against +q [N m].
    external_torque : float or array
        τ_ext [N m].
    viscous_friction : float or array
        b at this shaft [N m s/rad].
    inertia : float or array
        J at this shaft, positive [kg m²].

    Returns
    -------
    float or array
        ẇ = (τ − b w − f − τ_ext)/J [rad/s²].

    Notes
    -----
    Eq. 10 and 23 to 25, solved for the acceleration.

    Examples
    --------
    >>> shaft_acceleration(4.0, 1.0, 0.5, 0.25, 0.25, 2.0)
    1.5
    """
    return (driving_torque - viscous_friction * speed - dry_friction - external_torque) / inertia


def load_torque(acceleration: float, speed: float, dry_friction: float, external_torque: float,
                load_viscous_friction: float, load_inertia: float) -> float:
    """Return the torque that a shaft delivers to its load.

    Parameters
    ----------
    acceleration : float or array
        q̈ [rad/s²].
    speed : float or array
        q̇ [rad/s].
    dry_friction : float or array
        Of the load, against +q [N m].
    external_torque : float or array
        τ_ext [N m].
    load_viscous_friction : float or array
        B_L [N m s/rad].
    load_inertia : float or array
        J_L [kg m²].

    Returns
    -------
    float or array
        τ_L = J_L q̈ + B_L q̇ + its dry friction + τ_ext [N m].

    Notes
    -----
    Eq. 16 and 23.

    Examples
    --------
    >>> load_torque(2.0, 1.0, 0.25, 0.5, 0.25, 2.0)
    5.0
    """
    return load_inertia * acceleration + load_viscous_friction * speed + dry_friction + external_torque


def kinetic_energy(speed: float, inertia: float) -> float:
    """Return the kinetic energy of a shaft.

    Parameters
    ----------
    speed : float or array
        w [rad/s].
    inertia : float or array
        J at this shaft [kg m²].

    Returns
    -------
    float or array
        J w²/2 [J].

    Examples
    --------
    >>> kinetic_energy(2.0, 3.0)
    6.0
    """
    return 0.5 * inertia * speed * speed


def spring_torque(angle: float, stiffness: float, rest_angle: float = 0.0) -> float:
    """Return the torque of a spring on a shaft.

    Parameters
    ----------
    angle : float or array
        q [rad].
    stiffness : float or array
        k [N m/rad].
    rest_angle : float or array
        q_r, where it pushes neither way [rad].

    Returns
    -------
    float or array
        k (q − q_r), positive where it pushes towards −q [N m].

    Examples
    --------
    >>> spring_torque(2.0, 0.5, 1.0)
    0.5
    """
    return stiffness * (angle - rest_angle)


def pendulum_torque(angle: float, gravity_torque: float, hanging_angle: float = 0.0) -> float:
    """Return the torque of a hanging mass on a shaft.

    Parameters
    ----------
    angle : float or array
        q [rad].
    gravity_torque : float or array
        m g l [N m].
    hanging_angle : float or array
        q_h, where it hangs straight down [rad].

    Returns
    -------
    float or array
        m g l sin(q − q_h), positive where it pulls towards −q [N m].

    Examples
    --------
    >>> pendulum_torque(1.0, 0.5, 1.0)
    0.0
    """
    return gravity_torque * sin(angle - hanging_angle)


def pendulum_stiffness(angle: float, gravity_torque: float, hanging_angle: float = 0.0) -> float:
    """Return by how much the torque of a hanging mass grows with the angle.

    Parameters
    ----------
    angle : float or array
        q [rad].
    gravity_torque : float or array
        m g l [N m].
    hanging_angle : float or array
        q_h [rad].

    Returns
    -------
    float or array
        m g l cos(q − q_h) [N m/rad].

    Examples
    --------
    >>> pendulum_stiffness(1.0, 0.5, 1.0)
    0.5
    """
    return gravity_torque * cos(angle - hanging_angle)


def twist_torque(twist: float, twist_rate: float, stiffness: float, damping: float) -> float:
    """Return the torque of a spring and a damper between two bodies.

    Parameters
    ----------
    twist : float or array
        x, δ less the play [rad].
    twist_rate : float or array
        δ̇, the speed of the first body less that of the second [rad/s].
    stiffness : float or array
        k [N m/rad].
    damping : float or array
        c [N m s/rad].

    Returns
    -------
    float or array
        k x + c δ̇, which pushes the second body towards +q and the first towards −q [N m].

    Examples
    --------
    >>> twist_torque(0.5, 2.0, 4.0, 0.25)
    2.5
    """
    return stiffness * twist + damping * twist_rate


def stretch_beyond_play(twist: float, half_play: float) -> float:
    """Return by how much a spring behind a play is stretched.

    Parameters
    ----------
    twist : float or array
        δ [rad].
    half_play : float or array
        b/2, at least 0 [rad].

    Returns
    -------
    float or array
        δ ∓ b/2 beyond the play, 0 inside it [rad].

    Examples
    --------
    >>> stretch_beyond_play(0.5, 0.25), stretch_beyond_play(-0.5, 0.25), stretch_beyond_play(0.125, 0.25)
    (0.25, -0.25, 0.0)
    """
    return max(twist - half_play, 0.0) + min(twist + half_play, 0.0)


def spring_energy(stretch: float, stiffness: float) -> float:
    """Return the energy in a stretched spring.

    Parameters
    ----------
    stretch : float or array
        x [rad].
    stiffness : float or array
        k [N m/rad].

    Returns
    -------
    float or array
        k x²/2 [J].

    Examples
    --------
    >>> spring_energy(2.0, 3.0)
    6.0
    """
    return 0.5 * stiffness * stretch * stretch
