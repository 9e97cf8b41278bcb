"""Servos on a pseudo-terminal that speak Feetech's protocol or Dynamixel's, 2 and 1: addresses, signs and checksums as
the makers' tables say, written here a second time. What moves behind them is a plant.

    python tests/bench/bus_peers.py dynamixel-2 6

prints the port of six of them, and lets them live until its input ends.
"""

import math
import os
import select
import sys
import threading
import time
import tty
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

import servotwin as st

RPM = np.pi / 30.0
TURN = 2.0 * np.pi / 4096.0


class Reading(NamedTuple):
    """What a servo feels, in SI."""

    angle: float = 0.0
    speed: float = 0.0
    duty: float = 0.0
    current: float = 0.0
    voltage: float = 7.4
    temperature: float = 300.15


# --- plants ---------------------------------------------------------------------------------------------------------


class Fixed:
    """Readings that stand, one for each servo."""

    def __init__(self, *readings):
        self.readings = list(readings)

    def look(self, k, now, goal, torque):
        return self.readings[k]


class Ramp:
    """Goes to its goal at a constant speed [rad/s], and falls nowhere without torque."""

    def __init__(self, count, speed=3.0):
        self.angle, self.then, self.speed = [0.0] * count, [None] * count, speed

    def look(self, k, now, goal, torque):
        dt = 0.0 if self.then[k] is None else now - self.then[k]
        self.then[k] = now
        away = goal - self.angle[k] if torque else 0.0
        way = np.clip(away, -self.speed * dt, self.speed * dt)
        self.angle[k] += way
        return Reading(angle=self.angle[k], speed=way / dt if dt else 0.0, duty=np.sign(way) * 0.5 + 0.0)


class Fleet:
    """Simulated servos, all of a catalog's kind: in real time, or a `step` [s] for each question to all."""

    def __init__(self, name, count, step=None):
        self.step = step
        self.sims = st.VectorSimulator(st.DigitalServo(st.load_servo(name)), lanes=count, threads=1)
        self.sims.reset(command_angle=0.0)
        self.goals, self.on = np.zeros(count), np.ones(count, bool)
        self.sims.advance(1e-3, command_angle=self.goals)
        self.sims.set(torque_enable=self.on)
        self.then = math.inf
        self.look(0, 0.0, 0.0, True)  # all that has to be compiled is, before anybody waits for an answer
        self.then = time.perf_counter()

    def tick(self):
        if self.step:
            self.sims.advance(self.step, command_angle=self.goals)

    def look(self, k, now, goal, torque):
        if now > self.then and not self.step:
            self.sims.advance(now - self.then, command_angle=self.goals)
            self.then = now
        self.goals[k] = goal
        if torque != self.on[k]:
            self.on[k] = torque
            self.sims.set(torque_enable=self.on)
        at = {name: float(self.sims[name][k]) for name in (
            "output_angle", "output_speed", "duty", "armature_current", "bus_voltage")}
        return Reading(*at.values())


# --- memories -------------------------------------------------------------------------------------------------------


@dataclass
class Kind:
    """Where a model has what: (address, size, SI unit of a count, how minus is said)."""

    protocol: str
    number: int
    size: int
    number_at: int
    id_at: int
    torque_at: int
    goal: tuple
    middle: int
    outputs: dict
    factory: dict = field(default_factory=dict)  # address -> (value, size)


STS = Kind(
    "feetech", 777, 87, 3, 5, 40, (42, 2, TURN, 15), 2048,
    {"angle": (56, 2, TURN, 15), "speed": (58, 2, TURN, 15), "duty": (60, 2, 1e-3, 10), "voltage": (62, 1, 0.1, None),
     "temperature": (63, 1, 1.0, None), "current": (69, 2, 6.5e-3, 15)},
    {9: (0, 2), 11: (4095, 2), 18: (12, 1), 21: (32, 1), 22: (32, 1), 24: (16, 1), 31: (0x0805, 2), 81: (20, 1),
     84: (68, 1), 85: (100, 1), 86: (1, 1), 28: (310, 2), 48: (1000, 2), 8: (1, 1), 30: (1, 1), 16: (1000, 2)})
X330 = Kind(
    "dynamixel-2", 1200, 148, 0, 7, 64, (116, 4, TURN, "twos"), 2048,
    {"duty": (124, 2, 1 / 885, "twos"), "current": (126, 2, 1e-3, "twos"), "speed": (128, 4, 0.229 * RPM, "twos"),
     "angle": (132, 4, TURN, "twos"), "voltage": (144, 2, 0.1, None), "temperature": (146, 1, 1.0, None)},
    {11: (3, 1), 13: (2, 1), 48: (4095, 4), 52: (0, 4), 84: (400, 2), 36: (885, 2), 38: (1750, 2), 62: (140, 1),
     68: (2, 1), 100: (885, 2), 102: (1750, 2), 31: (70, 1), 34: (35, 2), 32: (70, 2), 63: (53, 1)})
XL430 = Kind(
    "dynamixel-2", 1060, 148, 0, 7, 64, (116, 4, TURN, "twos"), 2048,
    {"duty": (124, 2, 1 / 885, "twos"), "speed": (128, 4, 0.229 * RPM, "twos"), "angle": (132, 4, TURN, "twos"),
     "voltage": (144, 2, 0.1, None), "temperature": (146, 1, 1.0, None)},
    {11: (3, 1), 13: (2, 1), 48: (4095, 4), 52: (0, 4), 84: (640, 2), 80: (4000, 2), 36: (885, 2), 68: (2, 1),
     100: (885, 2), 31: (72, 1), 32: (140, 2), 34: (60, 2), 63: (52, 1)})
AX12 = Kind(
    "dynamixel-1", 12, 50, 0, 3, 24, (30, 2, np.radians(300 / 1023), None), 512,
    {"angle": (36, 2, np.radians(300 / 1023), None), "speed": (38, 2, 0.111 * RPM, 10), "duty": (40, 2, 1 / 1023, 10),
     "voltage": (42, 1, 0.1, None), "temperature": (43, 1, 1.0, None)},
    {6: (0, 2), 8: (1023, 2), 28: (32, 1), 29: (32, 1), 26: (1, 1), 27: (1, 1), 48: (32, 2), 14: (1023, 2),
     34: (1023, 2), 11: (70, 1), 12: (60, 1), 13: (140, 1), 16: (2, 1)})
KINDS = {"feetech": STS, "dynamixel-2": X330, "dynamixel-1": AX12}


def raw_of(value, size, sign):
    value = round(value)
    if isinstance(sign, int) and value < 0:
        value = -value | 1 << sign
    return (value % (1 << 8 * size)).to_bytes(size, "little")


def number_of(data, sign):
    value = int.from_bytes(data, "little", signed=sign == "twos")
    return -(value & (1 << sign) - 1) if isinstance(sign, int) and value >> sign & 1 else value


class Servo:
    """One servo: its memory, and which of the plant's it is."""

    def __init__(self, kind, identity, k, plant):
        self.kind, self.id, self.k, self.plant = kind, identity, k, plant
        self.memory = bytearray(kind.size)
        self.error = 0
        self.silent = False
        self.put(kind.number_at, raw_of(kind.number, 2, None))
        self.memory[kind.id_at] = identity
        for address, (value, size) in kind.factory.items():
            self.put(address, raw_of(value, size, None))
        self.put(kind.goal[0], raw_of(kind.middle, kind.goal[1], None))
        self.truth = []  # (time, reading, bytes of the angle)

    def put(self, address, data):
        self.memory[address:address + len(data)] = data

    @property
    def torque(self):
        return self.memory[self.kind.torque_at] == 1

    @property
    def goal(self):
        address, size, unit, sign = self.kind.goal
        return (number_of(self.memory[address:address + size], sign) - self.kind.middle) * unit

    def look(self):
        now = time.perf_counter()
        reading = self.plant.look(self.k, now, self.goal, self.torque)
        for name, (address, size, unit, sign) in self.kind.outputs.items():
            offset = self.kind.middle if name == "angle" else -273.15 if name == "temperature" else 0.0
            self.put(address, raw_of(getattr(reading, name) / unit + offset, size, sign))
        self.truth.append((now, reading))


# --- packets --------------------------------------------------------------------------------------------------------


def checksum(body):
    return ~sum(body) & 0xFF


def crc16(data):
    """CRC-16 of polynomial 0x8005, bit by bit."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class One:
    """Frames of Feetech and of Dynamixel's protocol 1: FF FF id length instruction … checksum."""

    wide = 1  # bytes of an address

    @staticmethod
    def take(buffer):
        start = buffer.find(b"\xff\xff")
        if start < 0 or len(buffer) < start + 4 or len(buffer) < start + 4 + buffer[start + 3]:
            return None
        end = start + 4 + buffer[start + 3]
        frame = bytes(buffer[start + 2:end])
        del buffer[:end]
        return (frame[0], frame[2], frame[3:-1]) if checksum(frame[:-1]) == frame[-1] else (None, None, None)

    @staticmethod
    def status(identity, error, data):
        body = bytes([identity, len(data) + 2, error]) + data
        return b"\xff\xff" + body + bytes([checksum(body)])

    @staticmethod
    def hello(servo):
        return b""


class Two:
    """Frames of Dynamixel's protocol 2: FF FF FD 00 id length(2) instruction … CRC, with bytes stuffed in."""

    wide = 2

    @staticmethod
    def take(buffer):
        start = buffer.find(b"\xff\xff\xfd\x00")
        if start < 0 or len(buffer) < start + 7:
            return None
        end = start + 7 + int.from_bytes(buffer[start + 5:start + 7], "little")
        if len(buffer) < end:
            return None
        frame = bytes(buffer[start:end])
        del buffer[:end]
        if crc16(frame[:-2]) != int.from_bytes(frame[-2:], "little"):
            return (None, None, None)
        return frame[4], frame[7], frame[8:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")

    @staticmethod
    def status(identity, error, data):
        body = (b"\x55" + bytes([error]) + data).replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
        frame = b"\xff\xff\xfd\x00" + bytes([identity]) + (len(body) + 2).to_bytes(2, "little") + body
        return frame + crc16(frame).to_bytes(2, "little")

    @staticmethod
    def hello(servo):
        return bytes(servo.memory[:2]) + b"\x2d"


PING, READ, WRITE, SYNC_READ, SYNC_WRITE, ALL = 1, 2, 3, 0x82, 0x83, 0xFE


class Bus:
    """Servos behind a pseudo-terminal, in a thread of their own."""

    def __init__(self, kind, ids, plant, baud=None):
        self.kind, self.plant, self.baud = kind, plant, baud
        self.frames = Two if kind.protocol == "dynamixel-2" else One
        self.servos = {identity: Servo(kind, identity, k, plant) for k, identity in enumerate(ids)}
        self.rejected = 0  # frames with a wrong checksum
        self.questions = 0
        self.harm = lambda frame: frame  # what the wire makes of an answer
        self.written = []  # (time, id, address, data)
        self._stop = threading.Event()

    def __enter__(self):
        self._master, self._slave = os.openpty()  # the slave stays open, so that a reader may come and go
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()
        self._close()

    def cut(self):
        """Pull the cable out."""
        self._stop.set()
        self._thread.join()
        self._close()

    def _close(self):
        for one in (self._master, self._slave):
            with suppress(OSError):
                os.close(one)

    def _live(self):
        buffer = bytearray()
        while not self._stop.is_set():
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            try:
                buffer += os.read(self._master, 4096)
            except OSError:
                continue
            while (frame := self.frames.take(buffer)) is not None:
                self._answer(*frame)

    def _answer(self, identity, instruction, words):
        if identity is None:
            self.rejected += 1
            return
        self.questions += 1
        wide, all_of = self.frames.wide, [one for one in self.servos.values() if identity in (one.id, ALL)]
        if instruction == PING:
            for one in all_of:
                self._say(one, self.frames.hello(one))
        elif instruction in (READ, SYNC_READ):
            address, size = (int.from_bytes(words[a * wide:(a + 1) * wide], "little") for a in (0, 1))
            if instruction == SYNC_READ and hasattr(self.plant, "tick"):
                self.plant.tick()
            asked = all_of if instruction == READ else [
                self.servos[one] for one in words[2 * wide:] if one in self.servos]
            for one in asked:
                one.look()
                self._say(one, bytes(one.memory[address:address + size]))
        elif instruction == WRITE:
            address = int.from_bytes(words[:wide], "little")
            for one in all_of:
                self._write(one, address, words[wide:])
                if identity != ALL:
                    self._say(one, b"")
        elif instruction == SYNC_WRITE:
            address, size = (int.from_bytes(words[a * wide:(a + 1) * wide], "little") for a in (0, 1))
            rest = words[2 * wide:]
            for k in range(0, len(rest), size + 1):
                if rest[k] in self.servos:
                    self._write(self.servos[rest[k]], address, rest[k + 1:k + 1 + size])

    def _write(self, servo, address, data):
        servo.look()  # it was where it was under the old orders until now
        servo.put(address, data)
        servo.look()  # and goes on under these
        self.written.append((time.perf_counter(), servo.id, address, bytes(data)))

    def _say(self, servo, data):
        if servo.silent:
            return
        frame = self.harm(self.frames.status(servo.id, servo.error, data))
        if self.baud:
            time.sleep(len(frame) * 10 / self.baud)
        with suppress(OSError):
            os.write(self._master, frame)


def main(kind_name, count, plant_name=""):
    kind = KINDS[kind_name]
    plant = Fleet(plant_name, count) if plant_name else Ramp(count)
    with Bus(kind, range(1, count + 1), plant, baud=1_000_000) as bus:
        print(bus.port, flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), *sys.argv[3:])
