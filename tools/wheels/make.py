"""Make wheels with all kernels compiled: of this machine, or with `--all` of all targets, which takes zig.

    make.py [--all] [--out FOLDER]

The wheel of pure Python is made first, by pip; libraries and their indices are added to a copy of it for each target.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

from targets import TARGETS, Target, host

from servotwin.simulation.compile import Recipe, source_key
from servotwin.simulation.compile.building import index, printed
from servotwin.simulation.compile.finding import Compiler, compilers, index_name, shipped_folder
from servotwin.simulation.compile.storage import cache_folder
from servotwin.simulation.compile.text.unread import unread
from servotwin.simulation.lanes.forms import parts_of
from servotwin.simulation.recipes import all_recipes

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("src", "pyproject.toml", "README.md", "LICENSE")
AT_ONCE = 2  # processes
MOST = 8e6  # bytes of a wheel


def zig() -> Compiler | None:
    """Return the compiler that makes libraries for other machines."""
    return next((compiler for compiler in compilers() if compiler.identity.startswith("zig ")), None)


def compiled(recipe: Recipe, compiler: Compiler, targets: Sequence[Target], folder: Path) -> None:
    """Print a recipe, and compile it for all targets into folders named by their tags."""
    translation = printed(recipe)
    source = folder / f"{recipe.name}.c"
    source.write_text(translation.text, encoding="utf-8")
    own = {"MACOSX_DEPLOYMENT_TARGET": "11.0"}
    for target in targets:
        into = folder / target.tag
        (into / index_name(recipe)).write_text(json.dumps(index(translation)), encoding="utf-8")
        command = (*compiler.command, *(("-target", target.triple) if target.triple else ()))
        for level in target.levels_for(recipe):
            made = Path(tempfile.mkdtemp(dir=folder)) / f"{recipe.name}-{level}{target.suffix}"
            # Named without its folder, which macOS would note in the library
            call = replace(compiler, command=command).library_command(source, Path(made.name), recipe.vector, level)
            done = subprocess.run(call, capture_output=True, text=True, check=False, cwd=made.parent,
                                  env=compiler.environment(cache_folder()) | own)
            if done.returncode != 0:
                raise RuntimeError(f"{' '.join(call)}\n{done.stderr}")
            made.replace(into / made.name)  # alone: for Windows, what lies beside it is for linkers


def note_unread(folder: Path) -> None:
    """Write down which numbers kernels do not know, which takes a second for each recipe, as a cache has it."""
    kept = os.environ.get("SERVOTWIN_CACHE_DIR")
    os.environ["SERVOTWIN_CACHE_DIR"] = str(folder)
    for recipe in all_recipes():
        for part in parts_of(recipe):
            unread(*part)
    os.environ.pop("SERVOTWIN_CACHE_DIR") if kept is None else os.environ.update(SERVOTWIN_CACHE_DIR=kept)


def pure(folder: Path) -> Path:
    """Make the wheel of pure Python from a copy of the sources, and return the folder that it is unpacked in."""
    copy = folder / "copy"
    copy.mkdir()
    for name in SOURCES:
        of = ROOT / name
        if of.is_dir():
            shutil.copytree(of, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", "shipped"))
        else:
            shutil.copy(of, copy)
    run("pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--wheel-dir", str(folder), str(copy))
    run("wheel", "unpack", "--dest", str(folder / "pure"), *map(str, folder.glob("*.whl")))
    (unpacked,) = (folder / "pure").iterdir()
    code = "from servotwin.simulation.compile import source_key as key; print(key())"
    key = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True, cwd=folder,
                         env=os.environ | {"PYTHONPATH": str(unpacked)})
    if key.stdout.strip() != source_key():
        sys.exit("make.py: the sources in the wheel are others than those that kernels are printed from")
    return unpacked


def run(module: str, *arguments: str) -> None:
    """Run a module; stop here if it fails."""
    done = subprocess.run([sys.executable, "-m", module, *arguments], check=False, stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"{done.stdout}make.py: {module} {arguments[0]} failed")


def packed(unpacked: Path, libraries: Path, target: Target, out: Path) -> Path:
    """Add libraries to a copy of the unpacked wheel, and pack it with its tag."""
    with tempfile.TemporaryDirectory() as name:
        tree = Path(name) / unpacked.name
        shutil.copytree(unpacked, tree)
        shutil.copytree(libraries, tree / shipped_folder().relative_to(ROOT / "src"))
        (told,) = tree.glob("*.dist-info/WHEEL")
        told.write_text(told.read_text(encoding="utf-8").replace("Root-Is-Purelib: true", "Root-Is-Purelib: false")
                        .replace("Tag: py3-none-any", f"Tag: py3-none-{target.tag}"), encoding="utf-8")
        run("wheel", "pack", "--dest-dir", name, str(tree))
        (made,) = Path(name).glob("*.whl")
        out.mkdir(parents=True, exist_ok=True)
        return Path(shutil.move(made, out / made.name))


def main() -> None:
    """Compile all recipes, and make the wheels."""
    asked = argparse.ArgumentParser(usage=__doc__)
    asked.add_argument("--all", action="store_true")
    asked.add_argument("--out", type=Path, default=ROOT / "dist")
    given = asked.parse_args()
    crossing = zig()
    if not compilers() or (given.all and crossing is None):
        sys.exit(f"make.py: no {'zig' if given.all else 'C compiler'}; pip install ziglang brings one")
    compiler = crossing or compilers()[0]
    own = host(compiler is crossing)
    targets = list(TARGETS.values()) if given.all else [own]
    told = crossing.identity if crossing else compiler.command[0]
    print(f"{len(all_recipes())} recipes for {len(targets)} target{'s'[:len(targets) > 1]}, by {told}",
          flush=True)
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="servotwin-wheel-") as name:
        folder = Path(name)
        for target in targets:
            (folder / target.tag).mkdir()
        unpacked = pure(folder)
        with ProcessPoolExecutor(AT_ONCE) as pool:
            list(pool.map(partial(compiled, compiler=compiler, targets=targets, folder=folder), all_recipes()))
        note_unread(folder / "unread")
        for target in targets:
            shutil.copytree(folder / "unread", folder / target.tag, dirs_exist_ok=True)
            wheel = packed(unpacked, folder / target.tag, target, given.out)
            size = wheel.stat().st_size
            print(f"{wheel}: {size / 1e6:.1f} MB, {', '.join(target.levels)}; "
                  f"{'of this machine' if target == own else 'compiled, not run'}", flush=True)
            if size > MOST:
                sys.exit(f"make.py: a wheel has at most {MOST / 1e6:.0f} MB")
    print(f"made in {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    main()
