"""The way in and the ways out: help, exit codes, pipes, interrupts, and what is not loaded."""

import os
import signal
import subprocess
import sys

import pytest

import servotwin as st
from servotwin.cli.failure import describe, one_line

COMMAND = [sys.executable, "-m", "servotwin"]
SERVO = "hitec-hs-755hb"


def test_version(cli):
    assert cli("--version").out == f"servotwin {st.__version__}\n"


@pytest.mark.long(but="words7")
@pytest.mark.parametrize("words", [[], ["--help"], ["-h"], ["catalog"], ["paper", "--help"], ["simulate", "--help"],
                                   ["catalog", "list", "--help"], ["catalog", "show", "-h"],
                                   ["catalog", "check", "--help"]])
def test_every_help_has_an_example(cli, words):
    ended = cli(*words)
    assert ended.code == 0
    assert ended.err == ""
    assert "Usage: servotwin" in ended.out
    assert "Example: servotwin " in ended.out


@pytest.mark.long
def test_examples_of_the_help_work(cli):
    ended = cli("simulate", "--help")
    line = next(line for line in ended.out.splitlines() if "Example: servotwin simulate hitec" in line)
    assert cli(*line.split("servotwin ", 1)[1].split()).code == 0


def test_python_m(child_environment):
    done = subprocess.run([*COMMAND, "--version"], capture_output=True, text=True, env=child_environment, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"servotwin {st.__version__}\n", "")


@pytest.mark.long(but="words0")
@pytest.mark.parametrize("words", [
    ["--help"], ["catalog", "list"], ["simulate", SERVO, "--step", "0:180", "--out", "run.csv"]])
def test_heavy_libraries_are_not_loaded(words, child_environment, tmp_path):
    program = ("import sys; from servotwin.cli import main; code = main(sys.argv[1:]);"
               "heavy = {'scipy', 'pandas', 'matplotlib', 'control', 'xarray', 'tomlkit'} & set(sys.modules);"
               "sys.exit(f'loaded: {heavy}' if heavy else code)")
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True,
                          env=child_environment, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr


def test_help_loads_no_numpy(child_environment):
    program = ("import sys; from servotwin.cli import main; main(['--help']);"
               "sys.exit('numpy loaded' if 'numpy' in sys.modules else 0)")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=child_environment,
                          check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.long(but="words1")
@pytest.mark.parametrize("words", [["catalog", "show", SERVO], ["--help"],
                                   ["simulate", SERVO, "--step", "0:1", "--json"]])
def test_a_broken_pipe_is_one_line(words, child_environment):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*COMMAND, *words], stdout=write, stderr=subprocess.PIPE, text=True, env=child_environment,
                          check=False)
    os.close(write)
    assert done.returncode == 2
    assert done.stderr.startswith("servotwin: error: the reader of the output went away")
    assert done.stderr.count("\n") == 1


@pytest.mark.long(but="words3")
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
@pytest.mark.parametrize("words", [["catalog", "list"], ["catalog", "list", "--json"], ["--version"], ["--help"]])
def test_a_full_disk_is_one_line(words, child_environment):
    with open("/dev/full", "w") as full:
        done = subprocess.run([*COMMAND, *words], stdout=full, stderr=subprocess.PIPE, text=True,
                              env=child_environment, check=False)
    assert done.returncode == 2
    assert "No space left on device" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.long
def test_closed_streams_do_no_harm(child_environment):
    words = f"{sys.executable} -m servotwin catalog"
    for line, code in ((f"{words} list >&-", 0), (f"{words} list 2>&-", 0), (f"{words} show nothing 2>&-", 2)):
        done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, env=child_environment, check=False)
        assert (done.returncode, done.stderr) == (code, "")


@pytest.mark.long
def test_text_that_the_terminal_cannot_show(child_environment, tmp_path):
    environment = {**child_environment, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([*COMMAND, "simulate", SERVO, "--sine", "90:1:1"], capture_output=True, text=True,
                          env=environment, cwd=tmp_path, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def _heed_interrupts():
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore them


def test_an_interrupt_is_one_line_and_130(child_environment, tmp_path):
    os.mkfifo(tmp_path / "command.csv")  # the program waits here for a command that never comes
    with subprocess.Popen([*COMMAND, "simulate", SERVO, "--command", "command.csv", "--out", "run.csv"],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=child_environment,
                          cwd=tmp_path, preexec_fn=_heed_interrupts) as child:
        with open(tmp_path / "command.csv", "w") as command:  # opens when the program has opened its end
            command.flush()
            child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=30)  # with the end closed no read can block a signal that came just before
    assert (child.returncode, out, err) == (130, "", "servotwin: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["command.csv"]


@pytest.mark.parametrize(("error", "code", "said"), [
    (MemoryError(), 2, "not enough memory"),
    (PermissionError(13, "Permission denied", "x.csv"), 2, "x.csv: Permission denied"),
    (KeyboardInterrupt(), 130, "interrupted"),
    (ZeroDivisionError("division by zero"), 1, "a mistake of servotwin itself (ZeroDivisionError: division by zero)"),
])
def test_what_commands_raise(cli, monkeypatch, error, code, said):
    def fail():
        raise error

    monkeypatch.setattr("servotwin.parameters.catalog_names", fail)
    ended = cli("catalog", "list", "--json")
    assert ended.code == code
    assert said in ended.err
    assert ended.err.count("\n") == 1
    assert ended.data["error"]["message"] in ended.err


def test_a_mistake_shows_its_traceback_on_request(cli, monkeypatch):
    def fail():
        raise ZeroDivisionError

    monkeypatch.setattr("servotwin.parameters.catalog_names", fail)
    monkeypatch.setenv("SERVOTWIN_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        cli("catalog", "list")


def test_one_line_is_printable_and_not_endless():
    assert one_line("a\r\nb\t\udc80") == "a b \\udc80"
    assert len(one_line("x" * 10_000)) < 700
    assert describe(OSError()).message == "OSError"


@pytest.mark.long(but="log")
@pytest.mark.parametrize(("words", "most"), [
    ("log run.csv", 260), ("doctor hitec-hs-422 run.csv", 273), ("curves hitec-hs-422 --voltage 5 --quick", 280),
    ("fit run.csv --servo hitec-hs-422 --free output_inertia --starts 1", 312)], ids=["log", "doctor", "curves", "fit"])
def test_a_command_loads_what_it_needs(tmp_path, child_environment, words, most):
    """Of the package; a fit of one servo needs no robot."""
    result = st.simulate(st.PulseServo(st.load_servo("hitec-hs-422")), st.signals.step(0.0, 20.0, at=0.1, unit="deg"),
                         duration=0.4)
    result.save(tmp_path / "run.csv")
    program = ("import sys; from servotwin.cli import main; code = main(sys.argv[1:]);"
               "own = [name for name in sys.modules if name.startswith('servotwin')];"
               "print(len(own), 'servotwin.robots' in own or 'mujoco' in sys.modules, file=open('loaded', 'w'));"
               "sys.exit(code)")
    done = subprocess.run([sys.executable, "-c", program, *words.split()], capture_output=True, text=True,
                          env=child_environment, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    count, robots = (tmp_path / "loaded").read_text().split()
    assert int(count) <= most
    assert robots == "False"
