"""What tests cost is booked by folder, calibrated, without what compiling takes; CI fails on folders, on no item."""

import types
from dataclasses import dataclass

import pytest

import costs
from conftest import pytest_take_turns


@dataclass(frozen=True)
class Case:
    nodeid: str


def report(name, own, children=0.0, made=(), loop=costs.BUDGETS["loop"]):
    return types.SimpleNamespace(nodeid=name, cost={"own": own, "children": children, "made": list(made), "used": [],
                                                    "loop": loop})


def table(monkeypatch, *reports, budgets=None):
    monkeypatch.setitem(costs.BUDGETS, "here", budgets or {})
    config = types.SimpleNamespace(getoption={"--budgets": "here", "--costs": None}.get, collecting=1.0)
    made, session = costs.Table(config), types.SimpleNamespace(exitstatus=0)
    for one in reports:
        made.pytest_runtest_logreport(one)
    made.pytest_sessionfinish(session)
    return made, session


def test_phases_and_children_add_up_and_compiling_stands_apart(monkeypatch):
    made, _ = table(monkeypatch, report("tests/a/test_x.py::one", 0.25),
                    report("tests/a/test_x.py::one", 0.5, 4.0, [("k", 3.0)]), report("tests/b/test_y.py::two", 1.0),
                    report("src/servotwin/z.py::z", 0.5), report("tests/test_w.py::w", 2.0))
    assert {name: row[:2] for name, row in made.folders.items()} == {
        "tests/a": [1, pytest.approx(1.75)], "tests/b": [1, pytest.approx(1.0)], "src": [1, pytest.approx(0.5)],
        "tests": [1, pytest.approx(2.0)]}


def test_a_slow_machine_costs_no_more(monkeypatch):
    made, _ = table(monkeypatch, report("tests/a/test_x.py::one", 3.0, loop=3.0 * costs.BUDGETS["loop"]))
    assert made.folders["tests/a"][1] == pytest.approx(1.0)


@pytest.mark.parametrize(("ci", "took", "code"), [("1", 2.1, 1), ("1", 1.9, 0), ("", 2.1, 0)])
def test_ci_fails_beyond_twice_the_budget_of_a_folder(monkeypatch, ci, took, code):
    monkeypatch.setenv("CI", ci)
    made, session = table(monkeypatch, report("tests/a/test_x.py::one", took / 2),
                          report("tests/a/test_x.py::two", took / 2), report("tests/b/test_y.py::two", 99.0),
                          budgets={"tests/a": 1.0})
    assert int(session.exitstatus) == code
    assert made.over == (["tests/a"] if took > 2.0 else [])


def test_a_loop_takes_time():
    assert 0.0 < costs.calibration() < 10.0


@pytest.mark.long(but="short")
@pytest.mark.parametrize("case", ["short", "as long as the others"])
def test_the_case_that_a_family_names_stays_among_the_quick_ones(case, request):
    assert (request.node.get_closest_marker("long") is None) == (case == "short")


@pytest.mark.parametrize("seed", [3])
def test_explore_goes_on_to_other_seeds(seed, request):
    assert seed == 3 + 1000 * (request.config.getoption("--seed") or 0)


def test_turns_run_every_case_once_in_three_and_what_has_few_each_time():
    """Cases of a long family of many; those of a small one, and of the documentation, come at each turn."""
    names = [*(f"tests/a/test_x.py::many[{k}]" for k in range(20)), *(f"tests/a/test_x.py::few[{k}]" for k in range(5)),
             *(f"tests/docs/test_y.py::page[{k}]" for k in range(9)), "tests/a/test_x.py::one"]
    seen, left = [], []
    for turn in (7, 8, 9):
        items = [Case(name) for name in names]
        hook = types.SimpleNamespace(pytest_deselected=lambda items: left.extend(items))
        pytest_take_turns(types.SimpleNamespace(getoption={"--turn": turn}.get, hook=hook), items)
        seen.append([item.nodeid for item in items])
        assert len(seen[-1]) in (21, 22)
    often = {name: sum(name in run for run in seen) for name in names}
    assert {name: times for name, times in often.items() if times != (1 if "many" in name else 3)} == {}
    assert len(left) == 40
