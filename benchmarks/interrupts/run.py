"""Ctrl-C at many moments of every command: 130 each time, one line, nothing half written.

`python benchmarks/interrupts/run.py 200` interrupts a fit and a sweep 200 times each, at moments spread evenly from
0.1 s after the start of the process to its end, and the others a tenth as often; `... 200 fit` one command alone.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

import servotwin as st
from servotwin.logs import write_log
from servotwin.tables import read_columns

SERVO = "hitec-hs-755hb"
PROGRAM = str(Path(sys.executable).with_name("servotwin"))
FIRST = 0.1  # s after the start, or later on a busy machine: before it Python itself is starting
LEAVING = 0.05  # s that the system takes to clear away a process that is done
COMMANDS = {
    "fit": ["fit", "logs", "--servo", SERVO, "--model", "bounded", "--free", "output_inertia,output_coulomb_torque",
            "--starts", "2", "--no-compare", "--out", "my.toml", "--report", "fit.html"],
    "sweep": ["sweep", SERVO, "--step", "0:60", "--vary", "motor.torque_constant=normal:5%", "--lanes", "20000",
              "--out", "study", "--plot"],
    "simulate": ["simulate", SERVO, "--step", "0:60", "--model", "pulse", "--duration", "8", "--out", "run.csv",
                 "--plot", "run.png"],
    "validate": ["validate", SERVO, "logs", "--report", "check.html"],
    "paper": ["paper", "--out", "report"],
    "catalog": ["catalog", "list"],
    "from-sheet": ["catalog", "from-sheet", SERVO, "--name", "mine", "--out", "mine.toml"],
}
OFTEN = ("fit", "sweep")


def write_logs(folder: Path) -> None:
    """Write a log of a servo whose rotor is heavier than the catalog says."""
    model = st.BoundedServo(st.load_servo(SERVO).replace({"motor.rotor_inertia": 6e-8}))
    times, noise = np.arange(0.0, 0.5, 0.02), np.random.default_rng(0)
    for k, target in enumerate((60.0,)):
        command = np.radians(np.where(times < 0.1, 0.0, target))
        run = st.simulate(model, st.signals.samples(times, command, unit="rad"), duration=float(times[-1]),
                          output_times=times)
        angle = run["output_angle"] + noise.normal(0.0, 1e-3, len(times))
        write_log(st.Log(name=f"step-{k}", time=times, command=command, command_kind="angle", motion="step",
                         measured={"output_angle": angle}), folder / f"step-{k}.csv")


def start_up() -> float:
    """Return how long Python takes until servotwin's own code runs, on this machine with what else it does now [s]."""
    took = []
    for _ in range(5):
        began = time.monotonic()
        subprocess.run([sys.executable, "-c", "import servotwin.cli"], check=True)
        took.append(time.monotonic() - began)
    return max(took)


def started(words: list[str], logs: Path, folder: Path) -> subprocess.Popen[str]:
    (folder / "logs").symlink_to(logs)
    return subprocess.Popen([PROGRAM, *words], cwd=folder, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=lambda: signal.signal(
                                signal.SIGINT, signal.default_int_handler))


def wrong(code: int, err: str, folder: Path) -> str:
    """Say what is wrong with an interrupted run; empty if nothing is."""
    if code != 130:
        return f"code {code}"
    strange = [line for line in err.splitlines() if not line.startswith("servotwin: ") and " % " not in line]
    if strange or err.count("interrupted") != 1:
        return f"stderr: {err!r}"
    for path in folder.rglob("*"):
        name = str(path.relative_to(folder))
        if not name.startswith("logs") and (problem := broken(path)):
            return f"{name}: {problem}"
    pages = [(folder / "report" / "report.html").exists(), (folder / "report").exists()]
    return "half a report" if len(set(pages)) > 1 else ""


def broken(path: Path) -> str:
    """Say what is wrong with a file that was left; every kind is read by what reads it."""
    if path.name.startswith("."):
        return "left behind"
    if path.is_dir():
        return "" if any(path.iterdir()) else "empty folder"
    readers: dict[str, Callable[[], object]] = {
        ".toml": lambda: st.load_servo(path), ".csv": lambda: "report" in path.parts or read_columns(path)}
    try:
        readers.get(path.suffix, lambda: None)()
    except st.errors.ServotwinError as error:
        return str(error)
    ends = {".png": b"IEND\xaeB`\x82", ".html": b"</html>", ".svg": b"</svg>", ".json": b"}"}
    end = ends.get(path.suffix, b"")
    return "" if path.read_bytes().rstrip().endswith(end) else "cut off"


def tried(words: list[str], logs: Path, after: float | None) -> tuple[str, float]:
    """Run a command, interrupt it after so many seconds, and return what is wrong and how long the process lived."""
    with tempfile.TemporaryDirectory() as name, started(words, logs, Path(name)) as child:
        began = time.monotonic()
        if after is not None:
            time.sleep(max(0.0, began + after - time.monotonic()))
            if child.poll() is not None:
                child.communicate()
                return "ended before", 0.0
            child.send_signal(signal.SIGINT)
        asked = time.monotonic()
        _, err = child.communicate()
        ended = time.monotonic()
        if after is None:
            return ("" if child.returncode == 0 else err), ended - began
        if child.returncode == 0 and ended - asked < LEAVING:
            return "ended before", 0.0
        return wrong(child.returncode, err, Path(name)), ended - asked


def main() -> None:
    first = max(FIRST, 4.0 * start_up())
    print(f"the first interrupt comes {first:.2f} s after the start of the process")
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    chosen = sys.argv[2:] or list(COMMANDS)
    print(f"{'command':<12}{'lasts':>8}{'interrupts':>12}{'good':>6}{'ended before':>14}   longest until it ended")
    with tempfile.TemporaryDirectory() as name:
        logs = Path(name) / "logs"
        logs.mkdir()
        write_logs(logs)
        for command in chosen:
            words, times = COMMANDS[command], count if command in OFTEN or len(sys.argv) > 2 else max(1, count // 10)
            tried(words, logs, None)  # everything compiled
            error, lasts = tried(words, logs, None)
            if error:
                sys.exit(f"{command}: {error}")
            found: Counter[str] = Counter()
            longest = 0.0
            for after in np.linspace(first, max(first, lasts), times):
                problem, took = tried(words, logs, float(after))
                found[problem] += 1
                longest = max(longest, took)
                if problem not in ("", "ended before"):
                    print(f"  {command} after {after:.3f} s: {problem}", flush=True)
            print(f"{command:<12}{lasts:>6.2f} s{times:>12}{found['']:>6}{found['ended before']:>14}   {longest:.2f} s",
                  flush=True)
            if set(found) - {"", "ended before"}:
                os._exit(1)


if __name__ == "__main__":
    main()
