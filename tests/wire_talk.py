"""Packets as a client writes them, a second time and plainly; and a client of a bus."""

import math

COUNT = 2.0 * math.pi / 4096.0
STS = "feetech-sts3215-12v"


def feetech(id, code, *data):
    body = [id, len(data) + 2, code, *data]
    return bytes([0xFF, 0xFF, *body, 255 - sum(body) % 256])


def word(value, sign=None):
    if sign is not None and value < 0:
        value = -value | 1 << sign
    return value & 0xFF, value >> 8 & 0xFF


def signed(data, sign):
    value = int.from_bytes(data, "little")
    return -(value & (1 << sign) - 1) if value >> sign & 1 else value


def crc(data):
    found = 0
    for byte in data:
        found ^= byte << 8
        for _ in range(8):
            found = (found << 1 ^ 0x8005) & 0xFFFF if found & 0x8000 else found << 1
    return found


def dynamixel(id, code, *data):
    body = bytes([code, *data]).replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
    made = bytes([0xFF, 0xFF, 0xFD, 0, id, *word(len(body) + 2)]) + body
    return made + crc(made).to_bytes(2, "little")


class Client:
    """Writes and reads registers of a bus of Feetech servos, in simulated time."""

    def __init__(self, bus):
        self.bus = bus

    def read(self, id, address, count):
        answer = self.bus.ask(feetech(id, 2, address, count))
        return answer[5:-1] if answer else None

    def number(self, id, address, count=2, sign=15):
        return signed(self.read(id, address, count), sign)

    def write(self, id, address, *data):
        return self.bus.ask(feetech(id, 3, address, *data))

    def goal(self, id, count):
        return self.write(id, 42, *word(count, 15))
