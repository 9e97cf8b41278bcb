"""Each controller on the case that it is for: servo, load, path, gains by rule, and the same without the controller."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import servotwin as st
from servotwin import control
from servotwin.control import ControlRun, SimulatedServo, tuning

ENCODER = control.Encoder()  # 4096 counts a turn
FRAME, TICK = 0.02, 0.002  # s, periods of controllers: over pulses; over a bus or a bridge
PLAIN = "plain commands"

Loop = Callable[[], ControlRun]
Maker = Callable[[SimulatedServo], control.Controller]


@dataclass(frozen=True, kw_only=True)
class Case:
    """What a controller is for: two loops on one task.

    Parameters
    ----------
    controller, servo, task, against : str
        In words; `against` is what it is compared with.
    without, with_it : callable
        Run the loops.
    error : callable
        What counts of a run [rad].
    """

    controller: str
    servo: str
    task: str
    against: str = PLAIN
    without: Loop
    with_it: Loop
    error: Callable[[ControlRun], float] = ControlRun.rms_error

    def errors(self) -> np.ndarray:
        """Return the errors without and with the controller [deg]."""
        return np.degrees([self.error(self.without()), self.error(self.with_it())])


def after(time: float) -> Callable[[ControlRun], float]:
    """The rms error from a time on [s]."""
    return lambda run: run.rms_error(since=time)


def ringing(time: float) -> Callable[[ControlRun], float]:
    """How much a body behind a spring swings from a time on, rms."""
    def twist(run: ControlRun) -> float:
        x = (run.true["load_angle"] - run.true["output_angle"])[run.true_time >= time]
        return float(np.sqrt(np.mean(x**2)))
    return twist


def sent(model: st.models.Model, path: control.Path, period: float, load: object = None,
         duration: float | None = None) -> Loop:
    """Plain commands."""
    return lambda: control.run_loop(SimulatedServo(model, load), control.PlainCommand(period=period), path, duration)


def steered(model: st.models.Model, make: Maker, path: control.Path, load: object = None,
            sensor: control.Sensor = ENCODER) -> Loop:
    """A controller, which is made for a port."""
    def run() -> ControlRun:
        port = SimulatedServo(model, load, sensors=[sensor])
        return control.run_loop(port, make(port), path)
    return run


def ahead(model: st.models.Model, period: float, load: object = None) -> Maker:
    """The inverse servo as feedforward through the servo's own loop; no sensor."""
    inverse = control.inverse_of(model, load)
    torque = None if load is None else control.LoadModel(load)
    feedforward = control.Feedforward(period=period, inverse=inverse, load_torque=torque)
    return lambda port: control.AheadOfServo(controller=feedforward, inverse=inverse)


def rates_on(port: SimulatedServo, inverse: control.ServoInverse, period: float = TICK) -> tuning.Rates:
    """The rule for the rates of a loop on a port, with the encoder."""
    return tuning.rates(inverse, period=period, lag=port.lag, frame=port.frame, count=ENCODER.count)


def torque(inverse: control.ServoInverse, external: object = None) -> Maker:
    """Computed torque on a bridge."""
    def make(port: SimulatedServo) -> control.ComputedTorque:
        rates = rates_on(port, inverse)
        return control.ComputedTorque(period=TICK, inverse=inverse, bandwidth=rates.bandwidth,
                                      filter_rate=rates.filter_rate, load_torque=external)
    return make


def observed(inverse: control.ServoInverse) -> Maker:
    """An observer beside a controller that knows no load but its inertia, and no friction."""
    return lambda port: control.DisturbanceObserver(
        controller=torque(inverse.frictionless)(port), inverse=inverse,
        filter_rate=rates_on(port, inverse).observer_rate)


def integral(model: st.models.Model, period: float) -> Maker:
    """An integral that corrects the angles that a servo is asked for."""
    def make(port: SimulatedServo) -> control.Pid:
        rate = tuning.integral_rate(control.inverse_of(model), period=period, lag=port.lag, frame=port.frame)
        return control.Pid(period=period, commands="command_angle", integral_gain=rate, filter_rate=1.0 / period)
    return make


def predictive(model: st.models.Model, load: object, period: float) -> Maker:
    """A plan of 20 ticks."""
    inverse = control.inverse_of(model, load)
    return lambda port: control.PredictiveControl(
        period=period, inverse=inverse, horizon=20, observer_rate=rates_on(port, inverse, period).observer_rate)


def swept(mean: float, amplitude: float, period: float, turns: int) -> control.Trajectory:
    """So many turns of a cosine, from its lowest angle on [rad], [s]."""
    t = np.linspace(0.0, turns * period, 100 * turns + 1)
    return control.sampled(t, mean - amplitude * np.cos(2.0 * np.pi / period * t))


def pulse_cases() -> Iterator[Case]:
    """The analog servo of the paper, told by pulses every 20 ms."""
    servo = st.load_servo("hitec-hs-755hb")
    model, name = st.PulseServo(servo), "HS-755HB, pulses"

    move = control.trapezoid([0.5, 1.5, 0.5], speed=2.5, acceleration=20.0)
    yield Case(controller="Feedforward", servo=name, task="57° and back at 2.5 rad/s, no sensor",
               without=sent(model, move, FRAME), with_it=steered(model, ahead(model, FRAME), move))

    slow = swept(1.05, math.radians(3.0), 5.0, 2)
    lag = tuning.lag_angle(control.inverse_of(model), frame=FRAME, speed=4.0 * math.radians(3.0) / 5.0)
    behind = control.DeadbandCompensation(controller=control.PlainCommand(period=FRAME), half_width=lag)
    yield Case(controller="DeadbandCompensation", servo=name, task="6° up and down in 5 s, no sensor",
               without=sent(model, slow, FRAME), with_it=steered(model, lambda port: behind, slow))

    weight = st.loads.Constant(0.4) + st.loads.Inertia(2e-3)
    rise = control.step(0.5, 1.2, at=0.1, duration=3.0)
    yield Case(controller="Pid", servo=name, task="holds 0.4 N m, potentiometer tapped with 10 bit", error=after(1.5),
               without=sent(model, rise, FRAME, weight),
               with_it=steered(model, integral(model, FRAME), rise, weight, control.Tap.of(servo)))

    arm = st.loads.Flexible(stiffness=5.0, inertia=0.01, damping=5e-3)
    quick = control.trapezoid([0.5, 1.2], speed=2.5, acceleration=15.0)
    shaper = control.zero_vibration_derivative(frequency=2.0 * math.pi * arm.held_frequency)
    soft = shaper.of(quick)
    yield Case(controller="InputShaper", servo=name, task="40° with an arm that swings at 3.6 Hz",
               error=ringing(soft.duration), without=sent(model, quick, FRAME, arm, 2.0),
               with_it=sent(model, soft, FRAME, arm, 2.0))


def bus_cases() -> Iterator[Case]:
    """A bus servo, told goals every 2 ms; its profile is as quick as the registers allow."""
    servo = st.feetech_sts({"Acceleration": 254, "Maximum_Acceleration": 254}, servo="feetech-sts3215-12v")
    model, name = st.DigitalServo(servo), "STS3215, bus"

    arm = st.loads.Pendulum(mass=0.3, length=0.15)
    swing = control.quintic([0.3, 2.0, 0.3], speed=3.5)
    yield Case(controller="Feedforward", servo=name, task="arm of 300 g up and down at 3.5 rad/s, no sensor",
               without=sent(model, swing, TICK, arm), with_it=steered(model, ahead(model, TICK, arm), swing, arm))

    pressed = st.loads.Recorded([0.0, 0.2, 0.7, 9.0], [0.0, 0.0, 1.2, 1.2]) + st.loads.Inertia(2e-3)
    still = control.hold(0.5, 2.5)
    yield Case(controller="Pid", servo=name, task="holds 1.2 N m that come, counts from the bus", error=after(1.2),
               without=sent(model, still, TICK, pressed),
               with_it=steered(model, integral(model, TICK), still, pressed))


def bridge_cases() -> Iterator[Case]:
    """The chip bypassed: voltages every 2 ms, angles of 4096 counts a turn."""
    servo = st.load_servo("hitec-hs-755hb")
    chip, bridge, name = st.PulseServo(servo), control.bare_bridge(servo, period=TICK), "HS-755HB, bridge"

    arm = st.loads.Pendulum(mass=0.3, length=0.15)
    up = control.quintic([0.3, 1.8, 0.3], speed=2.5)
    yield Case(controller="ComputedTorque", servo=name, task="arm of 300 g up and down at 2.5 rad/s",
               without=sent(chip, up, FRAME, arm),
               with_it=steered(bridge, torque(control.inverse_of(bridge, arm), control.LoadModel(arm)), up, arm))

    pushes = st.loads.Recorded([0.0, 0.5, 0.51, 1.2, 1.21, 9.0], [0.0, 0.0, 0.8, 0.8, -0.6, -0.6])
    pushed, still = pushes + st.loads.Inertia(2e-3), control.hold(1.0, 2.0)
    yield Case(controller="DisturbanceObserver", servo=name, task="pushed by 0.8 N m, then by −0.6 N m",
               without=sent(chip, still, FRAME, pushed),
               with_it=steered(bridge, observed(control.inverse_of(bridge, pushed)), still, pushed))

    heavy, jump, slow = st.loads.Inertia(0.02), control.step(0.3, 1.8, at=0.05, duration=1.5), 0.01
    wide = control.bare_bridge(servo, period=slow)
    yield Case(controller="PredictiveControl", servo=name, task="step of 86° with 0.02 kg m², after 0.4 s",
               error=after(0.4), without=sent(chip, jump, FRAME, heavy),
               with_it=steered(wide, predictive(wide, heavy, slow), jump, heavy))

    play = math.radians(1.5)
    loose = control.bare_bridge(servo.replace({"gear.backlash": play, "gear.output_inertia": 1e-3}), period=TICK)
    drag = st.loads.Coulomb(0.1) + st.loads.Inertia(1e-3)
    turns = swept(1.2, math.radians(10.0), 2.0, 2)
    rubs = control.inverse_of(loose, drag).coulomb_torque_forward + 0.1
    drives = torque(control.inverse_of(loose, drag).replace(coulomb_torque_forward=rubs, coulomb_torque_backward=rubs))
    at_motor = control.Encoder(signal="motor_angle", shows="output_angle", ratio=1.0 / servo.gear.gear_reduction)
    yield Case(controller="PlayCompensation", servo=name, task="1.5° of play behind an encoder at the motor, 20° sweep",
               against="computed torque", without=steered(loose, drives, turns, drag, at_motor),
               with_it=steered(loose, lambda port: control.PlayCompensation(controller=drives(port), play=play), turns,
                               drag, at_motor))


def cases() -> Iterator[Case]:
    """All of them."""
    yield from pulse_cases()
    yield from bus_cases()
    yield from bridge_cases()
