"""A law or a number that no fast form knows takes the general one: slow, never wrong.

Each growth is made in a copy of the package, as docs/theory/growing.md says; its kernels run as text.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import servotwin

PACKAGE = Path(servotwin.__file__).parent
FRICTION = "models/terms/friction.py"
SLIDES = "    F = coulomb(friction, forward)\n    if friction.varies == 0.0:\n        return F\n    speed"
NAME = "friction.quadratic_friction"
A_NUMBER = {
    "parameters/groups.py": [("    bearing_coulomb_torque: float | None = parameter(", """\
    quadratic_friction: float | None = parameter(
        "K_w", "number", NOT_NEGATIVE, "grown", THEORY.of(0.0, 1.0))
    bearing_coulomb_torque: float | None = parameter(""")],
    FRICTION: [
        ("READS = (\n", f'READS = (\n    "{NAME}",\n'),
        ("    K_eq: float\n", "    K_eq: float\n    K_w: float = 0.0\n"),
        ("_replace(breakaway=", f'_replace(K_w=model.value_or("{NAME}", 0.0), breakaway=')]}
BY_THE_SPEED = {
    "physics/load_friction.py": [("def share_balance(", """\
def quadratic_friction(speed: float, coefficient: float) -> float:
    return coefficient * speed * speed


def share_balance(""")],
    FRICTION: [
        ("    gear_friction_budget,\n", "    gear_friction_budget,\n    quadratic_friction,\n"),
        (SLIDES,
         "    F = coulomb(friction, forward)\n    if friction.K_w > 0.0:\n"
         "        F += quadratic_friction(w, friction.K_w)\n"
         "    if friction.varies == 0.0:\n        return F\n    speed"),
        ("    return (STEEP_W if contact == CORE else 0 if",
         "    return (STEEP_W if contact == CORE else CURVED_W if friction.K_w > 0.0 and not at_rest(contact)"
         " else 0 if")]}
CONSTANT = {FRICTION: [  # `depends` says nothing new of it
    (SLIDES,
     "    F = coulomb(friction, forward) + friction.K_w\n    if friction.varies == 0.0:\n        return F\n    speed"),
    ("    F = coulomb(friction, forward)\n    if friction.varies == 0.0:\n        return breakaway",
     "    F = coulomb(friction, forward) + friction.K_w\n    if friction.varies == 0.0:\n        return breakaway")]}


@pytest.mark.slow
@pytest.mark.parametrize("program", ["pulses", "digital"])
@pytest.mark.parametrize(("law", "value"), [(BY_THE_SPEED, 0.02), (CONSTANT, 0.2)], ids=["curved", "constant"])
def test_what_no_fast_form_knows_takes_the_general_one(tmp_path, law, value, program):
    shutil.copytree(PACKAGE, tmp_path / "servotwin", ignore=shutil.ignore_patterns("__pycache__"))
    for growth in (A_NUMBER, law):
        for name, changes in growth.items():
            file = tmp_path / "servotwin" / name
            text = file.read_text(encoding="utf-8")
            for before, after in changes:
                assert text.count(before) == 1, before
                text = text.replace(before, after)
            file.write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "SERVOTWIN_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run([sys.executable, str(Path(__file__).with_name("grown_runs.py")), json.dumps({NAME: value}),
                           program], text=True, capture_output=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert Path(told["package"]).is_relative_to(tmp_path)
    assert told["changed"] > 1e-3
    assert told["apart"] < 1e-9, told["used"]
