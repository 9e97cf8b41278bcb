"""An argument that laws share in one unit has one meaning, which stands once: in the nomenclature, or its group."""

import ast
import re
from collections import defaultdict
from dataclasses import fields
from pathlib import Path

import pytest

from servotwin import physics
from servotwin.parameters import GROUPS
from servotwin.physics.nomenclature import ARGUMENTS
from servotwin.units import si_unit

_SECTION = re.compile(r"Parameters\n-+\n(.*?)(?:\n\n\w[\w ]*\n-+\n|\Z)", re.DOTALL)
_UNIT = re.compile(r"\[([^\[\]]+)\]\.?$")
OF_SERVO = {f.name: si_unit(f.metadata["dimension"]).replace("ohm", "Ω").replace("m2", "m²") or "1"
            for kind in GROUPS.values() for f in fields(kind) if f.metadata["dimension"] not in ("word", "")}


def described(text):
    """Return the description of each argument of a docstring."""
    found, names = {}, []
    for line in (_SECTION.search(text or "") or ["", ""])[1].splitlines():
        if line and not line.startswith(" "):
            names = line.partition(" : ")[0].split(", ")
            found |= dict.fromkeys(names, "")
        else:
            found |= {name: f"{found[name]} {line.strip()}".strip() for name in names}
    return found


@pytest.fixture(scope="module")
def laws():
    """Descriptions of each argument, by the law that has it."""
    found = defaultdict(dict)
    for file in Path(physics.__file__).parent.glob("*.py"):
        for law in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(law, ast.FunctionDef) and not law.name.startswith("_"):
                for name, text in described(ast.get_docstring(law)).items():
                    found[name][law.name] = text
    return found


def units(texts):
    return [unit[1] for text in texts if (unit := _UNIT.search(text))]


def test_a_shared_argument_of_one_unit_has_its_row(laws):
    of = {name: units(texts.values()) for name, texts in laws.items()}
    shared = {name for name, given in of.items() if len(given) > 1 and len(set(given)) == 1}
    assert shared - set(ARGUMENTS) - set(OF_SERVO) == set()


def test_every_row_is_a_shared_argument(laws):
    assert [name for name in ARGUMENTS if len(laws[name]) < 2 or name in OF_SERVO] == []
    assert list(ARGUMENTS) == sorted(ARGUMENTS)


def test_laws_give_its_unit(laws):
    wanted = OF_SERVO | {name: one.unit for name, one in ARGUMENTS.items()}
    assert {f"{law}({name}) [{unit}]" for name, texts in laws.items() if name in wanted
            for law, text in texts.items() for unit in units([text]) if unit != wanted[name]} == set()


def test_laws_give_its_symbol(laws):
    assert [f"{law}({name}): {text}" for name, one in ARGUMENTS.items() if "a law names" not in one.meaning
            for law, text in laws[name].items()
            if not text.startswith(("As ", "Of ")) and not re.search(rf"(?<!\w){one.symbol}(?!\w)", text)] == []


def test_no_law_says_the_meaning_again(laws):
    assert [f"{law}({name})" for name, one in ARGUMENTS.items() for law, text in laws[name].items()
            if one.meaning in text] == []
