"""Deriving a compiled module from the kernels, and keeping it."""

import math
import os
import subprocess
import sys

import pytest

from servotwin.models.engine import arcs, tiles
from servotwin.models.engine.arcs import ArcNumbers
from servotwin.models.engine.noise import gaussian
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.compile.derive import derive
from servotwin.simulation.lane_recipes import ALL_RUNS, GAP_RUNS, PENDULUM_RUNS, PLAIN_RUNS

SLIDE = Recipe("slide", ("servotwin.models.engine.arcs:slide",), vector=True)
NUMBERS = ArcNumbers(60.0, 60.0, 0.2, 1 / 60.0, 1 / 60.0, 5.0, 330.0, 20.0, 5.0, 6.0, 0.4, 0.1, 33.0, 40.0, 5.0, 1.0,
                     -1.0, 0.0, -math.inf, math.inf, 6e-3, 2.0, 0.2, 0.2)
FLAGGED = ("_integrated", "_long_step")  # what a motion takes where no closed form holds
SCRIPT = """
from servotwin.simulation.compile import Recipe, kernels
print(kernels(Recipe("noise", ("servotwin.models.engine.noise:gaussian",))).gaussian(3, 7))
"""


def start(folder):
    return subprocess.Popen([sys.executable, "-c", SCRIPT], text=True, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, env={**os.environ, "SERVOTWIN_CACHE_DIR": str(folder)})


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_compiled_equals_plain():
    for drive, w, time in ((1.0, -2.0, 0.02), (0.0, 3.0, 0.1), (-1.0, 0.0, 1e-5)):
        compiled = kernels(SLIDE).slide(NUMBERS, drive, 0.3, w, time)
        assert compiled == pytest.approx(arcs.slide(NUMBERS, drive, 0.3, w, time), rel=1e-13, abs=1e-15)


def test_what_is_derived():
    text = derive(Recipe("run", ("servotwin.models.engine.runs:run",)))
    assert "def terms_frame__decide(" in text
    assert "from servotwin.models.engine.memory import Point as engine_memory__Point" in text
    assert "math.log1p" in text  # the general form leaves it to the system's library
    assert '"""' not in text
    compile(text, "derived", "exec")


def test_the_vector_form_has_polynomials():
    text = derive(Recipe("tiles", ("servotwin.models.engine.side_by_side:go_on",), vector=True))
    assert "engine_elementary__log1p(" in text
    assert "math.log1p" not in text


@pytest.mark.slow
def test_float32_stays_float32(folder):
    recipe = Recipe("single", ("servotwin.models.engine.phases:phases",
                               "servotwin.models.engine.windows:divide"), vector=True, single=True,
                    never=("BANDS", "STRIDES", "COILS", "GAPS"))
    module = kernels(recipe)
    from numba import from_dtype, types

    tile = from_dtype(tiles.tile_type("float32", tiles.ARCS))
    plan = from_dtype(tiles.plan_type("float32", tiles.ARCS)["of"])
    module.phases.compile((types.int64, types.boolean, types.int64, types.boolean, tile, plan))
    module.divide.compile((types.int64, types.boolean, types.boolean, tile, plan))
    for entry in (module.phases, module.divide):
        (code,) = entry.inspect_llvm().values()
        assert "float" in code
        assert "double" not in code


def test_two_processes_at_once(tmp_path):
    both = [start(tmp_path), start(tmp_path)]
    outputs = [process.communicate(timeout=300) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert outputs[0][0] == outputs[1][0]
    assert float(outputs[0][0]) == pytest.approx(gaussian(3, 7), rel=1e-14)
    assert "compiling the kernels" in outputs[0][1] + outputs[1][1]
    again, errors = start(tmp_path).communicate(timeout=300)
    assert (again, errors) == (outputs[0][0], "")  # nothing is compiled again
    assert len(list(tmp_path.glob("*.py"))) == 1
    assert not list(tmp_path.glob("*.tmp"))


def test_a_cache_that_cannot_be_written(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    process = start(blocked)
    output, errors = process.communicate(timeout=300)
    assert process.returncode == 0
    assert float(output) == pytest.approx(gaussian(3, 7), rel=1e-14)
    assert "SERVOTWIN_CACHE_DIR" in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize("module", ["servotwin.simulation.lane_runs", "servotwin.simulation.compile",
                                    "servotwin.simulation.c_entry"])
def test_numba_comes_late(module):
    code = f"import sys, {module}; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_what_no_term_asks_for_is_left_out():
    plain, swinging, loose, everything = (derive(one) for one in (PLAIN_RUNS, PENDULUM_RUNS, GAP_RUNS, ALL_RUNS))
    assert not any(f"engine_motion__{name}" in plain for name in FLAGGED)
    assert "engine_motion___long_step" in swinging
    assert all(f"engine_motion__{name}" in everything for name in FLAGGED)
    assert "terms_heat__warming_rates" in everything
    assert "terms_heat__warming_rates" not in plain + swinging + loose
    assert "engine_contacts__apart(" in loose
    assert "engine_contacts__apart(" not in plain + swinging
