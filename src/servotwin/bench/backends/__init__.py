"""Backends, which carry bytes to a bench and back: one small interface, and all that fits it."""

from servotwin.bench.backends.board_backend import Backend
from servotwin.bench.backends.emulated import EmulatedBackend, MockBackend
from servotwin.bench.backends.serial_port import SerialBackend, serial_ports

__all__ = ["Backend", "EmulatedBackend", "MockBackend", "SerialBackend", "serial_ports"]
