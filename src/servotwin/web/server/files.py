"""The files of the page, read once: whatever is asked for, no path reaches the disk."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from starlette.responses import Response

if TYPE_CHECKING:
    from starlette.requests import Request

PAGE = Path(__file__).parent.parent / "page"
_FIRST = "index.html"
_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml",
          ".png": "image/png", ".json": "application/json"}
_PLAIN = "text/plain"


class File(NamedTuple):
    """A file as it is sent: its bytes, what they are, and a mark that changes with them."""

    data: bytes
    kind: str
    mark: str


class Files:
    """All files of a folder.

    Parameters
    ----------
    folder : Path

    Examples
    --------
    >>> files = Files(PAGE)
    >>> files.files["js/main.js"].kind, "../server/files.py" in files.files
    ('text/javascript', False)
    """

    def __init__(self, folder: Path) -> None:
        found = (path for path in sorted(folder.rglob("*")) if path.is_file())
        self.files = {path.relative_to(folder).as_posix(): _read(path) for path in found}
        scripts = (name for name, file in self.files.items() if file.kind == _TYPES[".js"])
        self._links = ", ".join(f"</page/{name}>; rel=modulepreload" for name in scripts)

    async def first(self, request: Request) -> Response:
        """Answer with the page itself; a browser then asks for all its modules at once, not one after the other."""
        return self._sent(request, self.files[_FIRST], {"link": self._links})

    async def other(self, request: Request) -> Response:
        """Answer with a file of the page, if there is one of that name."""
        file = self.files.get(request.path_params["name"])
        return Response("no such file\n", 404, media_type=_PLAIN) if file is None else self._sent(request, file, {})

    def _sent(self, request: Request, file: File, more: dict[str, str]) -> Response:
        if request.headers.get("if-none-match") == file.mark:
            return Response(status_code=304, headers={"etag": file.mark})
        return Response(file.data, media_type=file.kind, headers={"etag": file.mark, **more})


def _read(path: Path) -> File:
    data = path.read_bytes()
    return File(data, _TYPES.get(path.suffix, _PLAIN), f'"{hashlib.sha256(data).hexdigest()[:20]}"')
