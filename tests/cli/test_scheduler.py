"""`--scheduler`: whatever the command, one that cannot be used is said in one line, and soon."""

import sys
import time

import pytest

from cli import fit_logs

SWEEP = ["sweep", "hitec-hs-755hb", "--step", "0:60", "--vary", "load.inertia=uniform:0..2e-3", "--lanes", "5"]
FIT = ["--servo", fit_logs.SERVO, "--model", "bounded", "--free", "output_inertia", "--starts", "1"]


@pytest.fixture(params=["sweep", "fit"])
def command(request, cli, tmp_path):
    words = SWEEP if request.param == "sweep" else ["fit", fit_logs.write_logs(tmp_path / "runs", count=1), *FIT]
    return lambda address: cli(*words, "--scheduler", address).error


def test_an_address_that_is_none(command):
    pytest.importorskip("distributed")
    assert command("nowhere").startswith("--scheduler: got 'nowhere (ValueError)'")


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_said_within_ten_seconds(command):
    pytest.importorskip("distributed")
    start = time.monotonic()
    assert "allowed: the address of a dask scheduler that answers" in command("tcp://127.0.0.1:9")
    assert time.monotonic() - start < 10.0


def test_dask_that_is_not_installed_is_one_line(command, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install 'servotwin[sweep]'" in command("tcp://127.0.0.1:9")
