"""The twins behind the IDs of a bus: lanes of one compiled simulator, on one supply."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError, ServotwinError
from servotwin.models import DigitalServo
from servotwin.parameters.groups import Firmware, Supply
from servotwin.robots.servos.servo_groups import OF_THE_BUS, differing, of_one_form
from servotwin.simulation import VectorSimulator

# --- The twins behind the IDs of a bus: lanes of one compiled simulator, on one supply --------------------------------

Array = NDArray[np.float64]
_TICK = 1.5e-3  # s, more than a tick of every program here: what it takes to see that torque was off
_FIRMWARE = tuple(one.name for one in fields(Firmware))
_SHOWN = ("duty", "armature_current", "supply_current", "bus_voltage", "goal_angle",
          "reference_angle", "trip")
_COLD = 298.15  # K, shown where a servo has no thermal numbers


class Seen(NamedTuple):
    """Signals of a servo, in SI; angles at the output shaft."""

    angle: float
    speed: float
    duty: float
    current: float
    supply_current: float
    voltage: float
    goal: float
    reference: float
    trip: int
    temperature: float


class Crew:
    """Servos on one supply, commanded and seen one by one, led on together.

    Parameters
    ----------
    models : sequence of DigitalServo
    supplies : sequence of (Supply, list of int)
        Each with the places of those that share it.
    angles : sequence of float
        Where they rest at first [rad].
    loads : sequence of Load
    seed : int
    say : callable
        Called with what cannot be computed.
    """

    def __init__(self, models: Sequence[DigitalServo], supplies: Sequence[tuple[Supply, list[int]]],
                 angles: Sequence[float], loads: Sequence[Any], seed: int, say: Callable[[str], None]) -> None:
        alike, count = of_one_form(models), len(models)
        parameters = {name: values for name, values in differing(alike, [str(k) for k in range(count)]).items()
                      if name not in OF_THE_BUS}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # limits that stand for none are beyond any servo's
            sims = VectorSimulator(alike[0], count, load=list(loads), parameters=parameters, bus=list(supplies),
                                   threads=1, seed=seed)
        self.begin(models, sims, np.array(angles, dtype=np.float64), say)
        self.sims.reset(command_angle=self._goals, output_angle=self._goals)
        self.sims.set(torque_enable=False)

    def begin(self, models: Sequence[DigitalServo], sims: VectorSimulator, angles: Array,
              say: Callable[[str], None]) -> None:
        """Take the simulator of all servos, which are limp at these angles [rad]."""
        self.sims, self._say, self._goals = sims, say, angles
        self._told = False
        self._torque = np.zeros(len(models), np.bool_)
        self._have: list[dict[str, Any]] = [
            {f"firmware.{name}": model.servo.get(f"firmware.{name}") for name in _FIRMWARE} for model in models]
        self._changes: dict[str, dict[int, float | str]] = {}
        self._releases: dict[int, float] = {}
        self._hands: dict[int, float] = {}
        self._warm = "housing_temperature" in sims.signals
        self._names = _SHOWN + ("housing_temperature",) * self._warm
        self._rows: list[Seen] | None = None

    def __len__(self) -> int:
        """Return the number of servos."""
        return len(self._goals)

    # --- time ---------------------------------------------------------------------------------------------------------

    def advance(self, duration: float) -> None:
        """Advance all [s]."""
        if duration <= 0.0:
            return
        self._rows = None
        if self._changes:
            self._change()
        while self._releases and duration > 0.0:
            part = min(min(self._releases.values()), duration)
            self.lead(part)
            duration -= part
            self._releases = {k: left - part for k, left in self._releases.items()}
            over = [k for k, left in self._releases.items() if left <= 0.0]
            for k in over:
                del self._releases[k]
                self._enable(k, bool(self._torque[k]))
        if duration > 0.0:
            self.lead(duration)

    def lead(self, duration: float) -> None:
        """Advance time [s] with nothing to be changed meanwhile."""
        if self._hands:
            held = [k for k in self._hands if not self._torque[k]]
            if held:
                self.sims.set(output_angle=[self._hands[k] for k in held], output_speed=0.0, lanes=held)
        if self._told:
            self.sims.advance(duration, command_angle=self._goals)
            self._told = False
        else:
            self.sims.advance(duration)

    # --- what a servo is sent -----------------------------------------------------------------------------------------

    def goal(self, servo: int, angle: float) -> None:
        """Tell a servo where to go [rad]."""
        self._goals[servo] = angle
        self._told = True

    def torque(self, servo: int, on: bool) -> None:
        """Switch a servo's torque."""
        if on != self._torque[servo]:
            self._torque[servo] = on
            self._rows = None
            self._enable(servo, bool(on))

    def release(self, servo: int) -> None:
        """Let a protection go: torque is off for a tick."""
        self._enable(servo, False)
        self._rows = None
        self._releases[servo] = _TICK

    def change(self, servo: int, numbers: Mapping[str, float | str]) -> None:
        """Give a servo other numbers (SI), by dotted name, before time advances."""
        have = self._have[servo]
        for name, value in numbers.items():
            if have.get(name) != value:
                have[name] = value
                self._changes.setdefault(name, {})[servo] = value

    def restart(self, servo: int) -> None:
        """Let a servo's program begin anew, limp, where its shaft is; it keeps its numbers."""
        angle = self.seen(servo).angle
        self._goals[servo] = angle
        self.sims.reset(command_angle=angle, output_angle=angle, lanes=[servo])
        self.sims.set(torque_enable=False, lanes=[servo])
        self._torque[servo], self._told, self._rows = False, True, None

    def hand(self, servo: int, angle: float | None) -> None:
        """Hold a limp servo's shaft at an angle [rad], or let go of it."""
        if angle is None:
            self._hands.pop(servo, None)
        else:
            self._hands[servo] = angle

    def _change(self) -> None:
        """Set what has changed, all at once; where that is refused one by one, so that the others act."""
        changes, self._changes = self._changes, {}
        lanes = sorted({servo for of in changes.values() for servo in of})
        try:
            self._set(changes, lanes)
        except ServotwinError:
            for name, of in changes.items():
                for servo, value in of.items():
                    try:
                        self._set({name: {servo: value}}, [servo])
                    except ServotwinError as error:
                        self._say(f"servo {servo}: {error}; it keeps what it had")

    def _set(self, changes: Mapping[str, Mapping[int, float | str]], lanes: list[int]) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if all(len(of) == len(lanes) for of in changes.values()):
                self.sims.set(parameters={name: [of[k] for k in lanes] for name, of in changes.items()}, lanes=lanes)
            else:
                for name, of in changes.items():
                    self.sims.set(parameters={name: list(of.values())}, lanes=list(of))
        self.touched()

    def touched(self) -> None:
        """Do what it asks for that memories or numbers of lanes were changed."""

    def _enable(self, servo: int, on: bool) -> None:
        self.sims.set(torque_enable=on, lanes=[servo])
        self.touched()

    # --- what shows ---------------------------------------------------------------------------------------------------

    def seen(self, servo: int) -> Seen:
        """Return what shows of a servo."""
        if self._rows is None:
            sims = self.sims
            self._rows = [
                Seen._make((angle, speed, *row[:6], int(row[6]) if row[6] == row[6] else 0,
                            row[7] if self._warm else _COLD))
                for angle, speed, row in zip(sims["output_angle"].tolist(), sims["output_speed"].tolist(),
                                             sims.shown(self._names).tolist(), strict=True)]
        return self._rows[servo]

    def failed(self) -> str | None:
        """Return why a servo cannot continue; None while all can."""
        failures = self.sims.failures if self.sims.status.any() else ()
        return f"servo {failures[0].lane}: {failures[0].cause}" if failures else None


def finite(value: float) -> float:
    """Return a number, 0 for what is none: the duty of a limp servo."""
    return value if math.isfinite(value) else 0.0


# --- Servos of a wire at the links of a robot in MuJoCo ---------------------------------------------------------------

_STEP = 2e-3  # s, of MuJoCo
_ROUNDING = 1e-9  # s


def body_of(source: str, joints: Sequence[str]) -> Callable[..., LinkCrew] | None:
    """Return what makes the crew of a robot's joints; None where MuJoCo is not installed.

    Parameters
    ----------
    source : str
        Name of a robot that comes with the package, or path of an MJCF file.
    joints : sequence of str
        Of the servos, in their order.

    Raises
    ------
    InputError
        Or one of its kinds, if there is no such robot, or it lacks a joint.
    """
    from servotwin.robots.model_file import joint_names, robot_model

    try:
        plant = robot_model(source)
    except MissingExtraError:
        return None
    there = joint_names(plant)
    for joint in joints:
        if joint not in there:
            raise InputError(f"joint of {source}", got=joint or "none", allowed=", ".join(there))
    plant.opt.timestep = _STEP

    def made(models: Sequence[DigitalServo], supplies: Sequence[tuple[Supply, list[int]]], angles: Sequence[float],
             loads: Sequence[Any], seed: int, say: Callable[[str], None]) -> LinkCrew:
        return LinkCrew(plant, joints, models, supplies, angles, say)

    return made


class LinkCrew(Crew):
    """Servos at joints, led on by MuJoCo's steps: what shows is that of the last one."""

    def __init__(self, plant: Any, joints: Sequence[str], models: Sequence[DigitalServo],
                 supplies: Sequence[tuple[Supply, list[int]]], angles: Sequence[float],
                 say: Callable[[str], None]) -> None:
        from servotwin.robots import ServoDrive
        from servotwin.robots.places import load_mujoco

        mujoco = load_mujoco()
        self._joints = tuple(joints)
        self._drive = ServoDrive(plant, dict(zip(joints, models, strict=True)), joint_friction="keep",
                                 bus=[(supply, [joints[k] for k in places]) for supply, places in supplies])
        self._data = mujoco.MjData(self._drive.model)
        model = self._drive.model
        self._place = [int(model.jnt_qposadr[model.joint(name).id]) for name in joints]
        self._speed = [int(model.jnt_dofadr[model.joint(name).id]) for name in joints]
        low, high = np.array([model.joint(name).range if model.jnt_limited[model.joint(name).id] else (-1e9, 1e9)
                              for name in joints]).T
        self._data.qpos[self._place] = np.clip(angles, low, high)
        mujoco.mj_forward(model, self._data)
        simulators, lanes = self._drive.simulators(self._data), self._drive.crew_joints(self._data)
        if lanes != (self._joints,):
            raise InputError("servos of an arm", got=" | ".join(", ".join(some) for some in lanes),
                             allowed="one kind, on supplies in the order of the IDs")
        self.begin(models, simulators[0], self._data.qpos[self._place].copy(), say)
        self._behind, self._dirty = 0.0, True
        self._drive.command(self._data, dict(zip(joints, self._goals.tolist(), strict=True)))
        self._drive.step(self._data)
        self.sims.set(torque_enable=False)

    def lead(self, duration: float) -> None:
        """Advance MuJoCo and the servos by whole steps; what is left waits."""
        if self._told:
            self._drive.command(self._data, dict(zip(self._joints, self._goals.tolist(), strict=True)))
            self._told = False
        self._behind += duration
        steps = int((self._behind + _ROUNDING) / _STEP)
        self._behind -= steps * _STEP
        if not steps:
            return
        if self._dirty:
            self._drive.changed(self._data)
            self._dirty = False
        held = [(k, angle) for k, angle in self._hands.items() if not self._torque[k]]
        if not held:
            self._drive.step(self._data, steps)
            return
        for _ in range(steps):
            for k, angle in held:
                self._data.qpos[self._place[k]], self._data.qvel[self._speed[k]] = angle, 0.0
            self._drive.step(self._data)

    def touched(self) -> None:
        """Let compiled code find what the servos remember, before the next step."""
        self._dirty = True

    def restart(self, servo: int) -> None:
        """Let a servo's program begin anew, limp; its shaft is where MuJoCo has it."""
        self._goals[servo] = self.seen(servo).angle
        self.torque(servo, False)
        self._told, self._rows = True, None
