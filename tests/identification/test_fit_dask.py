"""Fits on the workers of dask: the same to the last bit, though one is killed, and by the address of a scheduler."""

import json
import os
import signal

import pytest

from cli.fit_logs import SERVO, write_logs
from identification.fits import WRONG, fitted
from identification.test_executors import check_same
from servotwin.cli import main

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0",
                                  silence_logs=60) as cluster:
        yield cluster


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_costs_nothing_but_time(cluster, logs):
    killed = []

    def kill(share, text):
        if share > 0.1 and not killed:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    with distributed.Client(cluster, set_as_default=False) as client:
        found = fitted(logs, WRONG, executor=client.get_executor(pure=False, retries=3), progress=kill)
    assert killed
    check_same(found, fitted(logs, WRONG))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_command_finds_the_scheduler(cluster, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    folder = write_logs(tmp_path / "runs")
    words = ["fit", str(folder), "--servo", SERVO, "--model", "bounded", "--free", "output_inertia", "--no-priors",
             "--starts", "1", "--nuisance", "none", "--no-compare", "--json"]
    found = []
    for more in (["--scheduler", cluster.scheduler_address], []):
        assert main([*words, *more]) == 0
        captured = capsys.readouterr()
        assert all(line.startswith("fit: ") for line in captured.err.splitlines()), captured.err
        found.append(json.loads(captured.out))
    far, near = found
    assert far["estimates"] == near["estimates"]
    assert far["errors"] == near["errors"]
