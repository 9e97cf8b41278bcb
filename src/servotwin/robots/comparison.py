"""The same task of an arm by servos of every fidelity, under every controller, with right and with wrong beliefs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from servotwin.models import AveragedServo, BoundedServo, DigitalServo, Model, PulseServo
from servotwin.parameters import Servo
from servotwin.robots.arm import Arm
from servotwin.robots.kinematics import JointPath
from servotwin.robots.steering import STEERINGS, Plain, Steering
from servotwin.robots.task_run import Belief, TaskRun, run_task

WRONG = {"motor.armature_resistance": 1.2, "friction.coulomb_torque_forward": 0.7,
         "friction.coulomb_torque_backward": 0.7}
"""How wrong a controller is that believes the wrong numbers, `assumed`: shares of the true ones, 20 and 30 % off."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A way to do a task.

    Parameters
    ----------
    servos, controller, believes : str
        In words.
    model : Model
        Of all servos.
    steering : Steering
    belief : Belief, optional
        That is wrong.
    """

    servos: str
    controller: str
    believes: str = "–"
    model: Model
    steering: Steering
    belief: Belief | None = None


def fidelities(servo: Servo, bus_servo: Servo) -> dict[str, Model]:
    """Return an analog servo as the paper has it, with bounds and with pulses, and a bus servo.

    Examples
    --------
    >>> import servotwin as st
    >>> list(fidelities(st.load_servo("hitec-hs-755hb"), st.load_servo("feetech-sts3215-12v")))
    ['averaged', 'bounded', 'pulse', 'digital']
    """
    return {"averaged": AveragedServo(servo), "bounded": BoundedServo(servo), "pulse": PulseServo(servo),
            "digital": DigitalServo(bus_servo)}


def cases(servo: Servo, bus_servo: Servo, believed: Arm | None = None) -> Iterator[Case]:
    """Give all cases: every fidelity under plain commands, every controller on pulses, and what wrong beliefs cost.

    Parameters
    ----------
    servo, bus_servo : Servo
        Analog and digital.
    believed : Arm, optional
        That controllers with wrong beliefs believe in, such as one without the payload; the true one unless given.
    """
    models = fidelities(servo, bus_servo)
    for name, model in models.items():
        yield Case(servos=name, controller="plain", model=model, steering=Plain())
    for name, make in STEERINGS.items():
        if name != "plain":
            yield Case(servos="pulse", controller=name, believes="right", model=models["pulse"], steering=make())
    if believed is not None:
        for name, make in STEERINGS.items():
            if name != "plain":
                yield Case(servos="pulse", controller=name, believes="wrong", model=models["pulse"], steering=make(),
                           belief=Belief(arm=believed, parameters=WRONG))


def compared(joint_path: JointPath, chosen: Sequence[Case]) -> list[TaskRun]:
    """Let an arm do a task in each of some ways, on the same path of its joints.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.robots import follow, task_path, two_link
    >>> servo, arm = st.load_servo("hitec-hs-755hb"), two_link()
    >>> one = Case(servos="pulse", controller="plain", model=st.PulseServo(servo), steering=Plain())
    >>> [run] = compared(follow(arm, task_path(arm, "circle")), [one])
    >>> f"{1e3 * run.metrics.contour_rms:.0f} mm"
    '4 mm'
    """
    return [run_task(joint_path.arm, case.model, joint_path.path, steering=case.steering, believed=case.belief,
                     joint_path=joint_path) for case in chosen]
