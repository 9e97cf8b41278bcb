"""A wire with bus servos: ask one, ask several at once, tell one, tell several at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol


class Answer(NamedTuple):
    """What a servo said.

    Parameters
    ----------
    data : bytes
    error : int
        Its status byte; 0: all is well.
    sent, received : float
        When the question had gone out and the answer had come, `time.perf_counter` [s].
    """

    data: bytes
    error: int
    sent: float
    received: float

    @property
    def middle(self) -> float:
        """Between question and answer [s]; the servo looked at its registers at most half their distance from it."""
        return 0.5 * (self.sent + self.received)


class BusWire(Protocol):
    """Five things to do with servos on a wire. A packet that is damaged counts as none."""

    @property
    def name(self) -> str:
        """Of the wire, for messages."""

    def open(self) -> None:
        """Take the wire.

        Raises
        ------
        BenchError
            If it is not there, or somebody else has it.
        """

    def ping(self, ids: Sequence[int]) -> dict[int, int]:
        """Return the model numbers of those servos that answer, by id.

        Raises
        ------
        BenchError
            If the wire is cut.
        """

    def read(self, servo: int, address: int, size: int) -> Answer:
        """Ask a servo for a block of its registers, several times if need be.

        Raises
        ------
        BenchError
            If it does not answer, refuses, or the wire is cut.
        """

    def read_all(self, servos: Sequence[int], address: int, size: int) -> dict[int, Answer]:
        """Ask several servos for the same block, once; those that did not answer are left out.

        Raises
        ------
        BenchError
            If the wire is cut.
        """

    def write(self, servo: int, address: int, data: bytes) -> None:
        """Write into a servo's registers, and see that it arrived.

        Raises
        ------
        BenchError
            If it did not, or the wire is cut.
        """

    def write_all(self, address: int, data: Mapping[int, bytes]) -> None:
        """Write into several servos' registers at the same instant; nobody answers.

        Raises
        ------
        BenchError
            If the wire is cut.
        """

    def close(self) -> None:
        """Give the wire back."""
