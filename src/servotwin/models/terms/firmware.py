"""The firmware of a digital servo: the numbers by which it decides on a duty, tick by tick."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from servotwin.models.terms import sensor
from servotwin.models.terms.dependence import AT_COMMANDS, BEYOND, PROGRAM
from servotwin.models.terms.given import Given
from servotwin.physics import cut

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
"""What may be given of a digital servo."""

HOLD, LIMP, FAILSAFE = 0.0, 1.0, 2.0  # what it does without a command


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


def pack(model: Given, period: Any) -> Firmware:
    """Return the numbers of a model's firmware, told by pulses in frames of so many seconds."""
    def of(name: str, default: float = 0.0) -> Any:
        return model.value_or(f"firmware.{name}", default)

    def word(name: str, *words: str) -> Any:
        """Return the place of a word among others, from 1 on; 0 where it is none of them."""
        found = model.servo.get(f"firmware.{name}")
        if isinstance(found, np.ndarray):
            return sum((k + 1.0) * (found == one) for k, one in enumerate(words))
        return words.index(found) + 1.0 if found in words else 0.0

    limit = of("integral_limit")
    slope, T_0 = model.value_or("electronics.one_shot_slope", 0.0), model.value_or("electronics.one_shot_offset", 0.0)
    p, b_o = model.value_or("potentiometer.feedback_gain", 0.0), model.value_or("potentiometer.feedback_offset", 0.0)
    pulses = np.all(np.asarray(slope) * p != 0.0)
    s_mu = slope * p
    # an encoder that stands tells its angle as a voltage would, 1 V a radian
    per_volt = 1.0 / p if np.all(p != 0.0) else 1.0 if sensor.stands(model) else 0.0
    half_deadband = 0.5 * model.value_or("electronics.deadband", 0.0) / s_mu if pulses else 0.0
    quantum, whole = of("angle_quantum"), word("whole_counts", "yes")
    return Firmware(
        T_c=of("control_period"), t_phi=of("control_phase"), T_d=of("compute_delay"), quantum=quantum,
        weight=of("filter_weight", 1.0), h=cut(of("deadband_angle", half_deadband), whole * quantum),
        gate=word("deadband_law", "gate"),
        k_p=of("proportional_gain"), k_i=of("integral_gain"), k_d=of("derivative_gain"),
        k_v=of("velocity_feedforward"), k_a=of("acceleration_feedforward"),
        of_measurement=word("derivative_of", "measurement"), m=of("derivative_ticks", 1.0),
        threshold=of("derivative_threshold"), I_limit=_infinite_where_0(limit), kappa=of("anti_windup"),
        at_rest=word("integral_at_rest", "yes"), rest_travel=of("rest_travel"), delta=of("duty_quantum"),
        whole=whole, minimum=of("minimum_duty"), torque_limit=of("torque_limit", 1.0),
        duty_limit=of("duty_limit", 1.0), slew=of("duty_slew", math.inf), I_m=of("current_limit", math.inf),
        senses_bus=word("current_sense", "bus"), brakes=word("torque_off_state", "brake"),
        resolution=of("pulse_resolution"), goals=word("command_kind", "goal"), latency=of("bus_latency"),
        lower=of("lower_goal", -math.inf), upper=of("upper_goal", math.inf), v=of("speed_limit", math.inf),
        a=of("acceleration_limit", math.inf), v_0=of("minimum_speed"), overload_duty=of("overload_duty", math.inf),
        overload_time=of("overload_time"), stall_travel=of("stall_travel", math.inf),
        overload_output=of("overload_output"), latches=word("overload_latches", "yes"),
        trip_current=of("trip_current", math.inf), trip_time=of("trip_time"),
        trip_temperature=of("trip_temperature", math.inf), undervoltage=of("undervoltage"),
        resets=word("undervoltage_action", "reset"), restart_time=of("restart_time"),
        timeout=of("signal_timeout", math.inf), loss=word("signal_loss", "limp", "failsafe"),
        failsafe=of("failsafe_angle"), soft_duty=of("soft_start_duty", math.inf), soft_time=of("soft_start_time"),
        per_volt=per_volt, per_second=1.0 / s_mu if pulses else 0.0,
        at_nothing=-(T_0 / slope + b_o) / p if pulses else 0.0,
        shortest=model.value_or("electronics.pulse_width_min", 0.0),
        longest=model.value_or("electronics.pulse_width_max", math.inf), T_f=period,
        noise=model.value_or("potentiometer.noise", 0.0) if np.all(p != 0.0) else 0.0,
        b_o=b_o if np.all(p != 0.0) else 0.0)


def _infinite_where_0(limit: Any) -> Any:
    """Return a limit, or inf where it is 0, which says that there is none."""
    limits = np.where(limit == 0.0, math.inf, limit)
    return limits if limits.ndim else float(limits)
