"""`servotwin bench`: boards on pseudo-terminals, and everything that can be wrong with one."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

import servotwin as st
from bench import bus_peers
from bench_wires import BoardOnTerminal
from servotwin.bench.backends import MockBackend
from servotwin.bench.emulator.process import harness
from servotwin.errors import BenchError

pytest.importorskip("serial")
LIMITS = ("--range", "1000us:2000us", "--voltage", "6V", "--current-limit", "2A")


class Rising:
    """Pins that rise with time, so that every scan of a channel is another one."""

    def rise(self, time):
        pass

    def fall(self, time):
        pass

    def voltage(self, channel, time):
        return {"tap": 0.5 + 0.1 * (time % 10.0), "shunt": 0.2, "supply": 1.5, "command": 1.0}[channel]


@pytest.fixture
def board():
    terminal = BoardOnTerminal(MockBackend(Rising()))
    yield terminal
    terminal.cut()


def test_check_names_the_firmware_and_reads_the_channels(cli, board):
    ended = cli("bench", "check", "--port", board.port, "--json")
    assert ended.code == 0, ended.err
    assert ended.data["firmware"] == "1.0"
    assert ended.data["channels"]["supply"]["value"] == pytest.approx(6.0, abs=0.01)
    assert cli("bench", "check", "--port", board.port).out.count("\n") > 5


@pytest.mark.long
def test_record_makes_logs_that_can_be_read(cli, board):
    ended = cli("bench", "record", "my servo", "--port", board.port, "-e", "hold,torque_off", "--duration", "1",
                *LIMITS, "--licence", "CC0-1.0", "--load", "inertia=1e-3", "--out", "runs")
    assert ended.code == 0, ended.err
    logs = st.read_logs("runs")
    assert {log.motion for log in logs} == {"hold", "torque_off"}
    assert all(log.load.inertia == 1e-3 for log in logs)
    assert any(not log.sent.all() for log in logs)


@pytest.mark.parametrize(("voltage", "current", "said"), [
    ("6V", "2A", ""), ("7V", "2A", "reads 6.00 V, and --voltage says 7 V"), ("6V", "3A", "ends at 2.5 A")])
def test_wires_that_say_otherwise_than_the_user_are_told(cli, board, voltage, current, said):
    ended = cli("bench", "record", "x", "--port", board.port, "-e", "hold", "--duration", "0.2", *LIMITS[:2],
                "--voltage", voltage, "--current-limit", current, "--out", "runs")
    assert ended.code == 0
    assert (said in ended.err) if said else ended.err == ""


def test_calibrations_go_into_the_wiring_and_are_used(cli, board):
    ended = cli("bench", "calibrate", "supply", "--port", board.port, "--wiring", "bench.toml", "--meter",
                "6.1V,6.11V,6.13V", "--json")
    assert ended.code == 2  # one voltage all the time makes no line
    (os.path.exists("bench.toml"), ended.err)
    assert not os.path.exists("bench.toml")


WRONG = [
    (("check", "--port", "/dev/ttyNONE"), "no such port"),
    (("record", "x", "--port", "/dev/ttyNONE", *LIMITS, "--out", "runs"), "no such port"),
    (("record", "x", "--port", "/dev/ttyNONE", "--out", "runs"), "--range, --voltage, --current-limit"),
    (("record", "x", *LIMITS[:4], "--out", "runs"), "--current-limit"),
    (("record", "x", "--range", "1000:2000", *LIMITS[2:], "--out", "runs"), "--range"),
    (("record", "x", "--range", "2000us:1000us", *LIMITS[2:], "--out", "runs"), "low below high"),
    (("record", "x", "--range", "nanus:2000us", *LIMITS[2:], "--out", "runs"), "--range"),
    (("record", "x", *LIMITS[:2], "--voltage", "6A", *LIMITS[4:], "--out", "runs"), "--voltage"),
    (("record", "x", *LIMITS, "-e", "dance", "--out", "runs"), "dance"),
    (("record", "x", *LIMITS, "--duration", "-1", "--out", "runs"), "duration"),
    (("record", "x", *LIMITS, "--wiring", "none.toml", "--port", "p", "--out", "runs"), "none.toml"),
    (("record", "x", *LIMITS, "--id", "3", "--out", "runs"), "--id"),
    (("record", "x", *LIMITS, "--rate", "often", "--port", "p", "--out", "runs"), "rate"),
    (("calibrate", "everything", "--port", "p"), "everything"),
    (("calibrate", "supply", "--port", "p"), "--wiring"),
    (("calibrate", "supply", "--port", "p", "--wiring", "w.toml"), "--meter"),
    (("calibrate", "supply", "--port", "p", "--wiring", "w.toml", "--meter", "1V", "--out", "x.toml"), "--out"),
    (("rehearse", "hitec-hs-755hb", "--mock", "--noise", "-1V", *LIMITS, "--out", "runs"), "noise"),
    (("rehearse", "hitec-hs-755hb", "--mock", "--model", "bounded", *LIMITS, "--out", "runs"), "bounded"),
    (("rehearse", "no-such-servo", "--mock", *LIMITS, "--out", "runs"), "no-such-servo"),
    (("rehearse", "hitec-hs-755hb", *LIMITS), "--pty"),
    (("rehearse", "hitec-hs-755hb", "--pty", "--out", "runs"), "--out"),
    (("record", "x", "--bus", "can", "--port", "p", *LIMITS, "--out", "runs"), "--range"),
    (("record", "x", "--bus", "can", "--port", "p", "--range", "-60deg:60deg", *LIMITS[2:], "--out", "runs"), "can"),
    (("record", "x", "--bus", "feetech", "--port", "/dev/ttyNONE", "--range", "-60deg:60deg", *LIMITS[2:], "--out",
      "runs"), "no such port"),
    (("marker", "--out", "mark.txt"), "mark.txt"),
    (("video", "none.mp4", "--out", "filmed.csv"), "none.mp4"),
    (("flash", "--port", "p", "--board", "mega"), "mega"),
    (("paper", "--out", "bench.csv"), "bench.csv"),
]


@pytest.mark.long(but="record x --range 1000us:2000us --voltage 6V --curr1")
@pytest.mark.parametrize(("words", "said"), WRONG, ids=[" ".join(words)[:50] for words, _ in WRONG])
def test_what_is_wrong_is_told_in_one_line(cli, tmp_path, words, said):
    (tmp_path / "bench.csv").write_text("mine")
    assert said in cli("bench", *words).error
    assert not (tmp_path / "runs").exists()
    assert (tmp_path / "bench.csv").read_text() == "mine"


@pytest.mark.parametrize(("words", "said"), [(("flash", "--port", "p"), "apt install avrdude")])
def test_a_tool_that_is_missing_is_named(cli, monkeypatch, words, said):
    monkeypatch.setenv("PATH", "")
    assert said in cli("bench", *words).error


def test_avrdude_that_fails_says_why_in_one_line(cli, tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    fake = tmp_path / "bin" / "avrdude"
    fake.write_text("#!/bin/sh\necho 'avrdude: stk500_recv(): programmer is not responding' >&2\n"
                    "echo 'avrdude error: not in sync: resp=0x00' >&2\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{fake.parent}:{os.environ['PATH']}")
    assert "nano-old" in cli("bench", "flash", "--port", "p").error


def test_nothing_is_overwritten(cli, board, tmp_path):
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "hold.csv").write_text("mine")
    assert "--force" in cli("bench", "record", "x", "--port", board.port, "-e", "hold", *LIMITS, "--out", "runs").error
    assert (tmp_path / "runs" / "hold.csv").read_text() == "mine"


def recording(board, tmp_path, environment):
    """A recorder in a process of its own, that has written some rows."""
    words = [sys.executable, "-m", "servotwin", "bench", "record", "x", "--port", board.port, "-e", "steps",
             "--duration", "60", *LIMITS, "--out", "runs"]
    process = subprocess.Popen(words, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    log, start = tmp_path / "runs" / "step.csv", time.monotonic()
    while not log.exists() or log.stat().st_size < 20_000:
        assert process.poll() is None, process.stderr.read().decode()
        assert time.monotonic() - start < 60.0
        time.sleep(0.02)
    return process, log


def pulsing(board):
    return board.board._framing


@pytest.mark.long
@pytest.mark.parametrize("how", ["killed", "interrupted", "cable"])
def test_whatever_ends_a_recorder_keeps_its_rows_and_stops_the_pulses(board, tmp_path, child_environment, how):
    process, log = recording(board, tmp_path, child_environment)
    assert pulsing(board)
    before = len(log.read_text().splitlines()) - 1
    if how == "cable":
        board.cut()
    else:
        process.send_signal(signal.SIGKILL if how == "killed" else signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == {"killed": -9, "interrupted": 130, "cable": 2}[how], err.decode()
    assert b"Traceback" not in err
    read, = st.read_logs(log)
    assert len(read) >= before - 1
    said = json.loads(log.with_suffix(".json").read_text())
    assert said["recorded"]["complete"] is False
    if how != "cable":
        time.sleep(0.1)
        if how == "killed":
            start = board.board._now
            while pulsing(board) and board.board._now - start < 4_000_000:  # ticks of its own clock
                time.sleep(0.01)
            assert board.board._now - start < 2_200_000
        assert not pulsing(board)


@pytest.mark.long
def test_an_emulated_board_can_be_talked_to_by_any_program(cli, child_environment):
    try:
        harness()
    except BenchError as error:
        pytest.skip(str(error))
    process = subprocess.Popen([sys.executable, "-m", "servotwin", "bench", "rehearse", "hitec-hs-755hb", "--pty"],
                               env=child_environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        port = next(word for word in process.stdout.readline().split() if word.startswith("/dev/")).rstrip(",")
        seen = cli("bench", "check", "--port", port, "--json")
        assert seen.code == 0, seen.err
        assert seen.data["channels"]["supply"]["value"] == pytest.approx(6.0, abs=0.05)
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 130
    finally:
        process.kill()
        process.communicate()


@pytest.mark.long
def test_servos_of_a_bus_are_recorded_at_once(cli):
    pytest.importorskip("scservo_sdk")
    with bus_peers.Bus(bus_peers.STS, [1, 2], bus_peers.Ramp(2)) as peer:
        words = ("bench", "record", "feetech-sts3215-7v4", "--bus", "feetech", "--port", peer.port, "--baud", "1000000",
                 "-e", "hold", "--duration", "0.4", "--range", "-10deg:10deg", *LIMITS[2:])
        ended = cli(*words, "--frame-period", "10ms", "--id", "1", "--id", "2", "--out", "runs")
        assert ended.code == 0, ended.err
        assert {log.name for log in st.read_logs("runs")} == {"hold_1", "hold_2"}
        assert "no answer from servo 7" in cli(*words, "--id", "7", "--out", "more").error
        assert "--id says which" in cli(*words, "--out", "more").error
