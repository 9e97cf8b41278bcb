"""The subject of a sentence in the sources is the thing's technical name: none begins with what, who or nobody."""

import ast
import io
import re
import tokenize
from pathlib import Path

import pytest

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


# --- Things have, state, get and continue; they do not know, are not told, and do not go on ---------------------------

OF_PEOPLE = re.compile(r"(?i)\b(?<!you )(know|knows|knowing|told|(go|goes|going|gone|went)\s+on)\b")
NAMES = re.compile(r"`[^`]*`|(?m:^ *[\w*, ]+ : .*$|^ *(>>>|\.\.\.) .*$)")  # code, parameters, doctests


def of_people(text):
    """Give line and words of what docstrings and comments of a module say of things as if they were people."""
    if not OF_PEOPLE.search(text.replace("#", " ")):
        return
    parts = [(node.lineno, node.value.value) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Expr)
             and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)]
    comments = [""] * (text.count("\n") + 2)  # a line each, so that words are found over the end of one
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            comments[token.start[0]] = token.string.strip("# ")
    for first, words in (*parts, (0, "\n".join(comments))):
        words = NAMES.sub(lambda name: "\n" * name[0].count("\n"), words)
        yield from ((first + words.count("\n", 0, one.start()), " ".join(one[0].split()))
                    for one in OF_PEOPLE.finditer(words))


def test_things_spoken_of_as_people_are_found():
    text = '"""A model knows\n\n    knows : int\n        As you know, `go_on` or `told`; time goes\n    on."""\n'
    assert list(of_people(text + 'x = "told"  # is told\n# it went\n# on\n')) == [
        (1, "knows"), (4, "goes on"), (6, "told"), (7, "went on")]


@pytest.mark.long
def test_no_thing_is_spoken_of_as_people_are():
    assert [f"{file.relative_to(HOME)}:{line}: {words}" for file in sorted(HOME.rglob("*.py"))
            for line, words in of_people(file.read_text(encoding="utf-8"))] == []
