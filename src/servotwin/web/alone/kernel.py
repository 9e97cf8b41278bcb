"""The kernel of the page: what servos at a bench do, as WebAssembly made from the engine's text."""

from __future__ import annotations

import re
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from servotwin.errors import InputError
from servotwin.models.engine.bus import bus_records
from servotwin.models.engine.bus.bus_records import ROOM, Mate, Seat, Shared
from servotwin.models.engine.lanes import Lanes, Tables
from servotwin.models.engine.live import stretch
from servotwin.models.engine.live.posts import Circuit, Post, Sender, Weights
from servotwin.models.engine.log import COUNTS, Happened, Row
from servotwin.models.engine.memory import Memory
from servotwin.models.state.records import record_of, rows_of
from servotwin.models.terms.control import Firm
from servotwin.models.terms.firmware import Firmware
from servotwin.models.terms.frame import Chip
from servotwin.models.terms.given import Given
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.building import printed
from servotwin.simulation.compile.finding import Compiler, compilers
from servotwin.simulation.compile.kinds import Kind, Scalar, Tuple
from servotwin.simulation.compile.signatures import signatures
from servotwin.simulation.compile.translate import Translation

_INCLUDE = Path(__file__).parent / "include"
_FLAGS = ("-std=c99", "-Os", "-w", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fwrapv",
          "-fno-strict-aliasing", "-mbulk-memory", "-mnontrapping-fptoint", "-nostdlib", f"-I{_INCLUDE}",
          "-Wl,--no-entry", "-Wl,--export-dynamic", "-Wl,--allow-undefined", "-Wl,--export=__heap_base",
          "-Wl,-z,stack-size=1048576", "-Wl,--strip-all")
_TARGETS = {True: ("-target", "wasm32-freestanding"), False: ("--target=wasm32",)}  # of zig, and of clang
_NO_FMA = "\ndouble fma(double a, double b, double c) { return a * b + c; }\n"
_WORDS = 128  # of the longest call
_PAGE = 65536  # bytes of memory that WebAssembly adds at once
_LONGEST = 600.0  # s that a compiler may take


@cache
def recipe() -> Recipe:
    """Return what the kernel is made of; it is none of those that wheels have libraries of."""
    return Recipe("bench", tuple(f"servotwin.models.engine.live.bench:{name}" for name in (
        "make", "begin", "begin_at", "heed", "change", "take", "count", "draw", "look",
        "tune", "snapped", "next_edge", "advance", "advance_together")), never=("READINGS",))


class NoCompilerError(InputError):
    """No compiler at hand makes WebAssembly."""


@cache
def module() -> bytes:
    """Return the kernel as a module of WebAssembly.

    Raises
    ------
    NoCompilerError
        If no compiler at hand makes one.
    """
    text = _printed().text + _NO_FMA
    with tempfile.TemporaryDirectory(prefix="servotwin-") as folder:
        source, made = Path(folder) / "bench.c", Path(folder) / "bench.wasm"
        source.write_text(text, encoding="utf-8")
        problems = [_compiled(compiler, source, made) for compiler in compilers() if not made.exists()]
        if made.exists():
            return made.read_bytes()
    found = "; ".join(problems) or "no C compiler"
    raise NoCompilerError(f"no compiler makes WebAssembly ({found}): install clang and lld, or the package ziglang "
                          "(pip install 'servotwin[compile]')")


@cache
def _printed() -> Translation:
    return printed(recipe())


def _compiled(compiler: Compiler, source: Path, made: Path) -> str:
    """Compile a text; return what is wrong, if anything."""
    target = _TARGETS["ziglang" in compiler.command]
    command = [word for word in compiler.command if word != "-Wl,-s"]
    try:
        ended = subprocess.run([*command, *target, *_FLAGS, "-o", str(made), str(source)], check=False, text=True,
                               capture_output=True, timeout=_LONGEST, env=compiler.environment(source.parent))
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{command[0]}: {error}"
    if ended.returncode == 0:
        return ""
    made.unlink(missing_ok=True)
    lines = [line for line in ended.stderr.splitlines() if re.search("error|not found", line)]
    return f"{Path(command[0]).name}: {lines[0].strip() if lines else f'it ended with {ended.returncode}'}"


def layout() -> dict[str, Any]:
    """Return where a page finds what it writes and reads: fields of records, and arguments of entries."""
    kinds = {"shared": Shared, "seat": Seat, "mate": Mate, "post": Post,
             "sender": Sender, "circuit": Circuit, "memory": Memory, "firm": Firm, "program": Firmware,
             "given": Given, "weights": Weights, "row": Row, "happened": Happened}
    records = {name: {"size": record_of(kind).itemsize, "at": _places(record_of(kind))} for name, kind in kinds.items()}
    known = dict(signatures(recipe()))
    entries = {one.name: {"kinds": [_told(kind) for kind in known[one.name]], "result": one.result}
               for one in _printed().entries}
    tiles = {"size": rows_of(Chip, np.float64).itemsize, "at": {}}
    return {"records": {**records, "chips": tiles}, "entries": entries, "words": _WORDS, "page": _PAGE,
            "lanes": Lanes._fields, "tables": Tables._fields, "event": bus_records.EVENT,
            "series": 2 * ROOM, "log": {"motions": stretch.AT_ONCE, "events": 2 * stretch.AT_ONCE, "counts": COUNTS}}


def _places(kind: np.dtype[Any]) -> dict[str, Any]:
    """Return the place of each field of a record in bytes, and whether it is a whole number; of records in it too."""
    found: dict[str, Any] = {}
    for name, (own, at, *_) in (kind.fields or {}).items():
        if own.subdtype is None:
            found[name] = [at, *([_places(own)] if own.names else ["whole"] if own.kind == "i" else [])]
    return found


def _told(kind: Kind) -> Any:
    """Return an argument as a page lays it out: a number is a word, an array its address and its lengths."""
    if isinstance(kind, Tuple):
        return [_told(element) for element in kind.elements]
    if isinstance(kind, Scalar):
        return "float" if kind.c == "double" else "whole"
    return "array"
