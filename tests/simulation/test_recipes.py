"""The list of all recipes, which wheels are made from."""

import json
import subprocess
import sys

import pytest

from servotwin.simulation.lanes.forms import parts_of
from servotwin.simulation.recipes import all_recipes

pytestmark = pytest.mark.long

# Imports every module of the package; what cannot be imported here has no recipe that anybody could reach
_EVERY_RECIPE = """
import contextlib, gc, importlib, json, pkgutil, servotwin
from servotwin.simulation.compile import Recipe
for module in pkgutil.walk_packages(servotwin.__path__, "servotwin.", onerror=lambda name: None):
    if not module.name.endswith("__main__"):
        with contextlib.suppress(ImportError):
            importlib.import_module(module.name)
print(json.dumps(sorted(repr(each) for each in gc.get_objects() if isinstance(each, Recipe))))
"""


def test_no_recipe_of_the_package_is_missing():
    done = subprocess.run([sys.executable, "-c", _EVERY_RECIPE], stdout=subprocess.PIPE, text=True, check=True)
    read = {part for recipe in all_recipes() for part, _ in parts_of(recipe)}  # some of them are read alone
    read |= {part for recipe in all_recipes() for part in recipe.parts}
    assert json.loads(done.stdout) == sorted(map(repr, read | set(all_recipes())))
