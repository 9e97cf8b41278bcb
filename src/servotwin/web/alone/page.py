"""The page as one file: its modules, what they know, and the kernel, packed into one text of HTML."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.web.alone import kernel
from servotwin.web.alone.pack import world

if TYPE_CHECKING:
    from servotwin.web.live import Scene

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
    code = kernel.module()
    known = world(first)
    text = {"modules": modules(), "css": _css(), "world": {**known, "layout": kernel.layout()}}
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


def _css() -> str:
    return "\n".join((_PAGE / name).read_text("utf-8") for name in ("vendor/uPlot.min.css", "css/page.css"))


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def sizes(html: str) -> dict[str, int]:
    """Return how large a page is, and its packed parts [bytes]."""
    parts = dict(re.findall(r'<script type="application/gzip" id="(\w+)">([^<]*)</script>', html))
    return {"page": len(html.encode()), **{name: len(text) for name, text in parts.items()}}
