"""Plant bugs one at a time, and write down which tests see them: `mutate.py N [--seed S] [--engine K] [--limit S]`.

A bug is an operator that becomes another one, a number that is off by 1 %, or a branch that is taken the other way
round, at a place of the package that is drawn. One in the engine that changes no bit of the recorded numbers is drawn
anew. Of the tests, the files run that import the module, the nearest first, until their processor time is used up.
What they see is added to `mutants.json`; a bug that is there already is not run again.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KEPT = Path(__file__).with_name("mutants.json")
ENGINE = ("models/engine", "models/terms", "physics")  # below src/servotwin
LEFT_OUT = ("__init__", "__main__", "/web/page/", "/cli/options")
RECORDED = "tests/simulation/test_recorded_numbers.py"
AT_ONCE = 2
OTHER = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
         ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"),
         ast.Eq: ("==", "!="), ast.NotEq: ("!=", "==")}


@dataclass(frozen=True)
class Bug:
    """A place in a file of the package, and what stands there in its place."""

    file: str
    line: int
    begin: int  # in characters of the file
    end: int
    text: str
    before: str

    @property
    def name(self) -> str:
        return f"{self.file}:{self.line} {self.before} -> {self.text}"

    def plant(self, tree: Path) -> None:
        path = tree / self.file
        source = path.read_text(encoding="utf-8")
        path.write_text(source[:self.begin] + self.text + source[self.end:], encoding="utf-8")


def bugs(file: Path) -> Iterator[Bug]:
    """Yield all bugs that a file could have."""
    source = file.read_text(encoding="utf-8")
    begins = [0]
    for line in source.splitlines(keepends=True):
        begins.append(begins[-1] + len(line))
    lines = source.splitlines(keepends=True)

    def at(line: int, column: int) -> int:  # columns of syntax trees count bytes
        return begins[line - 1] + len(lines[line - 1].encode()[:column].decode())

    def one(node: ast.AST, begin: int, end: int, text: str) -> Bug:
        return Bug(str(file.relative_to(ROOT)), node.lineno, begin, end, text, source[begin:end])

    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.BinOp) and type(node.op) in OTHER:
            yield from _operator(one, node, source, at(node.left.end_lineno, node.left.end_col_offset),
                                 at(node.right.lineno, node.right.col_offset), *OTHER[type(node.op)])
        elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OTHER:
            right = node.comparators[0]
            yield from _operator(one, node, source, at(node.left.end_lineno, node.left.end_col_offset),
                                 at(right.lineno, right.col_offset), *OTHER[type(node.ops[0])])
        elif isinstance(node, ast.Constant) and type(node.value) is float and node.value not in (0.0, 1.0):
            yield one(node, at(node.lineno, node.col_offset), at(node.end_lineno, node.end_col_offset),
                      repr(1.01 * node.value))
        elif isinstance(node, (ast.If, ast.IfExp)) and "TYPE_CHECKING" not in ast.unparse(node.test):
            test = node.test
            begin, end = at(test.lineno, test.col_offset), at(test.end_lineno, test.end_col_offset)
            yield one(test, begin, end, f"not ({source[begin:end]})")


def _operator(one, node, source, begin, end, old, new) -> Iterator[Bug]:
    found = source[begin:end].find(old)
    if found >= 0:
        yield one(node, begin + found, begin + found + len(old), new)


def candidates(engine: bool) -> list[Path]:
    """Return the files of the engine, or all others."""
    package = ROOT / "src" / "servotwin"
    return [file for file in sorted(package.rglob("*.py"))
            if str(file.relative_to(package)).startswith(ENGINE) == engine
            and not any(part in str(file) for part in LEFT_OUT)]


def drawn(seed: int, engine: bool) -> Iterator[Bug]:
    """Yield bugs without end: any place is as likely as another."""
    rng = random.Random(f"{seed} {engine}")
    everywhere = [bug for file in candidates(engine) for bug in bugs(file)]
    while True:
        yield rng.choice(everywhere)


# --- which tests import a module --------------------------------------------------------------------------------------


def _named(tree: ast.AST) -> Iterator[str]:
    """Yield names of modules, or of what may be one, that a file imports, also late."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Attribute):  # st.simulate
            text = ast.unparse(node)
            if text.startswith("st."):
                yield "servotwin." + text[3:]


@cache
def imports() -> dict[str, set[str]]:
    """Return for each file which files it imports, public names by where they are defined."""
    files = {file: file.relative_to(ROOT / "src") for file in (ROOT / "src" / "servotwin").rglob("*.py")}
    files |= {file: file.relative_to(ROOT / "tests") for file in (ROOT / "tests").rglob("*.py")}
    homes = {".".join(short.with_suffix("").parts).removesuffix(".__init__"): file for file, short in files.items()}
    lazy = {name: f"servotwin.{home}" for name, home in re.findall(r'"(\w+)":\s*"([\w.]+)"', (
        ROOT / "src/servotwin/__init__.py").read_text(encoding="utf-8"))}
    public = {}
    for group, home in re.findall(r'fromkeys\(\s*\(([^)]*)\),\s*"(\w+)"\)', (
            ROOT / "src/servotwin/__init__.py").read_text(encoding="utf-8")):
        public |= {name: f"servotwin.{home}" for name in re.findall(r'"(\w+)"', group)}
    found: dict[str, set[str]] = {}
    for file in files:
        to = found.setdefault(str(file), set())
        for name in _named(ast.parse(file.read_text(encoding="utf-8"))):
            parts = name.split(".")
            if parts[0] == "servotwin" and len(parts) > 1:
                home = (public | lazy).get(parts[1])
                name = home if home else name
            while name and name not in homes:
                name = name.rpartition(".")[0]
            if name and name not in ("servotwin",):
                to.add(str(homes[name]))
    return found


def tests_of(file: str) -> list[str]:
    """Return the test files that lead to a file: those of its own room first, then by the imports between."""
    room = f"tests/{Path(file).parts[2]}/"
    back: dict[str, set[str]] = {}
    for one, others in imports().items():
        for other in others:
            back.setdefault(other, set()).add(one)
    far, waiting = {str(ROOT / file): 0}, deque([str(ROOT / file)])
    while waiting:
        here = waiting.popleft()
        for other in back.get(here, ()):
            if other not in far:
                far[other] = far[here] + 1
                waiting.append(other)
    tests = [one for one in far if "/tests/" in one and Path(one).name.startswith("test_")]
    return [str(Path(one).relative_to(ROOT)) for one in sorted(
        tests, key=lambda one: (room not in one, far[one], one))]


# --- running ----------------------------------------------------------------------------------------------------------


def tree_with(bug: Bug, folder: Path) -> Path:
    """Return a copy of the repository with the bug in it."""
    tree = folder / "main"
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", ".venv", "__pycache__", ".*_cache", "_build",
                                                              "paper-report", ".hypothesis", "dist"))
    if (ROOT.parent / "shared").is_dir():
        (folder / "shared").symlink_to(ROOT.parent / "shared")
    bug.plant(tree)
    return tree


def pytest(tree: Path, cache: Path, limit: float, *arguments: str) -> str:
    """Return what tests print in a tree; a process that uses up its time ends."""
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "SERVOTWIN_CACHE_DIR": str(cache)}
    most = int(limit + 120)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", "--tb=no", "--cpu-limit", str(limit),
         *arguments],
        cwd=tree, env=environment, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (most, most)))
    return done.stdout


def seen(said: str) -> tuple[list[str], int]:
    """Return the tests that failed, and how many ran; one that was running when the process ended has failed."""
    rows = re.findall(r"^(tests/\S.*?) (PASSED|FAILED|ERROR|SKIPPED|XFAIL)?", said, flags=re.MULTILINE)
    verdicts = re.findall(r"^(tests/.+?::.+?) +(PASSED|FAILED|ERROR|SKIPPED)", said, flags=re.MULTILINE)
    failed = [name for name, verdict in verdicts if verdict in ("FAILED", "ERROR")]
    broken = re.findall(r"^ERROR (tests/\S+)", said, flags=re.MULTILINE)
    open_one = [name for name, verdict in rows[-1:] if not verdict and "::" in name]
    return sorted({*failed, *broken, *open_one}), len(verdicts)


def result(bug: Bug, limit: float, engine: bool) -> dict[str, object]:
    """Return what sees a bug; nothing ran where it is in the engine and changes nothing that is recorded."""
    with tempfile.TemporaryDirectory(prefix="servotwin-mutant-") as name:
        folder = Path(name)
        tree = tree_with(bug, folder)
        recorded: list[str] = []
        if engine:
            recorded, _ = seen(pytest(tree, folder / "kernels", 600.0, "-m", "", RECORDED))
            if not recorded:
                return {"bug": bug.name, "engine": True, "ran": 0, "seen_by": []}
        failed, ran = seen(pytest(tree, folder / "kernels", limit, "-m", "", *tests_of(bug.file)))
    return {"bug": bug.name, "engine": engine, "ran": ran, "seen_by": sorted({*recorded, *failed})}


def main() -> None:
    asked = argparse.ArgumentParser(usage=__doc__)
    asked.add_argument("number", type=int)
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--engine", type=int, default=6, help="of so many bugs, those in the engine")
    asked.add_argument("--limit", type=float, default=600.0, help="s of processor time a bug")
    given = asked.parse_args()
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else []
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for engine, number in ((True, min(given.engine, given.number)),
                               (False, max(given.number - given.engine, 0))):
            draws, missing = drawn(given.seed, engine), number
            while missing > 0:
                batch = list(islice(draws, missing))
                counts = {one["bug"]: one["ran"] > 0 or not one["engine"] for one in kept}
                missing -= sum(counts.get(bug.name, False) for bug in batch)
                fresh = [bug for bug in batch if bug.name not in counts]
                rows = pool.map(partial(result, limit=given.limit, engine=engine), fresh)
                for bug, row in zip(fresh, rows, strict=True):
                    unseen = engine and row["ran"] == 0
                    print(f"{bug.name}: " + ("changes nothing that is recorded" if unseen else
                                             f"{len(row['seen_by'])} of {row['ran']} see it"), flush=True)
                    missing -= not unseen
                    kept.append(row)
                    KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
