"""What 60 documented commands and 25 tasks of Python print, write and load, kept and compared.

    python tests/kept_commands.py keep FILE [WORD ...]       # at one commit; of commands with one of these words alone
    python tests/kept_commands.py compare FILE [WORD ...]    # at another: what differs

A change of the house around the engine is held against the commit before by it. Of each command it keeps the exit code,
standard output at 80 and 200 columns, with `--json` all its digits, standard error, the files that it wrote, and how
many modules of the package it loaded. Dates, times that were measured, and the folder in which it runs are left out.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

_WIDTHS, _AT_ONCE = (80, 200), 2
_STEP = "simulate hitec-hs-422 --step 0:60 --duration 1 --out run.csv"
_SINE = "simulate hitec-hs-422 --sine 10:50:1 --duration 2 --out sine.csv"
_BUS = "simulate feetech-sts3215-12v --step 0:30 --duration 1 --out bus.csv"
_FIT = "fit run.csv sine.csv --servo hitec-hs-422 --free output_inertia,electronics.deadband --starts 2"
_KEPT = f"{_FIT} --out mine.toml"
_WAVE = ("python", """
import numpy as np
t = np.linspace(0.0, 1.0, 51)
rows = np.column_stack([t, 20.0 * np.sin(6.0 * t), 15.0 * np.sin(4.0 * t)])
np.savetxt("wave.csv", rows, delimiter=",", header="time_s,shoulder_deg,elbow_deg", comments="")
""")
_ARM = ("python", '''
open("arm.xml", "w").write("""<mujoco><worldbody><body pos="0 0 .3"><joint name="shoulder" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".05"/><body pos=".1 0 0"><joint name="elbow" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .08 0 0" size=".008" mass=".03"/></body></body></worldbody></mujoco>""")
''')
Command = tuple[str, tuple[str | tuple[str, str], ...], bool]  # the command, what comes before it, whether it has JSON


def commands() -> list[Command]:
    """Return the commands, each with what makes the files that it reads, and whether it has `--json`."""
    alone = """
    simulate hitec-hs-755hb --step 0:60 --load torque=0.3
    simulate hitec-hs-755hb --step 0:60 --set gear.backlash=0.3deg --set gear.output_inertia=2e-6
    simulate hitec-hs-755hb --step 0:90 --load pendulum=0.5:0.12,viscous=1e-3
    simulate hitec-hs-755hb --step 0:90 --model averaged --set supply.open_circuit_voltage=4.8V
    simulate towerpro-sg90 --set stops=none --set potentiometer.fixed_angle=0 --constant 1700 --unit us
    simulate towerpro-sg90 --step 0:60 --model pulse-inductive --set supply.internal_resistance=0.5ohm
    simulate feetech-sts3215-12v --step 0:30 --register P_Coefficient=16 --load torque=0.2
    simulate hitec-hs-755hb --sine 1500:200:2 --unit us --duration 2 --out sine.csv
    simulate hitec-hs-755hb --step 0:400
    simulate nobody
    catalog list
    catalog show hitec-hs-755hb
    catalog show feetech-sts3215-12v
    catalog which --lift 0.5kg --arm 10cm --voltage 5 --time 0.3
    catalog which --lift 50g --arm 8cm --supply usb --among towerpro-sg90,towerpro-mg90s,hitec-hs-422
    catalog which --limit mass=10g,time=0.12s
    catalog from-sheet --name acme-s1 --at 6V --torque '13.2 kgf.cm' --speed '0.17 s/60deg' --current '1.4 A'
    catalog from-sheet --name fs90r --continuous --torque '1.5 kgf.cm (6V)' --speed '130 rpm (6V)'
    curves towerpro-mg996r --voltage 5 --quick
    curves towerpro-sg90 hitec-hs-422 futaba-s3003 --supply usb --quick
    curves dynamixel-xl330-m288 --register Position_P_Gain=800 --quick
    curves feetech-sts3215-12v --register P_Coefficient=16 --load torque=0.2 --quick
    curves hitec-hs-755hb towerpro-sg90 --voltage 4.8 --lift 50g --arm 5cm --quick --out curves.html
    doctor
    doctor hitec-hs-422 --load arm=0.3kg:10cm --set gear.backlash=1deg
    doctor hitec-hs-422 --load inertia=1e-3 --set electronics.stretcher_gain=2500
    doctor towerpro-sg90 --supply 5V:0.2A --step=-60:60 --board uno
    linear feetech-sts3215-12v --load inertia=5e-3 --tune --overshoot 5%
    linear feetech-sts3215-12v --load inertia=5e-3 --tune --phase-margin 50deg
    linear hitec-hs-755hb --load inertia=1e-3 --frame 20ms,10ms --out linear.html
    sweep hitec-hs-755hb --step 0:60 --from-file --lanes 50 --metric overshoot
    sweep hitec-hs-755hb --step 0:60 --vary motor.torque_constant=normal:10% --lanes 50 --metric rise_time
    sweep hitec-hs-755hb --step 0:60 --grid gear.backlash=0..1deg:5 --metric overshoot
    fit --advise --servo hitec-hs-755hb --free output_inertia,electronics.stretcher_gain
    export c hitec-hs-755hb --load inertia=1e-3 --out firmware
    bench list
    bench marker --side 20mm --out horn.pdf
    bench paper --out bench
    robot scara --task circle --ideal --no-video --out circle
    robot mobile --waypoints '0,0;0.2,0' --encoders 512 --no-video --out round
    robot compare --robot two-link --speed 0.15 --out compared
    web --export bench.html
    """
    found: list[Command] = [(line.strip(), (), True) for line in alone.strip().splitlines()]
    after = [(_STEP, "log run.csv"), (_STEP, "log run.csv --plot run.png"), (_BUS, "log bus.csv"),
             (_STEP, "doctor hitec-hs-422 run.csv"), (_STEP, "validate hitec-hs-422 run.csv"),
             (_STEP, "validate hitec-hs-755hb run.csv --max-error 3deg --report check.html"),
             (_BUS, "validate feetech-sts3215-12v bus.csv"), (_STEP, "log run.csv --columns 1:ms"),
             (_BUS, "fit bus.csv --servo feetech-sts3215-12v --free output_inertia --starts 2")]
    found += [(words, (first,), True) for first, words in after]
    found += [(words, (_STEP, _SINE), True) for words in (
        f"{_FIT} --out fitted.toml --report fit.html", f"{_FIT} --holdout sine.csv", f"{_FIT} --within 0.5s",
        f"{_FIT} --free nobody")]
    found += [(words, (_STEP, _SINE, _KEPT), True) for words in (
        "catalog check mine.toml", "catalog show mine.toml", "validate mine.toml sine.csv")]
    found += [(f"robot run arm.xml --servo '*=hitec-hs-755hb' --motion wave.csv{more} --no-video --out wave",
               (_WAVE, _ARM), True) for more in ("", " --supply 6:0.3")]
    return found


_PULSED = 'model, command = st.PulseServo(st.load_servo("hitec-hs-755hb")), st.signals.step(0, 60, unit="deg")'
_RAN = f"{_PULSED}; run = st.simulate(model, command, duration=1.0)"
_ROOMS = ("bench", "control", "datasheet", "diagnosis", "export", "identification", "linear", "logs", "paper",
          "parameters", "plotting", "robots", "studies", "wire")
TASKS = tuple(f"import servotwin as st\n{line}" for line in (
    'print(repr(st.load_servo("hitec-hs-755hb")))', f"{_PULSED}; print(model.available)", f"{_RAN}; print(run)",
    f"{_RAN}; print(run.step_metrics)", f"{_RAN}; print(run.energy)", f"{_RAN}; print(run.remarks, run.stats, run.sag)",
    f"{_PULSED}; print(st.simulate_many(model, command, duration=0.5, parameters={{'load.torque': [0.0, 0.1]}}))",
    "print(st.grid(a=[1, 2], b=[3, 4]))", f"{_PULSED}; print(st.Simulator(model).initial(command))",
    'print(st.load_servo("hitec-hs-755hb").replace({"motor.armature_resistance": -1.0}))', "print(sorted(st.__all__))",
    *(f"from servotwin import {room}; print(sorted(room.__all__))".replace("room.", f"{room}.") for room in _ROOMS)))

_COUNTED = """
import atexit, os, sys
file, leave = sys.argv.pop(), os._exit
def count():
    with open(file, "w") as out:
        print(sum(name.startswith("servotwin") for name in sys.modules), file=out)
def left(code):
    count()
    leave(code)
atexit.register(count)
os._exit = left
"""
_CLI = f"{_COUNTED}\nfrom servotwin.cli import main\nsys.argv[0] = 'servotwin'\nmain()\n"


def run(words: list[str], folder: Path, columns: int) -> dict[str, object]:
    """Run Python with these words in a folder; return what it printed, and its exit code."""
    before = {path: path.read_bytes() for path in _files(folder)}
    count = folder.parent / f"{folder.name}.modules"
    done = subprocess.run([sys.executable, *words, str(count)], cwd=folder, capture_output=True, text=True, check=False,
                          env=os.environ | {"COLUMNS": str(columns), "NO_COLOR": "1", "TERM": "dumb"})
    written = {str(path.relative_to(folder)): _digest(path) for path in _files(folder)
               if before.get(path) != path.read_bytes()}
    modules = int(count.read_text()) if count.exists() else 0
    count.unlink(missing_ok=True)
    return {"code": done.returncode, "out": _plain(done.stdout, folder), "error": _plain(done.stderr, folder),
            "files": written, "modules": modules}


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _digest(path: Path) -> str:
    """Return what a file is told from another by: its text without dates; of others, that they are there."""
    if path.suffix in (".png", ".pdf", ".npz", ".mp4", ".fmu", ".svg"):
        return path.suffix
    text = _plain(path.read_text(encoding="utf-8", errors="replace"), path.parent)
    text = re.sub(r'data:image/[^"]*|<svg.*?</svg>|\d+(\.\d+)?\s*s\b', "", text, flags=re.DOTALL)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(text: str, folder: Path) -> str:
    """Return a text without what is another each time: the folder, dates, and times that were measured."""
    text = text.replace(str(folder), "HERE").replace(str(folder.parent), "HERE")
    text = re.sub(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d+)?)?)?(\+\d\d:\d\d|Z)?", "DATE", text)
    text = re.sub(r'("(?:seconds|elapsed|wall|cpu|took)[^"]*": )[\d.e+-]+', r"\1TIME", text)
    text = re.sub(r"(?m)^\w+: \d+ %.*$", "PROGRESS", text)
    text = re.sub(r"held out, \d+(\.\d+)? s\b", "held out, TIME", text)
    return re.sub(r"\b\d+(\.\d+)? ?m?s of (CPU|processor)[^\n]*|in \d+(\.\d+)? ?m?s\b", "TIME", text)


def kept(one: Command | str) -> dict[str, object]:
    """Run a command, or a task, in a folder of its own; return all that is kept of it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "here"
        folder.mkdir()
        if isinstance(one, str):
            return {"task": run(["-c", _COUNTED + one], folder, _WIDTHS[0])}
        words, before, has_json = one
        for first in before:
            words_of_it = ["-c", _COUNTED + first[1]] if isinstance(first, tuple) else ["-c", _CLI, *shlex.split(first)]
            run(words_of_it, folder, 80)
        found = {}
        for name, more, columns in (*((str(width), [], width) for width in _WIDTHS),
                                    *([("json", ["--json"], 80)] if has_json else [])):
            here = Path(place) / name
            shutil.copytree(folder, here)
            found[name] = run(["-c", _CLI, *shlex.split(words), *more], here, columns)
        return found


def every(words: list[str]) -> dict[str, Command | str]:
    """Return all commands and tasks by what they are, those with one of some words alone if there are any."""
    found: dict[str, Command | str] = {one[0]: one for one in commands()}
    found |= {task.splitlines()[-1]: task for task in TASKS}
    return {name: one for name, one in found.items() if not words or any(word in name for word in words)}


def keep(file: str, words: list[str]) -> None:
    """Keep what all of them come to."""
    cases = every(words)
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        found = dict(zip(cases, pool.map(kept, cases.values()), strict=True))
    Path(file).write_bytes(gzip.compress(json.dumps(found).encode()))
    print(f"{len(found)} kept")


def compare(file: str, words: list[str]) -> None:
    """Print what differs."""
    before, cases = json.loads(gzip.decompress(Path(file).read_bytes())), every(words)
    differs = 0
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        for name, now in zip(cases, pool.map(kept, cases.values()), strict=True):
            lines = [f"  {how}, {what}: {_change(then[what], own[what])}" for how, own in now.items()
                     if (then := before.get(name, {}).get(how)) for what in ("code", "out", "error", "files")
                     if then[what] != own[what]]
            loads = [f"{before[name][how]['modules']} -> {own['modules']} modules" for how, own in now.items()
                     if how in before.get(name, {}) and before[name][how]["modules"] < own["modules"]]
            differs += bool(lines)
            if lines or name not in before:
                print("\n".join([name, *lines, *(f"  {one}" for one in loads[:1])]), flush=True)
    print(f"{len(cases)} compared, {len(cases) - differs} the same")
    sys.exit(differs > 0)


def _change(then: object, now: object) -> str:
    """Return the first thing that differs."""
    if isinstance(then, str) and isinstance(now, str):
        pairs = ((a, b) for a, b in zip([*then.splitlines(), ""], [*now.splitlines(), ""], strict=False) if a != b)
        return "{!r} -> {!r}".format(*next(pairs, (f"{len(then)} characters", f"{len(now)} characters")))[:400]
    return f"{then} -> {now}"[:400]


def main(words: list[str]) -> None:
    """Keep or compare."""
    if len(words) < 2 or words[0] not in ("keep", "compare"):
        sys.exit("usage: tests/kept_commands.py keep|compare FILE [WORD ...]")
    (keep if words[0] == "keep" else compare)(words[1], words[2:])


if __name__ == "__main__":
    main(sys.argv[1:])
