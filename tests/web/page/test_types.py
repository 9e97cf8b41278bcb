"""The page's modules are typed: TypeScript finds nothing; what comes from elsewhere is what was published."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

import servotwin.web

PAGE = Path(servotwin.web.__file__).parent / "page"
OPTIONS = {"checkJs": True, "allowJs": True, "strict": True, "noEmit": True, "noImplicitReturns": True,
           "noUnusedLocals": True, "noUnusedParameters": True, "target": "ES2022", "module": "ES2022",
           "moduleResolution": "bundler", "lib": ["ES2022", "DOM", "DOM.Iterable"], "types": []}
LARGEST = 300_000  # bytes of all that a browser gets
pytestmark = pytest.mark.slow


def checked(tools, folder, which="**/*"):
    """Let TypeScript look at a copy of the page, beside the published types of the chart library."""
    (folder / "page/vendor").mkdir(parents=True, exist_ok=True)
    shutil.copy(tools / "uplot/dist/uPlot.d.ts", folder / "page/vendor/uPlot.d.ts")
    (folder / "tsconfig.json").write_text(json.dumps({"compilerOptions": OPTIONS, "include": [f"page/js/{which}.js"]}))
    return subprocess.run(["node", str(tools / "typescript/bin/tsc"), "--project", str(folder)], capture_output=True,
                          text=True, check=False, timeout=120)


def test_typescript_finds_nothing_and_would_find_a_mistake(tools, tmp_path):
    shutil.copytree(PAGE / "js", tmp_path / "page/js")
    done = checked(tools, tmp_path)
    assert (done.stdout, done.returncode) == ("", 0)
    with (tmp_path / "page/js/units.js").open("a") as file:
        file.write('plain("1");\n')
    assert "TS2345" in checked(tools, tmp_path, "units").stdout


def test_typescript_finds_nothing_in_the_page_as_one_file(tools, tmp_path):
    shutil.copytree(PAGE / "js", tmp_path / "page/js")
    for path in (PAGE.parent / "alone/js").glob("*.js"):
        shutil.copy(path, tmp_path / "page/js")
    (tmp_path / "page/js/toml_parse.d.ts").write_text("export function parse(text: string): any;\n")
    done = checked(tools, tmp_path)
    assert (done.stdout, done.returncode) == ("", 0)


def test_the_chart_library_is_the_published_one(tools):
    ours = (PAGE / "vendor/uPlot.js").read_text()
    theirs = (tools / "uplot/dist/uPlot.iife.min.js").read_text()
    assert ours.removesuffix("export default uPlot;\n").strip() == theirs.strip()
    ours, theirs = PAGE / "vendor/uPlot.min.css", tools / "uplot/dist/uPlot.min.css"
    assert ours.read_text().strip() == theirs.read_text().strip()


def test_the_page_is_small():
    sizes = {path.name: path.stat().st_size for path in PAGE.rglob("*") if path.is_file()}
    assert sum(sizes.values()) < LARGEST
    assert not [name for name in sizes if name.endswith((".ts", ".map", ".json"))]
