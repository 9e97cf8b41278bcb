"""The firmware of a digital servo: the numbers by which it decides on a duty, tick by tick."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.terms.dependence import AT_COMMANDS, BEYOND, PROGRAM
from servotwin.models.terms.frame import FRAME
from servotwin.models.terms.given import Given, either, place
from servotwin.models.terms.sensor import stands
from servotwin.physics.firmware import cut

READS = tuple(f"firmware.{name}" for name in (
    "control_phase", "compute_delay", "angle_quantum", "filter_weight", "deadband_angle", "deadband_law",
    "integral_gain", "derivative_gain", "velocity_feedforward", "acceleration_feedforward", "derivative_of",
    "derivative_ticks", "derivative_threshold", "integral_limit", "anti_windup", "integral_at_rest", "rest_travel",
    "duty_quantum", "whole_counts", "minimum_duty", "torque_limit", "duty_limit", "duty_slew", "current_limit",
    "current_sense", "torque_off_state", "pulse_resolution", "command_kind", "bus_latency", "lower_goal", "upper_goal",
    "speed_limit", "acceleration_limit", "minimum_speed", "overload_duty", "overload_time", "stall_travel",
    "overload_output", "overload_latches", "trip_current", "trip_time", "trip_temperature", "undervoltage",
    "undervoltage_action", "restart_time", "signal_timeout", "signal_loss", "failsafe_angle", "soft_start_duty",
    "soft_start_time"))
"""Optional numbers of a digital servo."""

HOLD, LIMP, FAILSAFE = 0.0, 1.0, 2.0  # what it does without a command
_GATE, _WHOLE, _OF_MEASUREMENT, _AT_REST, _SENSES_BUS, _BRAKES, _GOALS, _LATCHES, _RESETS, _LIMP, _SAFE = (
    place(f"firmware.{name}", word) for name, word in (
        ("deadband_law", "gate"), ("whole_counts", "yes"), ("derivative_of", "measurement"),
        ("integral_at_rest", "yes"), ("current_sense", "bus"), ("torque_off_state", "brake"), ("command_kind", "goal"),
        ("overload_latches", "yes"), ("undervoltage_action", "reset"), ("signal_loss", "limp"),
        ("signal_loss", "failsafe")))


class Firmware(NamedTuple):
    """Numbers of the control loop; a limit that is not there is inf, or 0 where 0 does nothing."""

    T_c: float  # 0: there is no firmware
    t_phi: float
    T_d: float
    quantum: float  # Δ; 0: none
    weight: float  # a
    h: float  # a multiple of Δ where all is whole
    gate: float
    k_p: float
    k_i: float
    k_d: float
    k_v: float
    k_a: float
    of_measurement: float
    m: float
    threshold: float
    I_limit: float
    kappa: float
    at_rest: float
    rest_travel: float
    delta: float  # δ; 0: none
    whole: float
    minimum: float
    torque_limit: float
    duty_limit: float
    slew: float
    I_m: float
    senses_bus: float
    brakes: float  # 1: with torque off the bridge brakes
    resolution: float
    goals: float  # 1: what comes in is goals, not pulses
    latency: float
    lower: float
    upper: float
    v: float
    a: float
    v_0: float
    overload_duty: float
    overload_time: float
    stall_travel: float
    overload_output: float
    latches: float
    trip_current: float
    trip_time: float
    trip_temperature: float
    undervoltage: float
    resets: float
    restart_time: float
    timeout: float
    loss: float
    failsafe: float
    soft_duty: float
    soft_time: float
    per_volt: float  # rad for a volt of the potentiometer; 0: an encoder on the shaft
    per_second: float  # goal of a pulse [rad/s], and that of no pulse at all [rad]
    at_nothing: float
    shortest: float  # pulses that are taken, bounds included
    longest: float
    T_f: float  # of regular frames
    noise: float  # V rms
    b_o: float  # V of the potentiometer at angle 0


NO_FIRMWARE = Firmware(*[0.0] * len(Firmware._fields))
ACTS = {
    **dict.fromkeys((  # in measuring, P and D, and limits that are compared with at every tick
        "T_c", "t_phi", "T_d", "quantum", "weight", "h", "gate", "k_p", "k_d", "of_measurement", "m", "delta",
        "duty_limit", "I_m", "senses_bus", "lower", "upper", "overload_duty", "trip_current", "trip_temperature",
        "undervoltage", "timeout", "per_volt", "noise", "b_o"), PROGRAM),
    **dict.fromkeys((
        "k_i", "k_v", "k_a", "threshold", "I_limit", "kappa", "at_rest", "rest_travel", "whole", "minimum",
        "torque_limit", "slew", "brakes", "v", "a", "v_0", "overload_time", "stall_travel", "overload_output",
        "latches", "trip_time", "resets", "restart_time", "loss", "failsafe", "soft_duty", "soft_time"), BEYOND),
    **dict.fromkeys((
        "resolution", "goals", "latency", "per_second", "at_nothing", "shortest", "longest", "T_f"), AT_COMMANDS)}
"""Where each number acts."""


def present(firmware: Firmware) -> bool:
    """Tell whether a program decides on the drive."""
    return firmware.T_c > 0.0


def needs(firmware: Firmware) -> int:
    """Return what there is to be followed of the program."""
    return PROGRAM if firmware.T_c > 0.0 else 0


def pack(given: Given, period: float) -> Firmware:
    """Return the numbers of a servo's program under pulses in frames of so many seconds; nan: as the servo says."""
    slope, T_0 = either(given.electronics_one_shot_slope, 0.0), either(given.electronics_one_shot_offset, 0.0)
    p, b_o = either(given.potentiometer_feedback_gain, 0.0), either(given.potentiometer_feedback_offset, 0.0)
    s_mu = slope * p
    pulses = s_mu != 0.0
    half_deadband = 0.5 * either(given.electronics_deadband, 0.0) / s_mu if pulses else 0.0
    quantum = either(given.firmware_angle_quantum, 0.0)
    whole = 1.0 if given.firmware_whole_counts == _WHOLE else 0.0
    limit = either(given.firmware_integral_limit, 0.0)
    return Firmware(
        T_c=given.firmware_control_period, t_phi=either(given.firmware_control_phase, 0.0),
        T_d=either(given.firmware_compute_delay, 0.0), quantum=quantum,
        weight=either(given.firmware_filter_weight, 1.0),
        h=cut(either(given.firmware_deadband_angle, half_deadband), whole * quantum),
        gate=1.0 if given.firmware_deadband_law == _GATE else 0.0, k_p=given.firmware_proportional_gain,
        k_i=either(given.firmware_integral_gain, 0.0), k_d=either(given.firmware_derivative_gain, 0.0),
        k_v=either(given.firmware_velocity_feedforward, 0.0), k_a=either(given.firmware_acceleration_feedforward, 0.0),
        of_measurement=1.0 if given.firmware_derivative_of == _OF_MEASUREMENT else 0.0,
        m=either(given.firmware_derivative_ticks, 1.0), threshold=either(given.firmware_derivative_threshold, 0.0),
        I_limit=math.inf if limit == 0.0 else limit, kappa=either(given.firmware_anti_windup, 0.0),
        at_rest=1.0 if given.firmware_integral_at_rest == _AT_REST else 0.0,
        rest_travel=either(given.firmware_rest_travel, 0.0), delta=either(given.firmware_duty_quantum, 0.0),
        whole=whole, minimum=either(given.firmware_minimum_duty, 0.0),
        torque_limit=either(given.firmware_torque_limit, 1.0), duty_limit=either(given.firmware_duty_limit, 1.0),
        slew=either(given.firmware_duty_slew, math.inf), I_m=either(given.firmware_current_limit, math.inf),
        senses_bus=1.0 if given.firmware_current_sense == _SENSES_BUS else 0.0,
        brakes=1.0 if given.firmware_torque_off_state == _BRAKES else 0.0,
        resolution=either(given.firmware_pulse_resolution, 0.0), goals=1.0 if takes_goals(given) else 0.0,
        latency=either(given.firmware_bus_latency, 0.0), lower=either(given.firmware_lower_goal, -math.inf),
        upper=either(given.firmware_upper_goal, math.inf), v=either(given.firmware_speed_limit, math.inf),
        a=either(given.firmware_acceleration_limit, math.inf), v_0=either(given.firmware_minimum_speed, 0.0),
        overload_duty=either(given.firmware_overload_duty, math.inf),
        overload_time=either(given.firmware_overload_time, 0.0),
        stall_travel=either(given.firmware_stall_travel, math.inf),
        overload_output=either(given.firmware_overload_output, 0.0),
        latches=1.0 if given.firmware_overload_latches == _LATCHES else 0.0,
        trip_current=either(given.firmware_trip_current, math.inf), trip_time=either(given.firmware_trip_time, 0.0),
        trip_temperature=either(given.firmware_trip_temperature, math.inf),
        undervoltage=either(given.firmware_undervoltage, 0.0),
        resets=1.0 if given.firmware_undervoltage_action == _RESETS else 0.0,
        restart_time=either(given.firmware_restart_time, 0.0), timeout=either(given.firmware_signal_timeout, math.inf),
        loss=LIMP if given.firmware_signal_loss == _LIMP else FAILSAFE if given.firmware_signal_loss == _SAFE else HOLD,
        failsafe=either(given.firmware_failsafe_angle, 0.0), soft_duty=either(given.firmware_soft_start_duty, math.inf),
        soft_time=either(given.firmware_soft_start_time, 0.0),
        # an encoder that stands tells its angle as a voltage would, 1 V a radian
        per_volt=1.0 / p if p != 0.0 else 1.0 if stands(given) else 0.0, per_second=1.0 / s_mu if pulses else 0.0,
        at_nothing=-(T_0 / slope + b_o) / p if pulses else 0.0,
        shortest=either(given.electronics_pulse_width_min, 0.0),
        longest=either(given.electronics_pulse_width_max, math.inf),
        T_f=either(period, either(given.electronics_frame_period, FRAME)),
        noise=either(given.potentiometer_noise, 0.0) if p != 0.0 else 0.0, b_o=b_o if p != 0.0 else 0.0)


def takes_goals(given: Given) -> bool:
    """Tell whether commands are goals on a bus, not pulses."""
    return given.firmware_command_kind == _GOALS
