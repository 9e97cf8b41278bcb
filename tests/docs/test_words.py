"""The subject of a sentence in sources and pages is the thing's technical name: none begins with what, who or nobody.

A question may. Code, what it prints, and fences are no sentences.
"""

import ast
import inspect
import io
import re
import tokenize
from itertools import groupby
from pathlib import Path

import pytest

import servotwin
from docs.pages import ROOT

NO_SUBJECT = re.compile(r"(What|Who|Whom|Whose|Whoever|Whatever|Nobody)\b")
SENTENCE = re.compile(r"(?<=[.:;!?])\s+(?=[A-Z])")
HOME = Path(servotwin.__file__).parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def texts(file):
    """Give the texts of a module, its docstrings and comments, or of a page, if it has one of the words at all."""
    text = file.read_text(encoding="utf-8")
    if not re.search(rf"\b{NO_SUBJECT.pattern}", text):
        return
    if file.suffix == ".md":
        yield re.sub(r"(?ms)^ *(```+).*?^ *\1 *$", "", text)
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield re.sub(r"(?m)^ *>>>.*(\n *\S.*)*", "", inspect.cleandoc(node.value.value))
    yield from (line.lstrip(" #-") for line in text.splitlines() if line.lstrip().startswith("#"))


def blocks(text):
    """Give the paragraphs, list items, headings and cells of a text; what is described under a name is indented."""
    text = re.sub(r"(?m)^ *-{3,}$", "", text)  # below the heading of a section
    text = re.sub(r"(?m)^ *(?:[-+*>]|#+|\d+\.) ", lambda mark: "\n" + " " * len(mark[0]), text)
    lines = re.sub(r"[*()\[\]]", "", text.replace("|", "\n\n")).splitlines()
    for _, part in groupby(lines, lambda line: line.strip() and len(line) - len(line.lstrip())):
        yield " ".join(" ".join(part).split())


def without_subject(text):
    """Return the sentences of a text that begin without a subject, and do not ask."""
    return [one for block in blocks(text) for one in SENTENCE.split(block)
            if NO_SUBJECT.match(one) and not one.endswith("?")]


def test_sentences_without_a_subject_are_found():
    assert without_subject("Of a servo. What it does.\n\nA part: Nobody knows whose.") == [
        "What it does.", "Nobody knows whose."]
    assert without_subject("A servo says what it does. Somewhat. What is it?") == []


def test_sentences_without_a_subject_are_found_of_parameters():
    assert without_subject("Say it.\n\nParameters\n----------\nload : Load\n    What hangs\n    on it.\nto : Servo\n"
                           "    Whose it is. A servo.\n\nReturns\n-------\nfloat\n    In rad: What is left.") == [
        "What hangs on it.", "Whose it is.", "What is left."]


def test_sentences_without_a_subject_are_found_of_a_page():
    assert without_subject("## What it costs\n\nTime.\n- **What?** Money. **Who pays.** All\n  do. What\n  is left.\n"
                           "\n| Who? | 1 |\n|---|---|\n| What is read | 2 |\n") == [
        "What it costs", "Who pays.", "What is left.", "What is read"]


def test_every_sentence_names_its_subject():
    found = [f"{file}: {one}" for file in [*PAGES, *sorted(HOME.rglob("*.py"))]
             for text in texts(file) for one in without_subject(text)]
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
