"""What the bench shows: the seven values of its display, and a row of its table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Reading:
    """The seven values of the display, in the paper's order.

    Parameters
    ----------
    command_voltage : float
        V_i [V].
    command_count : int
        ADC_i [counts].
    feedback_voltage : float
        V_o [V].
    feedback_count : int
        ADC_o [counts].
    pulse_rate : float
        f [Hz].
    output_angle : float
        q [rad].
    pulse_width : float
        t_a [s].

    Examples
    --------
    >>> from servotwin.bench import Bench
    >>> import servotwin as st
    >>> reading = Bench(st.BoundedServo(st.load_servo("hitec-hs-755hb"))).reading(1.425, 1.5708)
    >>> reading.command_count, round(1e6 * reading.pulse_width)
    (582, 1526)
    """

    command_voltage: float
    command_count: int
    feedback_voltage: float
    feedback_count: int
    pulse_rate: float
    output_angle: float
    pulse_width: float


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """One row of the table: the mean of an approach from below and one from above.

    Parameters
    ----------
    reading : Reading
        The mean of both; ADC_o is that of the mean V_o.
    from_below, from_above : Reading
        What the display shows after either approach.
    target_angle, target_voltage : float
        Angle [rad] and feedback voltage [V] without error, the middle of the deadband.
    standing_band : float
        Half the difference of the two angles [rad].
    deadband_band : float
        The part of it that half the electrical deadband explains [rad].
    friction_band : float
        The rest of it: friction, and the creep that had no time to end [rad].
    at_rest : bool
        Whether both approaches ended with a shaft that stands still; a smoothed friction creeps for minutes, and the
        pulses of a `PulseServo` move it by ever smaller steps.
    dwell : float
        The longer of the two waiting times [s].
    """

    reading: Reading
    from_below: Reading
    from_above: Reading
    target_angle: float
    target_voltage: float
    standing_band: float
    deadband_band: float
    friction_band: float
    at_rest: bool
    dwell: float
