"""Feetech's STS servos: what their registers do. Where sources disagree, which one is followed is said at the place."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from servotwin.models import DigitalServo
from servotwin.parameters.registers.feetech import REGISTERS, STS_MODELS, sts_family
from servotwin.parameters.registers.table import model_for
from servotwin.wire.device import COUNT, LANDED, MIDDLE, TURN, Device
from servotwin.wire.twins import finite

VOLTAGE, HEAT, CURRENT, OVERLOAD = 1, 4, 8, 32  # bits of the status
_TRIPS = {1: OVERLOAD, 2: CURRENT, 3: HEAT, 4: VOLTAGE}
_END = 87  # bytes that can be read; sources tell of no more
_LATE = 0.051  # s until a supply that is too high shows
_FURTHEST = 32767  # counts, of a goal over several turns
_FIRST_SEEN, _LAST_SEEN = 56, 78  # addresses of what the servo itself writes


class Sts(Device):
    """A servo of the STS series."""

    SIZE: ClassVar[int] = 256
    BAUDS: ClassVar[dict[int, int]] = dict(enumerate(
        (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)))

    def __init__(self, lane: int, model: DigitalServo, say: Callable[[str], None], *,
                 firmware: tuple[int, int] = (3, 10), lock: str = "keep") -> None:
        self._drops = lock == "drop"
        self._kind = model_for(STS_MODELS, model.servo, 0, REGISTERS)
        super().__init__(lane, model, sts_family(self._kind), say, firmware)
        for place in (*range(5), *range(56, 78)):
            self.table.read_only[place] = 1

    def fixed(self) -> dict[str, int]:
        """Return model and firmware."""
        return {"Firmware_Major_Version": self.version[0], "Firmware_Minor_Version": self.version[-1],
                "Model_Number": self._kind.number}

    def begin(self) -> None:
        """Lock is on at power-up."""
        self.table["Lock"] = 1

    @property
    def answers_writes(self) -> bool:
        """Whether a write to it alone is answered."""
        return self.table["Response_Status_Level"] != 0

    # --- the frame of counts ------------------------------------------------------------------------------------------

    @property
    def _turns(self) -> bool:
        """Whether the position counts over several turns."""
        return bool(self.table["Phase"] & 0x10)

    def present(self) -> int:
        """Return the position: what the encoder has less the offset, within a turn unless Phase says otherwise."""
        shifted = self.raw - self.table["Homing_Offset"]
        return shifted if self._turns else shifted % TURN

    def aim(self, goal: int) -> None:
        """Go to a goal in counts of the shifted frame, within the limits."""
        table = self.table
        low, high = table["Min_Position_Limit"], table["Max_Position_Limit"]
        if low == high == 0:
            low, high = -_FURTHEST, _FURTHEST
        goal = min(max(goal, low), max(low, high))
        offset = table["Homing_Offset"]
        turn = 0 if self._turns else (self.raw - offset) // TURN
        self.crew.goal(self.lane, (turn * TURN + goal + offset - MIDDLE) * COUNT)

    def stay(self) -> None:
        """Take where the shaft is as the goal."""
        self.table["Goal_Position"] = self.present()
        self.crew.goal(self.lane, (self.raw - MIDDLE) * COUNT)

    # --- reading ------------------------------------------------------------------------------------------------------

    def read(self, address: int, count: int) -> bytes | None:
        """Return bytes; fewer where the memory ends, None where there is none."""
        if address >= _END:
            return None
        if address < _LAST_SEEN and address + count > _FIRST_SEEN:
            self.refresh(address + count)
        return bytes(self.table.bytes[address:min(address + count, _END)])

    def refresh(self, end: int) -> None:
        """Put what shows of the twin into the bytes before an address; those behind the position cost more."""
        table, seen = self.table, self.seen
        memory = table.bytes
        _put(memory, 56, self.present(), 15)
        if end > 58:
            speed = seen.speed / COUNT
            _put(memory, 58, round(speed if table["Phase"] & 4 else speed / 50.0), 15)
            _put(memory, 60, min(max(round(1000.0 * finite(seen.duty)), -1000), 1000), 10)
            memory[62] = min(max(round(10.0 * seen.voltage), 0), 255)
            memory[63] = min(max(round(seen.temperature - 273.15), 0), 255)
            memory[64] = self.waiting is not None
            memory[65] = self.status()
            memory[66] = self.moving()
            _put(memory, 67, table["Goal_Position"], 15)
            _put(memory, 69, round(finite(seen.current) / self._kind.current_unit), 15)

    def moving(self) -> bool:
        """Return whether the reference has not landed at its goal (assumed)."""
        seen = self.seen
        return bool(self.table["Torque_Enable"]) and abs(seen.reference - seen.goal) > LANDED

    def status(self) -> int:
        """Return the bits of what is wrong; they stay while the cause lasts."""
        seen, table = self.seen, self.table
        bits = self.forced | _TRIPS.get(seen.trip, 0)
        if seen.voltage < 0.1 * table["Min_Voltage_Limit"]:
            bits |= VOLTAGE
        if seen.voltage > 0.1 * table["Max_Voltage_Limit"] and self.clock() - self.powered_at > _LATE:
            bits |= VOLTAGE
        if seen.temperature - 273.15 > table["Max_Temperature_Limit"]:
            bits |= HEAT
        return bits

    # --- writing ------------------------------------------------------------------------------------------------------

    def write(self, address: int, data: bytes) -> None:
        """Write bytes; those that are read only are passed over."""
        table = self.table
        locked = table["Lock"] != 0
        names = table.touched(address, len(data))
        before = {name: table[name] for name in names}
        for k, value in enumerate(data[:max(0, _END - address)], start=address):
            if not table.read_only[k] and not (locked and self._drops and table.eeprom[k]):
                table.bytes[k] = value
        for name in names:
            if table[name] != before[name] or name in ("Goal_Position", "Torque_Enable"):
                self._act(name, before[name])
        if not table["Lock"] or not locked:  # what was written with Lock on is lost at power-off
            self.changed |= not locked and table.keep(range(address, min(address + len(data), _END)))

    def _act(self, name: str, before: int) -> None:
        table = self.table
        if name == "Goal_Position":
            self._go(table[name])
        elif name == "Torque_Enable":
            self._switch(table[name], before)
        elif name == "Homing_Offset":
            self.stay()
        elif name == "Operating_Mode":
            self._mode()
        elif name in ("Min_Position_Limit", "Max_Position_Limit") and table["Torque_Enable"]:
            self.aim(table["Goal_Position"])
        self.tune(name)

    def _go(self, goal: int) -> None:
        """Follow a goal that was written: that turns torque on."""
        mode = self.table["Operating_Mode"]
        if mode != 0:
            self.note(f"Operating_Mode {mode} is not computed: a goal moves nothing")
            return
        self.aim(goal)
        if not self.table["Torque_Enable"]:
            self.table["Torque_Enable"] = 1
            self.crew.torque(self.lane, True)

    def _switch(self, value: int, before: int) -> None:
        table = self.table
        if value == 128:  # the middle is here: one source, another calls it a reboot
            table["Torque_Enable"] = before if before in (0, 1) else 0
            self.centre(MIDDLE)
            return
        on = value != 0 and table["Operating_Mode"] == 0
        if on and before == 0:
            self.stay()  # (assumed): it holds where it is
        elif on and self.seen.trip:
            self.crew.release(self.lane)
        self.crew.torque(self.lane, on)

    def centre(self, position: int) -> None:
        """Make the present position this one, as far as the offset can hold it."""
        table = self.table
        offset = (self.raw - position + 2048) % TURN - 2048
        table["Homing_Offset"] = min(max(offset, -2047), 2047)
        if not table["Lock"]:
            self.changed |= table.keep(range(31, 33))
        self.stay()

    def _mode(self) -> None:
        """Torque off, speed and acceleration 0 where the mode changes."""
        table = self.table
        table["Torque_Enable"] = 0
        table["Goal_Velocity"], table["Acceleration"] = 0, 0
        self.crew.torque(self.lane, False)
        self.tune("Goal_Velocity", "Acceleration")

    def reset(self) -> None:
        """Go back to the factory's values; the ID stays."""
        table, id = self.table, self.id
        for name, one in table.registers.items():
            if one.stored and not one.reading:
                table[name] = one.factory
        table["ID"] = id
        self.changed |= table.keep(range(table.size))
        self.power_up()


def _put(memory: bytearray, address: int, value: int, sign: int) -> None:
    size = min(abs(value), (1 << sign) - 1)
    if value < 0 and size:
        size |= 1 << sign
    memory[address], memory[address + 1] = size & 0xFF, size >> 8
