"""Runs of references come back as they were recorded; what is another run is computed."""

import dataclasses
import json
import math

import numpy as np
import pytest

from reference import recorded
from reference.digital_circuit import Bridge
from reference.drivetrain_circuit import Source


def test_values_come_back():
    values = (Source(6.0, 0.5, math.inf), Bridge("open"), {"a": [1, -0.0, None, "é"]}, np.arange(6.0).reshape(2, 3),
              np.array([], np.int64), (True, (1.5, "x")))
    again = recorded.decoded(json.loads(json.dumps(recorded.encoded(values))))
    assert repr(again) == repr(values)
    assert [type(one) for one in again] == [type(one) for one in values]


def test_only_classes_of_the_references_are_made():
    with pytest.raises(ValueError, match="no class of the references"):
        recorded.decoded({"of": "subprocess:Popen", "with": {"args": "true"}})


@pytest.fixture
def square(tmp_path, monkeypatch):
    """A reference that counts how often it computes, and its folder."""
    calls = []

    def square(x):
        calls.append(x)
        return np.array(x) ** 2

    square.__module__ = "reference.square"
    (tmp_path / "square.py").write_text("x = 1\n")
    monkeypatch.setattr(recorded, "HERE", tmp_path)
    monkeypatch.setattr(recorded, "ONE_IN", 10**30)
    yield recorded.recorded(square), calls, tmp_path
    recorded.runs.cache_clear()
    recorded.syntax.cache_clear()


def record(square, folder, monkeypatch, *arguments):
    monkeypatch.setenv("RECORD_REFERENCE", str(folder))
    for x in arguments:
        square(x)
    monkeypatch.delenv("RECORD_REFERENCE")
    recorded.pack(folder)
    recorded.runs.cache_clear()
    recorded.syntax.cache_clear()


def test_what_was_recorded_is_not_computed_again(square, monkeypatch):
    function, calls, folder = square
    record(function, folder, monkeypatch, 1.0, 2.0)
    assert (float(function(2.0)), float(function(3.0))) == (4.0, 9.0)
    assert calls == [1.0, 2.0, 3.0]
    (folder / "square.py").write_text("x = 1  # a comment\n")
    recorded.syntax.cache_clear()
    assert float(function(1.0)) == 1.0
    (folder / "square.py").write_text("x = 2\n")
    recorded.syntax.cache_clear()
    assert float(function(1.0)) == 1.0
    assert calls == [1.0, 2.0, 3.0, 1.0]


def test_a_run_that_is_another_now_is_found(square, monkeypatch):
    function, calls, folder = square
    record(function, folder, monkeypatch, 2.0)
    path = folder / "recorded" / "square.json.xz"
    rows = json.loads(recorded.lzma.decompress(path.read_bytes()))
    other = json.dumps(dict.fromkeys(rows, recorded.encoded(np.array(5.0))))
    path.write_bytes(recorded.lzma.compress(other.encode()))
    recorded.runs.cache_clear()
    assert float(function(2.0)) == 5.0
    monkeypatch.setattr(recorded, "ONE_IN", 1)
    with pytest.raises(AssertionError, match="another run than was recorded"):
        function(2.0)
    assert len(calls) == 2


def test_what_is_no_data_is_computed(square, monkeypatch):
    assert recorded.recorded(lambda f: f(2.0))(math.sqrt) == math.sqrt(2.0)
    with pytest.raises(TypeError):
        recorded.encoded(dataclasses.field)
