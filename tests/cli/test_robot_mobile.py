"""`servotwin robot mobile`: waypoints by odometry, its files, and what is refused."""

import csv
import json

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
FILES = {"path.csv", "paths.png", "summary.json", "index.html"}


@pytest.fixture
def robot(cli, tmp_path, monkeypatch):
    """The command in an empty folder, where nothing can be drawn."""
    monkeypatch.setenv("MUJOCO_GL", "off")
    return lambda *words: cli("robot", "mobile", *words, "--out", "out", "--no-video")


@pytest.mark.long
def test_a_short_way_by_encoders(robot, tmp_path):
    ended = robot("--waypoints", "0,0; 0.15,0", "--encoders", "4096")
    assert ended.code == 0, ended.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES | {"run.csv"}
    found = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert found["missed"] < 0.025
    assert found["largest_off_belief"] < 0.01
    assert "encoders of 4096 counts" in ended.out
    with (tmp_path / "out" / "path.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["is_x_m"]) == pytest.approx(0.15, abs=0.025)
    assert 700.0 < float(rows[10]["left_pulse_us"]) < 2300.0


def test_waypoints_from_a_table_on_ideal_wheels(robot, tmp_path):
    (tmp_path / "way.csv").write_text("x_m,y_m\n0,0\n0.3,0\n0.3,0.2\n")
    found = robot("--waypoints", "way.csv", "--ideal", "--json").data
    np.testing.assert_allclose(found["waypoints"], [[0.0, 0.0], [0.3, 0.0], [0.3, 0.2]])
    assert found["missed"] < 0.02
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES


def test_a_circle(robot):
    found = robot("--task", "circle", "--size", "40cm", "--ideal", "--json").data
    corners = np.array(found["waypoints"])
    np.testing.assert_allclose(np.hypot(corners[:, 0], corners[:, 1] - 0.2), 0.2, rtol=1e-12)
    assert found["largest_off_path"] < 0.02


@pytest.mark.parametrize(("words", "said"), [
    (("--waypoints", "0,0; 1"), "--waypoints: got '0,0; 1', allowed: X,Y;X,Y;... in metres"),
    (("--task", "cube"), "unknown round of the mobile robot 'cube'"),
    (("--size", "-1cm"), "size of a round: got -0.01"),
    (("--size", "1m", "--waypoints", "0,0;1,0"), "--size: got '1m', allowed: a round"),
    (("--waypoints", "none.csv"), "--waypoints: got 'none.csv'"),
    (("--speed", "9", "--waypoints", "0,0;0.1,0"), "speed of the mobile robot: got 9.0, allowed: at most"),
    (("--encoders", "0"), "encoders: got 0"),
    (("--servo", "no-such"), "unknown servo 'no-such'"),
])
def test_bad_input_is_one_line(robot, tmp_path, words, said):
    ended = robot(*words)
    assert ended.code == 2
    assert said in ended.err
    assert not (tmp_path / "out").exists()
