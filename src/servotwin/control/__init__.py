"""Control of servos: trajectories, sensors, controllers, rules for their gains, and loops over them.

A controller is a plain function of measured signals with explicit state: the same object runs on a `Simulator`, in a
robot, and on hardware.
"""

from servotwin.control import tuning
from servotwin.control.bare import bare_bridge
from servotwin.control.compensation import DeadbandCompensation, PlayCompensation
from servotwin.control.computed_torque import ComputedTorque
from servotwin.control.controller import Controller, Decision, PlainCommand
from servotwin.control.controller import Measured as Measured
from servotwin.control.feedforward import Feedforward
from servotwin.control.inverse import LoadModel, ServoInverse, inverse_of, joined
from servotwin.control.levels import AheadOfServo, ThroughServo
from servotwin.control.loop import ControlRun, run_loop
from servotwin.control.observer import DisturbanceObserver
from servotwin.control.pid import Pid
from servotwin.control.ports import Port, SimulatedServo
from servotwin.control.predictive import PredictiveControl
from servotwin.control.reference import Path, Reference, Trajectory
from servotwin.control.sensors import Encoder, Sensor, Tap
from servotwin.control.shaping import InputShaper, Shaped, zero_vibration, zero_vibration_derivative
from servotwin.control.stability import check_stable, closed_loop_poles
from servotwin.control.trajectories import hold, quintic, s_curve, sampled, step, trapezoid

__all__ = [
    "AheadOfServo", "ComputedTorque", "ControlRun", "Controller", "DeadbandCompensation", "Decision",
    "DisturbanceObserver", "Encoder", "Feedforward", "InputShaper", "LoadModel", "Path", "Pid",
    "PlainCommand", "PlayCompensation", "Port", "PredictiveControl", "Reference", "Sensor", "ServoInverse", "Shaped",
    "SimulatedServo", "Tap", "ThroughServo", "Trajectory", "bare_bridge", "check_stable", "closed_loop_poles", "hold",
    "inverse_of", "joined", "quintic", "run_loop", "s_curve", "sampled", "step", "trapezoid", "tuning",
    "zero_vibration", "zero_vibration_derivative"]
