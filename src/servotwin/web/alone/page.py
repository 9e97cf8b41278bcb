"""The page as one file: its modules, their data, and the kernel, packed into one text of HTML."""

from __future__ import annotations

import base64
import gzip
import json
import re
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
from servotwin.simulation.compile.signatures import signatures
from servotwin.simulation.compile.text.kinds import Kind, Scalar, Tuple
from servotwin.simulation.compile.text.translate import Translation
from servotwin.web.alone.pack import world

if TYPE_CHECKING:
    from servotwin.web.live import Scene


# --- The kernel of the page: what servos at a bench do, as WebAssembly made from the engine's text --------------------

_INCLUDE = Path(__file__).parent / "include"
_FLAGS = ("-std=c99", "-Os", "-w", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fwrapv",
          "-fno-strict-aliasing", "-mbulk-memory", "-mnontrapping-fptoint", "-nostdlib", f"-I{_INCLUDE}",
          "-Wl,--no-entry", "-Wl,--export-dynamic", "-Wl,--allow-undefined", "-Wl,--export=__heap_base",
          "-Wl,-z,stack-size=1048576", "-Wl,--strip-all")
_TARGETS = {True: ("-target", "wasm32-freestanding"), False: ("--target=wasm32",)}  # of zig, and of clang
_NO_FMA = "\ndouble fma(double a, double b, double c) { return a * b + c; }\n"
_WORDS = 128  # of the longest call
_MEMORY_PAGE = 65536  # bytes of memory that WebAssembly adds at once
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
    return {"records": {**records, "chips": tiles}, "entries": entries, "words": _WORDS, "page": _MEMORY_PAGE,
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


# --- The page as one file: its modules, their data, and the kernel, packed into one text of HTML ----------------------

_HERE = Path(__file__).parent
_PAGE = _HERE.parent / "page"
_POLICY = ("default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' data:; style-src 'unsafe-inline'; "
           "img-src data: blob:; form-action 'none'; base-uri 'none'")  # nothing is asked of any other computer
_IMPORT = re.compile(r'''(from\s*|import\s*)["'](?:\./|\.\./vendor/)([\w.]+\.js)["']''')


def page(first: Scene) -> str:
    """Return the page as one text.

    Parameters
    ----------
    first : Scene
        With which it begins.

    Raises
    ------
    NoCompilerError
        If no compiler at hand makes WebAssembly.
    """
    code = module()
    known = world(first)
    css = "\n".join((_PAGE / name).read_text("utf-8") for name in ("vendor/uPlot.min.css", "css/page.css"))
    text = {"modules": modules(), "css": css, "world": {**known, "layout": layout()}}
    pieces = {"text": json.dumps(text, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode(),
              "code": code}
    html = (_PAGE / "index.html").read_text("utf-8")
    icon = base64.b64encode((_PAGE / "icon.svg").read_bytes()).decode()
    head = (f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
            f'<link rel="icon" href="data:image/svg+xml;base64,{icon}" type="image/svg+xml">')
    html = re.sub(r"<link [^>]*>\n|<script [^>]*></script>\n", "", html).replace("</title>\n", f"</title>\n{head}\n")
    parts = [f'<script type="application/gzip" id="{name}">{_packed(data)}</script>' for name, data in pieces.items()]
    boot = f"<script>{(_HERE / 'boot.js').read_text('utf-8')}</script>"
    return html.replace("</body>", "\n".join([*parts, boot, "</body>"]))


def modules() -> dict[str, str]:
    """Return the text of every module by its name; where the server's page has one of the same name, this one counts.

    Examples
    --------
    >>> "bench/main.js" in modules(), "WebSocket" in modules()["bench/line.js"]
    (True, False)
    """
    found: dict[str, str] = {}
    for path in (*sorted((_PAGE / "js").glob("*.js")), _PAGE / "vendor" / "uPlot.js",
                 *sorted((_HERE / "vendor").glob("*.js")), *sorted((_HERE / "js").glob("*.js"))):
        found[f"bench/{path.name}"] = _IMPORT.sub(r'\1"bench/\2"', path.read_text("utf-8"))
    return found


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def sizes(html: str) -> dict[str, int]:
    """Return how large a page is, and its packed parts [bytes]."""
    parts = dict(re.findall(r'<script type="application/gzip" id="(\w+)">([^<]*)</script>', html))
    return {"page": len(html.encode()), **{name: len(text) for name, text in parts.items()}}
