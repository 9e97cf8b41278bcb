"""The bridge of a servo without its chip: a goal is a duty, every millisecond."""

from __future__ import annotations

from servotwin.errors import InputError
from servotwin.models import DigitalServo
from servotwin.parameters import Servo
from servotwin.units import is_finite

_TAPPED = ("potentiometer.feedback_gain", "potentiometer.feedback_offset")  # still there for who taps it


def bare_bridge(servo: Servo, *, duty_steps: int = 1000, period: float = 1e-3, delay: float = 0.0) -> DigitalServo:
    """Return motor, gear and bridge of a servo without its own loop, told by duties: the chip is bypassed.

    Its program hands a goal on as the duty, as servos with a mode for PWM do; `SimulatedServo` takes voltages for it
    and sends v/(V_oc − V_ce0). The potentiometer can still be tapped; end stops do not count.

    Parameters
    ----------
    servo : Servo
        Analog or digital; of its program nothing is left.
    duty_steps : int
        Of full duty.
    period : float
        Of the program [s].
    delay : float
        From a tick until its duty holds [s].

    Raises
    ------
    InputError
        If a number makes no sense.
    MissingParameterError
        If the servo lacks numbers of motor, gear or supply.

    Examples
    --------
    >>> import servotwin as st
    >>> bridge = bare_bridge(st.load_servo("hitec-hs-755hb"))
    >>> result = st.simulate(bridge, st.signals.constant(0.5, unit="rad"), duration=0.5)
    >>> f"{result['output_speed'][-1]:.3f} rad/s at {result['duty'][-1]:g} of the duty"
    '1.952 rad/s at 0.5 of the duty'
    """
    if not (isinstance(duty_steps, int) and duty_steps >= 1):
        raise InputError("duty_steps", got=duty_steps, allowed="a whole number of at least 1")
    if not (is_finite(period) and period > 0.0):
        raise InputError("period of the bridge", got=period, allowed="a positive number of seconds")
    gone = ("firmware.", "electronics.", "potentiometer.", "stops.")
    nothing = dict.fromkeys(name for name in servo.names() if name.startswith(gone) and name not in _TAPPED)
    return DigitalServo(servo.replace({
        **nothing, "firmware.control_period": period, "firmware.compute_delay": delay, "firmware.command_kind": "goal",
        "firmware.proportional_gain": 1.0, "firmware.duty_quantum": 1.0 / duty_steps,
        "firmware.deadband_angle": 0.0, "firmware.lower_goal": -1.0, "firmware.upper_goal": 1.0,
        "potentiometer.fixed_angle": 0.0}, source="the chip bypassed"))
