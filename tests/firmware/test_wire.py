"""Whatever comes over the wire: what is bent is not obeyed, all of it is counted, and the board lives on."""

import os
import random
import struct

import pytest

from board_talk import (
    ASK,
    CYCLES_PER_TICK,
    DONE,
    HELLO,
    IDENTITY,
    LIMP,
    MODE,
    STATUS,
    Script,
    crc16,
    frame,
    points,
    status,
    stuffed,
    unstuffed,
)

RANDOM_FRAMES = int(os.environ.get("SERVOTWIN_RANDOM_FRAMES", "5000"))  # the full test takes 100000
SECONDS_PER_BYTE = 24e-6  # a little slower than the wire


def is_valid(piece: bytes) -> bool:
    """Say whether a board has to take what stood between two bytes 0."""
    try:
        body = unstuffed(piece)
    except AssertionError:
        return False
    return (len(body) >= 10 and len(body) == body[0] + 10 <= 82 and body[1] == 1
            and crc16(body[:-2]) == int.from_bytes(body[-2:], "little"))


def pieces_of(data: bytes) -> list[bytes]:
    return [piece for piece in data.split(b"\0") if piece]


def send(script: Script, at: float, frames: list[bytes]) -> float:
    """Put frames on the wire one after the other, and return the end."""
    for data in frames:
        script.wire(at, data)
        at += len(data) * SECONDS_PER_BYTE + 2e-4
    return at


def test_the_checksum_is_the_known_one():
    assert crc16(b"123456789") == 0x29B1  # check value of CRC-16/CCITT-FALSE


def test_bent_bytes_are_never_obeyed_and_always_counted(board):
    rng = random.Random(18)
    clean = [frame(ASK, sequence=k) if k % 3 else points(1, *[(1, 3000, 40000 + k)] * 10) for k in range(1500)]
    bent = bytearray(b"".join(clean))
    hits = rng.sample(range(len(bent)), len(bent) // 1000)
    for place in hits:
        bent[place] ^= rng.randrange(1, 256)
    sent, at = [], 0
    for one in clean:
        sent.append(bytes(bent[at:at + len(one)]))
        at += len(one)
    script = Script()
    end = send(script, 0.02, sent)
    log = board(script.wire(end + 0.01, frame(ASK, sequence=99)), end + 0.02)
    pieces = pieces_of(bytes(bent))
    valid = [unstuffed(piece) for piece in pieces if is_valid(piece)]
    assert len(hits) > 30
    assert len(valid) > 1400
    # What was answered is what was valid, in its order; of all else the board counted every piece
    answered = [(one.kind, one.payload[0]) for one in log.frames if one.kind in (STATUS, DONE)]
    assert answered == [*((STATUS if body[3] == ASK else DONE, body[2]) for body in valid), (STATUS, 99)]
    assert {body for body in valid} <= {unstuffed(piece) for one in clean for piece in pieces_of(one)}
    assert status(log)["bad"] == len(pieces) - len(valid) >= len(hits) * 0.9
    assert status(log)["good"] == len(valid) + 1


@pytest.mark.long
def test_random_frames_leave_the_board_alive(board):
    """Noise, true frames of noise, and orders with random numbers; then it still is who it was."""
    rng = random.Random(1811)

    def one() -> bytes:
        kind = rng.randrange(4)
        if kind == 0:
            return b"\0" + rng.randbytes(rng.randrange(1, 120)) + b"\0"
        if kind == 1:
            return b"\0" + stuffed(rng.randbytes(rng.randrange(1, 100))) + b"\0"
        if kind == 2:
            return frame(rng.randrange(256), rng.randbytes(rng.randrange(73)), rng.randrange(256))
        length = {2: 4, 3: 2 + 6 * rng.randrange(1, 11), 5: 4, 7: 3, 9: 1}.get(order := rng.randrange(1, 10), 0)
        payload = bytearray(rng.randbytes(length))
        if order in (7, 9):
            payload = bytearray(byte % 4 for byte in payload)
        elif order == 2:
            payload[:] = struct.pack("<HH", rng.randrange(150, 6100), rng.randrange(6000, 50010))
        return frame(order, bytes(payload))

    frames = [one() for _ in range(RANDOM_FRAMES)]
    script = Script(jumper=True)
    end = send(script, 0.02, frames)
    for k, last in enumerate((frame(MODE, b"\0"), frame(LIMP), frame(HELLO, sequence=5), frame(ASK, sequence=6))):
        script.wire(end + 0.01 * (k + 1), last)
    log = board(script, end + 0.1)
    pieces = pieces_of(b"".join(frames))
    good = sum(is_valid(piece) for piece in pieces)
    assert good > RANDOM_FRAMES // 3
    assert [one.payload[:9] for one in log.of(IDENTITY)][-1] == b"\x05servotwn"
    assert status(log)["good"] == (good + 4) % 65536
    assert status(log)["bad"] == (len(pieces) - good) % 65536
    # No pulse is longer than the longest, whatever was ordered in the middle of it
    widths = {wide / CYCLES_PER_TICK for _, wide in log.pulses}
    assert len(widths) > 20
    assert 12 <= min(widths)
    assert max(widths) <= 6000
    assert log.edges[-1][1] == 0
