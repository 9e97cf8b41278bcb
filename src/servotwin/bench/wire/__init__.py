"""The wire to the microcontroller: frames, messages, and the text that defines them."""

from servotwin.bench.wire.board import Board, Message
from servotwin.bench.wire.frames import Clock, Field, Frame, Kind, Protocol, Splitter, from_wire, protocol, to_wire

__all__ = ["Board", "Clock", "Field", "Frame", "Kind", "Message", "Protocol", "Splitter", "from_wire", "protocol",
           "to_wire"]
