"""`run_task`: an arm whose tool follows a path, with servos of any kind under any controller, in numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.control import ControlRun, Trajectory, bare_bridge, run_loop
from servotwin.errors import ServotwinError
from servotwin.models import AveragedServo, BoundedServo, DigitalServo, Model, PulseServo
from servotwin.parameters import Servo, Supply
from servotwin.robots.arms.arm import TOOL, Arm, scara, two_link
from servotwin.robots.arms.controllers import STEERINGS, Delayed, DrivePort, Plain, Steering, known_of
from servotwin.robots.arms.tasks import Criterion, JointPath, LeastMotion, ToolPath, follow, task_path
from servotwin.robots.drive import ServoDrive
from servotwin.robots.motion import Motion
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import SETTLE, RobotRun, finished, supply_of
from servotwin.robots.servos.mount import Mount, supplied, warm_mounts
from servotwin.robots.tracking import Contour, contour_error, ideal_run

# --- `run_task` -------------------------------------------------------------------------------------------------------

Array = NDArray[np.float64]
_BLEND = 2.0  # samples of the motion, over which ideal actuators blend it


@dataclass(frozen=True, kw_only=True)
class Belief:
    """Beliefs of a controller that may be wrong.

    Parameters
    ----------
    arm : Arm
        Such as one without the payload.
    parameters : mapping of str to float
        Of all servos, by dotted name (SI): by how much of the true one the controller is wrong, such as
        ``{"motor.armature_resistance": 1.2}``.
    """

    arm: Arm
    parameters: Mapping[str, float] = field(default_factory=dict)

    def mounts(self, true: Mapping[str, Mount]) -> dict[str, Mount]:
        """Return mounts of the servos that it believes in."""
        return {joint: replace(mount, model=self._model(mount.model)) for joint, mount in true.items()}

    def _model(self, model: Model) -> Model:
        wrong = {name: share * model.value(name) for name, share in self.parameters.items()}
        return type(model)(model.servo.replace(wrong)) if wrong else model


class TaskMetrics(NamedTuple):
    """How well a task was done; nan where a model has nothing of it.

    Parameters
    ----------
    contour_rms, contour_largest : float
        Distance of the tool from its path [m]
    tool_rms : float
        Distance of the tool from where it should be at the time [m]
    angle_rms : float
        Error of the servos' angles, over all [rad]
    effort : float
        Root mean square of the motors' voltage, over all [V]
    chatter : float
        How far commands go up and down per second, mean over all [V/s or rad/s]
    energy : float
        Taken from the supplies [J]
    """

    contour_rms: float
    contour_largest: float
    tool_rms: float
    angle_rms: float
    effort: float
    chatter: float
    energy: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskRun:
    """An arm that has done a task.

    Parameters
    ----------
    arm : Arm
    path : JointPath
        Of the tool and of the joints.
    criterion : Criterion
        By which the joints' was chosen.
    run : RobotRun
        Record of servos and joints, from the settling before the motion to the rest after it.
    control : ControlRun
        Record of the controller; its times count from the beginning of the settling.
    """

    arm: Arm
    path: JointPath
    criterion: Criterion
    run: RobotRun
    control: ControlRun

    @property
    def control_bypasses(self) -> bool:
        """Whether the chips of the servos were bypassed: commands are voltages."""
        return all(mount.model.endless for mount in self.run.mounts.values())

    @cached_property
    def tool(self) -> Array:
        """Where the tool was at the times of the run, shape (n, 3) [m]."""
        return tool_places(self.run.model, self.run.poses)

    @cached_property
    def ideal_tool(self) -> Array:
        """Where it was with ideal actuators [m]."""
        return tool_places(self.run.model, self.run.ideal.poses)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Which times of the run are of the motion."""
        time: Array = self.run.time
        return np.asarray((time >= 0.0) & (time <= self.run.motion.duration))

    @cached_property
    def contour(self) -> Contour:
        """How far the tool was from its path during the motion."""
        return contour_error(self.tool[self.moving], self.path.path.line)

    @cached_property
    def ideal_contour(self) -> Contour:
        """How far it was with ideal actuators."""
        return contour_error(self.ideal_tool[self.moving], self.path.path.line)

    @cached_property
    def metrics(self) -> TaskMetrics:
        """How well it was done."""
        moving, true = self.moving, self.run.record
        angles = [self._shaft_error(joint)[moving] for joint in self.run.mounts]
        volts = [true[joint]["armature_voltage"][moving] for joint in self.run.mounts]
        off = np.linalg.norm(self.tool[moving] - self.ideal_tool[moving], axis=1)
        return TaskMetrics(
            contour_rms=self.contour.rms, contour_largest=self.contour.largest, tool_rms=_rms(off),
            angle_rms=_rms(np.array(angles)), effort=_rms(np.array(volts)),
            chatter=float(np.mean(self.control.chatter)), energy=self._energy())

    def _shaft_error(self, joint: str) -> Array:
        error: Array = self.run.goal(joint) - self.run.record[joint]["joint_angle"]
        return error / self.run.mounts[joint].gain

    def _energy(self) -> float:
        time, total = self.run.time[self.moving], 0.0
        for record in self.run.record.values():
            if "supply_current" not in record or "bus_voltage" not in record:
                return math.nan
            total += float(np.trapezoid((record["supply_current"] * record["bus_voltage"])[self.moving], time))
        return total


def run_task(arm: Arm, servos: Model | Mapping[str, Model], path: ToolPath, *, criterion: Criterion | None = None,
             steering: Steering | None = None, believed: Belief | None = None, bus: Any = None,
             settle: float = SETTLE, assume_heat: bool = False, joint_path: JointPath | None = None) -> TaskRun:
    """Let the tool of an arm follow a path, its servos under a controller, and the same with ideal actuators beside.

    Parameters
    ----------
    arm : Arm
    servos : Model, or mapping of str to Model
        One kind at all joints, or by joint.
    path : ToolPath
    criterion : Criterion, optional
        Use that a redundant arm makes of its free joint; joints move as little as they can unless given.
    steering : Steering, optional
        Which controller; plain commands unless given.
    believed : Belief, optional
        Belief of the controller about servos and arm; the truth unless given.
    bus : Supply, optional
        That servos share, as of `ServoDrive`.
    settle : float
        Rest before the motion and after it [s]
    assume_heat : bool
        Whether servos get warm by thermal numbers that their mass lets assume.
    joint_path : JointPath, optional
        That was found before; inverse kinematics is not asked then.

    Raises
    ------
    InputError
        If the tool does not get to a place, a joint's limit is in its way, or a servo does not fit.
    MissingExtraError
        If MuJoCo or mink is not installed.
    SimulationError
        If a servo or MuJoCo cannot continue.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.robots.arms.tasks import task_path
    >>> from servotwin.robots.arms.arm import two_link
    >>> arm = two_link()
    >>> done = run_task(arm, st.PulseServo(st.load_servo("hitec-hs-755hb")), task_path(arm, "circle"), settle=0.1)
    >>> done.ideal_contour.largest < 1e-6 < 1e-3 < done.metrics.contour_rms < 1e-2
    True
    """
    criterion, steering = criterion or LeastMotion(), steering or Plain()
    given = arm.mounts(servos)
    mounts = warm_mounts(given, assume_heat=assume_heat, shared=bus is not None)
    for joint, mount in mounts.items():
        supplied(mount.model, supply_of(bus, joint))  # raises before anything is run
    if joint_path is None:
        joint_path = criterion.solve(arm, path)
    if steering.bare:
        mounts = {joint: _bare(mount) for joint, mount in mounts.items()}
    motion = joint_path.motion()
    drive = ServoDrive(arm.model(), mounts, bus=bus, assume_heat=False)
    port = DrivePort(drive, mounts, motion, settle=settle, sensors=steering.sensors(mounts))
    begins = {joint: float(motion.angles[joint][0]) for joint in mounts}
    shafts = _of_shafts(joint_path, mounts)
    controller = steering.controller(known_of(
        believed.arm if believed else arm, believed.mounts(mounts) if believed else mounts, begins,
        speed=np.sqrt(np.mean(np.square(shafts.at(motion.time).speed), axis=0)), frame=port.frame, lag=port.lag))
    control = run_loop(port, controller, Delayed(shafts, settle))
    run = finished(drive, port.data, motion, mounts, bus, np.array(port.poses),
                   window=_BLEND * float(motion.time[1]))
    return TaskRun(arm=arm, path=joint_path, criterion=criterion, run=run, control=control)


class IdealTask(NamedTuple):
    """A task as ideal actuators do it.

    Parameters
    ----------
    motion : Motion
    time : ndarray, shape (n,)
        [s]
    poses : ndarray, shape (n, joints)
    tool : ndarray, shape (n, 3)
        [m]
    torque : mapping of str to ndarray
        Torque or force of each joint that it takes, without servos [N m or N]
    contour : Contour
    """

    motion: Motion
    time: Array
    poses: Array
    tool: Array
    torque: Mapping[str, Array]
    contour: Contour


def ideal_task(joint_path: JointPath) -> IdealTask:
    """Let the tool of an arm follow a path with ideal actuators.

    Examples
    --------
    >>> from servotwin.robots.arms.tasks import follow
    >>> from servotwin.robots.arms.tasks import task_path
    >>> from servotwin.robots.arms.arm import two_link
    >>> ideal_task(follow(two_link(), task_path(two_link(), "circle"))).contour.largest < 1e-6
    True
    """
    model, motion = joint_path.arm.model(), joint_path.motion()
    time = np.arange(0.0, motion.duration, float(model.opt.timestep))
    found = ideal_run(model, tuple(joint_path.arm.joints), motion, time, window=_BLEND * float(motion.time[1]))
    tool = tool_places(model, found.poses)
    return IdealTask(motion, time, found.poses, tool, found.torque, contour_error(tool, joint_path.path.line))


def tool_places(model: Any, poses: Array) -> Array:
    """Return where the tool is in poses, shape (n, 3) [m]."""
    mujoco = load_mujoco()
    data, found = mujoco.MjData(model), np.empty((len(poses), 3))
    site = model.site(TOOL).id
    for k, pose in enumerate(poses):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        found[k] = data.site_xpos[site]
    return found


def _of_shafts(path: JointPath, mounts: Mapping[str, Mount]) -> Trajectory:
    """Return the angles of the servos over time, for those of the joints."""
    zero, gain = (np.array(column) for column in zip(
        *((mounts[joint].zero, mounts[joint].gain) for joint in path.arm.joints), strict=True))
    coefficients = np.array(path.spline.c)  # power, piece, joint
    coefficients[-1] -= zero
    return Trajectory(path.spline.x, coefficients / gain)


def _bare(mount: Mount) -> Mount:
    """Return the servo of a joint without its chip."""
    return replace(mount, model=bare_bridge(mount.model.servo))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


# --- Controllers of servos compared: every task of an arm by every fidelity, and when it gets hard --------------------

# A case is a task, a fidelity of the servos, a controller and a condition. Controllers that drive the motors past the
# chips do so on the parameters that the fidelity reads: the averaged servo has a supply without end, the bounded one no
# more than limit, drop and stiction, the pulse servo all that its file gives.

NOMINAL = "nominal"
WRONG = {"motor.armature_resistance": 1.3, "motor.rotor_inertia": 1.3, "friction.coulomb_torque_forward": 0.7,
         "friction.coulomb_torque_backward": 0.7}
"""Shares of the true numbers that a controller believes in which is 30 % wrong."""
PAYLOAD = 0.05
"""Of the tool; with load it is twice as much, which is in no controller's model, `assumed` [kg]."""
LOW_BATTERY = Supply(open_circuit_voltage=4.4, internal_resistance=0.3)
"""Four tired cells that all servos share, `assumed`; controllers believe in the servo's own supply."""
PLAY = 0.0175
"""Of worn gears, 1 degree, which is in the controllers' models: physics.md has 0.3 to 1 degree [rad]."""
_HORN = 1e-5  # kg m² of gear wheel and horn behind the play, assumed
_FREE = 10.0  # times the supply: one that does not end


class Case(NamedTuple):
    """One way to do a task.

    Parameters
    ----------
    robot, task, servos, controller, condition : str
        In words; keys of `ROBOTS`, `TASKS`, `FIDELITIES`, `STEERINGS` and `CONDITIONS`.
    """

    robot: str
    task: str
    servos: str
    controller: str
    condition: str


class Outcome(NamedTuple):
    """The outcome of a case: metrics, or in one line why there are none."""

    case: Case
    metrics: TaskMetrics | None
    failure: str


@dataclass(frozen=True, kw_only=True)
class Condition:
    """A condition harder than nominal.

    Parameters
    ----------
    payload : float
        That the tool carries, beside that in the controllers' models [kg]
    believes : mapping of str to float
        Shares of the true numbers that controllers believe in.
    bus : Supply, optional
        That all servos share.
    play : float
        Of the gears [rad]
    """

    payload: float = 0.0
    believes: Mapping[str, float] = field(default_factory=dict)
    bus: Supply | None = None
    play: float = 0.0


CONDITIONS: Mapping[str, Condition] = {
    NOMINAL: Condition(), "30 % wrong": Condition(believes=WRONG), "with load": Condition(payload=PAYLOAD),
    "low battery": Condition(bus=LOW_BATTERY), "worn gears": Condition(play=PLAY)}
"""By name."""
ROBOTS = {"scara": scara, "two-link": two_link}
"""By name: makes an arm with a payload."""
TASKS: Mapping[str, tuple[str, ...]] = {"scara": ("circle", "square", "pick-and-place"), "two-link": ("circle",)}
"""Of each robot."""
FIDELITIES = ("ideal torque", "averaged", "bounded", "pulse", "digital")
"""Of the servos; with ideal torque a motor gives the torque asked for: no friction, no drop, no play, no limit."""


def cases(robots: Sequence[str] = tuple(ROBOTS), tasks: Sequence[str] | None = None) -> Iterator[Case]:
    """Give all cases: nominal by every fidelity, then each condition by pulse servos.

    Examples
    --------
    >>> chosen = list(cases(["two-link"]))
    >>> len(chosen), chosen[0]
    (69, Case(robot='two-link', task='circle', servos='ideal torque', controller='pid', condition='nominal'))
    """
    for robot in robots:
        for task in (task for task in TASKS[robot] if tasks is None or task in tasks):
            for servos in FIDELITIES:
                yield from (Case(robot, task, servos, name, NOMINAL) for name, make in STEERINGS.items()
                            if servos != "ideal torque" or make().bare)
            for condition in CONDITIONS:
                if condition != NOMINAL:
                    yield from (Case(robot, task, "pulse", name, condition) for name in STEERINGS)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """All that cases share.

    Parameters
    ----------
    servo, bus_servo : Servo
        Analog and digital, at all joints.
    speed : float
        Of the tool [m/s]
    """

    servo: Servo
    bus_servo: Servo
    speed: float = 0.08

    def arm(self, case: Case) -> Arm:
        """Return the arm of the controllers' models."""
        return ROBOTS[case.robot](payload=PAYLOAD)

    def joints(self, case: Case) -> JointPath:
        """Return the path of the joints, which is the same in all cases of a task."""
        arm = self.arm(case)
        return follow(arm, task_path(arm, case.task, speed=self.speed))

    def outcome(self, case: Case, joints: JointPath) -> Outcome:
        """Do a task; a controller that cannot is no reason to end."""
        condition, known = CONDITIONS[case.condition], self.arm(case)
        arm = ROBOTS[case.robot](payload=PAYLOAD + condition.payload)
        try:
            run = run_task(arm, self.model(case), joints.path, steering=STEERINGS[case.controller](),
                           believed=Belief(arm=known, parameters=condition.believes), bus=condition.bus,
                           joint_path=joints)
            return Outcome(case, run.metrics, "")
        except ServotwinError as error:
            return Outcome(case, None, str(error))

    def model(self, case: Case) -> Model:
        """Return the model of all servos."""
        servo, play = self.servo, CONDITIONS[case.condition].play
        if play > 0.0:
            servo = servo.replace({"gear.backlash": play, "gear.output_inertia": _HORN})
        if case.servos == "digital":
            return DigitalServo(self.bus_servo)
        if not STEERINGS[case.controller]().bare:
            kinds: dict[str, type[Model]] = {"averaged": AveragedServo, "bounded": BoundedServo, "pulse": PulseServo}
            return kinds[case.servos](servo)
        return PulseServo(_read_by(servo, case.servos))  # its chip is bypassed; motor, gear and bridge count


def _read_by(servo: Servo, fidelity: str) -> Servo:
    """Return a servo with those numbers of motor, gear and bridge that count in a fidelity."""
    if fidelity == "pulse":
        return servo
    unread = set(PulseServo.optional) - set(BoundedServo.requires + BoundedServo.optional)
    found = servo.replace({name: None for name in servo.names() if name in unread
                           and not name.startswith("electronics.")})
    if fidelity == "bounded":
        return found
    supply = {"supply.open_circuit_voltage": _FREE * servo.get("supply.open_circuit_voltage"),  # type: ignore[operator]
              "supply.bridge_drop_voltage": 0.0}
    friction = {"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0}
    return found.replace(supply | (friction if fidelity == "ideal torque" else {}))
