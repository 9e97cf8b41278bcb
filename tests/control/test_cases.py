"""Each controller beats what there is without it, on the case that it is for, by the factor that the page prints."""

import importlib.util
import re
import sys

import pytest

from docs.pages import ROOT

PAGE = ROOT / "docs" / "theory" / "control.md"


@pytest.fixture(scope="module")
def benchmark(monkeypatch_module):
    folder = ROOT / "benchmarks" / "control"
    monkeypatch_module.syspath_prepend(folder)
    spec = importlib.util.spec_from_file_location("control_run", folder / "run.py")
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    yield found
    sys.modules.pop("cases", None)


@pytest.fixture(scope="module")
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


def test_feedforward_takes_nine_tenths_of_the_error_and_more(benchmark):
    case = next(iter(benchmark.cases()))
    without, with_it = case.errors()
    assert without > 10.0 * with_it


@pytest.mark.slow
def test_the_table_is_that_of_a_new_run(benchmark):
    pytest.importorskip("osqp")
    rows = re.findall(r"^\| `.*$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert rows == [benchmark.row(case) for case in benchmark.cases()]
    assert all(float(row.split("|")[-2]) > 4.0 for row in rows)
