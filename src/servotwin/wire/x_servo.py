"""Dynamixel's X servos, protocol 2.0: what their registers do, by the e-manual; (A): assumed, no source was read."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from servotwin.models import DigitalServo
from servotwin.parameters.registers.dynamixel_x import FULL, REGISTERS, SPEED, X_MODELS, x_family
from servotwin.parameters.registers.table import model_for
from servotwin.wire.device import COUNT, LANDED, MIDDLE, Device
from servotwin.wire.twins import finite

RANGE, LENGTH, LIMIT, ACCESS = 4, 5, 6, 7  # errors
ALERT = 128
_SPEED = SPEED * 0.10471975511965977  # rad/s a step
_SINGLE, _MULTI, _BY_CURRENT = 3, 4, 5  # operating modes
_TRIPS = {1: 32, 2: 32, 3: 4, 4: 1}  # bits of Hardware_Error_Status
_FIRST_SEEN = 120
_INDIRECT = ((168, 208, 20),)  # (first address word, first data byte, how many)


class X(Device):
    """A servo of the X series."""

    SIZE: ClassVar[int] = 661
    BAUDS: ClassVar[dict[int, int]] = {0: 9600, 1: 57_600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000,
                                       6: 4_000_000, 7: 4_500_000}

    def __init__(self, lane: int, model: DigitalServo, say: Callable[[str], None], *, firmware: int = 45) -> None:
        self._kind = model_for(X_MODELS, model.servo, 0, REGISTERS)
        super().__init__(lane, model, x_family(self._kind), say, (firmware,))
        self.alert = 0  # bits that last until a reboot

    def fixed(self) -> dict[str, int]:
        """Return model and firmware."""
        return {"Model_Number": self._kind.number, "Firmware_Version": self.version[-1]}

    def begin(self) -> None:
        """No error; indirect addresses point at their own data."""
        self.alert = 0
        for first, data, count in _INDIRECT:
            for k in range(count):
                self.table.bytes[first + 2 * k:first + 2 * k + 2] = (data + k).to_bytes(2, "little")

    # --- the frame of counts ------------------------------------------------------------------------------------------

    @property
    def _way(self) -> int:
        return -1 if self.table["Drive_Mode"] & 1 else 1

    def present(self) -> int:
        """Return the position: what the encoder has and the offset; mirrored about the middle by drive mode 1 (A)."""
        return MIDDLE + self._way * (self.raw - MIDDLE) + self.table["Homing_Offset"]

    def aim(self, goal: int) -> None:
        """Go to a goal in counts of that frame."""
        raw = self._way * (goal - self.table["Homing_Offset"] - MIDDLE)
        self.crew.goal(self.lane, raw * COUNT)

    def stay(self) -> None:
        """Take where the shaft is as the goal."""
        self.table["Goal_Position"] = self.present()
        self.crew.goal(self.lane, (self.raw - MIDDLE) * COUNT)

    # --- reading ------------------------------------------------------------------------------------------------------

    @property
    def error(self) -> int:
        """The status of every answer: whether something is wrong."""
        self.alert |= _TRIPS.get(self.seen.trip, 0) | self.forced
        return ALERT if self.alert else 0

    @property
    def level(self) -> int:
        """Of answers: 0 to pings, 1 to reads too, 2 to all."""
        return self.table["Status_Return_Level"]

    def read(self, address: int, count: int) -> bytes | int:
        """Return bytes, or an error where there are none."""
        if count == 0 or address + count > self.SIZE:
            return ACCESS
        if address + count > 69 and address < 148:
            self.refresh()
        for first, data, number in _INDIRECT:
            if address < data + number and address + count > data:
                self.refresh()
                memory = self.table.bytes
                return bytes(memory[self._place(k, first, data, number)] for k in range(address, address + count))
        return bytes(self.table.bytes[address:address + count])

    def _place(self, address: int, first: int, data: int, number: int) -> int:
        """Return where a byte lies really that may be an indirect one."""
        if not data <= address < data + number:
            return address
        at = first + 2 * (address - data)
        place = self.table.bytes[at] | self.table.bytes[at + 1] << 8
        return place if place < self.SIZE else address

    def refresh(self) -> None:
        """Put what shows of the twin into the registers."""
        table, seen, kind = self.table, self.seen, self._kind
        table["Present_Position"] = self.present()
        speed = round(self._way * seen.speed / _SPEED)
        table["Present_Velocity"] = speed
        duty = self._way * finite(seen.duty)
        table["Present_PWM"] = round(duty * FULL)
        if kind.current_unit is None:
            table["Present_Load"] = round(1000.0 * duty)
        else:
            current = seen.supply_current if kind.current_sense == "bus" else self._way * seen.current
            table["Present_Current"] = round(finite(current) / kind.current_unit)
        table["Present_Input_Voltage"] = round(10.0 * seen.voltage)
        table["Present_Temperature"] = min(max(round(seen.temperature - 273.15), 0), 255)
        landed = not abs(seen.reference - seen.goal) > LANDED
        table["Moving"] = abs(speed) > table["Moving_Threshold"]
        table["Moving_Status"] = int(landed) | (0 if landed else 2)
        table["Position_Trajectory"] = (MIDDLE + round(self._way * finite(seen.reference) / COUNT)
                                        + table["Homing_Offset"])
        table["Realtime_Tick"] = int(1000.0 * self.clock()) % 32768
        table["Hardware_Error_Status"] = self.alert | _TRIPS.get(seen.trip, 0)
        table["Registered_Instruction"] = self.waiting is not None

    # --- writing ------------------------------------------------------------------------------------------------------

    def write(self, address: int, data: bytes) -> int:
        """Write bytes; return an error, 0 for none. Where one register is refused, none is written (A)."""
        if not data or address + len(data) > self.SIZE:
            return ACCESS
        for first, at, number in _INDIRECT:
            if address < at + number and address + len(data) > at:
                return self._scatter(address, data, first, at, number)
        table, end = self.table, address + len(data)
        names = table.touched(address, len(data))
        torque = table["Torque_Enable"]
        for name in names:
            one = table.registers[name]
            error = self._refusal(name, address, end, data, torque)
            if error:
                return error
            if one.address < address or one.address + one.size > end:
                return LENGTH
        before = {name: table[name] for name in names}
        for k, value in enumerate(data, start=address):
            if not table.read_only[k]:
                table.bytes[k] = value
        for name in names:
            if table[name] != before[name] or name in ("Goal_Position", "Torque_Enable"):
                self._act(name, before[name])
        self.changed |= table.keep(range(address, end))
        return 0

    def _scatter(self, address: int, data: bytes, first: int, at: int, number: int) -> int:
        """Write bytes through indirect addresses: runs of neighbours together."""
        places = [self._place(k, first, at, number) for k in range(address, address + len(data))]
        runs: list[tuple[int, bytearray]] = []
        for place, value in zip(places, data, strict=True):
            if runs and runs[-1][0] + len(runs[-1][1]) == place:
                runs[-1][1].append(value)
            else:
                runs.append((place, bytearray([value])))
        for place, run in runs:
            if any(at <= place + k < at + number for k in range(len(run))):
                self.table.bytes[place:place + len(run)] = run
            elif error := self.write(place, bytes(run)):
                return error
        return 0

    def _refusal(self, name: str, address: int, end: int, data: bytes, torque: int) -> int:
        """Return why a register is not written, 0 where it is."""
        table, one = self.table, self.table.registers[name]
        if table.read_only[one.address] or (one.stored and torque):
            return ACCESS
        if not (address <= one.address and one.address + one.size <= end):
            return 0
        value = one.decode(data[one.address - address:one.address - address + one.size])
        if name == "Goal_Position":
            low, high = table["Min_Position_Limit"], table["Max_Position_Limit"]
            return LIMIT if table["Operating_Mode"] == _SINGLE and not low <= value <= high else 0
        limit = {"Goal_PWM": "PWM_Limit", "Goal_Current": "Current_Limit", "Goal_Velocity": "Velocity_Limit"}.get(name)
        if limit is not None:
            return LIMIT if abs(value) > table[limit] else 0
        if one.only and value not in one.only:
            self.note(f"{name} = {value} is refused: {one.why}")
            return RANGE
        return 0 if one.reading or one.lower <= value <= one.upper else RANGE

    def _act(self, name: str, before: int) -> None:
        table = self.table
        if name == "Goal_Position":
            if table["Torque_Enable"]:
                self.aim(table[name])
        elif name == "Torque_Enable":
            on = bool(table[name]) and not self.alert
            table[name] = int(on)
            if on and not before:
                self.stay()
            self.crew.torque(self.lane, on)
        elif name == "Operating_Mode":  # gains and limits of RAM are set anew by the real servo
            for goal, source in self.family.copied.items():
                table[goal] = table[source]
                self.tune(goal)
        self.tune(name)

    def protect(self) -> None:
        """Let an error switch torque off, as it lasts until a reboot."""
        if self.alert and self.table["Torque_Enable"]:
            self.table["Torque_Enable"] = 0
            self.crew.torque(self.lane, False)

    def reset(self, *, keep_id: bool, keep_baud: bool) -> None:
        """Go back to the factory's values."""
        table = self.table
        kept = {"ID": self.id if keep_id else 1, "Baud_Rate": table["Baud_Rate"] if keep_baud else 1}
        for name, one in table.registers.items():
            if one.stored and not one.reading:
                table[name] = kept.get(name, one.factory)
        self.changed |= table.keep(range(table.size))
        self.power_up()
