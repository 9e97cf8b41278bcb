"""A browser's side of the wire, without a browser."""

import contextlib
import json
import socket
import struct
import subprocess
import sys

import numpy as np
from websockets.sync.client import connect


class Page:
    """What a page does: it says things, and takes pushes."""

    def __init__(self, address: str, query: str = "", **options) -> None:
        self._open = contextlib.ExitStack()
        self.socket = self._open.enter_context(connect(
            address.replace("http", "ws").rstrip("/") + "/live" + query, max_size=None, compression=None, **options))
        self.number = 0
        self.texts: list[dict] = []
        self.pushes: list[tuple[dict, list]] = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self) -> None:
        """Leave as a tab that is closed: in mid push, and without waiting for an answer."""
        with contextlib.suppress(OSError):
            self.socket.socket.shutdown(socket.SHUT_RDWR)
        self._open.close()

    def take(self, timeout: float = 5.0) -> dict | None:
        """Take one message; return it if it is a text."""
        data = self.socket.recv(timeout)
        if isinstance(data, str):
            self.texts.append(json.loads(data))
            return self.texts[-1]
        self.pushes.append(unpacked(data))
        return None

    def until(self, word: str, timeout: float = 10.0) -> dict:
        """Take messages until one has a word; return it."""
        for _ in range(5000):
            text = self.take(timeout)
            if text is not None and word in text:
                return text
        raise AssertionError(word)

    def ask(self, **message) -> dict:
        """Say something, and return the answer: one with "done" or "refused"."""
        self.number += 1
        self.socket.send(json.dumps({**message, "id": self.number}))
        for _ in range(5000):
            text = self.take(20.0)
            if text is not None and self.number in (text.get("done"), text.get("refused")):
                return text
        raise AssertionError(message)

    def pushed(self, count: int = 1) -> None:
        """Take so many pushes."""
        end = len(self.pushes) + count
        while len(self.pushes) < end:
            self.take()


def unpacked(data: bytes) -> tuple[dict, list]:
    """Return header and, for each servo, points and pulses of a push."""
    (length,) = struct.unpack_from("<I", data)
    header = json.loads(data[4:4 + length])
    numbers = np.frombuffer(data, "<f8", offset=-(-(4 + length) // 8) * 8)
    found, at = [], 0
    for part in header["servos"]:
        size, width = part["n"] * len(part["columns"]), len(part["columns"])
        points, at = numbers[at:at + size].reshape(-1, width), at + size
        pulses, at = numbers[at:at + 2 * part["m"]].reshape(-1, 2), at + 2 * part["m"]
        found.append((points, pulses))
    assert at == len(numbers)
    return header, found


@contextlib.contextmanager
def running(*options: str):
    """Run `servotwin web` on a free port; the page's address, and all that the command says of itself."""
    process, links = started(*options)
    try:
        yield links["page"], links
    finally:
        process.terminate()
        process.wait(10)
        process.stdout.close()


def started(*options: str) -> tuple[subprocess.Popen, dict]:
    """Start `servotwin web` on a free port; return the process and what it says of itself."""
    command = [sys.executable, "-m", "servotwin", "web", "--port", "0", "--no-open", "--json", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    line = process.stdout.readline()
    if not line:
        raise RuntimeError("no server")
    text = line
    while not _whole(text):
        text += process.stdout.readline()
    return process, json.loads(text)


def _whole(text: str) -> bool:
    try:
        json.loads(text)
    except ValueError:
        return False
    return True
