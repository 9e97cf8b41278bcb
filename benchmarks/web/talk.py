"""A server in a process of its own, clients that read all pushes, and what the server computes for them."""

import asyncio
import contextlib
import json
import os
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
from web_talk import started

STEADY = 1.5  # s until all is warm


class Client:
    """A visitor that reads all that it is sent, and keeps what pushes say of the pace."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.pushes = self.bytes = self.behind = 0
        self.time = 0.0
        self._reading = asyncio.create_task(self._read())

    async def _read(self) -> None:
        async for data in self.socket:
            if isinstance(data, bytes):
                (length,) = struct.unpack_from("<I", data)
                header = json.loads(data[4:4 + length])
                self.pushes, self.bytes, self.time = self.pushes + 1, self.bytes + len(data), header["t"]
                self.behind += header["behind"]

    async def say(self, **message: Any) -> None:
        await self.socket.send(json.dumps(message))

    async def leave(self) -> None:
        self._reading.cancel()
        self.socket.transport.abort()
        with contextlib.suppress(asyncio.CancelledError):
            await self._reading

    def clear(self) -> None:
        self.pushes = self.bytes = self.behind = 0


async def come(address: str, query: str = "") -> Client:
    """Return a visitor at a server."""
    link = address.replace("http", "ws").rstrip("/") + "/live" + query
    return Client(await connect(link, max_size=None, compression=None))


@contextlib.contextmanager
def server(*options: str) -> Iterator[tuple[dict[str, Any], int]]:
    """Run `servotwin web`; what it says of itself, and the number of its process."""
    process, links = started(*options)
    try:
        yield links, process.pid
    finally:
        process.terminate()
        process.wait(10)
        process.stdout.close()


def processor_time(pid: int) -> float:
    """Return the time that a process has computed for [s]."""
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        user, system = file.read().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


async def watched(clients: list[Client], pid: int, seconds: float) -> dict[str, float]:
    """Return, over so many seconds, the server's share of a core, and the clients' worst pace and push rate."""
    await asyncio.sleep(STEADY)
    for one in clients:
        one.clear()
    computed, begun, times = processor_time(pid), time.monotonic(), [one.time for one in clients]
    await asyncio.sleep(seconds)
    wall, computed = time.monotonic() - begun, processor_time(pid) - computed
    return {"share": computed / wall,
            "pace": min((one.time - start) / wall for one, start in zip(clients, times, strict=True)),
            "rate": min(one.pushes for one in clients) / wall,
            "bytes": sum(one.bytes for one in clients) / max(sum(one.pushes for one in clients), 1),
            "behind": sum(one.behind for one in clients)}
