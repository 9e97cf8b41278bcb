"""Plug-ins: the example package is installed, and what it adds is there; what cannot be loaded is one line."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long
EXAMPLE = Path(__file__).parents[2] / "examples" / "plugin"


@pytest.fixture(scope="session")
def installed(tmp_path_factory, child_environment):
    """Run Python or the command line where the example, and a plug-in that is broken, are installed."""
    folder = tmp_path_factory.mktemp("installed")
    source = tmp_path_factory.mktemp("source") / "plugin"
    subprocess.run(["cp", "-r", str(EXAMPLE), str(source)], check=True)
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index",
                    "--no-build-isolation", "--disable-pip-version-check", "--target", str(folder), str(source)],
                   check=True)
    broken = folder / "broken-1.0.dist-info"
    broken.mkdir()
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (broken / "entry_points.txt").write_text("[servotwin.commands]\nnothing = no_such_module:run\nfit = math:sin\n")

    def run(*words):
        path = f"{folder}:{child_environment.get('PYTHONPATH', '')}"
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
    told = json.loads(installed("-m", "servotwin", "log", str(file), "--json").stdout)
    assert told["logs"][0]["rows"] == 100
    read = installed("-c", f"from servotwin.logs import read_logs; "
                     f"print(read_logs({str(file)!r}, 'acme')[0].measured['output_angle'][-1])")
    assert float(read.stdout) == pytest.approx(math.radians(30.0))
    known = installed("-c", "from servotwin.bench.bus.families import known_models; "
                      "print(known_models()['feetech', 9001].name)")
    assert known.stdout == "Acme B1\n"


def test_what_cannot_be_loaded_is_left_out_in_one_line(installed):
    told = installed("-m", "servotwin", "--version")
    assert told.returncode == 0
    lines = told.stderr.splitlines()
    assert any("plug-in nothing (no_such_module:run) is left out: ModuleNotFoundError" in line for line in lines)
    assert any("plug-in fit is left out: servotwin has commands of that name itself" in line for line in lines)
    assert "Traceback" not in told.stderr
