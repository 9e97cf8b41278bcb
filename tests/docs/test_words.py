"""The subject of a sentence in the sources is the thing's technical name: none begins with what, who or nobody."""

import ast
import re
from pathlib import Path

import servotwin

NO_SUBJECT = re.compile(r"(What|Who|Whom|Whose|Whoever|Whatever|Nobody)\b")
SENTENCE = re.compile(r"(?<=[.:;!?])\s+(?=[A-Z])")
HOME = Path(servotwin.__file__).parent


def texts(file):
    """Give line and text of the docstrings and comments of a module that has one of the words at all."""
    text = file.read_text(encoding="utf-8")
    if not re.search(rf"\b{NO_SUBJECT.pattern}", text):
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.lineno, re.sub(r"(?m)^\s*(>>>|\.\.\.).*$", "", node.value.value)
    yield from ((number, line.lstrip(" #-")) for number, line in enumerate(text.splitlines(), 1)
                if line.lstrip().startswith("#"))


def without_subject(text):
    """Return the sentences of a text that begin without a subject."""
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", text) if "-----" not in part]  # no parameters
    return [one for part in paragraphs for one in SENTENCE.split(part) if NO_SUBJECT.match(one)]


def test_sentences_without_a_subject_are_found():
    assert without_subject("Of a servo. What it does.\n\nA part: Nobody knows whose.") == [
        "What it does.", "Nobody knows whose."]
    assert without_subject("A servo says what it does. Somewhat.") == []


def test_every_sentence_names_its_subject():
    found = [f"{file.relative_to(HOME)}:{line}: {one}" for file in sorted(HOME.rglob("*.py"))
             for line, text in texts(file) for one in without_subject(text)]
    assert found == []
