"""A servo on a bus as a rig: what the recorder records from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from servotwin.bench.backends.backend import Backend
from servotwin.bench.backends.serial_port import SerialBackend
from servotwin.bench.bus.bus import Bus
from servotwin.bench.bus.scan import FoundServo
from servotwin.bench.bus.sdk_wire import PATIENCE
from servotwin.bench.recording.experiment import Experiment


class BusRig:
    """A Feetech or Dynamixel servo on its wire.

    Parameters
    ----------
    backend : Backend
    protocol : {"feetech", "dynamixel-2", "dynamixel-1"}
    id : int
        Of the servo.
    rate : float
        Rows in a second [Hz].
    baud : int
        Speed of the wire [bit/s].
    patience : float
        How long an answer may be late beyond its time on the wire; rows wait for so long for one that is lost [s].

    Raises
    ------
    InputError
        If the rate is not possible.
    """

    kind = "angle"

    def __init__(self, backend: Backend, protocol: str, id: int, *, rate: float = 100.0,
                 baud: int = 1_000_000, patience: float = PATIENCE) -> None:
        self.bus = Bus(backend, protocol, [id], rate=rate, baud=baud, patience=patience)
        self.id = id

    @property
    def columns(self) -> Sequence[str]:
        """Of its rows; what is measured depends on the model, which is known once it is open."""
        return columns_of(self.bus, self.id)

    def open(self) -> None:
        """Take the wire and read all registers; the servo is limp."""
        self.bus.open()

    def facts(self) -> Mapping[str, Any]:
        """Return model, registers, what the columns are made of, and what happened in the last run."""
        return self.bus.facts(self.id)

    def approach(self, value: float) -> None:
        """Go to an angle [rad] slowly and wait until the servo stands."""
        self.bus.approach({self.id: value})

    def run(self, experiment: Experiment) -> Iterator[Sequence[float]]:
        """Command an experiment and yield rows as they come."""
        for rows in self.bus.run({self.id: experiment}):
            yield rows[self.id]

    def limp(self) -> None:
        """Switch the torque off; never raises."""
        self.bus.limp()

    def close(self) -> None:
        """Switch the torque off and give the wire back."""
        self.bus.close()


def columns_of(bus: Bus, servo: int) -> tuple[str, ...]:
    """Return the columns of a servo's rows."""
    return ("time_s", "command_angle_deg", *(one.column for one in bus.servos[servo].channels), "torque_on")


def rig_of(port: str, found: FoundServo, *, rate: float = 100.0) -> BusRig:
    """Return the rig of a servo that `scan` has found on a port."""
    return BusRig(SerialBackend(port, found.baud), found.protocol, found.id, rate=rate, baud=found.baud)
