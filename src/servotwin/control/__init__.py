"""Control of servos: trajectories, sensors, controllers, rules for their gains, and loops over them.

A controller is a plain function of measured signals with explicit state: the same object runs on a `Simulator`, in a
robot, and on hardware.
"""

from servotwin.control import tuning
from servotwin.control.controller import Controller, Decision, Encoder, PlainCommand, Sensor, Tap
from servotwin.control.controller import Measured as Measured
from servotwin.control.controllers import (
    ComputedTorque,
    DeadbandCompensation,
    DisturbanceObserver,
    Feedforward,
    Pid,
    PlayCompensation,
)
from servotwin.control.inverse import AheadOfServo, LoadModel, ServoInverse, ThroughServo, inverse_of, joined
from servotwin.control.loop import ControlRun, check_stable, closed_loop_poles, run_loop
from servotwin.control.ports import Port, SimulatedServo, bare_bridge
from servotwin.control.predictive import PredictiveControl
from servotwin.control.reference import (
    InputShaper,
    Path,
    Reference,
    Shaped,
    Trajectory,
    hold,
    quintic,
    s_curve,
    sampled,
    step,
    trapezoid,
    zero_vibration,
    zero_vibration_derivative,
)

__all__ = [
    "AheadOfServo", "ComputedTorque", "ControlRun", "Controller", "DeadbandCompensation", "Decision",
    "DisturbanceObserver", "Encoder", "Feedforward", "InputShaper", "LoadModel", "Path", "Pid",
    "PlainCommand", "PlayCompensation", "Port", "PredictiveControl", "Reference", "Sensor", "ServoInverse", "Shaped",
    "SimulatedServo", "Tap", "ThroughServo", "Trajectory", "bare_bridge", "check_stable", "closed_loop_poles", "hold",
    "inverse_of", "joined", "quintic", "run_loop", "s_curve", "sampled", "step", "trapezoid", "tuning",
    "zero_vibration", "zero_vibration_derivative"]
