import random

import pytest

from servotwin.wire import dynamixel_frames, feetech_frames
from servotwin.wire.packet import Packet
from wire_talk import dynamixel, feetech


@pytest.mark.parametrize(("made", "text"), [
    (feetech_frames.frame(1, feetech_frames.PING), "ff ff 01 02 01 fb"),
    (feetech_frames.frame(1, feetech_frames.READ, bytes([3, 2])), "ff ff 01 04 02 03 02 f3"),
    (feetech_frames.frame(6, feetech_frames.WRITE, bytes([40, 0])), "ff ff 06 04 03 28 00 ca"),
    (feetech_frames.frame(0xFE, feetech_frames.SYNC_READ, bytes([56, 2, 1, 2])), "ff ff fe 06 82 38 02 01 02 3c"),
    (feetech_frames.frame(1, 0, bytes([9, 3])), "ff ff 01 04 00 09 03 ee"),  # model 777
    (dynamixel_frames.frame(1, dynamixel_frames.PING), "ff ff fd 00 01 03 00 01 19 4e"),
    (dynamixel_frames.answer(1, 0, bytes([0x06, 0x04, 0x26])), "ff ff fd 00 01 07 00 55 00 06 04 26 65 5d"),
    (dynamixel_frames.frame(1, dynamixel_frames.READ, bytes([132, 0, 4, 0])),
     "ff ff fd 00 01 07 00 02 84 00 04 00 1d 15"),
    (dynamixel_frames.frame(0xFE, dynamixel_frames.SYNC_READ, bytes([0x84, 0, 4, 0, 1, 2])),
     "ff ff fd 00 fe 09 00 82 84 00 04 00 01 02 ce fa"),
])
def test_frames_are_those_of_the_makers(made, text):
    assert made == bytes.fromhex(text)


def test_a_header_within_a_packet_of_protocol_2_is_stuffed():
    made = dynamixel_frames.frame(1, 3, bytes([0xFF, 0xFF, 0xFD]))
    assert made[8:12] == b"\xff\xff\xfd\xfd"
    assert made == dynamixel(1, 3, 0xFF, 0xFF, 0xFD)
    assert dynamixel_frames.split(bytearray(made)) == ([Packet(1, 3, b"\xff\xff\xfd")], 0)


@pytest.mark.parametrize("count", [10_000, pytest.param(100_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("frames", "plain"), [(feetech_frames, feetech), (dynamixel_frames, dynamixel)])
def test_packets_come_out_as_they_went_in_whatever_is_between(frames, plain, count):
    draw, sent, buffer, found = random.Random(1), [], bytearray(), []
    for _ in range(count):
        data = bytes(draw.choice((draw.randrange(256), 0xFF, 0xFD, 0)) for _ in range(draw.randrange(12)))
        sent.append(Packet(draw.randrange(254), draw.randrange(1, 256), data))
        whole = frames.frame(*sent[-1])
        assert whole == plain(sent[-1].id, sent[-1].code, *data)
        noise = bytes(draw.randrange(0xFE) for _ in range(draw.randrange(4)))
        cut = draw.randrange(len(whole))
        for part in (noise, whole[:cut], whole[cut:]):
            buffer += part
            found += frames.split(buffer)[0]
    assert found == sent
    assert len(buffer) < 3


@pytest.mark.parametrize(("frames", "most"), [(feetech_frames, 260), (dynamixel_frames, 2100)])
def test_a_bent_packet_is_counted_and_the_next_one_heard(frames, most):
    good = frames.frame(3, 2, bytes([1, 2, 3, 4]))
    for place in range(len(good)):
        bent = bytearray(good)
        bent[place] ^= 0x10
        buffer = bytearray(bytes(bent) + good * (most // len(good) + 1))
        packets, _ = frames.split(buffer)
        assert packets[-1] == Packet(3, 2, bytes([1, 2, 3, 4]))
        assert len(packets) >= most // len(good)
