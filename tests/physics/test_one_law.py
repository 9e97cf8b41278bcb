"""A law stands once: change it, and the plain engine, the compiled one and the outputs change alike."""

import ast
import inspect
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from servotwin import physics
from servotwin.physics.laws import array_form

HERE = Path(__file__).parent
PACKAGE = Path(physics.__path__[0]).parent
PUBLIC = {name: function for name in physics.__all__ if inspect.isfunction(function := getattr(physics, name))}
LAWS = {name: inspect.unwrap(function) for name, function in PUBLIC.items() if hasattr(function, "__wrapped__")}
ENGINE = sorted(set(PUBLIC) - set(physics.ANALYSIS))
SCALED = [name for name in ENGINE if name in LAWS and inspect.signature(LAWS[name]).return_annotation != "bool"]
FEW = ("drive_time",)
HIDDEN = ("braking_distance",)  # by 1 % of the others, at the few ticks that a batch sees
# Where lanes go side by side no potentiometer has play, so that its law is not asked; and the voltage of a bus is what
# the currents of all balance at, while that of a servo's own supply follows from its one current
REPEATED = {"play": "tiles", "source_voltage": "on a bus", "supply_current": "on a bus"}
# Laws of which the balance of energy is made: 1 % off, it cannot close
BALANCE = {"armature_current_rate", "bridge_loss", "brush_loss", "circuit_current", "copper_loss",
           "driving_voltage", "kinetic_energy", "magnetic_energy", "needed_voltage",
           "shaft_acceleration", "source_voltage", "spring_energy", "steady_armature_current",
           "stretch_beyond_play", "supply_current", "twist_torque"}
FOLLOWED = ("error_beyond_deadband", "feedback_error")  # 1 % off, an averaged servo takes 40 s for 0.11 s
MOST = 5  # cases that a batch runs with one law changed
# One for each way in which kernels are compiled: lanes side by side, lanes one by one, and a program
COMPILED = ("tiles", "tiles that measure", "coasting", "loaded", "chopped")
EDGES = (0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -2.0)


class Runs:
    """A copy of the package in which laws can be changed, and what it gives."""

    def __init__(self, folder):
        self.folder = folder
        shutil.copytree(PACKAGE, folder / "servotwin", ignore=shutil.ignore_patterns("__pycache__"))
        self.before, self.called = self.run("plain")

    def run(self, how, *words):
        out = self.folder / "signals.npz"
        environment = {**os.environ, "PYTHONPATH": str(self.folder), "SERVOTWIN_CACHE_DIR": str(self.folder / "cache")}
        done = subprocess.run([sys.executable, str(HERE / "one_law_runs.py"), str(out), how, *words], check=True,
                              text=True, capture_output=True, env=environment)
        told = json.loads(done.stdout)
        assert Path(told["package"]).is_relative_to(self.folder)
        with np.load(out) as found:
            return dict(found), told["laws"]

    def scaled(self, names, how, *words):
        """Return what `run` returns where some laws return 1.01 times as much."""
        changed = {}
        for name in names:
            file = self.folder / "servotwin" / "physics" / Path(inspect.getfile(LAWS[name])).name
            text = file.read_text(encoding="utf-8")
            changed.setdefault(file, text)
            file.write_text(_scaled(text, name), encoding="utf-8")
        self._forget()
        try:
            return self.run(how, *words)
        finally:
            for file, text in changed.items():
                file.write_text(text, encoding="utf-8")
            self._forget()

    def callers(self, name):
        """Return which cases call a law."""
        return [case for case, called in self.called.items() if name in called]

    def _forget(self):
        shutil.rmtree(self.folder / "servotwin" / "physics" / "__pycache__", ignore_errors=True)


def _scaled(text, name):
    tree = ast.parse(text)
    law = next(node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name)
    for node in ast.walk(law):
        if isinstance(node, ast.Return):
            node.value = ast.BinOp(ast.Constant(1.01), ast.Mult(), node.value)
    return ast.unparse(ast.fix_missing_locations(tree))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return Runs(tmp_path_factory.mktemp("one_law"))


def _agree(found, tolerance, but=()):
    for key, values in found.items():
        if key.startswith("batch/") and not key.split("/")[1].startswith(but):
            plain = found["plain/" + key[len("batch/"):]]
            size = max(np.nanmax(np.abs(plain), initial=0.0), 1e-6)
            np.testing.assert_allclose(values / size, plain / size, rtol=0.0, atol=tolerance, err_msg=key)


def _differs(one, other):
    return any(not np.array_equal(one[key], other[key], equal_nan=True) for key in one if key.startswith("plain/"))


def _unbalanced(found):
    """Return the largest residual of an energy balance, relative to its largest entry."""
    energies = [values for key, values in found.items() if key.startswith("plain/") and key.endswith("/energy")]
    return max(abs(energy[-1]) / np.abs(energy[:-1]).max() for energy in energies)


@pytest.mark.long
def test_every_law_is_run_by_the_engine_or_named_as_analysis(runs):
    assert set(physics.ANALYSIS) <= set(PUBLIC)
    called = set().union(*runs.called.values())
    assert not called & set(physics.ANALYSIS)
    assert set(ENGINE) <= called


def _check(found, before, name):
    """Check that a law with 1 % on it is seen, and its energy: 1 % off a law of the balance, that cannot close."""
    assert _differs(found, before)
    if name in BALANCE:
        assert _unbalanced(found) > 1e-6
    else:
        assert _unbalanced(found) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCALED if name not in (*FEW, *HIDDEN, *REPEATED)])
def test_a_law_that_changes_changes_the_plain_engine(runs, name):
    callers = [case for case in runs.callers(name) if name not in FOLLOWED or not case.startswith("averaged")]
    _check(runs.scaled([name], "plain", *callers)[0], runs.before, name)


@pytest.mark.long
@pytest.mark.parametrize("name", [*FEW, *(pytest.param(name, marks=pytest.mark.slow)
                                           for name in (*HIDDEN, *REPEATED))])
def test_a_law_that_changes_changes_all_paths_alike(runs, name):
    callers = runs.callers(name)
    found, _ = runs.scaled([name], "derived", *(callers[k * len(callers) // MOST] for k in range(MOST))
                           if len(callers) > MOST else callers)
    _check(found, runs.before, name)
    _agree(found, 1e-12, REPEATED.get(name, ()))


@pytest.mark.slow
@pytest.mark.parametrize("names", [(), [name for name in SCALED if name not in REPEATED]], ids=["none", "all"])
def test_laws_that_change_together_change_all_paths_of_all_cases_alike(runs, names):
    """One path that has a law of its own is 1 % off, whatever else has changed."""
    found, called = runs.scaled(names, "derived")
    assert _differs(found, runs.before) == bool(names)
    assert {name for name in names if {*runs.callers(name)} & {*called}} <= set().union(*called.values())
    _agree(found, 1e-12)


@pytest.mark.slow
def test_laws_that_change_together_change_compiled_kernels_alike(runs):
    """All cases have shown that the derived text follows its laws: here it is compiled, in each way that there is."""
    found, _ = runs.scaled([name for name in SCALED if name != "play"], "compiled", *COMPILED)
    assert _differs(found, runs.before)
    _agree(found, 1e-9)


@pytest.mark.slow
def test_every_law_compiled_is_the_law_and_changes_with_it(runs):
    before, found = (runs.scaled(names, "laws", *SCALED)[0] for names in ((), SCALED))
    for name in SCALED:
        assert not np.array_equal(found[f"batch/laws/{name}"], before[f"batch/laws/{name}"], equal_nan=True), name
    _agree(before, 1e-12)
    _agree(found, 1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_the_array_form_is_the_law_element_by_element(name):
    law = LAWS[name]
    rng = np.random.default_rng(5)
    parameters = inspect.signature(law).parameters
    given = {}
    for key, parameter in parameters.items():
        values = np.concatenate([rng.uniform(-3.0, 3.0, 200), rng.choice(EDGES, 200)])
        rng.shuffle(values)
        given[key] = values > 0.0 if parameter.annotation == "bool" else values
    together = PUBLIC[name](**given)
    compared = 0
    for k in range(400):
        try:
            alone = law(**{key: bool(x[k]) if x.dtype == bool else float(x[k]) for key, x in given.items()})
        except (ArithmeticError, ValueError):  # numbers for which the law says nothing
            continue
        for part, of_one in zip(*(x if isinstance(x, tuple) else (x,) for x in (together, alone)), strict=True):
            if isinstance(of_one, float) and not math.isfinite(of_one):
                assert not np.isfinite(part[k])
            else:
                assert part[k] == pytest.approx(of_one, rel=1e-12, abs=1e-14)
            compared += 1
    assert compared > 50


def looping(x: float) -> float:
    """Add up; not a law."""
    for _ in range(3):
        x += 1.0
    return x


def test_a_loop_is_refused():
    with pytest.raises(NotImplementedError, match="looping: no array form of 'for _ in range"):
        array_form(looping)(np.zeros(2))
