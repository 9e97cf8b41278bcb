"""`import control` is python-control, in this folder of the same name too, whatever was imported before."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import control

TESTS = Path(__file__).resolve().parents[1]


def test_control_is_python_control():
    assert control is sys.modules["control"]
    assert control.tf([1.0], [1.0, 1.0]).dcgain() == 1.0
    assert not Path(control.__file__).is_relative_to(TESTS)


def test_the_folder_of_the_same_name_does_not_hide_it_where_it_comes_first():
    code = "from importlib.util import find_spec; print(find_spec('control').origin)"
    told = subprocess.run([sys.executable, "-c", code], cwd=TESTS, capture_output=True, text=True, check=True)
    assert told.stdout.strip() == find_spec("control").origin
