"""The firmware of a servo with a microcontroller: all that its program makes of goal, angle and time.

Gains are in duty (1: the bridge always on) per unit of the output shaft. A maker's registers are set into these numbers
by `parameters.registers`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from servotwin.parameters.group import (
    ANY,
    AT_LEAST_ONE,
    CELSIUS,
    FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    PROGRAMS,
    SHARE,
    TURNS,
    Group,
    Relation,
    choice,
    parameter,
)

MOST_WAITING = 16  # duties, or goals, that may be on their way
_SLACK = 1e-9


@dataclass(frozen=True, kw_only=True)
class Firmware(Group):
    """The control loop of a digital or bus servo, tick by tick; angles at the output shaft."""

    title = "firmware"
    less = (("lower_goal", "upper_goal"),)
    control_period: float | None = parameter(
        "T_c", "time", POSITIVE, "time between two ticks of the control loop", PROGRAMS.of(2e-05, 0.1))
    control_phase: float | None = parameter(
        "t_phi", "time", NOT_NEGATIVE, "time of the first tick", PROGRAMS.of(0.0, 0.1))
    compute_delay: float | None = parameter(
        "T_d", "time", NOT_NEGATIVE, "from a tick until its duty is applied", PROGRAMS.of(0.0, 0.1))
    angle_quantum: float | None = parameter(
        "Delta", "angle", POSITIVE, "output angle per count; absent: not counted", PROGRAMS.of(1e-06, 0.1))
    filter_weight: float | None = parameter(
        "a", "number", FRACTION, "weight of the newest angle; absent: 1, no filter", SHARE.of(0.0, 1.0))
    deadband_angle: float | None = parameter(
        "h", "angle", NOT_NEGATIVE, "half width of the dead zone of the error", PROGRAMS.of(0.0, 0.2))
    deadband_law: str | None = choice(
        ("subtract", "gate"), "whether the dead zone is taken off the error beyond it; absent: it is")
    proportional_gain: float | None = parameter(
        "k_p", "inverse angle", POSITIVE, "duty per error", PROGRAMS.of(0.01, 1000.0))
    integral_gain: float | None = parameter(
        "k_i", "inverse angle and time", NOT_NEGATIVE, "duty per error and time", PROGRAMS.of(0.0, 10000.0))
    derivative_gain: float | None = parameter(
        "k_d", "inverse speed", NOT_NEGATIVE, "duty per rate", PROGRAMS.of(0.0, 10.0))
    velocity_feedforward: float | None = parameter(
        "k_v", "inverse speed", NOT_NEGATIVE, "duty per profile's speed", PROGRAMS.of(0.0, 10.0))
    acceleration_feedforward: float | None = parameter(
        "k_a", "inverse acceleration", NOT_NEGATIVE, "duty per profile's acceleration", PROGRAMS.of(0.0, 1.0))
    derivative_of: str | None = choice(("error", "measurement"), "what the derivative is of; absent: the error")
    derivative_ticks: float | None = parameter(
        "m", "number", AT_LEAST_ONE, "ticks for which a derivative is held", PROGRAMS.of(1.0, 1000.0))
    derivative_threshold: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "smaller changes have no derivative", PROGRAMS.of(0.0, 0.2))
    integral_limit: float | None = parameter(
        "", "number", NOT_NEGATIVE, "most duty of the integral; absent or 0: any", PROGRAMS.of(0.0, 10.0))
    anti_windup: float | None = parameter(
        "kappa", "angle", NOT_NEGATIVE, "error taken off per duty beyond a limit", PROGRAMS.of(0.0, 100.0))
    integral_at_rest: str | None = choice(("yes", "no"), "whether it integrates at rest alone; absent: no")
    rest_travel: float | None = parameter(
        "", "angle", POSITIVE, "less travel in derivative_ticks counts as rest", PROGRAMS.of(1e-06, 0.2))
    duty_quantum: float | None = parameter(
        "delta", "number", POSITIVE, "step of the duty; absent: none", PROGRAMS.of(1e-06, 0.1))
    whole_counts: str | None = choice(("yes", "no"), "whether it computes in whole counts and steps; absent: no")
    minimum_duty: float | None = parameter(
        "", "number", FRACTION, "added to any duty that is not 0", SHARE.of(0.0, 1.0))
    torque_limit: float | None = parameter(
        "", "number", FRACTION, "most duty that the loop asks for; absent: 1", SHARE.of(0.0, 1.0))
    duty_limit: float | None = parameter(
        "", "number", FRACTION, "most duty that the bridge gets; absent: 1", SHARE.of(0.0, 1.0))
    duty_slew: float | None = parameter(
        "", "rate", POSITIVE, "most change of the duty per time", PROGRAMS.of(0.1, 100000.0))
    current_limit: float | None = parameter(
        "I_m", "current", POSITIVE, "current that the duty is kept within", PROGRAMS.of(0.01, 100.0))
    current_sense: str | None = choice(("motor", "bus"), "which current that is; absent: the motor's")
    off_state: str | None = choice(
        ("brake", "diode", "coast"), "what the bridge does while it is off within a PWM period; absent: it brakes")
    torque_off_state: str | None = choice(("open", "brake"), "the bridge with torque off; absent: open")
    pulse_resolution: float | None = parameter(
        "q_t", "time", POSITIVE, "step in which a pulse is measured", PROGRAMS.of(1e-09, 0.0001))
    command_kind: str | None = choice(("pulse", "goal"), "what comes in: pulses, or goals on a bus; absent: pulses")
    bus_latency: float | None = parameter(
        "", "time", NOT_NEGATIVE, "from the write of a goal until it counts", PROGRAMS.of(0.0, 0.5))
    lower_goal: float | None = parameter("", "angle", ANY, "goals below are raised to it", TURNS.of(-20.0, 20.0))
    upper_goal: float | None = parameter("", "angle", ANY, "goals above are lowered to it", TURNS.of(-20.0, 20.0))
    speed_limit: float | None = parameter(
        "v", "output speed", POSITIVE, "most speed of the profile; absent: any", PROGRAMS.of(0.01, 200.0))
    acceleration_limit: float | None = parameter(
        "a", "angular acceleration", POSITIVE, "acceleration of the profile; absent: any", PROGRAMS.of(0.1, 100000.0))
    minimum_speed: float | None = parameter(
        "v_0", "output speed", NOT_NEGATIVE, "least speed of a profile on its way", PROGRAMS.of(0.0, 20.0))
    overload_duty: float | None = parameter(
        "", "number", FRACTION, "more duty starts the clock of the overload trip", SHARE.of(0.0, 1.0))
    overload_time: float | None = parameter("", "time", NOT_NEGATIVE, "after which it trips", PROGRAMS.of(0.0, 100.0))
    stall_travel: float | None = parameter(
        "", "angle", NOT_NEGATIVE, "more travel starts that clock anew", PROGRAMS.of(0.0, 6.3))
    overload_output: float | None = parameter(
        "", "number", FRACTION, "most duty once tripped; 0: limp", SHARE.of(0.0, 1.0))
    overload_latches: str | None = choice(("yes", "no"), "whether only a power cycle ends the trip; absent: no")
    trip_current: float | None = parameter("", "current", POSITIVE, "current that trips", PROGRAMS.of(0.01, 100.0))
    trip_time: float | None = parameter(
        "", "time", NOT_NEGATIVE, "for which it has to flow on end", PROGRAMS.of(0.0, 100.0))
    trip_temperature: float | None = parameter(
        "", "temperature", POSITIVE, "housing temperature that trips", CELSIUS.of(290.0, 430.0))
    undervoltage: float | None = parameter(
        "", "voltage", POSITIVE, "bus voltage below which it stops or starts anew", PROGRAMS.of(0.5, 100.0))
    undervoltage_action: str | None = choice(("reset", "stop"), "what it does then; absent: it stops")
    restart_time: float | None = parameter("", "time", NOT_NEGATIVE, "that a reset takes", PROGRAMS.of(0.0, 10.0))
    signal_timeout: float | None = parameter(
        "", "time", POSITIVE, "without a command it acts as signal_loss says", PROGRAMS.of(0.001, 100.0))
    signal_loss: str | None = choice(("hold", "limp", "failsafe"), "what it does without a command; absent: hold")
    failsafe_angle: float | None = parameter(
        "", "angle", ANY, "goal without a command, where signal_loss is failsafe", TURNS.of(-20.0, 20.0))
    soft_start_duty: float | None = parameter(
        "", "number", FRACTION, "most duty just after power-up", SHARE.of(0.0, 1.0))
    soft_start_time: float | None = parameter(
        "", "time", NOT_NEGATIVE, "for so long after the first goal", PROGRAMS.of(0.0, 100.0))

    def _relations(self) -> Iterator[Relation]:
        yield from super()._relations()
        T_c, most = self.control_period, MOST_WAITING - 1
        for name, time in (("compute_delay", self.compute_delay), ("bus_latency", self.bus_latency)):
            if T_c is not None and time is not None:
                yield Relation(f"firmware.{name}", time <= most * T_c * (1.0 + _SLACK), time,
                               f"at most {most} times firmware.control_period", most * T_c)
        if self.derivative_ticks is not None:
            m = self.derivative_ticks
            yield Relation("firmware.derivative_ticks", m == m // 1, m, "a whole number")
        if self.whole_counts == "yes":
            yield from self._only_with("whole_counts", ("angle_quantum", "duty_quantum"))
        if self.integral_at_rest == "yes":
            yield from self._only_with("integral_at_rest", ("rest_travel",))
        if self.signal_loss == "failsafe":
            yield from self._only_with("signal_loss", ("failsafe_angle",))
