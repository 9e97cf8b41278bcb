"""Kernels compiled from the derived text: what they return, and what stands in their text in C."""

import math
import os
import re
import subprocess
import sys

import pytest

from servotwin.models.engine.batch.segments import linear_segments
from servotwin.models.engine.batch.segments.linear_segments import ArcNumbers
from servotwin.models.state.noise import gaussian
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.compile.building import printed
from servotwin.simulation.compile.finding import compilers
from servotwin.simulation.compile.text.derive import derive
from servotwin.simulation.compile.text.translate import header
from servotwin.simulation.lanes.forms import _BY_FORMULA, CALM, DIGITAL, RUNS

SLIDE = Recipe("slide", ("servotwin.models.engine.batch.segments.linear_segments:slide",), vector=True)
NUMBERS = ArcNumbers(60.0, 60.0, 0.2, 1 / 60.0, 1 / 60.0, 5.0, 330.0, 20.0, 5.0, 6.0, 0.4, 0.1, 33.0, 40.0, 5.0, 1.0,
                     -1.0, 0.0, -math.inf, math.inf, 6e-3, 2.0, 0.2, 0.2)
FLAGGED = ("_integrated", "_long_step")  # what a motion takes where no closed form holds
SCRIPT = """
from servotwin.simulation.compile import Recipe, kernels
print(kernels(Recipe("noise", ("servotwin.models.state.noise:gaussian",))).gaussian(3, 7))
"""


def start(folder):
    return subprocess.Popen([sys.executable, "-c", SCRIPT], text=True, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, env={**os.environ, "SERVOTWIN_CACHE_DIR": str(folder)})


def test_compiled_equals_plain():
    for drive, w, time in ((1.0, -2.0, 0.02), (0.0, 3.0, 0.1), (-1.0, 0.0, 1e-5)):
        compiled = kernels(SLIDE).slide(NUMBERS, drive, 0.3, w, time)
        assert compiled == pytest.approx(linear_segments.slide(NUMBERS, drive, 0.3, w, time), rel=1e-13, abs=1e-15)


@pytest.mark.long
def test_what_is_derived():
    text = derive(Recipe("run", ("servotwin.models.engine.run.run:run",))).text
    assert "def terms_frame__decide(" in text
    assert "from servotwin.models.engine.memory import Point as engine_memory__Point" in text
    assert "physics_elementary__log1p(" in text  # whose digits are the same everywhere
    assert '"""' not in text
    compile(text, "derived", "exec")


@pytest.mark.long
def test_the_vector_form_has_polynomials():
    text = derive(Recipe("tiles", ("servotwin.models.engine.batch.side_by_side:go_on",), vector=True)).text
    assert "motions_elementary__log1p(" in text
    assert "math.log1p" not in text


def functions_of(text):
    """Return the functions of a text in C, by their names."""
    whole = r"^(?:static|INLINED|EXPORTED) [^\n;]*?(\w+)\([^\n]*\) \{\n(.*?)^\}"
    return dict(re.findall(whole, text, re.MULTILINE | re.DOTALL))


def reached(name, functions):
    """Return a function and all that it calls."""
    found, left = set(), [name]
    while left:
        one = left.pop()
        if one not in found:
            found.add(one)
            left += [called for called in re.findall(r"\w+", functions[one]) if called in functions]
    return found


@pytest.mark.long
@pytest.mark.parametrize("ending", ["phases__phases", "phases__divide"])
def test_float32_stays_float32(ending):
    functions = functions_of(printed(_BY_FORMULA["float32"]).text.removeprefix(header()))
    (name,) = (each for each in functions if each.endswith(ending))
    own = reached(name, functions)
    assert len(own) > 3
    for each in own:
        assert "double" not in functions[each], each
        assert not re.search(r"(?<![\w.])\d+\.\d*(?:e[+-]?\d+)?(?![\w.])", functions[each]), each  # 1.0f is none
        assert not re.search(r"\b(?:exp|log|sqrt|fabs|floor|fma|sin|log1p|expm1|copysign)\(", functions[each]), each


@pytest.mark.long
def test_two_processes_at_once(tmp_path):
    if not compilers():
        pytest.skip("no C compiler")
    both = [start(tmp_path), start(tmp_path)]
    outputs = [process.communicate(timeout=300) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert outputs[0][0] == outputs[1][0]
    assert float(outputs[0][0]) == pytest.approx(gaussian(3, 7), rel=1e-14)
    assert "compiling kernels" in outputs[0][1] + outputs[1][1]
    again, errors = start(tmp_path).communicate(timeout=300)
    assert (again, errors) == (outputs[0][0], "")  # nothing is compiled again
    assert len(list(tmp_path.glob("*.json"))) == 1
    assert not list(tmp_path.glob("*.tmp"))


@pytest.mark.long
def test_what_no_term_asks_for_is_left_out():
    calm, loose, everything = (derive(one).text for one in (CALM, DIGITAL.parts[0], RUNS))
    assert not any(f"motions_choice__{name}" in calm for name in FLAGGED)
    assert all(f"motions_choice__{name}" in everything for name in FLAGGED)
    assert "terms_heat__warming_rates" in everything
    assert "terms_heat__warming_rates" not in calm + loose
    assert "dynamics_contacts__apart(" in loose
    assert "dynamics_contacts__apart(" not in calm
