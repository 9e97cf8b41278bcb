"""Traffic on a wire as logs: what servos sent a program, and the truth beside."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from servotwin.errors import InputError
from servotwin.wire import dynamixel_frames, feetech_frames
from servotwin.wire.device import COUNT, MIDDLE
from servotwin.wire.packet import ALL

if TYPE_CHECKING:
    from servotwin.wire.bus import Bus
    from servotwin.wire.packet import Packet

_TOLD = ("time_s", "command_angle_deg", "output_angle_deg", "output_speed_deg_per_s", "duty", "armature_current_A",
         "bus_voltage_V", "housing_temperature_K", "torque_on")
_TRUTH = ("time", "command_angle", "output_angle", "output_speed", "duty", "armature_current", "bus_voltage",
          "housing_temperature")
_POSITION = {"feetech": (56, 58), "dynamixel-2": (132, 136)}  # bytes of Present_Position


class Traffic:
    """Logs of all servos of a bus, a row each time that a program asks for a position; `read_logs` takes them.

    Parameters
    ----------
    folder : path
        Gets `ID.csv` with what the servo sent, in the units of a real log, and `truth/ID.csv` (SI); it is made.
    bus : Bus

    Raises
    ------
    InputError
        If there are such logs already, or they cannot be written.
    """

    def __init__(self, folder: str | Path, bus: Bus) -> None:
        self._bus, place = bus, Path(folder)
        taken = next((path for id in bus.ids for path in (place / f"{id}.csv", place / "truth" / f"{id}.csv")
                      if path.exists()), None)
        if taken is not None:
            raise InputError("--record", got=str(taken), allowed="a folder without logs of these servos")
        self._files: list[TextIO] = []
        self._last: dict[int, float] = {}
        self._fault = ""
        try:
            (place / "truth").mkdir(parents=True, exist_ok=True)
            self._told = {id: self._writer(place / f"{id}.csv", _TOLD) for id in bus.ids}
            self._truth = {id: self._writer(place / "truth" / f"{id}.csv", _TRUTH) for id in bus.ids}
            for id in bus.ids:
                self._sidecar(place / f"{id}.json", id)
        except OSError as error:
            raise InputError("--record", got=str(folder), allowed=f"a folder that can be written ({error})") from None

    def _writer(self, path: Path, head: tuple[str, ...]) -> Any:
        file = path.open("w", encoding="utf-8", newline="")
        self._files.append(file)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        return writer

    def _sidecar(self, path: Path, id: int) -> None:
        device = self._bus.device(id)
        facts = {"format": "servotwin-log-1", "name": str(id), "recorded": {
            "servo": f"{device.servo.name}, twin of ID {id}", "rig": "wire", "protocol": self._bus.protocol,
            "servo_id": id, "family": str(device.servo.sheet.get("registers", "")), "registers": device.table.values()}}
        path.write_text(json.dumps(facts, indent=1) + "\n", "utf-8")

    def heard(self, packet: Packet) -> None:
        """Write a row of each servo whose position a packet asks for; where that fails it is said, once."""
        for device in self._asked(packet):
            id = self._bus.ids[device.lane]
            if self._bus.time > self._last.get(id, -1.0):
                self._last[id] = self._bus.time
                try:
                    self._row(id, device)
                except OSError as error:
                    fault = error.strerror or str(error)
                    if fault != self._fault:
                        self._bus.counts.said.append(f"logs cannot be written ({fault}): rows are lost")
                    self._fault = fault

    def _asked(self, packet: Packet) -> list[Any]:
        data, frames = packet.data, feetech_frames if self._bus.protocol == "feetech" else dynamixel_frames
        wide = 1 if self._bus.protocol == "feetech" else 2
        if packet.code not in (frames.READ, frames.SYNC_READ) or len(data) < 2 * wide:
            return []
        address, count = (int.from_bytes(data[k * wide:(k + 1) * wide], "little") for k in (0, 1))
        first, end = _POSITION[self._bus.protocol]
        if address > first or address + count < end:
            return []
        ids = data[2 * wide:] if packet.id == ALL else bytes((packet.id,))
        return [one for one in self._bus.devices if one.id in ids]

    def _row(self, id: int, device: Any) -> None:
        seen, on = device.seen, bool(device.table["Torque_Enable"])
        count = math.degrees(COUNT)
        goal = math.degrees(round(seen.goal / COUNT) * COUNT) if on else math.nan
        duty = seen.duty if math.isfinite(seen.duty) else 0.0
        self._told[id].writerow((
            round(self._bus.time, 7), "" if not on else round(goal, 6), round((device.raw - MIDDLE) * count, 6),
            round(round(seen.speed / COUNT) * count, 6), round(duty, 3),
            round(seen.current / 6.5e-3) * 6.5e-3 if math.isfinite(seen.current) else 0.0, round(seen.voltage, 1),
            round(seen.temperature - 273.15) + 273.15, float(on)))
        self._truth[id].writerow((self._bus.time, "" if not on else seen.goal, seen.angle, seen.speed, duty,
                                  seen.current, seen.voltage, seen.temperature))

    def close(self) -> None:
        """End the logs."""
        for file in self._files:
            if not file.closed:
                file.close()

    def flush(self) -> None:
        """Put on the disk what is written."""
        for file in self._files:
            if not file.closed:
                file.flush()
