"""What controllers make of servos: every task of an arm by every fidelity, and when it gets hard.

A case is a task, a fidelity of the servos, a controller and a condition. Controllers that drive the motors past the
chips do so on the parameters that the fidelity reads: the averaged servo has a supply without end, the bounded one no
more than limit, drop and stiction, the pulse servo all that its file gives.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from servotwin.errors import ServotwinError
from servotwin.models import AveragedServo, BoundedServo, DigitalServo, Model, PulseServo
from servotwin.parameters import Servo, Supply
from servotwin.robots.arm import Arm
from servotwin.robots.kinematics import JointPath, follow
from servotwin.robots.scara import scara
from servotwin.robots.steering import STEERINGS
from servotwin.robots.task_run import Belief, TaskMetrics, run_task
from servotwin.robots.tasks import task_path
from servotwin.robots.two_link import two_link

NOMINAL = "nominal"
WRONG = {"motor.armature_resistance": 1.3, "motor.rotor_inertia": 1.3, "friction.coulomb_torque_forward": 0.7,
         "friction.coulomb_torque_backward": 0.7}
"""Shares of the true numbers that a controller believes in which is 30 % wrong."""
PAYLOAD = 0.05
"""Of the tool; with load it is twice as much, of which controllers know nothing, `assumed` [kg]."""
LOW_BATTERY = Supply(open_circuit_voltage=4.4, internal_resistance=0.3)
"""Four tired cells that all servos share, `assumed`; controllers believe in the servo's own supply."""
PLAY = 0.0175
"""Of worn gears, 1 degree, of which the controllers know: physics.md has 0.3 to 1 degree [rad]."""
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
    """What a case gave: metrics, or in one line why there are none."""

    case: Case
    metrics: TaskMetrics | None
    failure: str


@dataclass(frozen=True, kw_only=True)
class Condition:
    """What is harder than nominal.

    Parameters
    ----------
    payload : float
        That the tool carries, beside what controllers know [kg]
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
        """Return the arm that controllers know."""
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
