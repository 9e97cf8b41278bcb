"""A log of one's own: handed in, read, laid over its twin, fitted, and what is wrong with it told in a line."""

import http.client
import json
import math
import os
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote, urlsplit

import pytest

from web_talk import Page, running, started

SLOW = 60.0  # s: no wait is longer
LOG = "t [ms];Soll [us];Winkel [deg];note\n" + "".join(
    f"{20 * k};{1500 if k < 10 else 1600};{min(max(k - 12, 0), 10):.1f};x\n" for k in range(60))


@pytest.fixture
def page(server):
    with Page(server) as made:
        made.until("hello")
        yield made


def token(page: Page) -> str:
    return next(text["hello"]["visitor"] for text in page.texts if "hello" in text)


def handed_in(server: str, own: str, data: bytes, name: str = "run.csv", **headers: str) -> tuple[int, dict]:
    """Hand a file in; return status and answer."""
    request = urllib.request.Request(f"{server}api/log?name={quote(name)}", data=data, method="POST",
                                     headers={"x-visitor": own, **headers})
    try:
        with urllib.request.urlopen(request, timeout=SLOW) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        with error:
            text = error.read().decode()
            return error.code, json.loads(text) if text.startswith("{") else {"error": text}


def brought(server: str, page: Page, data: bytes, name: str = "run.csv") -> dict:
    """Hand a log in that can be read; return what is told of it."""
    status, answer = handed_in(server, token(page), data, name)
    assert status == 200
    return answer["log"]


def told(page: Page, word: str, key: str) -> dict:
    """Return the next of what is told by a word that has something, however long compiling takes."""
    return next_of(page, lambda text: key in (text.get(word) or {}))[word][key]


def ended(page: Page) -> dict:
    """Return how the next fit has ended."""
    return next_of(page, lambda text: text.get("fit", {}).get("state", "running") != "running")["fit"]


def next_of(page: Page, asked: Callable[[dict], bool]) -> dict:
    """Take messages until one is what is asked for; return that once."""
    limit = time.monotonic() + 5.0 * SLOW
    while time.monotonic() < limit:
        for k, text in enumerate(page.texts):
            if asked(text):
                return page.texts.pop(k)
        page.take(SLOW)
        page.pushes.clear()
    raise AssertionError(page.texts[-1])


def is_line(text: str) -> bool:
    return 10 < len(text) <= 310 and "\n" not in text and "Traceback" not in text and "/tmp" not in text


def pace(page: Page) -> float:
    """Return how fast the bench has gone on for a while, of the latest push [s per s]."""
    limit = time.monotonic() + 1.5
    while time.monotonic() < limit:
        page.take()
    return page.pushes[-1][0]["pace"]


def table_of(page: Page) -> bytes:
    return page.ask(export="csv", servo=0)["file"]["text"].encode()


# --- handed in --------------------------------------------------------------------------------------------------------

def test_how_a_log_was_read_is_told(server, page):
    log = brought(server, page, LOG.encode(), "../../my run.csv")
    assert log["name"] == "my run.csv"
    columns = {one["signal"]: (one["column"], one["unit"], one["known"].split()[0]) for one in log["columns"]}
    assert columns == {"time": ("t [ms]", "ms", "guessed"), "pulse_width": ("Soll [us]", "us", "guessed"),
                       "output_angle": ("Winkel [deg]", "deg", "guessed")}
    assert log["unread"] == ["note"]
    run, = log["runs"]
    assert (run["name"], run["rows"], run["duration"]) == ("my run", 60, pytest.approx(1.18))
    assert run["command"] == {"kind": "pulse_width", "unit": "us", "low": pytest.approx(1500.0),
                              "high": pytest.approx(1600.0), "hold": "previous", "changes": 1}
    at = page.ask(log={"play": True})["time"]
    page.ask(run=True)
    text = page.ask(text=True)["text"]
    action = next(line for line in text.splitlines() if '"recorded"' in line)
    assert f"[{at!r}," in action
    assert '"time" = [0.0, 0.2, 1.18]' in action.replace("time =", '"time" =')
    assert "1500.0, 1600.0, 1600.0" in action


@pytest.mark.parametrize(("headers", "status"), [
    ({"x-visitor": "nobody"}, 403), ({"x-visitor": ""}, 403), ({"Origin": "https://evil.example"}, 403),
    ({"Host": "evil.example"}, 403)])
def test_a_log_of_nobody_is_refused(server, page, headers, status):
    given, answer = handed_in(server, headers.get("x-visitor", token(page)), LOG.encode(), **{
        name: value for name, value in headers.items() if name != "x-visitor"})
    assert given == status
    assert is_line(answer["error"].strip())


def test_who_has_left_hands_in_nothing(server):
    with Page(server) as page:
        page.until("hello")
        own = token(page)
    for _ in range(100):
        if handed_in(server, own, b"")[0] == 403:
            return
        time.sleep(0.05)
    raise AssertionError("still there")


def test_a_log_that_is_too_large_is_refused_whether_it_says_so_or_not(server, page):
    status, answer = handed_in(server, token(page), bytes(21_000_000))
    assert (status, answer["error"]) == (413, "log: got '21.0 MB', allowed: at most 20 MB")
    line = http.client.HTTPConnection(urlsplit(server).netloc, timeout=SLOW)
    line.request("POST", "/api/log", body=(bytes(1_000_000) for _ in range(22)), encode_chunked=True,
                 headers={"x-visitor": token(page), "Transfer-Encoding": "chunked"})
    answer = line.getresponse()
    assert answer.status == 413
    assert is_line(json.loads(answer.read())["error"])
    line.close()
    assert "done" in page.ask(view={})


def test_logs_come_no_faster_than_they_are_read(server, page):
    found = []
    for _ in range(8):
        line = http.client.HTTPConnection(urlsplit(server).netloc, timeout=SLOW)
        line.putrequest("POST", "/api/log")
        for name, value in (("x-visitor", token(page)), ("Content-Length", "100000000000")):
            line.putheader(name, value)
        line.endheaders()
        found.append(line.getresponse().status)
        line.close()
    assert found[:6] == [413] * 6
    assert 429 in found


@pytest.mark.long
@pytest.mark.parametrize("message", [
    {"log": {"show": True}}, {"log": {"play": True}}, {"log": {"columns": "time=t:ms"}}, {"log": {}},
    {"log": "run.csv"}, {"log": {"open": "/etc/passwd"}}, {"fit": {"servo": 0}}, {"fit": {"take": "beside"}},
    {"fit": []}, {"fit": {"plan": True, "servo": 9}}, {"fit": {"plan": True, "model": "DCMotor"}}])
def test_what_cannot_be_done_with_a_log_is_refused_in_a_line(page, message):
    answer = page.ask(**message)
    assert answer["refused"] == 1
    assert is_line(answer["message"])


@pytest.mark.slow
def test_a_watcher_brings_no_log():
    with running("--host", "0.0.0.0", "--class") as (_, links):
        address = f"http://127.0.0.1:{urlsplit(links['page']).port}/"
        teaching = f"?{urlsplit(links['teacher']).query}"
        with Page(address, teaching) as teacher, Page(address, f"?code={links['code']}") as watcher:
            teacher.until("hello")
            watcher.until("hello")
            status, answer = handed_in(address, token(watcher), LOG.encode())
            assert status == 403
            assert "teacher" in answer["error"]
            assert "teacher" in watcher.ask(log={"show": True})["message"]
            assert brought(address, teacher, LOG.encode())["runs"]


# --- what is wrong ----------------------------------------------------------------------------------------------------

BAD = {
    "nothing": (b"", "empty"), "bytes": (bytes(range(256)) * 40, "binary"),
    "no time": (b"a,b\n1,2\n3,4\n", "no time"),
    "no command": (b"time_s,output_angle_deg\n0,1\n1,2\n2,3\n", "no command"),
    "gaps": (b"time_s,pulse_width_us,output_angle_deg\n0,1500,nan\n1,1500,nan\n2,1600,nan\n", "output_angle"),
    "time back": (b"time_s,pulse_width_us,output_angle_deg\n0,1500,1\n2,1500,2\n1,1600,3\n", "backwards"),
    "deep": (b"[" * 1_000_000, "JSON"), "other JSON": (b'{"a": 1}', "JSON"), "dataset": (b"PAR1", "LeRobot")}


@pytest.mark.slow
def test_what_is_wrong_with_a_log_is_told_in_a_line(server):
    for name, (data, word) in BAD.items():
        with Page(server) as page:
            page.until("hello")
            status, answer = handed_in(server, token(page), data, "mine.csv")
            assert status == 200, name
            assert word in answer["wrong"], (name, answer)
            assert is_line(answer["wrong"]), name
            assert "refused" in page.ask(log={"show": True})


@pytest.mark.slow
def test_the_guess_can_be_changed_and_rows_that_stand_still_passed_over(server, page):
    data = b"a,b,c\n0,1500,0\n20,1500,0\n20,1500,0\n40,1600,1\n60,1600,5\n"
    assert "no time" in handed_in(server, token(page), data, "odd.csv")[1]["wrong"]
    said = "time=a:ms command=b:us angle=c:deg-90"
    page.ask(log={"columns": "time=nothing"})
    assert is_line(told(page, "own", "wrong"))
    page.ask(log={"columns": said})
    assert "stands still" in told(page, "own", "wrong")
    page.ask(log={"columns": said, "mend": "drop-repeated"})
    log = told(page, "own", "reading")
    assert log["runs"][0]["rows"] == 4
    assert [one["known"] for one in log["columns"]] == ["--columns"] * 3
    page.ask(log={"forget": True})
    assert "refused" in page.ask(log={"columns": said})


@pytest.mark.slow
def test_a_log_that_takes_too_long_and_one_that_does_not_move(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    hurry = "from servotwin.web.server.own import brought\nbrought.READING = 0.05"
    with running(before=hurry) as (address, _), Page(address) as page:
        page.until("hello")
        status, answer = handed_in(address, token(page), LOG.encode())
        assert (status, "of work" in answer["wrong"]) == (200, True)
    assert list(tmp_path.glob("servotwin-*")) == []  # nothing is left of what was brought


@pytest.mark.slow
def test_a_servo_that_cannot_be_fitted_is_told(server, page):
    still = b"time_s,pulse_width_us,output_angle_deg\n" + b"".join(b"%d,1500,1\n" % k for k in range(30))
    brought(server, page, still)
    page.ask(fit={"servo": 0, "run": 0})
    found = ended(page)
    assert found["state"] == "failed"
    assert "never changes" in found["message"]
    assert is_line(found["message"])
    assert "AveragedServo" in page.ask(fit={"servo": 0, "model": "AveragedServo"})["message"]
    brought(server, page, LOG.encode())
    page.ask(fit={"servo": 0, "free": ["motor.colour"]})
    assert "motor.colour" in ended(page)["message"]


# --- over its twin, and fitted ----------------------------------------------------------------------------------------

@pytest.mark.slow
def test_a_table_of_the_bench_lies_on_its_twin_while_the_bench_goes_on(server, page):
    page.ask(speed=4.0)
    page.ask(do="command", value={"shape": "step", "unit": "us", "low": 1400, "high": 1600, "period": 1.0})
    page.pushed(60)
    page.ask(speed=1.0)
    log = brought(server, page, table_of(page), "bench.csv")
    assert log["computed"] is True
    page.ask(log={"show": True, "servo": 0, "rig": False})
    assert pace(page) > 0.5
    same = told(page, "own", "overlay")
    assert same["rms"] < 1e-6  # deg
    assert same["worst"] == pytest.approx(max(same["residual"], key=abs), abs=1e-6)
    page.ask(do="set", value={"load.torque": 0.2})
    page.ask(log={"show": True, "servo": 0, "rig": False})
    other = told(page, "own", "overlay")
    assert other["rms"] > 0.1
    assert len(other["time"]) == len(other["simulated"]) <= 5000
    left = [m - s for m, s in zip(other["measured"], other["simulated"], strict=True)]
    assert max(abs(a - b) for a, b in zip(left, other["residual"], strict=True)) < 1e-3


@pytest.mark.slow
def test_a_mystery_servo_is_found_by_its_own_table(server, page):
    page.ask(mystery=11)
    page.ask(do="command", value={"shape": "step", "unit": "us", "low": 1300, "high": 1700, "period": 1.0})
    page.pushed(100)
    for k in range(8):
        page.ask(do="command", value={"shape": "hold", "unit": "us", "value": 1500 + 4 * k * (-1) ** k})
        page.pushed(15)
    data = table_of(page)
    page.ask(run=False)
    brought(server, page, data, "mystery.csv")
    plan = page.ask(fit={"plan": True, "servo": 0})["plan"]
    assert [one["name"] for one in plan["free"]][-1] == "output_coulomb_torque"
    assert next(one["value"] for one in plan["free"] if one["name"] == "electronics.deadband") == 8e-6  # of the base
    page.ask(fit={"servo": 0, "free": [one["name"] for one in plan["free"]]})
    found = ended(page)
    assert found["state"] == "done", found
    assert found["verdict"]["holds"] is True
    assert "noise" in found["notes"][0]
    assert set(found["guess"]) <= {row["name"] for row in page.ask(guess=found["guess"])["compared"]}
    compared = page.ask(guess=found["guess"])["compared"]
    sure = [row for row in compared if row["guess"] is not None]
    assert len(sure) >= 3
    assert {row["said"] for row in sure} <= {"found", "near"}, compared
    page.ask(fit={"take": "beside"})
    state = next(text["scene"] for text in reversed(page.texts) if "scene" in text)
    assert [one["id"] for one in state["servos"]] == ["mystery", "hitec-hs-755hb"]
    page.ask(run=True)
    page.ask(log={"play": True})
    page.pushed(90)
    header, servos = page.pushes[-1]
    angles = [points[-1][header["servos"][k]["columns"].index("output_angle")]
              for k, (points, _) in enumerate(servos)]
    assert math.degrees(abs(angles[0] - angles[1])) < 0.2


@pytest.mark.slow
def test_one_fit_at_a_time_and_its_end():
    with running() as (address, links), Page(address) as first, Page(address) as second:
        for page in (first, second):
            page.until("hello")
            brought(address, page, table_of_steps(page))
        first.ask(fit={"servo": 0})
        told(first, "fit", "share")
        refused = second.ask(fit={"servo": 0})["message"]
        assert "another fit is running" in refused
        child, = children(links["pid"])
        assert os.getpriority(os.PRIO_PROCESS, child) > os.getpriority(os.PRIO_PROCESS, links["pid"])
        start = time.monotonic()
        first.ask(fit={"cancel": True})
        assert ended(first)["state"] == "cancelled"
        gone(child, 1.0 - (time.monotonic() - start))
        second.ask(fit={"servo": 0})
        told(second, "fit", "share")
        child, = children(links["pid"])
        second.close()  # who leaves takes the fit along
        gone(child, 5.0)
        limit = time.monotonic() + 5.0
        while "refused" in first.ask(fit={"servo": 0}):  # until the desk knows
            assert time.monotonic() < limit
            time.sleep(0.05)
        told(first, "fit", "share")
        first.ask(fit={"cancel": True})
        assert ended(first)["state"] == "cancelled"


@pytest.mark.slow
def test_a_fit_ends_with_the_server():
    process, links = started()
    try:
        with Page(links["page"]) as page:
            page.until("hello")
            brought(links["page"], page, table_of_steps(page))
            page.ask(fit={"servo": 0})
            told(page, "fit", "share")
            child, = children(process.pid)
            process.send_signal(signal.SIGKILL)  # which no server can answer
            process.wait(10)
            gone(child, 5.0)
    finally:
        process.kill()
        process.wait(10)
        process.stdout.close()


@pytest.mark.slow
def test_measured_logs_are_read_and_compared(server, page, data_folder):
    file = data_folder / "maccepa_hitec" / "servo1_step60.0_2017-05-09_21-02-48.csv"
    assert "one, said by" in handed_in(server, token(page), file.read_bytes(), file.name)[1]["wrong"]
    said = "time=%time:ns command=field.u1:rad angle=field.servo1_position:rad"
    page.ask(log={"columns": said, "mend": "drop-repeated"})
    assert told(page, "own", "reading")["runs"][0]["command"]["high"] == pytest.approx(60.0, abs=0.01)
    page.ask(log={"show": True, "servo": 0})
    overlay = told(page, "own", "overlay")
    assert 1.0 < overlay["rms"] < 10.0
    assert overlay["worst"] < -20.0  # the reading jumps by -25 degrees in the first 60 ms, as SOURCE.md says
    page.ask(fit={"servo": 0, "free": ["output_torque_constant", "electronics.stretcher_gain"], "diagnose": False})
    found = ended(page)
    assert found["state"] == "done", found
    assert found["rms"] < overlay["rms"]
    page.ask(fit={"take": "instead"})
    state = next(text["scene"] for text in reversed(page.texts) if "scene" in text)
    assert len(state["servos"]) == 1
    assert "fit to logs" in state["scene"]


@pytest.mark.slow
def test_the_runs_of_a_file_can_be_chosen(server, page, data_folder):
    log = brought(server, page, (data_folder / "miuzei_25kg" / "runs.json").read_bytes(), "runs.json")
    assert len(log["runs"]) == 58
    assert log["columns"] == []  # JSON says what it holds
    assert "refused" in page.ask(log={"show": True, "run": 58})
    page.ask(do="command", value={"shape": "hold", "unit": "us", "value": 1500})
    assert page.ask(log={"play": True, "run": 3})["time"] >= 0.0


def table_of_steps(page: Page) -> bytes:
    page.ask(do="command", value={"shape": "step", "unit": "us", "low": 1400, "high": 1600, "period": 0.5})
    page.pushed(60)
    return table_of(page)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    if not Path("/proc/self/task").is_dir():
        pytest.skip("the processes of another are not seen on this system")
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        found += [int(word) for word in (task / "children").read_text().split()]
    return found


def gone(pid: int, seconds: float) -> None:
    """Wait until a process is no more."""
    limit = time.monotonic() + seconds
    while is_there(pid):
        assert time.monotonic() < limit, pid
        time.sleep(0.02)


def is_there(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
