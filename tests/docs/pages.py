"""The code of the documentation: fenced blocks of a page, and what their lines say that they print."""

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "guide").glob("*.md"))]
_FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


class Block(NamedTuple):
    """Code and the line of the page before its first one."""

    code: str
    line: int


def blocks(page, language):
    """The page's code in a language, in order."""
    text = page.read_text(encoding="utf-8")
    return [Block(found[2], text[:found.start(2)].count("\n")) for found in _FENCE.finditer(text)
            if found[1] == language]


def with_code(language):
    """The pages that have any."""
    return [page for page in PAGES if blocks(page, language)]


def promised(code):
    """What the comments say that is printed: behind a print, or on lines of their own right below it."""
    lines, last = [], ""
    for line in code.splitlines():
        behind = re.search(r"^\s*print\(.*\)  # (.*)$", line)
        alone = re.match(r"^\s+# (.*)$", line)
        if behind:
            lines.append(behind[1])
        elif alone and (last.startswith("print(") or last.startswith("# ")):
            lines.append(alone[1])
        last = line.strip()
    return lines
