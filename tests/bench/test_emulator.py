"""The firmware under simavr beside a simulated servo: pulses, conversions, wire and display, and how it all ends."""

import math
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import servotwin as st
from servotwin.bench.backends import EmulatedBackend, SerialBackend
from servotwin.bench.emulator import process
from servotwin.bench.emulator.plant import Front, ServoOnPins
from servotwin.bench.emulator.process import Microcontroller, Pins
from servotwin.bench.emulator.pseudo_terminal import Terminal
from servotwin.bench.wire import Board, protocol
from servotwin.errors import BenchError, InputError

CHANNELS = ("tap", "shunt", "supply", "command")
FRONTS = {"tap": Front(1.0, 0.0), "shunt": Front(1.0, 0.1), "supply": Front(0.25, 0.0), "command": Front(0.5, 0.2)}
SIGNALS = {"tap": "feedback_voltage", "shunt": "supply_current", "supply": "bus_voltage"}
ANALOG = st.load_servo("hitec-hs-755hb").replace({"supply.internal_resistance": 0.2})
MODELS = {"pulse": lambda: st.PulseServo(ANALOG), "digital": lambda: st.DigitalServo(st.load_servo("emax-es08md")),
          "inductive": lambda: st.PulseServoInductive(ANALOG.replace({"motor.armature_inductance": 5e-4}))}
TICK = 0.5e-6


@pytest.fixture(scope="module", autouse=True)
def _tools():
    try:
        process.harness()
    except BenchError as error:
        pytest.skip(str(error))


class Asked:
    """A plant that remembers what it was asked for."""

    def __init__(self, plant):
        self.plant, self.rise, self.fall, self.asked = plant, plant.rise, plant.fall, []

    def voltage(self, channel, moment):
        volts = self.plant.voltage(channel, moment)
        self.asked.append((channel, moment))
        return volts


def opened(plant, **more):
    messages = []
    wire = EmulatedBackend(plant, **more)
    board = Board(wire, lambda message: messages.append(message))
    board.open()
    return wire, board, messages


def played(board, wire, widths, period=0.02, each=0.1):
    for width in widths:
        board.order("pulse", width=protocol().ticks(width), period=protocol().ticks(period))
        until = wire.time + each
        while wire.time < until:
            board.take(0.02)


@pytest.fixture
def servo():
    plant = ServoOnPins(MODELS["pulse"](), fronts=FRONTS)
    wire, board, messages = opened(plant)
    yield plant, wire, board, messages
    wire.close()


def test_a_servo_goes_where_the_same_pulses_send_it_in_a_simulation(servo):
    plant, wire, board, _ = servo
    played(board, wire, [2e-3, 1.2e-3], each=0.5)
    first, width = plant.edges[0]
    assert width == pytest.approx(2e-3, abs=1e-12)
    rises, widths = np.array(plant.edges).T
    command = st.signals.pulse_train(rises, widths, unit="s")
    result = st.simulate(plant.model, command, duration=plant.time, output_times=[0.0, plant.time],
                         initial={"output_angle": plant.truth([0.0])["output_angle"][0]})
    assert plant.state(plant.time)["output_angle"] == pytest.approx(result["output_angle"][-1], abs=1e-12)
    assert abs(result["output_angle"][-1] - result["output_angle"][0]) > math.radians(20.0)
    assert first < 0.2


@pytest.mark.parametrize("frames", [50.0, 320.0])
def test_pulses_are_exact_to_the_cycle_while_everything_else_goes_on(servo, frames):
    plant, wire, board, _ = servo
    board.order("stream", mask=15, rate=2, reference=0)
    played(board, wire, [1.2e-3, 1.8e-3], period=1.0 / frames, each=0.3)
    rises, widths = np.array(plant.edges).T
    assert set(np.round(widths / 62.5e-9).astype(int)) == {19200, 28800}
    period = protocol().ticks(1.0 / frames) * 8
    assert set(np.round(np.diff(rises) / 62.5e-9).astype(int)) == {period}


@pytest.mark.long(but="digital-frame")
@pytest.mark.parametrize("rate", ["fast", "frame"])
@pytest.mark.parametrize("model", MODELS)
def test_each_count_is_that_of_the_voltage_at_its_instant(model, rate):
    command = st.signals.sine(mean=1.0, amplitude=0.9, frequency=2.0, unit="V")
    plant = Asked(ServoOnPins(MODELS[model](), fronts=FRONTS, command=command))
    wire, board, messages = opened(plant)
    board.order("stream", mask=15, rate=protocol().words["rate"][rate], reference=0)
    played(board, wire, [1.9e-3, 1.1e-3, 1.7e-3], each=0.25)
    board.close()
    scans = scans_of(messages)[1:]  # the first conversion of all takes longer, by the data sheet
    assert len(scans) > (650 if rate == "fast" else 30)
    edges = [message.values for message in messages if message.name == "edge"]
    assert edges
    # The board's clock, from any edge that both have seen
    begun = next(m.time for m in messages if m.name == "edge" and m.values["width"])
    zero = plant.plant.edges[0][0] - begun
    held = instants(plant.asked, scans, zero)
    truth = plant.plant.truth(np.sort(held.ravel()))
    order = np.argsort(np.argsort(held.ravel())).reshape(held.shape)
    for k, channel in enumerate(CHANNELS):
        front = FRONTS[channel]
        values = command(held[:, k]) if channel == "command" else truth[SIGNALS[channel]][order[:, k]]
        expected = np.clip(np.floor(1024.0 * (front.gain * values + front.offset) / 2.5), 0, 1023)
        assert np.array([counts[k] for _, counts in scans]).tolist() == expected.tolist(), channel
    assert np.ptp([counts[0] for _, counts in scans]) > 50
    assert max(counts[1] for _, counts in scans) > 100


def scans_of(messages):
    """Return time [s] and counts of each scan."""
    found = []
    for message in messages:
        if message.name not in ("samples", "edge") or not message.values["mask"]:
            continue
        counts = message.values["counts"]
        found += [(message.time + 1e-3 * k, counts[4 * k:4 * k + 4]) for k in range(len(counts) // 4)]
    return found


def instants(asked, scans, zero):
    """Return when the voltages of scans were held [s], (n, 4): the latest answer near to where each belongs."""
    near = {}
    hold, step = (protocol().numbers[name] * TICK for name in ("hold_ticks", "channel_ticks"))
    times = np.array([time for time, _ in scans]) + zero
    for channel, moment in asked:
        k = CHANNELS.index(channel)
        scan = int(np.argmin(abs(times + hold + k * step - moment)))
        if abs(times[scan] + hold + k * step - moment) < 20e-6:
            near[scan, k] = moment
    return np.array([[near[scan, k] for k in range(4)] for scan in range(len(scans))])


def test_the_display_shows_what_the_board_reads(servo):
    _, wire, board, messages = servo
    board.order("stream", mask=15, rate=2, reference=0)
    played(board, wire, [1.5e-3], each=1.0)
    _, counts = scans_of(messages)[-1]
    lines = wire.lines
    assert [len(line) for line in lines] == [16, 16]
    assert lines[0].endswith("1500us")
    assert lines[1].split()[1:3] == [str(counts[0]), "50"]


def test_torque_off_leaves_the_pin_low(servo):
    plant, wire, board, _ = servo
    played(board, wire, [1.7e-3], each=0.2)
    board.limp()
    board.wait(0.1)
    pulses, portb = len(plant.edges), wire.look(0x23, 3)  # PINB, DDRB, PORTB
    board.wait(0.3)
    assert len(plant.edges) == pulses > 5
    assert portb[1] & 2
    assert not portb[2] & 2


def test_silence_ends_the_pulses_after_a_second(servo):
    plant, wire, board, _ = servo
    played(board, wire, [1.7e-3], each=0.2)
    board.order("ask")
    said = wire.time
    while wire.time < said + 2.0:
        wire.read(0.1)
    assert 0.95 < plant.edges[-1][0] - said < 1.01


def test_mode_paper_makes_the_pulses_of_a_voltage():
    plant = ServoOnPins(MODELS["pulse"](), fronts={"command": Front(1.0, -0.82 / 409.6)},
                        command=st.signals.constant(1.425, unit="V"))
    wire = EmulatedBackend(plant, paper=True)
    wire.open()
    while wire.time < 0.3:
        wire.read(0.05)
    wire.close()
    rises, widths = np.array(plant.edges[2:]).T
    assert widths == pytest.approx(1526e-6, abs=1e-9)
    assert np.diff(rises) == pytest.approx(16.384e-3, abs=1e-9)


def test_time_goes_on_when_another_board_is_switched_on(servo):
    plant, wire, board, _ = servo
    played(board, wire, [1.9e-3], each=0.2)
    before, pulses = wire.time, len(plant.edges)
    board.close()
    again = Board(wire)
    again.open()
    played(again, wire, [1.1e-3], each=0.2)
    assert wire.time > before + 0.2
    assert len(plant.edges) > pulses
    assert np.all(np.diff([rise for rise, _ in plant.edges]) > 0.0)


def test_memory_can_be_looked_at_and_poked(servo):
    _, wire, _, _ = servo
    wire.poke(0x08F0, b"\x12\x34")
    assert wire.look(0x08F0, 3)[:2] == b"\x12\x34"
    assert wire.look(0x08FF, 2) == b""  # beyond the end


def test_a_program_that_takes_the_terminal_for_a_port_talks_to_the_board(servo):
    pytest.importorskip("serial")
    plant = ServoOnPins(MODELS["pulse"]())
    over = threading.Event()
    with Terminal(EmulatedBackend(plant, real_time=True)) as terminal:
        server = threading.Thread(target=terminal.serve, kwargs={"go_on": lambda: not over.is_set()})
        server.start()
        try:
            for _ in range(2):  # closed and opened again
                board = Board(SerialBackend(terminal.port))
                assert board.open().mode == "computer"
                board.order("pulse", width=3000, period=40000)
                board.wait(0.2)
                board.close()
            pulses = len(plant.edges)
            time.sleep(1.5)  # nobody speaks: a second of the board, which keeps time with the wall
            last = len(plant.edges)
            time.sleep(0.3)
        finally:
            over.set()
            server.join()
    assert 10 < pulses < last < pulses + 60
    assert len(plant.edges) == last


def test_a_killed_process_is_told_in_one_line(servo):
    _, wire, _, _ = servo
    os.kill(wire.pid, signal.SIGKILL)
    with pytest.raises(BenchError, match="emulator: its process has ended") as told:
        wire.read(0.5)
    assert "\n" not in str(told.value)


HOST = """
import sys, time
from servotwin.bench.backends import EmulatedBackend
wire = EmulatedBackend()
wire.open()
print(wire.pid, flush=True)
while True:
    wire.read({timeout})
"""


@pytest.mark.parametrize("timeout", [0.001, 1e6], ids=["between two steps", "in the midst of one"])
def test_no_emulator_outlives_its_host(timeout):
    host = subprocess.Popen([sys.executable, "-c", HOST.format(timeout=timeout)], stdout=subprocess.PIPE, text=True)
    pid = int(host.stdout.readline())
    time.sleep(0.2)
    host.kill()
    host.wait()
    host.stdout.close()
    end = time.monotonic() + 5.0
    while is_running(pid) and time.monotonic() < end:
        time.sleep(0.05)
    assert not is_running(pid)


def is_running(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


NOTHING = Pins(pulse=lambda *_: None, light=lambda *_: None, display=lambda _: None, convert=lambda *_: 0,
               reset=lambda: None)


@pytest.mark.parametrize(("text", "said"), [
    ("no hex\n", "is no hex file"), (":00000001FF\n", "is no hex file"), (None, "there is no such firmware"),
])
def test_what_is_no_firmware_is_told_in_one_line(tmp_path, text, said):
    path = tmp_path / "some.hex"
    if text is not None:
        path.write_text(text)
    with pytest.raises(BenchError, match=said) as told:  # noqa: PT012 - either may find it
        chip = Microcontroller(path, NOTHING)
        try:
            chip.go(1000)
        finally:
            chip.close()
    assert "\n" not in str(told.value)


def test_a_program_that_stops_is_told(tmp_path):
    """`cli; sleep`: nothing will ever wake it."""
    code = bytes.fromhex("F8948895")
    line = bytes((len(code), 0, 0, 0)) + code
    path = tmp_path / "asleep.hex"
    path.write_text(f":{line.hex().upper()}{-sum(line) % 256:02X}\n:00000001FF\n")
    chip = Microcontroller(path, NOTHING)
    with pytest.raises(BenchError, match="the program has crashed, or sleeps for ever"):
        chip.go(1000)
    chip.close()


@pytest.mark.parametrize(("compiler", "said"), [
    (None, "there is no C compiler"),
    ("echo 'harness.c:38:10: fatal error: simavr/avr_adc.h: No such file or directory' >&2; exit 1",
     "simavr is not installed"),
    ("echo 'cc: error: something else' >&2; exit 1", "something else"),
])
def test_a_missing_tool_is_told_in_one_line_that_names_the_packages(tmp_path, monkeypatch, compiler, said):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path / "cache"))
    tools = tmp_path / "bin"
    tools.mkdir()
    if compiler is not None:
        (tools / "cc").write_text(f"#!{shutil.which('sh')}\n{compiler}\n")
        (tools / "cc").chmod(0o755)
    monkeypatch.setenv("PATH", str(tools))
    with pytest.raises(BenchError, match=said) as told:
        EmulatedBackend().open()
    assert re.search(r"gcc libsimavr-dev libelf-dev", str(told.value))
    assert "\n" not in str(told.value)


def test_the_harness_is_compiled_once(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path))
    first = process.harness()
    made = first.stat().st_mtime_ns
    assert process.harness() == first
    assert (first.stat().st_mtime_ns, len(list(tmp_path.iterdir()))) == (made, 1)


@pytest.mark.long
def test_a_harness_that_others_may_write_is_not_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path / "cache"))
    made = process.harness()
    assert made.stat().st_mode & 0o777 == 0o700
    planted = b"#!/bin/sh\nexit 1\n"
    made.write_bytes(planted)
    made.chmod(0o777)
    assert process.harness() == made
    assert made.read_bytes() != planted
    assert made.stat().st_mode & 0o777 == 0o700
    assert capsys.readouterr().err == f"servotwin: {made} is made anew, for others may write it, until chmod go-w\n"
    made.parent.chmod(0o777)
    assert process.harness().parent not in (made.parent, *made.parents)


@pytest.mark.parametrize("model", [
    lambda: st.BoundedServo(st.load_servo("hitec-hs-755hb")),
    lambda: st.DigitalServo(st.load_servo("feetech-sts3215-12v")),
])
def test_a_model_that_takes_no_pulses_is_refused(model):
    with pytest.raises(InputError, match="model on the bench"):
        ServoOnPins(model())


def test_a_pulse_longer_than_the_servo_takes_is_none():
    """What is seen before, within and after it is what a whole run of the same pulses has there."""
    plant = ServoOnPins(st.PulseServo(ANALOG.replace({"electronics.pulse_timeout": 0.03})), fronts=FRONTS)
    random, times, volts = np.random.default_rng(5), [], []
    for k, width in enumerate([2e-3, 1e-3, 2.9e-3, 2.9e-3, 2.9e-3, 1.8e-3, 1e-4, 1.2e-3]):
        rise = 0.003 + 0.02 * k
        plant.rise(rise)
        fallen = False
        for moment in np.sort(random.uniform(rise, rise + 0.02, 12)):
            if moment > rise + width and not fallen:
                plant.fall(rise + width)
                fallen = True
            times.append(moment)
            volts.append([plant.voltage(channel, moment) for channel in CHANNELS[:3]])
    truth = plant.truth(times)
    for k, channel in enumerate(CHANNELS[:3]):
        expected = FRONTS[channel].gain * truth[SIGNALS[channel]] + FRONTS[channel].offset
        assert np.array(volts)[:, k] == pytest.approx(expected, abs=1e-12), channel


def test_noise_comes_by_its_seed():
    def volts(seed):
        plant = ServoOnPins(MODELS["pulse"](), noise=2e-3, seed=seed)
        return np.array([plant.voltage("supply", 1e-5 * k) for k in range(2000)])

    assert volts(1).tolist() == volts(1).tolist() != volts(2).tolist()
    assert volts(1).std() == pytest.approx(2e-3, rel=0.1)
