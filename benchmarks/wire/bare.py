"""The bare responder: six IDs on a pseudo-terminal in plain Python, without registers or physics.

    python bare.py

prints the port, serves until its input ends, and prints its processor time per answer.
"""

import json
import os
import select
import sys
import time
import tty

HEAD = b"\xff\xff"


def status(id, data=b""):
    body = bytes((id, len(data) + 2, 0)) + data
    return HEAD + body + bytes((~sum(body) & 0xFF,))


def answer(body, goals):
    id, code, data = body[0], body[2], body[3:]
    if code == 0x82:
        return b"".join(status(one, goals.get(one, 2048).to_bytes(2, "little")) for one in data[2:])
    if code == 0x83:
        for k in range(2, len(data), data[1] + 1):
            goals[data[k]] = data[k + 1] | data[k + 2] << 8
        return b""
    return status(id, goals.get(id, 2048).to_bytes(2, "little") if code == 2 else b"") if id < 0xFE else b""


def main():
    master, slave = os.openpty()
    for one in (master, slave):
        tty.setraw(one)
    os.set_blocking(master, False)
    print(os.ttyname(slave), flush=True)
    buffer, goals, costs = bytearray(), {}, []
    while True:
        ready = select.select([master, sys.stdin], [], [])[0]
        if sys.stdin in ready:
            break
        began = time.thread_time()
        try:
            buffer += os.read(master, 4096)
        except OSError:
            continue
        while (at := buffer.find(HEAD)) >= 0 and len(buffer) >= at + 4 and len(buffer) >= at + 4 + buffer[at + 3]:
            end = at + 4 + buffer[at + 3]
            body = bytes(buffer[at + 2:end - 1])
            good = ~sum(body) & 0xFF == buffer[end - 1]
            del buffer[:end]
            data = answer(body, goals) if good else b""
            if data:
                os.write(master, data)
                costs.append(time.thread_time() - began)
    print(json.dumps({"costs": costs, "cpu": time.process_time()}), flush=True)


if __name__ == "__main__":
    main()
