"""Benches of the page as one file and of the server: random scenes, random actions, the same numbers and words."""

import json
import re
import warnings

import numpy as np
import pytest

from bench_made import benches, wild
from bench_scenes import by_python, drawn
from servotwin.web.live import LiveBench, read_scene
from servotwin.web.live.rest_watch import NOT_AT_REST

ANGLE = 1e-9  # rad
BETWEEN = 1e-8  # s: where a drive ends as the next begins, rounding decides whether the bridge is off in between
OTHER = 1e-6  # of the peak of a signal: rates that two libraries of functions, under an integrator, leave


def whole(value):
    """Return a value as it comes from a page, which writes 2.0 as 2."""
    if isinstance(value, dict | list):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        made = {key: whole(one) for key, one in inner}
        return made if isinstance(value, dict) else list(made.values())
    return int(value) if isinstance(value, float) and value == int(value) else value


def compare(folder, seeds):
    """Let benches go on both ways and compare what shows, what happened, and what was refused."""
    jobs = [{**job, "steps": [{**step, "value": whole(step.get("value"))} for step in job["steps"]]}
            for job in map(drawn, seeds)]
    refused = moved = 0
    for seed, job, page in zip(seeds, jobs, benches(folder, jobs), strict=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            server = by_python(job)
            columns = LiveBench(read_scene(job["scene"])).columns
        said = [re.sub(r"; did you mean [^?]*\?", "", line) for line in server["refused"]]
        assert page["refused"] == said, seed
        refused += len(said)
        for names, ours, theirs in zip(columns, page["rows"], server["rows"], strict=True):
            ours, theirs = (np.array(rows, np.float64) for rows in (ours, theirs))
            assert ours.shape == theirs.shape, seed
            off, at = np.abs(ours - theirs), names.index("output_angle")
            assert off[:, at].max() < ANGLE, seed
            bad = (off / np.maximum(np.abs(theirs).max(axis=0), 1e-3)).max(axis=1) >= OTHER
            apart = np.diff(theirs[:, 0], prepend=-1.0, append=1e9)
            assert not bad[np.minimum(apart[:-1], apart[1:]) > BETWEEN].any(), seed
            assert bad.sum() <= 2, seed
            moved += np.ptp(theirs[:, at]) > 0.01
        for ours, theirs in zip(page["pulses"], server["pulses"], strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-12, err_msg=str(seed))
        happened = [event for event in server["events"] if not event[1].startswith(NOT_AT_REST)]
        assert [[word, servo] for _, word, servo in page["events"]] == [[word, servo] for _, word, servo in happened]
        np.testing.assert_allclose([one[0] for one in page["events"]], [one[0] for one in happened], atol=1e-6)
        assert read_scene(page["text"]) == read_scene(server["text"]), seed
    return refused, moved


def test_some_benches(folder):
    refused, moved = compare(folder, range(12))
    assert refused > 3
    assert moved > 5


def test_benches_with_a_control_circuit(folder):
    seeds = [seed for seed in range(60) if "[control]" in drawn(seed)["scene"]]
    _, moved = compare(folder, seeds)
    assert len(seeds) > 3
    assert moved > 2


@pytest.mark.slow
def test_two_hundred_benches(folder):
    refused, moved = compare(folder, range(1000, 1200))
    assert refused > 100
    assert moved > 150


def test_texts_are_refused_in_the_same_words(folder):
    """Each text is that of a scene with one mistake."""
    good = 'format = 1\nservo = [{id = "hitec-hs-755hb"}]\n'
    texts = [good + line for line in (
        'seed = -1', 'frame_rate = 5000', 'end = -1', 'load = {inertia = "x"}', 'load = {weight = 1}', 'name = 3',
        'actions = [[0.5, "push"]]', 'actions = [[-1, "push", 0.1]]', 'actions = [[0, "jump", 1]]',
        'actions = [[1, "push", 0.1], [0.5, "push", 0.1]]', 'actions = [[0, "push", 0.1, 3]]',
        'actions = [[0, "frames", {rate = 50}, 0]]', 'actions = [[0, "torque", 1]]', 'actions = [[0, "set", {}]]',
        'actions = [[0, "command", {shape = "saw"}]]', 'actions = [[0, "command", {shape = "hold", value = 1}]]',
        'actions = [[0, "command", {shape = "hold", unit = "us", value = 1500, low = 1}]]',
        'actions = [[0, "command", {shape = "recorded", unit = "us", time = [0], value = [1]}]]',
        'actions = [[0, "command", {shape = "recorded", unit = "us", time = [0, 1], value = [1]}]]',
        'lesson = {title = 3}', 'other = 3', 'load = 3')]
    texts += ['format = 2\nservo = [{id = "x"}]', 'format = 1', 'format = 1\nservo = [{}]',
              'format = 1\nservo = [{id = "a", mystery = 3}]', 'format = 1\nservo = [{id = "a", of = 3}]',
              'format = 1\nservo = [{id = "a", model = "Servo"}]', 'format = 1\nservo = [{id = 3}]']
    found = benches(folder, [{"scene": text, "steps": [], "rate": 60.0, "switches": True} for text in texts])
    for text, one in zip(texts, found, strict=True):
        with pytest.raises(ValueError, match=r".") as error:
            read_scene(text)
        words = re.sub(r"; did you mean [^?]*\?", "", " ".join(str(error.value).split()))
        assert one["refused"] == [words], json.dumps(text)


@pytest.mark.parametrize("model", ["BoundedServo", "PulseServo", "PulseServoInductive", "AveragedServo"])
def test_no_number_lets_the_kernel_trap(folder, model):
    text = f'format = 1\nservo = [{{id = "hitec-hs-755hb", model = "{model}"}}]\n[load]\ninertia = 1e-4\n'
    assert wild(folder, [text]) == 36


def test_no_number_lets_the_kernel_of_a_program_or_a_bus_trap(folder):
    digital = 'format = 1\nservo = [{id = "feetech-sts3215-12v"}]\n[load]\ninertia = 1e-4\n'
    bus = 'format = 1\nservo = [{id = "hitec-hs-755hb"}, {id = "hitec-hs-755hb"}]\n[load]\ninertia = 1e-4\n[supply]\n'
    assert wild(folder, [digital, bus + "open_circuit_voltage = 6.0\ninternal_resistance = 0.5\n"]) == 72
