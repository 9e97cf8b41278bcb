"""Chunks on the workers of dask: the same study to the last bit, and a lost worker costs nothing but time."""

import os
import signal

import numpy as np
import pytest

import servotwin as st

distributed = pytest.importorskip("distributed")

STEP = st.signals.step(0.0, 60.0, at=0.1, unit="deg")
OPTIONS = {"duration": 0.5, "lanes": 600, "chunk": 20, "vary": {
    "motor.torque_constant": "normal:3%", "load.inertia": "uniform:0..1e-3"}}


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0",
                                  silence_logs=60) as cluster:
        yield cluster


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_nothing(cluster, servo, tmp_path):
    model, killed = st.PulseServo(servo), []
    local = st.sweep(model, STEP, directory=tmp_path / "local", **OPTIONS)

    def kill(done, total):
        if done >= 100 and not killed:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    with distributed.Client(cluster, set_as_default=False) as client:
        found = st.sweep(model, STEP, directory=tmp_path / "cluster", progress=kill,
                         executor=client.get_executor(pure=False, retries=3), **OPTIONS)
    assert killed
    for name, column in local.table.items():
        np.testing.assert_array_equal(found.table[name], column, err_msg=name)
    files = sorted(path.name for path in (tmp_path / "local").iterdir())
    assert len(files) == 32
    assert files == sorted(path.name for path in (tmp_path / "cluster").iterdir())
    for name in files:
        assert (tmp_path / "local" / name).read_bytes() == (tmp_path / "cluster" / name).read_bytes(), name


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_command_finds_the_scheduler(cluster, tmp_path, monkeypatch, capsys):
    from servotwin.cli import main

    monkeypatch.chdir(tmp_path)
    words = ["sweep", "hitec-hs-755hb", "--step", "0:60", "--duration", "0.5", "--lanes", "20", "--vary",
             "load.inertia=uniform:0..1e-3"]
    assert main([*words, "--out", "far", "--scheduler", cluster.scheduler_address]) == 0
    assert main([*words, "--out", "near"]) == 0
    assert capsys.readouterr().err == ""
    assert (tmp_path / "far" / "lanes-00000.csv").read_bytes() == (tmp_path / "near" / "lanes-00000.csv").read_bytes()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_without_workers_is_waited_for_and_said():
    from servotwin.cli.sweep import executor_at

    with (distributed.LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=60) as idle,
          pytest.warns(UserWarning, match="has no worker yet"), executor_at(idle.scheduler_address) as executor):
        assert callable(executor.submit)
