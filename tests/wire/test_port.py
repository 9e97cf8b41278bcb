"""Programs of others at a port that `servotwin wire` serves, unchanged."""

import os
import socket
import subprocess
import sys
import time

import pytest

from wire_served import served
from wire_talk import feetech, word

serial = pytest.importorskip("serial", reason="pyserial is not installed")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals here")
IDS = (1, 2, 3, 4, 5, 6)
PATIENT = 400.0  # ms: another may have the processor


@pytest.fixture
def feetech_sdk(so101):
    sdk = pytest.importorskip("scservo_sdk", reason="feetech-servo-sdk is not installed")
    port = sdk.PortHandler(so101["link"])
    port.setPacketTimeout = lambda length: port.setPacketTimeoutMillis(PATIENT)
    assert port.openPort()
    assert port.setBaudRate(1_000_000)
    yield sdk, port, sdk.PacketHandler(0)
    port.closePort()


def test_feetech_sdk(feetech_sdk):
    sdk, port, packets = feetech_sdk
    for id in IDS:
        assert packets.ping(port, id) == (777, 0, 0)
    assert packets.ping(port, 9)[1] == sdk.COMM_RX_TIMEOUT
    read, write = sdk.GroupSyncRead(port, packets, 56, 2), sdk.GroupSyncWrite(port, packets, 42, 2)
    assert all(read.addParam(id) for id in IDS)
    first = read.txRxPacket()
    before = [read.getData(id, 56, 2) for id in IDS]
    for _ in range(50):
        for id in IDS:
            write.addParam(id, list(word(2200)))
        write.txPacket()
        write.clearParam()
        assert read.txRxPacket() == sdk.COMM_SUCCESS
        time.sleep(0.01)
    time.sleep(1.0)
    assert first == read.txRxPacket() == sdk.COMM_SUCCESS
    assert all(abs(read.getData(id, 56, 2) - 2200) < 10 for id in IDS)
    assert before != [2200] * 6


@pytest.mark.skipif(sys.platform != "linux", reason="the speed of a client is seen on Linux alone")
@pytest.mark.parametrize(("code", "rate"), [(2, 250_000), (3, 128_000), (5, 76_800), (7, 38_400)])
def test_a_servo_answers_at_its_own_speed_alone(feetech_sdk, code, rate):
    _, port, packets = feetech_sdk
    assert packets.write1ByteTxRx(port, 2, 6, code) == (0, 0)
    with serial.Serial(port.getPortName(), rate, timeout=2.0) as other:
        other.write(feetech(2, 1))
        assert other.read(6) == feetech(2, 0)
        other.write(feetech(1, 1))
        other.timeout = 0.2
        assert other.read(6) == b""
        other.timeout = 2.0
        other.write(feetech(2, 3, 6, 0))
        assert other.read(6) == feetech(2, 0)
    port.setBaudRate(1_000_000)
    assert packets.ping(port, 2) == (777, 0, 0)


@pytest.mark.long
def test_dynamixel_sdk(koch):
    sdk = pytest.importorskip("dynamixel_sdk", reason="dynamixel-sdk is not installed")
    port, packets = sdk.PortHandler(koch["port"]), sdk.PacketHandler(2.0)
    port.setPacketTimeout = lambda length: port.setPacketTimeoutMillis(PATIENT)
    assert port.openPort()
    found = {}
    for rate in (57_600, 1_000_000):
        port.setBaudRate(rate)
        found |= {id: packets.ping(port, id)[0] for id in IDS if packets.ping(port, id)[1] == 0}
    assert found == {1: 1060, 2: 1060, 3: 1200, 4: 1200, 5: 1200, 6: 1200}
    port.setBaudRate(57_600)
    read, write = sdk.GroupSyncRead(port, packets, 132, 4), sdk.GroupSyncWrite(port, packets, 116, 4)
    for id in IDS:
        assert packets.write1ByteTxRx(port, id, 64, 1) == (0, 0)
        assert read.addParam(id)
        assert write.addParam(id, list((2100).to_bytes(4, "little")))
    write.txPacket()
    time.sleep(1.0)
    assert read.txRxPacket() == sdk.COMM_SUCCESS
    assert all(abs(read.getData(id, 132, 4) - 2100) < 60 for id in IDS)
    assert packets.write4ByteTxRx(port, 3, 116, 9999)[1] == 6
    port.closePort()


@pytest.mark.long
def test_ten_openings_a_killed_client_and_two_at_once(so101):
    for _ in range(10):
        with serial.Serial(so101["link"], 1_000_000, timeout=2.0) as port:
            port.write(feetech(1, 1))
            assert port.read(6) == feetech(1, 0)
    code = ("import serial, sys, time\nport = serial.Serial(sys.argv[1], 1000000, timeout=0)\n"
            "while True:\n    port.write(bytes.fromhex('ffff010201fb'))\n    time.sleep(0.001)\n")
    client = subprocess.Popen([sys.executable, "-c", code, so101["link"]])
    time.sleep(1.0)
    client.kill()
    client.wait()
    with (serial.Serial(so101["link"], 1_000_000, timeout=2.0) as one,
          serial.Serial(so101["link"], 1_000_000, timeout=0.2) as two):
        while two.read(4096):  # what the servos still answer to the one that was killed
            pass
        one.reset_input_buffer()
        one.write(feetech(3, 1))
        two.write(feetech(4, 1))
        assert sorted((one.read(12) + two.read(12)).split(b"\xff\xff"))[1:] == [b"\3\2\0\xfa", b"\4\2\0\xf9"]
    assert so101["process"].poll() is None


@pytest.mark.long
def test_what_is_stored_outlives_the_process(tmp_path):
    for offset, found in ((321, 0), (None, 321)):
        with served("--servo", "1=feetech-sts3215-12v", "--keep", tmp_path / "kept.json") as facts, \
                serial.Serial(facts["port"], 1_000_000, timeout=5.0) as port:
            port.write(feetech(1, 2, 31, 2))
            assert int.from_bytes(port.read(8)[5:7], "little") == found
            if offset is not None:
                for data in ((55, 0), (31, *word(offset))):
                    port.write(feetech(1, 3, *data))
                    assert port.read(6) == feetech(1, 0)
    assert not [name for name in os.listdir(tmp_path) if name.startswith(".")]


@pytest.mark.long
def test_tcp(tmp_path):
    with served("--servo", "7=feetech-sts3215-12v", "--tcp", "0") as facts:
        host, port = facts["port"].removeprefix("socket://").split(":")
        assert host == "127.0.0.1"
        for _ in range(3):
            with socket.create_connection((host, int(port)), timeout=10.0) as line:
                line.sendall(feetech(7, 1))
                assert line.recv(6) == feetech(7, 0)
