"""A client: `python client.py sdk|raw PORT CYCLES IDS` reads and writes servos at 100 Hz; prints how long it took."""

import json
import os
import select
import sys
import time
import tty

PERIOD, PATIENCE = 0.01, 0.05  # s
IDS = range(1, int(sys.argv[4]) + 1)


def frame(id, code, data):
    body = bytes((id, len(data) + 2, code)) + data
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


class Sdk:
    """Feetech's own package."""

    def __init__(self, port):
        import scservo_sdk as sdk

        self.port, self.packets, self.good = sdk.PortHandler(port), sdk.PacketHandler(0), sdk.COMM_SUCCESS
        self.port.openPort()
        self.port.setBaudRate(1_000_000)
        self.read = sdk.GroupSyncRead(self.port, self.packets, 56, 2)
        self.write = sdk.GroupSyncWrite(self.port, self.packets, 42, 2)
        for id in IDS:
            self.read.addParam(id)

    def ask(self):
        return self.read.txRxPacket() == self.good

    def tell(self, goal):
        for id in IDS:
            self.write.addParam(id, [goal & 0xFF, goal >> 8])
        self.write.txPacket()
        self.write.clearParam()


class Raw:
    """The port alone: sleeps until something comes."""

    def __init__(self, port):
        import termios

        self.port = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.port)
        modes = termios.tcgetattr(self.port)
        modes[4] = modes[5] = termios.B1000000
        termios.tcsetattr(self.port, termios.TCSANOW, modes)
        self.question = frame(0xFE, 0x82, bytes((56, 2, *IDS)))

    def ask(self):
        os.write(self.port, self.question)
        got, end = 0, time.perf_counter() + PATIENCE
        while got < 8 * len(IDS):
            if not select.select([self.port], [], [], max(end - time.perf_counter(), 0.0))[0]:
                return False
            got += len(os.read(self.port, 4096))
        return got == 8 * len(IDS)

    def tell(self, goal):
        data = b"".join(bytes((id,)) + goal.to_bytes(2, "little") for id in IDS)
        os.write(self.port, frame(0xFE, 0x83, bytes((42, 2)) + data))


def main():
    kind, port, cycles = sys.argv[1], sys.argv[2], int(sys.argv[3])
    client = {"sdk": Sdk, "raw": Raw}[kind](port)
    lost, times, start = 0, [], time.perf_counter()
    for k in range(cycles):
        began = time.perf_counter()
        good = client.ask()
        times.append(time.perf_counter() - began)
        lost += not good
        client.tell(2048 + 2 * (k % 300))
        time.sleep(max(start + (k + 1) * PERIOD - time.perf_counter(), 0.0))
    print(json.dumps({"lost": lost, "times": times, "took": time.perf_counter() - start,
                      "cpu": time.process_time()}))


if __name__ == "__main__":
    main()
