"""Ctrl-C at any moment: 130, one line, nothing half written. All moments: benchmarks/interrupts."""

import importlib.util
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "interrupts" / "run.py"
LINE = "servotwin: interrupted\n"
FIRST = "servotwin: interrupted; keeping the best so far (Ctrl-C again: end at once)\n"
START = """
import signal, sys
from pathlib import Path
from servotwin.cli import interrupts
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore them
ctrl_c = lambda: signal.raise_signal(signal.SIGINT)
"""
PROGRAMS = {
    "where an exception would be lost": ("""
class Lost:
    def __del__(self):
        ctrl_c()
interrupts.watch([])
Lost()
print("went on")
""", "", LINE, []),
    "while a file is written": ("""
from servotwin.parameters import write_file
interrupts.watch([])
write_file("a.csv", lambda path: (path.write_text("half"), ctrl_c()))
""", "", LINE, []),
    "while files move into place": ("""
interrupts.watch([])
with interrupts.held():
    for name in "ab":
        Path(name).write_text("whole")
        ctrl_c()
print("went on")
""", "", LINE, ["a", "b"]),
    "where there is something to keep": ("""
interrupts.watch([])
with interrupts.finishing() as check:
    ctrl_c()
    try:
        check()
    except KeyboardInterrupt:
        Path("best").write_text("so far")
    with interrupts.held():
        pass
print("kept")
sys.stdout.flush()
interrupts.leave(interrupts.CODE if interrupts.noted() else 0)
""", "kept\n", FIRST, ["best"]),
    "a second time": ("""
interrupts.watch([])
with interrupts.finishing():
    ctrl_c()
    ctrl_c()
print("went on")
""", "", FIRST + LINE, []),
    "with last words": ("""
interrupts.watch(["--json"])
with interrupts.last_words(lambda: "half of it is there"), interrupts.last_words(lambda: None):
    ctrl_c()
""", '{"error": {"type": "KeyboardInterrupt", "message": "interrupted"}}\n',
                        "servotwin: half of it is there\n" + LINE, []),
}


@pytest.mark.parametrize("case", PROGRAMS)
def test_an_interrupt(case, child_environment, tmp_path):
    program, out, err, files = PROGRAMS[case]
    done = subprocess.run([sys.executable, "-c", START + program], capture_output=True, text=True, cwd=tmp_path,
                          env=child_environment, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, out, err)
    assert sorted(path.name for path in tmp_path.iterdir()) == files
    if out.startswith("{"):
        assert json.loads(out)["error"]["message"] == "interrupted"


@pytest.mark.parametrize("case", [name for name in PROGRAMS if name != "where an exception would be lost"])
def test_a_termination_does_the_same(case, child_environment, tmp_path):
    program, out, err, files = PROGRAMS[case]
    program = program.replace("interrupts.CODE", "interrupts.code()").replace("ctrl_c()", "terminate()")
    done = subprocess.run([sys.executable, "-c", START + "terminate = lambda: signal.raise_signal(signal.SIGTERM)\n"
                           + program], capture_output=True, text=True, cwd=tmp_path, env=child_environment, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (143, out, err)
    assert sorted(path.name for path in tmp_path.iterdir()) == files


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="a system without hang-ups")
@pytest.mark.parametrize("ignored", [False, True])
def test_a_closed_terminal_does_the_same_once(child_environment, tmp_path, ignored):
    """Shells send a hang-up of their own beside that of the system; what was for the terminal goes nowhere."""
    import fcntl
    import os
    import pty
    import termios

    program = START.replace("signal.SIGINT)", "signal.SIGHUP)") + """
import os, time
interrupts.watch([])
with interrupts.finishing() as check:
    print("ready", flush=True)
    while os.isatty(1):
        time.sleep(0.01)
    ctrl_c()
    try:
        check()
        print("went on", flush=True)
    except KeyboardInterrupt:
        print("kept", flush=True)
    Path("best").write_text("so far")
interrupts.leave(interrupts.code() if interrupts.noted() else 0)
"""

    def at_its_terminal():
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    ours, theirs = pty.openpty()
    child = subprocess.Popen([sys.executable, "-c", program], stdin=theirs, stdout=theirs, stderr=theirs, cwd=tmp_path,
                             env=child_environment, start_new_session=True, preexec_fn=at_its_terminal)
    os.close(theirs)
    assert os.read(ours, 5) == b"ready"
    os.close(ours)
    assert child.wait(60) == (0 if ignored else 128 + signal.SIGHUP)
    assert (tmp_path / "best").read_text() == "so far"


def test_where_interrupts_are_ignored_they_stay_so(child_environment):
    program = START.replace("signal.default_int_handler", "signal.SIG_IGN") + """
interrupts.watch([])
ctrl_c()
print("went on")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=child_environment,
                          check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "went on\n", "")


def test_who_calls_main_keeps_interrupts(cli):
    before = signal.getsignal(signal.SIGINT)
    assert cli("--version").code == 0
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.slow
@pytest.mark.parametrize("command", ["fit", "sweep", "simulate"])
def test_interrupts_spread_over_a_command(command, tmp_path):
    found = importlib.util.spec_from_file_location("interrupts_benchmark", BENCHMARK)
    run = importlib.util.module_from_spec(found)
    found.loader.exec_module(run)
    run.write_logs(tmp_path)
    words = run.COMMANDS[command]
    run.tried(words, tmp_path, None)  # everything compiled
    error, lasts = run.tried(words, tmp_path, None)
    assert not error
    for after in np.linspace(max(run.FIRST, 4.0 * run.start_up()), 0.9 * lasts, 4):
        assert run.tried(words, tmp_path, float(after))[0] in ("", "ended before")
