"""`servotwin web`: what it says when it cannot, and how it ends."""

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request

import pytest

pytest.importorskip("uvicorn", reason="the extra web is not installed")

SCENE = 'format = 1\n[[servo]]\nid = "hitec-hs-755hb"\n'


@pytest.mark.parametrize(("words", "said"), [
    (["--port", "99999"], "--port: got 99999, allowed: 0 to 65535"), (["--port", "-1"], "--port: got -1"),
    (["--port", "many"], "--port"), (["--class"], "--host with an address that others reach"),
    (["--class", "--host", "localhost"], "--host with an address"), (["--host", "no.such.host.invalid"], "host"),
    (["--host", "192.0.2.1"], "an address of this computer"), (["--lesson", "deadbnd"], "deadband"),
    (["--scene", "absent.toml"], "absent.toml"), (["hitec-hs-755"], "hitec-hs-755hb"),
    (["absent.toml"], "absent.toml"), (["hitec-hs-755hb", "--lesson", "deadband"], "one of them")])
def test_bad_input_is_told_in_a_line(cli, words, said):
    assert said in cli("web", "--no-open", *words).error


@pytest.mark.parametrize(("text", "said"), [
    (b"not toml [", "TOML"), (b"\xff\xfe\x00", "UTF-8"), (b"format = 2", "format"), (b"format = 1", "servos"),
    (SCENE.replace("hitec", "hitek").encode(), "hitec-hs-755hb"), (b"a = " + b"[" * 5000, "nested"),
    ((SCENE + 'model = "DigitalServo"\n').encode(), "DigitalServo"),
    ((SCENE + 'parameters = {"gear.gear_reduction" = -1.0}\n').encode(), "gear.gear_reduction"),
    (b'actions = [[0.0, "command", {shape = "hold", unit = "deg", value = 999.0}]]\n' + SCENE.encode(), "999"),
    (b"end = -1.0\n" + SCENE.encode(), "end")])
def test_a_scene_file_that_is_no_bench_is_told_in_a_line(cli, tmp_path, text, said):
    (tmp_path / "bench.toml").write_bytes(text)
    assert said in cli("web", "--no-open", "--port", "0", "--scene", "bench.toml").error


def test_a_port_that_is_taken(cli):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert cli("web", "--no-open", "--port", port).error.startswith(f"port {port}: got 'one that another program")


def test_without_the_extra(cli, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert "servotwin[web]" in cli("web", "--no-open", "--port", "0").error


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(("how", "codes", "said"), [
    (signal.SIGINT, {130}, "servotwin: interrupted\n"), (signal.SIGTERM, {143}, "servotwin: interrupted\n")])
@pytest.mark.parametrize("busy", [False, True])
def test_it_ends_when_it_is_told_to(child_environment, tmp_path, how, codes, said, busy):
    command = [sys.executable, "-m", "servotwin", "web", "--port", "0", "--no-open", "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
                               env=child_environment)
    try:
        text = ""
        while not text.endswith("}\n"):
            text += process.stdout.readline()
        page = json.loads(text)["page"]
        with urllib.request.urlopen(page, timeout=20) as answer:
            assert answer.status == 200
        if busy:
            from web_talk import Page

            with Page(page) as visitor:
                visitor.ask(speed="unpaced")
                os.kill(process.pid, how)
                _, err = process.communicate(timeout=20)
        else:
            os.kill(process.pid, how)
            _, err = process.communicate(timeout=20)
    finally:
        process.kill()
        process.communicate(timeout=10)
    assert process.returncode in codes
    assert err == said
