"""Servos of a robot as what controllers are wired to: the port of `servotwin.control`, with joints as arrays.

All angles here are those of the servos' shafts, as their controllers see them; a `Mount` makes them the joints'.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.control import Measured, Reference, Sensor, ServoInverse
from servotwin.control.sensors import Readings
from servotwin.control.wires import wire_of
from servotwin.errors import InputError
from servotwin.robots.drive import ServoDrive
from servotwin.robots.motion import Motion
from servotwin.robots.mount import Mount
from servotwin.robots.places import load_mujoco
from servotwin.robots.record import ServoRecord
from servotwin.robots.run import begin
from servotwin.robots.told import told

Array = NDArray[np.float64]
_SOON = 1e-3  # of a step


class DrivePort:
    """All servos of a `ServoDrive` as one port: it measures arrays (n,), and takes them.

    Time 0 of the port is the beginning of the settling before the motion.

    Parameters
    ----------
    drive : ServoDrive
    mounts : mapping of str to Mount
        Of its joints.
    motion : Motion
        Where the robot begins, and what it is to do.
    settle : float
        How long it rests before the motion [s]
    sensors : sequence of Sensor
        All that a controller sees; each looks at all servos.
    resolution : float
        Of pulses that are sent [s].
    seed : int
        Of all noise.

    Raises
    ------
    InputError
        If some servos take voltages and others angles.
    """

    def __init__(self, drive: ServoDrive, mounts: Mapping[str, Mount], motion: Motion, *, settle: float,
                 sensors: Sequence[Sensor] = (), resolution: float = 1e-6, seed: int = 0) -> None:
        self.drive, self.motion, self._mounts, self._settle = drive, motion, mounts, settle
        self._sensors, self._seed = tuple(sensors), seed
        ordered = [mounts[joint] for joint in drive.joints]
        self._zero, self._gain = (np.array(column) for column in zip(
            *((mount.zero, mount.gain) for mount in ordered), strict=True))
        self._told_zero, self._told_gain = (np.array(column) for column in zip(
            *((each.zero, each.gain) for each in map(told, ordered)), strict=True))
        self._wires = [_Sent(mount, resolution) for mount in ordered]
        self._takes = {wire.takes for wire in self._wires}
        if len(self._takes) > 1:
            raise InputError("servos of one controller", got=" and ".join(sorted(self._takes)), allowed="one of them")
        self._begin()

    def _begin(self) -> None:
        self.data = load_mujoco().MjData(self.drive.model)
        begin(self.drive, self.data, self.motion, self._mounts, -self._settle)
        self.poses: list[Array] = []
        self._readings = Readings(self._sensors, self._seed, len(self._zero))

    @property
    def takes(self) -> str:
        """A voltage of bare bridges, an angle of servos."""
        return next(iter(self._takes))

    @property
    def frame(self) -> float:
        """The longest of all servos [s]."""
        return max(wire.frame for wire in self._wires)

    @property
    def lag(self) -> float:
        """The longest of all servos [s]."""
        return max(wire.lag for wire in self._wires)

    @property
    def nominal(self) -> ServoInverse | None:
        """Nothing: what the joints carry changes with the posture."""
        return None

    @property
    def time(self) -> float:
        """Now, since the beginning of the settling [s]."""
        return float(self.data.time) + self._settle

    def start(self, angle: Any) -> None:
        """Begin anew where the motion begins."""
        if self.poses:
            self._begin()

    def measure(self) -> Measured:
        """Return what the sensors show now, arrays (n,)."""
        return self._readings.at(self.time, self._true)

    def _true(self, name: str) -> Array:
        if name == "output_angle":  # before the first tick servos show nothing yet
            places = [self._at(joint) for joint in self.drive.joints]
            return np.asarray((self.data.qpos[places] - self._zero) / self._gain)
        if name == "motor_angle" and not self.poses:  # centred in the play
            reductions = [self._mounts[joint].model.value("gear.gear_reduction") for joint in self.drive.joints]
            return np.asarray(self._true("output_angle") * reductions)
        return self.drive.look(self.data, name)

    def _at(self, joint: str) -> int:
        return int(self.drive.model.jnt_qposadr[self.drive.model.joint(joint).id])

    def send(self, command: Any) -> None:
        """Command voltages [V] or angles [rad] from now on, an array (n,), the nearest that the wires carry."""
        values = np.broadcast_to(np.asarray(command, dtype=np.float64), self._zero.shape).tolist()
        if not all(map(math.isfinite, values)):
            raise InputError(f"command at {self.time:g} s", got=values, allowed="finite numbers")
        shafts = np.array([wire.shaft(value) for wire, value in zip(self._wires, values, strict=True)])
        goals = self._told_zero + self._told_gain * shafts
        self.drive.command(self.data, dict(zip(self.drive.joints, goals.tolist(), strict=True)))

    def wait(self, until: float) -> None:
        """Return at a time [s]."""
        step = float(self.drive.model.opt.timestep)
        while self.time < until - _SOON * step:
            self.drive.step(self.data)
            self.poses.append(self.data.qpos.copy())

    def record(self, time: Array) -> Mapping[str, Any]:
        """Return true signals of all servos at times since the beginning [s], by name, of shape (m, n)."""
        return _Signals(list(self.drive.result(self.data).values()), time - self._settle)


class _Signals(Mapping[str, Array]):
    """Signals of several servos, side by side."""

    def __init__(self, records: Sequence[ServoRecord], time: Array) -> None:
        self._records, self._time = records, time

    def __getitem__(self, name: str) -> Array:
        return np.stack([np.interp(self._time, record.time, record[name]) for record in self._records], axis=1)

    def __iter__(self) -> Any:
        return iter(name for name in self._records[0].names if all(name in one.names for one in self._records))

    def __len__(self) -> int:
        return len(list(iter(self)))


class _Sent:
    """How a command gets to one servo: pulses in steps, duties as goals."""

    def __init__(self, mount: Mount, resolution: float) -> None:
        model = mount.model
        wire = wire_of(model, model.servo, resolution)
        self.takes, self.frame, self.lag, self._carried = wire.takes, wire.frame, wire.lag, wire.carried
        self._per_angle, self._first = 1.0, 0.0
        if wire.unit == "s":  # pulses: back to the angle that they stand for
            exact = wire_of(model, model.servo, 0.0).carried
            middle = 0.5 * math.pi
            self._per_angle = (exact(middle + 0.1) - exact(middle - 0.1)) / 0.2
            self._first = exact(middle) - self._per_angle * middle

    def shaft(self, value: float) -> float:
        """Return the angle [rad] that the drive has to be told: of a bare bridge its duty."""
        return (self._carried(value) - self._first) / self._per_angle


class Delayed:
    """A path that begins later, and ends as much later.

    Parameters
    ----------
    path : Path
    by : float
        [s]
    """

    def __init__(self, path: Any, by: float) -> None:
        self._path, self._by = path, by

    @property
    def duration(self) -> float:
        """When it ends, with as long a rest behind it as before it [s]."""
        return float(self._path.duration) + 2.0 * self._by

    def at(self, time: Any) -> Reference:
        """Return what is asked for at `time` [s]."""
        found: Reference = self._path.at(np.asarray(time, dtype=np.float64) - self._by)
        return found
