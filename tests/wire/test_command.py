"""`servotwin wire`: what it refuses, in one line and with code 2; and what people see."""

import os
import sys
import time

import pytest

from servotwin.cli import main
from wire_served import served

STS = "feetech-sts3215-12v"


def files(folder):
    (folder / "taken").write_text("mine", "utf-8")
    (folder / "bad.json").write_text("{", "utf-8")
    (folder / "other.json").write_text('{"servotwin": "wire", "protocol": "feetech", "servos": {"9": {}}}', "utf-8")
    (folder / "name.json").write_text('{"servotwin": "wire", "protocol": "feetech", "servos": {"1": {"X": 1}}}',
                                      "utf-8")
    (folder / "bad.toml").write_text("[[fault]]\nkind = 'gremlin'\n", "utf-8")
    (folder / "noid.toml").write_text("[[fault]]\nkind = 'absent'\n", "utf-8")
    (folder / "twice.toml").write_text(f"[[servo]]\nid = 1\nservo = '{STS}'\n" * 2, "utf-8")
    (folder / "empty.toml").write_text("supply = '12V'\n", "utf-8")
    (folder / "hand.csv").write_text("time_s,knee_deg\n0,1\n", "utf-8")
    (folder / "deep.json").write_text("[" * 100_000, "utf-8")
    (folder / "version.toml").write_text("[[fault]]\nkind = 'firmware'\nid = 1\nversion = ['x']\n", "utf-8")
    (folder / "text.toml").write_text("[[fault]]\nkind = 'absent'\nid = 'x'\n", "utf-8")
    (folder / "kind.toml").write_text("[[fault]]\nkind = ['a']\n", "utf-8")
    (folder / "five.toml").write_text(f"[[servo]]\nid = 1\nservo = '{STS}'\nregisters = 5\n", "utf-8")
    (folder / "latin.csv").write_bytes(b"time_s,1_deg\n0,0\n1,\xff\n")
    (folder / "torn.csv").write_text("time_s,1_deg\n0,1\n1\n", "utf-8")


@pytest.mark.long(but="words7-Dynamixel MX")
@pytest.mark.parametrize(("words", "said"), [
    ([], "no servos"),
    (["so202"], "so202"),
    (["--servo", f"1={STS}", "--servo", f"1={STS}"], "ID 1 twice"),
    (["--servo", "1"], "ID=SERVO"),
    (["--servo", f"254={STS}"], "254"),
    (["--servo", "1=no-such-servo"], "no-such-servo"),
    (["--servo", "1=hitec-hs-755hb"], "no registers"),
    (["--servo", "1=dynamixel-mx-28"], "Dynamixel MX"),
    (["--servo", f"1={STS}", "--servo", "2=dynamixel-xl330-m288"], "one maker"),
    (["--servo", f"1={STS}", "--link", "taken"], "--link"),
    (["--servo", f"1={STS}", "--link", "no/such/folder"], "--link"),
    (["--servo", f"1={STS}", "--keep", "bad.json"], "no JSON"),
    (["--servo", f"1={STS}", "--keep", "other.json"], "IDs 9"),
    (["--servo", f"1={STS}", "--keep", "deep.json"], "no JSON"),
    (["--servo", f"1={STS}", "--faults", "version.toml"], "version of the fault"),
    (["--servo", f"1={STS}", "--faults", "text.toml"], "id of the fault"),
    (["--servo", f"1={STS}", "--faults", "kind.toml"], "unknown fault"),
    (["--servo", f"1={STS}", "--hand", "latin.csv"], "row 3"),
    (["five.toml"], "registers of servo 1"),
    (["--servo", f"1={STS}", "--keep", "name.json"], "X"),
    (["--servo", f"1={STS}", "--keep", "no/such/file"], "--keep"),
    (["--servo", f"1={STS}", "--faults", "bad.toml"], "gremlin"),
    (["--servo", f"1={STS}", "--faults", "noid.toml"], "an ID"),
    (["--servo", f"1={STS}", "--faults", "none.toml"], "none.toml"),
    (["--servo", f"1={STS}", "--hand", "hand.csv"], "knee_deg"),
    (["--servo", f"1={STS}", "--hand", "torn.csv"], "row 3"),
    (["--servo", f"1={STS}", "--lock", "maybe"], "maybe"),
    (["--servo", f"1={STS}", "--firmware", "x"], "3.10"),
    (["--servo", f"1={STS}", "--firmware", "3.999"], "255"),
    (["--servo", f"1={STS}", "--tcp", "x"], "--tcp"),
    (["--servo", f"1={STS}", "--tcp", "99999"], "--tcp"),
    (["--servo", f"1={STS}", "--supply", "much"], "much"),
    (["--servo", f"1={STS}", "--duration", "0"], "--duration"),
    (["--servo", f"1={STS}", "--register", "No=1"], "No"),
    (["twice.toml"], "1 twice"),
    (["empty.toml"], "[[servo]]"),
    (["missing.toml"], "missing.toml"),
])
def test_what_is_refused(words, said, tmp_path, monkeypatch, capfd):
    files(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["wire", *words]) == 2
    told = capfd.readouterr()
    assert said in told.err
    assert told.err.count("\n") == 1
    assert "Traceback" not in told.err


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals here")
def test_without_pseudo_terminals(monkeypatch, capfd):
    def none():
        raise OSError("out of pty devices")

    monkeypatch.setattr(os, "openpty", none)
    assert main(["wire", "--servo", f"1={STS}"]) == 2
    assert "out of pty devices" in capfd.readouterr().err


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals here")
def test_a_link_comes_and_goes(tmp_path, capfd):
    link = tmp_path / "arm"
    link.symlink_to(tmp_path / "gone")  # what a killed process has left
    assert main(["wire", "--servo", f"1={STS}", "--link", str(link), "--duration", "0.2"]) == 0
    assert "feetech at" in capfd.readouterr().out
    assert not os.path.lexists(link)
    with served("--servo", f"1={STS}", "--link", link) as facts:
        assert os.path.realpath(link) == os.path.realpath(facts["port"])
        facts["process"].terminate()
        assert facts["process"].wait(20) == 143
    assert not os.path.lexists(link)


def test_an_arm_file(tmp_path, capfd):
    arm = tmp_path / "arm.toml"
    arm.write_text(f"supply = '12V:0.1ohm'\n[[servo]]\nid = 3\nservo = '{STS}'\njoint = 'tilt'\nangle_deg = 20\n"
                   "registers = 'lerobot'\n", "utf-8")
    assert main(["wire", str(arm), "--duration", "0.1", "--json"]) == 0
    assert '"3": "tilt"' in capfd.readouterr().out


def test_time_that_is_lost_is_said():
    import servotwin as st
    from servotwin.wire.service import Service

    bus, lines = st.wire.Bus({1: STS}), []

    def slow(moved):
        time.sleep(0.15 if moved.time < 0.2 else 0.0)

    service = Service(bus, say=lines.append, each=slow)
    service.run(1.0)
    service.stop()
    assert service.timing.lost > 0.1
    assert service.timing.losses >= 1
    assert len(lines) == 1
    assert bus.time < 1.0
