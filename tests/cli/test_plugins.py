"""Plug-ins: the example package is installed, and what it adds is there; what cannot be loaded is one line."""

import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long
EXAMPLE = Path(__file__).parents[2] / "examples" / "plugin"
BROKEN = """
[servotwin.commands]
nothing = no_such_module:run
fit = broken:run
number = broken:NUMBER
unread = broken:unread
[servotwin.servos]
torn = broken_servos
flat = broken
[servotwin.log_formats]
words = broken:NUMBER
[servotwin.bus_models]
known = broken:known
raising = broken:raising
"""
MODULE = '''
NUMBER = 3


def unread(value: "NoSuchType"):
    pass


def known():
    from servotwin.bench.bus import MODELS

    like = MODELS["feetech", 777]
    return [(like._replace(name="Twice"), like.family)]


def raising():
    raise SystemExit(3)
'''


@pytest.fixture(scope="session")
def installed(tmp_path_factory, child_environment):
    """Run Python or the command line where the example, and a package of plug-ins that are all wrong, are installed."""
    folder = tmp_path_factory.mktemp("installed")
    source = tmp_path_factory.mktemp("source") / "plugin"
    shutil.copytree(EXAMPLE, source)
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index",
                    "--no-build-isolation", "--disable-pip-version-check", "--target", str(folder), str(source)],
                   check=True)
    facts = folder / "broken-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text(BROKEN)
    (folder / "broken.py").write_text(MODULE)
    servos = folder / "broken_servos"
    servos.mkdir()
    (servos / "__init__.py").touch()
    (servos / "torn.toml").write_text("name = ")
    shutil.copy(EXAMPLE / "acme_servos" / "acme-s1.toml", servos / "hitec-hs-422.toml")

    def run(*words):
        path = os.pathsep.join([str(folder), child_environment.get("PYTHONPATH", "")])
        return subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False,
                              env={**child_environment, "PYTHONPATH": path}, cwd=folder)

    return run


def test_a_plugin_adds_servos_logs_bus_models_and_commands(installed, tmp_path):
    shown = installed("-m", "servotwin", "catalog", "show", "acme-s1", "--json")
    assert json.loads(shown.stdout)["title"] == "Acme S1"
    page = tmp_path / "reserve.html"
    told = installed("-m", "servotwin", "reserve", "acme-s1", "--torque", "0.3", "--out", str(page)).stdout
    assert "Acme S1, holding 0.3 N m" in told
    assert "deg/s" in told
    assert page.read_text().count("<figcaption>") == 1
    facts = json.loads(installed("-m", "servotwin", "reserve", "acme-s1", "--torque", "0.3", "--json").stdout)
    assert list(facts["speeds"].values()) == sorted(facts["speeds"].values())
    again = installed("-m", "servotwin", "reserve", "acme-s1", "--out", str(page))
    assert again.returncode == 2
    assert f"{page} exists" in again.stderr.splitlines()[-1]
    assert "reserve" in installed("-m", "servotwin", "--help").stdout
    file = tmp_path / "run.json"
    target, angle = [0.0] * 20 + [30.0] * 80, [0.0] * 25 + [min(k, 30.0) for k in range(75)]
    file.write_text(json.dumps({"tester": "acme", "step_ms": 10.0, "target_deg": target, "angle_deg": angle}))
    for more in ((), ("--format", "acme")):
        told = json.loads(installed("-m", "servotwin", "log", str(file), "--json", *more).stdout)
        assert told["logs"][0]["rows"] == 100
    read = installed("-c", f"from servotwin.logs import read_logs; "
                     f"print(read_logs({str(file)!r}, 'acme')[0].measured['output_angle'][-1])")
    assert float(read.stdout) == pytest.approx(math.radians(30.0))
    known = installed("-c", "from servotwin.bench.bus.families import known_models; "
                      "print(known_models()['feetech', 9001].name, known_models()['feetech', 777].name)")
    assert known.stdout == "Acme B1 STS3215\n"
    assert {"reserve", "number"} <= set(json.loads(installed("-m", "servotwin", "doctor", "--json").stdout)
                                        ["plugins"]["commands"])


@pytest.mark.parametrize(("words", "left_out"), [
    (("-m", "servotwin", "catalog", "list"), [
        "plug-in nothing (no_such_module:run) is left out: ModuleNotFoundError",
        "plug-in fit is left out: servotwin has commands of that name itself",
        "plug-in number (broken:NUMBER) is left out: ", "plug-in unread (broken:unread) is left out: NameError",
        "torn.toml is left out: ServoFileError", "hitec-hs-422.toml is left out: the catalog has hitec-hs-422 already",
        "plug-in flat (broken) is left out: TypeError"]),
    (("-c", "from servotwin.logs.formats import log_formats; log_formats()"), [
        "plug-in words (broken:NUMBER) is left out: TypeError: 3 is no LogFormat"]),
    (("-c", "from servotwin.bench.bus.families import known_models; known_models()"), [
        "bus model Twice is left out: STS3215 has its number, 777",
        "plug-in raising (broken:raising) is left out: SystemExit"]),
])
def test_what_cannot_be_loaded_is_left_out_in_one_line(installed, words, left_out):
    told = installed(*words)
    assert told.returncode == 0
    lines = told.stderr.splitlines()
    for text in left_out:
        assert sum(text in line for line in lines) == 1, text
    assert "Traceback" not in told.stderr
