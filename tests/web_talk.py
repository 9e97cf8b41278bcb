"""A browser's side of the wire, without a browser."""

import contextlib
import json
import socket
import struct
import subprocess
import sys
from urllib.parse import urlsplit

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


class Deaf:
    """A page that comes in and reads nothing, until it is asked how far its bench had come."""

    def __init__(self, address: str) -> None:
        own = urlsplit(address)
        self.line = socket.socket()
        self.line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # soon full
        self.line.settimeout(20.0)
        self.line.connect((own.hostname, own.port))
        self.line.sendall((f"GET /live HTTP/1.1\r\nHost: {own.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                           "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n").encode())
        self._rest = b""
        while b"\r\n\r\n" not in self._rest:
            self._rest += self.line.recv(1)
        assert b"101" in self._rest.splitlines()[0]
        self._rest = b""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.line.close()

    def say(self, **message) -> None:
        """Say something."""
        self.line.sendall(framed(json.dumps(message).encode()))

    def time_of_next_push(self) -> float:
        """Take what comes up to the next push; return its time [s]."""
        while True:
            kind, size = self._taken(2)
            size = int.from_bytes(self._taken({126: 2, 127: 8}[size]), "big") if size > 125 else size
            data = self._taken(size)
            if kind == 0x82:
                return unpacked(data)[0]["t"]

    def is_cut(self) -> bool:
        """Take all that comes until the server ends it; whether it does."""
        try:
            while self.line.recv(65536):
                pass
        except ConnectionError:
            return True
        except TimeoutError:
            return False
        return True

    def _taken(self, size: int) -> bytes:
        while len(self._rest) < size:
            data = self.line.recv(65536)
            if not data:
                raise ConnectionError
            self._rest += data
        found, self._rest = self._rest[:size], self._rest[size:]
        return found


def framed(data: bytes, kind: int = 1) -> bytes:
    """Return a frame as a browser sends it: 1 for text, 2 for bytes, 9 for a ping."""
    size = len(data)
    length = bytes([0x80 | size]) if size < 126 else (
        bytes([0xFE]) + size.to_bytes(2, "big") if size < 65536 else bytes([0xFF]) + size.to_bytes(8, "big"))
    return bytes([0x80 | kind]) + length + bytes(4) + data


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
def running(*options: str, before: str = ""):
    """Run `servotwin web` on a free port; the page's address, and all that the command says of itself."""
    process, links = started(*options, before=before)
    try:
        yield links["page"], {**links, "pid": process.pid}
    finally:
        process.terminate()
        process.wait(10)
        process.stdout.close()


def started(*options: str, before: str = "") -> tuple[subprocess.Popen, dict]:
    """Start `servotwin web` on a free port, after a program; return the process and what it says of itself."""
    program = f"{before}\nimport sys\nfrom servotwin.cli import main\nsys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "web", "--port", "0", "--no-open", "--json", *options]
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
