"""The servos on a wire: both makers' protocols are tried at the usual speeds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from servotwin.bench.backends.board_backend import Backend
from servotwin.bench.backends.serial_port import SerialBackend
from servotwin.bench.bus.families import MODEL_NUMBER_AT, BusModel, known_models
from servotwin.bench.bus.sdk_wire import PATIENCE, BusWire, SdkWire, dynamixel_wire, feetech_wire
from servotwin.errors import BenchError, InputError, UnknownNameError

BAUDS = (1_000_000, 57_600, 115_200, 500_000, 2_000_000)
"""Speeds that are tried: the factory's of Feetech and AX, of X and MX, then what people set [bit/s]."""

IDS = tuple(range(32))
"""Of servos that have to be asked one by one; those of protocol 2 answer one question to all, whatever their id."""

_ID_AT = {"feetech": 5, "dynamixel-1": 3}
_HEAD = 6  # bytes that tell both protocols of the same packets apart
_WIRES: dict[str, Callable[..., SdkWire]] = {
    "feetech": feetech_wire, "dynamixel-2": dynamixel_wire,
    "dynamixel-1": lambda backend, **more: dynamixel_wire(backend, 1, **more)}


class FoundServo(NamedTuple):
    """A servo on a wire.

    Parameters
    ----------
    id : int
    protocol : {"feetech", "dynamixel-2", "dynamixel-1"}
    number : int
        Of its model.
    model : BusModel or None
        None: it is not known, and cannot be recorded.
    baud : int
        Speed at which it answered [bit/s].
    """

    id: int
    protocol: str
    number: int
    model: BusModel | None
    baud: int


def wire_of(protocol: str, backend: Backend, *, baud: int = 1_000_000, patience: float = PATIENCE) -> BusWire:
    """Return a wire of a protocol on a backend; answers may be late by `patience` [s].

    Raises
    ------
    UnknownNameError
        If there is no such protocol.
    MissingExtraError
        If the maker's package is not installed.
    """
    if protocol not in _WIRES:
        raise UnknownNameError("protocol of bus servos", str(protocol), _WIRES)
    return _WIRES[protocol](backend, baud=baud, patience=patience)


def scan(port: str, *, bauds: Sequence[int] = BAUDS, ids: Iterable[int] = IDS, thorough: bool = False,
         patience: float = PATIENCE, connect: Callable[[str, int], Backend] = SerialBackend) -> list[FoundServo]:
    """Return the servos on a port; nothing is written into them.

    Parameters
    ----------
    port : str
        Such as "/dev/ttyUSB0" or "COM3".
    bauds : sequence of int
        Speeds to try, in this order; ends with the first at which somebody answers [bit/s].
    ids : iterable of int
        Of servos that have to be asked one by one, 0 to 253.
    thorough : bool
        Try all speeds.
    patience : float
        How long each servo that is asked by itself has to answer [s].
    connect : callable
        From port and speed to a backend.

    Raises
    ------
    BenchError
        If there is no such port, or somebody else has it.
    MissingExtraError
        If pyserial or a maker's package is not installed.
    """
    asked = sorted(set(ids))
    if not all(isinstance(one, int) and 0 <= one <= 253 for one in asked):
        raise InputError("ids", got=asked, allowed="whole numbers from 0 to 253")
    found: list[FoundServo] = []
    for baud in bauds:
        backend = connect(port, baud)
        backend.open()
        try:
            wire = dynamixel_wire(backend, baud=baud)
            twos = [FoundServo(one, "dynamixel-2", number, known_models().get(("dynamixel-2", number)), baud)
                    for one, number in wire.ping(range(253)).items()]
            found += [*twos, *_others(backend, baud, asked, patience)]
        finally:
            backend.close()
        if found and not thorough:
            break
    return sorted(found, key=lambda one: (one.baud, one.id))


def identified(wire: BusWire, protocol: str, servo: int) -> BusModel:
    """Return the model of a servo.

    Raises
    ------
    BenchError
        If it does not answer, or is a model that is not known.
    """
    number = int.from_bytes(wire.read(servo, MODEL_NUMBER_AT[protocol], 2).data, "little")
    model = known_models().get((protocol, number))
    if model is None:
        raise BenchError(f"servo {servo} at {wire.name}", f"its model number {number} is none that can be recorded")
    return model


def _others(backend: Backend, baud: int, ids: Sequence[int], patience: float) -> list[FoundServo]:
    """Return servos whose packets look alike: what lies where the id has to be tells Feetech and Dynamixel apart."""
    wire = feetech_wire(backend, baud=baud, patience=patience)
    made = []
    for one in wire.ping(ids):
        head = wire.read(one, 0, _HEAD).data
        fits = [name for name, place in _ID_AT.items() if head[place] == one]
        numbers = {name: int.from_bytes(head[MODEL_NUMBER_AT[name]:][:2], "little") for name in fits}
        known = [name for name in fits if (name, numbers[name]) in known_models()]
        if not fits:
            continue
        protocol = (known or fits)[0]
        model = known_models().get((protocol, numbers[protocol]))
        made.append(FoundServo(one, protocol, numbers[protocol], model, baud))
    return made
