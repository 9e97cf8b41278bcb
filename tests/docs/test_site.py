"""The documentation as it is built: complete, and readable without a network."""

import inspect
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ElementTree

import pytest

import servotwin as st
from docs.pages import ROOT
from servotwin.parameters import catalog_names

pytest.importorskip("sphinx")
pytest.importorskip("latex2mathml")

_FOREIGN = re.compile(r"""<(?:script|img|iframe|source)[^>]*\ssrc=["'](?:https?:)?//|"""
                      r"""<link[^>]*\shref=["'](?:https?:)?//|url\(["']?(?:https?:)?//|@import\s+["'](?:https?:)?//""")


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run([sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", "docs", str(out)], cwd=ROOT,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.slow
def test_nothing_is_loaded_from_elsewhere(site):
    files = [*site.rglob("*.html"), *site.rglob("*.css")]
    assert len(files) > 30
    assert [path.name for path in files if _FOREIGN.search(path.read_text(encoding="utf-8"))] == []


@pytest.mark.slow
def test_every_formula_is_mathml(site):
    found = 0
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert "$$" not in text, path
        for formula in re.findall(r"<math\b.*?</math>", text, re.DOTALL):
            words = "".join(ElementTree.fromstring(formula).itertext())
            assert words.strip(), path
            assert "\\" not in words, (path, words)
            found += 1
    assert found > 300


@pytest.mark.slow
def test_every_equation_of_the_paper_has_its_number(site):
    text = (site / "theory" / "paper.html").read_text(encoding="utf-8")
    numbers = {int(n) for n in re.findall(r'class="number">\((\d+)', text)}
    assert numbers == set(range(1, 42))


@pytest.mark.slow
def test_everything_public_is_in_the_reference(site):
    pages = "".join(path.read_text(encoding="utf-8") for path in (site / "reference").glob("*.html"))
    missing = []
    for module in ("parameters", "signals", "loads", "models", "simulation", "linear", "control", "datasheet", "bench",
                   "plotting", "physics", "logs", "studies", "identification"):
        for name in getattr(st, module).__all__:
            item = getattr(getattr(st, module), name)
            passed_on = module == "identification" and getattr(item, "__module__", "").startswith("servotwin.logs.")
            home = "logs" if passed_on else module
            if (inspect.isclass(item) or inspect.isroutine(item)) and f'id="servotwin.{home}.{name}"' not in pages:
                missing.append(f"{module}.{name}")
    assert missing == []


def test_every_dependency_says_what_it_replaces():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = [*project["dependencies"], *(line for name, lines in extras.items() if name not in ("all", "dev")
                                         for line in lines)]
    page = (ROOT / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| (?:`[\w-]+` \| )?([a-z][\w-]+) \|", page, re.MULTILINE)) - {"package", "extra"}
    assert listed == {re.match(r"[\w-]+", line)[0] for line in asked}


def test_readme_counts_the_servos_of_the_catalog():
    assert f"{len(catalog_names())} servos come along" in (ROOT / "README.md").read_text("utf-8")
