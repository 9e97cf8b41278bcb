"""A servo on a wire, as the recorder knows it: its registers, what it was told, what it said."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from servotwin.bench.bus.families import BusFamily, BusModel, chunks, decoded
from servotwin.bench.bus.scan import identified
from servotwin.bench.bus.sdk_wire import Answer, BusWire
from servotwin.errors import BenchError

_ALERT = 128  # of a status byte of protocol 2


class BusServo:
    """What is known of a servo.

    Parameters
    ----------
    id : int
    model : BusModel
    registers : mapping of str to int
        Raw values of all registers, as they were read.

    Raises
    ------
    BenchError
        If it is not set to control its angle.
    """

    def __init__(self, id: int, model: BusModel, registers: Mapping[str, int]) -> None:
        self.id, self.model, self.registers = id, model, dict(registers)
        self.limits = self.family.goals(self.registers)
        self.channels = self.family.columns(self.registers)
        first = self.family.block[0]
        self._places = [(self.family.registers[one.register], one.scale, one.offset,
                         self.family.registers[one.register].address - first) for one in self.channels]
        self.goal = registers.get("Goal_Position", self.family.middle)
        self.torque = bool(registers.get("Torque_Enable", 0))
        self.command = math.nan  # deg
        self.fresh()

    def fresh(self) -> None:
        """Forget what belongs to a run."""
        self.order: tuple[int, int] = (-1, -1)
        self.error, self.lost, self.tripped = 0, 0, False
        self.misses = 0  # since its last answer
        self._heard: float | None = None

    @property
    def family(self) -> BusFamily:
        """Of its model."""
        return self.model.family

    def told(self, goal: int) -> None:
        """Note a goal that was written [counts]."""
        self.goal = goal
        self.command = (goal - self.family.middle) * self.family.count

    def heard(self, answer: Answer | None, now: float) -> float:
        """Note whether it answered; return for how long it has not [s]."""
        self.misses = 0 if answer is not None else self.misses + 1
        if answer is not None or self._heard is None:
            self._heard = now
        return now - self._heard

    def values(self, data: Sequence[int]) -> list[float]:
        """Return the values of a block of its registers, in the units of its columns."""
        return [scale * register.decode(data[place:place + register.size]) + offset
                for register, scale, offset, place in self._places]

    def words(self, values: Mapping[str, int]) -> str:
        """Return what its status byte says, with registers that were read because of it."""
        bits = self.error
        if self.family.protocol == "dynamixel-2":
            bits = values.get("Hardware_Error_Status", 0) if self.error & _ALERT else 0
        said = [text for bit, text in self.family.errors.items() if bits & bit]
        if not said:
            return "no error any more" if not self.error else f"status {self.error}"
        off = "; it has switched its torque off" if values.get("Torque_Enable") == 0 and self.torque else ""
        return f"error: {', '.join(said)}{off}"

    def facts(self) -> dict[str, Any]:
        """Return what a sidecar says of it."""
        return {"servo_id": self.id, "model": self.model.name, "family": self.family.name,
                "registers": dict(self.registers),
                "columns": {one.column: {"register": one.register, "scale": one.scale, "offset": one.offset}
                            for one in self.channels},
                "columns_source": self.family.source}


def opened(wire: BusWire, protocol: str, servo: int) -> BusServo:
    """Return a servo with all its registers read.

    Raises
    ------
    BenchError
        If it does not answer, is of a model that is not known, or is not set to control its angle.
    """
    model = identified(wire, protocol, servo)
    memory: dict[int, int] = {}
    for address, size in chunks(model.family.registers):
        memory.update(enumerate(wire.read(servo, address, size).data, start=address))
    try:
        return BusServo(servo, model, decoded(model.family.registers, memory))
    except BenchError as error:
        raise BenchError(f"{error.what} at {wire.name}", error.problem) from None
