"""What a derived module does not contain, so that it can be printed in a language with fixed types and no heap."""

import ast

import pytest

from servotwin.simulation import bus_run
from servotwin.simulation.compile.text.derive import derive
from servotwin.simulation.lanes import forms

RECIPES = (bus_run.BUSES, forms.RUNS, forms.DIGITAL,
           forms.CALM, forms.LOOK, forms.BY_TICKS,
           forms.TICKS)


@pytest.fixture(scope="module", params=RECIPES, ids=lambda recipe: recipe.name)
def functions(request):
    return list(derive(request.param).functions.values())


def leaves(node):
    if isinstance(node, ast.If):
        return bool(node.orelse) and leaves(node.body[-1]) and leaves(node.orelse[-1])
    return isinstance(node, ast.Return | ast.Break | ast.Continue)


@pytest.mark.long(but="by_ticks")
def test_every_statement_can_be_reached(functions):
    for function in functions:
        for node in ast.walk(function):
            for body in (getattr(node, "body", []), getattr(node, "orelse", [])):
                if isinstance(body, list):
                    assert not any(leaves(statement) for statement in body[:-1]), function.name
            if isinstance(node, ast.If | ast.IfExp):
                assert not isinstance(node.test, ast.Constant), function.name


def test_no_list_grows_and_no_field_has_a_name_that_is_looked_up(functions):
    for function in functions:
        for node in (part for statement in function.body for part in ast.walk(statement)):
            assert not isinstance(node, ast.ListComp | ast.Starred), function.name
            if isinstance(node, ast.List):
                assert len(node.elts) == 1, function.name  # times how many there are
            assert not (isinstance(node, ast.Constant) and isinstance(node.value, str)), function.name
