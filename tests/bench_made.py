"""The page as one file, made once, and its benches in node."""

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

from servotwin.web.alone import page
from servotwin.web.alone.pack import world
from servotwin.web.alone.page import modules
from servotwin.web.server.serve import first_scene

HARNESS = Path(__file__).parent / "web" / "alone" / "harness"


@cache
def known() -> dict:
    """Return what the page knows, with the layout of its page."""
    return {**world(first_scene()), "layout": page.layout()}


def unpacked(folder: Path) -> Path:
    """Put the modules and the kernel of the page into a folder, for node."""
    (folder / "package.json").write_text('{"type": "module"}')
    for name, text in modules().items():
        (folder / name.removeprefix("bench/")).write_text(text.replace('"bench/', '"./'), encoding="utf-8")
    (folder / "bench.wasm").write_bytes(page.module())
    return folder


def benches(folder: Path, jobs: list[dict]) -> list[dict]:
    """Let benches go on in node; return what shows of each."""
    return in_node("bench", folder, jobs=jobs)


def wild(folder: Path, scenes: list[str]) -> int:
    """Put numbers that no rule lets through into benches; return how many were tried."""
    return in_node("wild", folder, scenes=scenes)


def in_node(harness: str, folder: Path, **given: Any) -> Any:
    """Return what a harness makes of what is given, in node, with the page that lies in a folder."""
    done = subprocess.run([shutil.which("node"), "--no-warnings", str(HARNESS / f"{harness}.mjs"), str(folder)],
                          check=False, capture_output=True, text=True, input=json.dumps({"world": known(), **given}))
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)
